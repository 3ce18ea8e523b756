"""The command `rodcone plot`: a figure of a sweep over light, as a file."""

from pathlib import Path

from rodcone.errors import require_name
from rodcone.files import write_files
from studies.commands.console import require_place
from studies.metrics.metric import METRICS, PSNR
from studies.pages.plots import png_bytes, svg_text
from studies.pages.sweep_plot import metric_figure, panels
from studies.sweep.export import axis_values, read_rows


def plot(
    folder: Path,
    /,
    *,
    out: Path,
    metric: str = PSNR.key,
    by: str = "processor",
    first: str | None = None,
    where: list[str] | None = None,
) -> None:
    """Draw a metric of a sweep over light, with the first line's lead over each other one, and print the file's path.

    Lines are means over the seeds, bands their 95 % intervals (Student's t); a lead's is of the pairs of one seed.
    What else the sweep varies stands in rows of the figure.

    Parameters
    ----------
    folder
        Folder of the sweep.
    out
        File to write, ending in .svg or .png.
    metric
        Metric by its column: psnr_db, ssim, delta_e_median, delta_e_p95, s_cielab_median, s_cielab_p95, flip_mean,
        pu21_psnr_db, mtf50_cy_per_px, chart_delta_e_mean or patch_snr_db.
    by
        Axis whose values are the lines: scene, spectrum, exposure, sensor, white_balance, frames, gain or processor.
    first
        The line whose lead is drawn, such as ple_rgbw; the study's first by default.
    where
        AXIS=VALUE to keep, such as white_balance=as-shot; may be given several times.
    """
    require_place(out, ".svg", ".png")
    by_key = {each.key: each for each in METRICS}
    require_name("metric", metric, by_key)
    parts = panels(read_rows(folder), by_key[metric], by, axis_values(where or ()), first)
    figure = metric_figure(parts, by_key[metric])
    write_files({out: svg_text(figure) if out.suffix.lower() == ".svg" else png_bytes(figure)})
    print(out)
