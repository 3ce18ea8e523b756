"""The numbers that the program states of its own work, and what counts each of them another way.

python tests/verification/stated_numbers.py     writes docs/results/stated_numbers.csv
"""

import sys
from csv import writer
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "results" / "stated_numbers.csv"


@dataclass(frozen=True)
class Stated:
    """A number that the program states.

    Attributes
    ----------
    number : str
    told_by : tuple of str
        Of `Transport`, `results.json`, `row` (of a sweep), `report`, `bench`, each with the name it has there.
    counted : str
        The other way of counting.
    test : str
        File and function below `tests`.
    fault : str
        Name in `tests/faults/fault_catalogue.py` of the planted fault that this test must notice.
    """

    number: str
    told_by: tuple[str, ...]
    counted: str
    test: str
    fault: str


STATED = (
    Stated(
        "samples a pixel",
        ("Transport.spp", "results.json rows.spp", "row.spp"),
        "paths that the tracer was handed, over pixels and light groups; each scene, with and without a plane",
        "render/test_samples.py::test_at_most_an_eighth_more_is_drawn_than_asked_for",
        "samples told as asked",
    ),
    Stated(
        "samples of each pixel",
        ("Transport.counts",),
        "numbers of the pixels that the tracer was handed, pixel by pixel",
        "render/test_samples.py::test_each_pixel_has_the_samples_that_its_count_tells",
        "samples told as asked",
    ),
    Stated(
        "what stopped the render",
        ("Transport.stopped_by", "results.json rows.render.stopped_by"),
        "the error reached, recomputed from the relit light",
        "render/test_engine.py::test_an_error_asked_for_is_reached",
        "the end told of another limit",
    ),
    Stated(
        "noise rule",
        ("Transport.stopped_by",),
        "samples drawn where any error is good enough",
        "render/test_engine.py::test_an_error_is_not_believed_before_eight_samples_in_each_half",
        "an error believed at once",
    ),
    Stated(
        "seconds of a render",
        ("Transport.seconds", "results.json rows.render_s", "row.render_s"),
        "a clock that runs alone move on, over two calls of one render",
        "render/test_engine.py::test_seconds_are_those_of_all_the_calls_that_a_render_took",
        "seconds of the earlier render forgotten",
    ),
    Stated(
        "variance of a render",
        ("Transport.variance", "Transport.light"),
        "scatter over the pixels of a wall that is even",
        "render/test_engine.py::test_the_stated_variance_is_the_scatter_of_pixels_about_the_closed_form",
        "the whole difference of a render's halves as its error",
    ),
    Stated(
        "relative Monte Carlo error",
        ("Transport.relative_mc_error", "row.render", "results.json rows.render.relative_mc_error"),
        "a variance written by hand",
        "render/test_error_estimates.py::test_the_relative_error_of_uniform_planes_is_standard_error_over_mean",
        "pooled over three pixels",
    ),
    Stated(
        "error of a level",
        ("Transport.level", "results.json rows.render.relative_level_error"),
        "draws of the means' errors; the scatter of levels over ten seeds, three sizes and both variants",
        "render/test_transport.py::test_a_level_and_its_error_are_those_of_a_ratio_of_means",
        "a level's error without that of its area",
    ),
    Stated(
        "level in cd/m2",
        ("row.luminance_cd_m2", "results.json rows.luminance_cd_m2"),
        "luminance of the picture less that of lamps, over the area that shows none",
        "render/test_transport.py::test_the_mean_luminance_asked_for_is_that_of_what_is_no_light",
        "level counts the lamps seen",
    ),
    Stated(
        "bands",
        ("results.json rows.bands", "row.bands"),
        "planes of the stored render",
        "studies/test_stated_numbers.py::test_bands_and_samples_are_those_of_the_stored_render",
        "another band than rendered",
    ),
    Stated(
        "exposure",
        ("results.json rows.exposure_s", "row.exposure_s"),
        "electrons over the well",
        "studies/test_stated_numbers.py::test_an_automatic_exposure_fills_the_well_or_ends_at_the_longest",
        "the longest exposure as the shortest",
    ),
    Stated(
        "saturated share",
        ("results.json rows.saturated", "row.saturated"),
        "a frame of light far over the well",
        "sensor/test_raw.py::test_all_of_a_saturated_frame_is_flagged_and_nothing_of_a_dark_one",
        "saturated = (dn >= white)",
    ),
    Stated(
        "Monte Carlo share of a cell",
        ("row.mc_share",),
        "pixels below saturation alone, from light written by hand",
        "studies/sweep/test_run_cell.py::test_the_monte_carlo_share_is_of_the_pixels_below_saturation",
        "a cell's Monte Carlo share over saturated pixels too",
    ),
    Stated(
        "Monte Carlo share from the render's halves",
        ("row.mc_share", "results.json rows.mc_share"),
        "halves drawn with a known error",
        "studies/sweep/test_run_sweep.py::test_a_finer_request_goes_on_from_the_coarser_render_and_makes_its_cells_anew",
        "the whole difference of the halves as error",
    ),
    Stated(
        "white of the pictures",
        ("report",),
        "a hundred greys in order",
        "studies/metrics/test_truth_metrics.py::test_white_is_the_percentile_of_the_area_that_shows_no_light",
        "white at another percentile",
    ),
    Stated(
        "engines of a row",
        ("row.readout_engine", "row.development_engine"),
        "the kernels that were called",
        "studies/sweep/test_provenance.py::test_a_row_names_the_engines_that_kernels_ran_on",
        "engine of captures 'cuda'",
    ),
    Stated(
        "engines in the results",
        ("results.json rows.readout_engine", "results.json rows.development_engine"),
        "the readout that was called",
        "studies/photograph/test_clock.py::test_the_results_stages_are_the_runs_and_their_rows_name_their_engines",
        "engine of captures 'cuda'",
    ),
    Stated(
        "variant",
        ("Transport.variant", "row.variant"),
        "Mitsuba, asked in another process",
        "studies/sweep/test_provenance.py::test_a_rows_variant_is_the_one_that_mitsuba_has_set",
        "variant told as the scalar one",
    ),
    Stated(
        "threads",
        ("row.threads", "report"),
        "threads of the working process, as the system counts them",
        "studies/sweep/test_provenance.py::test_threads_told_are_those_that_the_working_process_has",
        "threads told as 1",
    ),
    Stated(
        "versions",
        ("row.versions", "report"),
        "what each module says of itself",
        "studies/sweep/test_provenance.py::test_versions_are_those_that_the_modules_tell_themselves",
        "a version left out",
    ),
    Stated(
        "versions in a report",
        ("report",),
        "rows of two versions in one folder",
        "studies/sweep/test_provenance.py::test_a_report_over_mixed_cells_is_refused_in_one_line",
        "versions of the process that asks for the report",
    ),
    Stated(
        "seconds of a cell's steps",
        ("row.capture_s", "row.develop_s", "row.measure_s"),
        "a clock that each step alone moves on by its own amount",
        "studies/photograph/test_clock.py::test_a_rows_seconds_are_each_of_its_own_step",
        "capture and develop seconds swapped",
    ),
    Stated(
        "first calls",
        ("row.first_s", "report"),
        "kernels that Dr.Jit compiled or loaded within the seconds told",
        "studies/photograph/test_clock.py::test_no_kernel_is_compiled_or_loaded_within_the_seconds_told",
        "another kernel's first call within the seconds",
    ),
    Stated(
        "time of each stage",
        ("results.json stages", "report"),
        "the wall clock of the run",
        "studies/photograph/test_clock.py::test_the_reports_stages_add_up_to_the_runs_wall_clock",
        "seconds of all workers as one's",
    ),
    Stated(
        "seconds of renders in a report",
        ("report",),
        "renders made, however many cells share them",
        "studies/photograph/test_clock.py::test_a_render_counts_once_however_many_cells_share_it",
        "render seconds counted once a cell",
    ),
    Stated(
        "N of M cells",
        ("report",),
        "cells of the study, of a sweep ended in its first scene",
        "studies/sweep/test_stored.py::test_a_sweep_of_two_scenes_ended_in_its_first_gives_a_report_that_counts_all_cells",
        "the first scene's cells alone as wanted",
    ),
    Stated(
        "interval of a mean",
        ("report", "table"),
        "how many of many intervals hold the true mean; a printed table",
        "studies/metrics/test_confidence.py::test_five_figures_have_the_interval_of_the_printed_table",
        "an interval of one side",
    ),
    Stated(
        "seconds of a choice",
        ("bench first_s", "bench seconds", "bench processor_s"),
        "two clocks that calls move on at different rates",
        "studies/commands/test_bench.py::test_calls_take_turns_the_first_does_not_count_and_the_median_does",
        "processor's seconds from the wall clock",
    ),
    Stated(
        "ratios of choices",
        ("bench time_over_reference", "bench share_of_noise_variance"),
        "numbers worked out on paper",
        "studies/commands/test_bench.py::test_ratios_stand_beside_seconds",
        "a share of noise from amplitudes",
    ),
)


def page() -> str:
    """The table as CSV."""
    text = StringIO()
    out = writer(text, lineterminator="\n")
    out.writerow(("number", "told by", "counted another way", "test", "planted fault"))
    for one in STATED:
        out.writerow((one.number, ", ".join(one.told_by), one.counted, f"tests/{one.test}", one.fault))
    return text.getvalue()


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")
    sys.stdout.write(f"{PAGE.relative_to(ROOT)}: {len(STATED)} numbers\n")
