"""The command `rodcone table`."""

from pathlib import Path

from rodcone.errors import InputError
from studies.sweep.export import read_rows
from studies.sweep.table import lines, markdown


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
        Figures, joined by commas: the ledger's columns, electrons_W (G, R, B), pair_delta_e and
        true_pair_delta_e of scene metamers, daylight_delta_e of scene color_checker.
    where
        AXIS=VALUE to keep, such as level=10lux; may be given several times.
    """
    axes, figures = ([name.strip() for name in text.split(",")] for text in (by, show))
    chosen = {}
    for text in where or ():
        axis, equals, value = text.partition("=")
        if not equals:
            raise InputError(f"where: {text!r} is not allowed; write AXIS=VALUE, such as level=10lux")
        chosen[axis] = value
    print(markdown(lines(read_rows(folder), folder, axes, figures, chosen), axes, figures))
