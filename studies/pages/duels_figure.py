"""The figure of a camera beside its opponents: PSNR over light, a chart for each scene and sensor."""

from collections.abc import Sequence

from matplotlib import rc_context
from matplotlib.figure import Figure

from studies.pages.duels import BEHIND, Contest, duels, group_name, groups_of, opponents_of
from studies.pages.plots import BLUE, CHART, GREEN, ORANGE, STYLE, blank, name_at_ends, plain_ticks
from studies.pages.report_text import PSNR

COLUMNS = 2  # charts beside each other
FEWEST_LEVELS = 2  # that a curve takes
OTHERS = "#9aa0a5"


def hardest(contests: Sequence[Contest], camera: str) -> str | None:
    """Return the opponent that is ahead of the camera in PSNR most often; None where none ever is."""
    lost = {
        name: sum(duel.outcome == BEHIND for duel in duels(contests, camera, name, PSNR))
        for name in opponents_of(contests, camera)
    }
    most = max(lost, key=lambda name: lost[name])
    return most if lost[most] else None


def description(contests: Sequence[Contest], camera: str) -> str:
    """Say what the figure shows, for those who don't see it."""
    most = hardest(contests, camera)
    tail = f"and {most}, which is ahead of it most often" if most else "of which no other is ahead of it anywhere"
    return f"PSNR over light for every processor: {camera}, {tail}"


@rc_context(STYLE)
def figure_of(contests: Sequence[Contest], camera: str) -> Figure | None:
    """Draw the charts; None where no group has two levels.

    The camera, the first of its opponents and the one that is ahead of it most often have colours, the others are grey.
    """
    groups = groups_of(contests)
    of_groups = [[contest for contest in contests if contest.group == group] for group in groups]
    charted = [of_group for of_group in of_groups if len(of_group) >= FEWEST_LEVELS]
    if not charted:
        return None
    names, most = opponents_of(contests, camera), hardest(contests, camera)
    colours = dict.fromkeys(names, OTHERS) | ({most: GREEN} if most else {}) | {names[0]: ORANGE, camera: BLUE}
    columns, rows = min(len(charted), COLUMNS), -(-len(charted) // COLUMNS)
    figure = blank(columns * CHART[0], rows * CHART[1])
    for place, of_group in enumerate(charted):
        axes = figure.add_subplot(rows, columns, place + 1)
        light = [contest.luminance_cd_m2 for contest in of_group]
        for name, colour in colours.items():
            psnr_db = [contest.mean(name, PSNR) for contest in of_group]
            axes.semilogx(light, psnr_db, color=colour, label=name, zorder=2.0 if colour == OTHERS else 3.0)
        axes.set(
            title=f"PSNR [dB], {group_name(of_group[0].group, groups)}", xlabel="cd/m²", xlim=(light[0], light[-1])
        )
        plain_ticks(axes)
        name_at_ends(axes, [(name, of_group[-1].mean(name, PSNR), colour) for name, colour in colours.items()])
    return figure
