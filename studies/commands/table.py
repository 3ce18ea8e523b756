"""The command `rodcone table`: a sweep's figures as Markdown."""

from pathlib import Path

from studies.sweep.export import axis_values, lines, markdown, read_rows


def table(
    folder: Path,
    /,
    *,
    by: str = "spectrum,level,processor",
    show: str = "psnr_db,delta_e_median",
    where: list[str] | None = None,
) -> None:
    """Print figures of a sweep as a Markdown table: means over the seeds, with the half width of their 95 % interval.

    Parameters
    ----------
    folder
        Folder of the sweep.
    by
        Axes joined by commas, with a line for each combination: scene, spectrum, level, exposure, sensor, processor.
    show
        Figures, joined by commas: the database's columns, electrons_W (G, R, B), pair_delta_e and
        true_pair_delta_e of scene metamers, daylight_delta_e of scene color_checker.
    where
        AXIS=VALUE to keep, such as level=10lux; may be given several times.
    """
    axes, figures = ([name.strip() for name in text.split(",")] for text in (by, show))
    print(markdown(lines(read_rows(folder), folder, axes, figures, axis_values(where or ())), axes, figures))
