"""The figure of a camera beside its opponents: PSNR over light, a chart for each scene and sensor."""

from collections.abc import Sequence

from studies.pages.drawing import Drawing, Mark
from studies.pages.duels import BEHIND, Case, duels, opponents_of
from studies.pages.duels_text import group_text, groups_of
from studies.pages.layout import HEIGHT, WIDTH, curves
from studies.pages.report_text import PSNR

COLUMNS = 2  # charts beside each other
FEWEST_LEVELS = 2  # that a curve takes
CAMERA, FIRST, HARDEST, OTHERS = "0", "1", "2", "soft"  # colours of the drawing


def hardest(cases: Sequence[Case], camera: str) -> str | None:
    """Opponent that is ahead of the camera in PSNR most often; None where none ever is."""
    lost = {
        name: sum(duel.outcome == BEHIND for duel in duels(cases, camera, name, PSNR))
        for name in opponents_of(cases, camera)
    }
    most = max(lost, key=lambda name: lost[name])
    return most if lost[most] else None


def description(cases: Sequence[Case], camera: str) -> str:
    """What the figure shows, for those who don't see it."""
    most = hardest(cases, camera)
    tail = f"and {most}, which is ahead of it most often" if most else "of which no other is ahead of it anywhere"
    return f"PSNR over light for every processor: {camera}, {tail}"


def figure_of(cases: Sequence[Case], camera: str) -> Drawing | None:
    """Lay out the charts; None where no group has two levels.

    The camera, the first of its opponents and the one that is ahead of it most often have colours, the others are grey.
    """
    groups = groups_of(cases)
    of_groups = [[case for case in cases if case.group == group] for group in groups]
    charted = [of_group for of_group in of_groups if len(of_group) >= FEWEST_LEVELS]
    if not charted:
        return None
    names, most = opponents_of(cases, camera), hardest(cases, camera)
    colours = dict.fromkeys(names, OTHERS) | ({most: HARDEST} if most else {}) | {names[0]: FIRST, camera: CAMERA}
    behind_first = sorted(colours, key=lambda name: colours[name], reverse=True)  # grey lines under the coloured
    marks: list[Mark] = []
    for place, of_group in enumerate(charted):
        title = f"PSNR [dB], {group_text(of_group[0].group, groups).replace('`', '')}"
        lines = [(name, [case.mean(name, PSNR) for case in of_group], colours[name], False) for name in behind_first]
        light = [case.luminance_cd_m2 for case in of_group]
        corner = (place % COLUMNS * WIDTH, place // COLUMNS * HEIGHT)
        marks += curves(title, "cd/m²", light, lines, log=(True, False), at=corner)
    width, height = min(len(charted), COLUMNS) * WIDTH, -(-len(charted) // COLUMNS) * HEIGHT
    return Drawing(width, height, f"{camera} beside its opponents", description(cases, camera), tuple(marks))
