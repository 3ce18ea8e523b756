"""One camera against every other processor of a sweep: its lead in each condition, with an interval over seeds."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan, log10, nan, sqrt

import numpy as np

from isp.processors.catalogue import FAIR, PROCESSORS
from rodcone.errors import InputError, unknown
from sensor.burst import merged_sensor
from sensor.presets import names, preset
from sensor.readout import as_raw
from sensor.variations import vary
from studies.metrics.confidence import SeedMean, mean_with_confidence
from studies.pages.report_text import DELTA_E, PSNR, Metric
from studies.sweep.provenance import require_alike
from studies.sweep.row import Row

FLIP = Metric("flip_mean", "FLIP, mean", 3, "", higher=False)
METRICS = (PSNR, DELTA_E, FLIP)
MARGINS = {PSNR.key: 0.1, DELTA_E.key: 0.1, FLIP.key: 0.003}  # of a lead: less is not seen
AHEAD, LEVEL, BEHIND = "ahead", "level", "behind"
FEWEST_SEEDS = 2  # that an interval takes


@dataclass(frozen=True)
class Group:
    """Scene, spectrum, exposure, sensor, white balance and frames: all that a row of a study's levels has in common."""

    scene: str
    spectrum: str
    exposure: str
    sensor: str
    white_balance: str
    frames: int = 1


@dataclass(frozen=True)
class Contest:
    """One condition of a sweep: rows by processor, each in the order of the seeds, the same for all.

    Attributes
    ----------
    group : Group
    level : str
        As the study writes it.
    luminance_cd_m2 : float
    rows : mapping of str to tuple of Row
    """

    group: Group
    level: str
    luminance_cd_m2: float
    rows: Mapping[str, tuple[Row, ...]]

    def mean(self, processor: str, metric: Metric) -> float:
        """Mean of a metric over the seeds."""
        return float(np.mean([getattr(row, metric.key) for row in self.rows[processor]]))


@dataclass(frozen=True)
class Duel:
    """A camera's lead over one opponent in one condition, in the metric's unit; positive is better than the opponent.

    Attributes
    ----------
    contest : Contest
    opponent : str
    lead : SeedMean
        Over pairs of pictures of the same seed.
    """

    contest: Contest
    opponent: str
    lead: SeedMean

    @property
    def outcome(self) -> str:
        """`AHEAD` or `BEHIND` where the whole 95 % interval is on one side of 0, else `LEVEL`."""
        return AHEAD if self.lead.low > 0 else BEHIND if self.lead.high < 0 else LEVEL


def contests_of(rows: Sequence[Row]) -> list[Contest]:
    """Sort a sweep's rows by condition, and the conditions of a group by luminance.

    Raises
    ------
    InputError
        Where a processor lacks a picture that another has, there are fewer than two seeds, or rows were made by
        different versions, variants or engines.
    """
    require_alike(rows)
    of_cells = {
        (
            Group(row.scene, row.spectrum, row.exposure, row.sensor, row.white_balance, row.frames),
            row.level,
            row.processor,
            row.seed,
        ): row
        for row in rows
    }
    processors, seeds = dict.fromkeys(row.processor for row in rows), sorted({row.seed for row in rows})
    if len(seeds) < FEWEST_SEEDS:
        raise InputError(f"seeds: {seeds} is not allowed; give two or more, which an interval takes, and sweep again")
    contests = []
    for group, level in dict.fromkeys((group, level) for group, level, _, _ in of_cells):
        by_processor = {}
        for name in processors:
            found = [of_cells.get((group, level, name, seed)) for seed in seeds]
            by_processor[name] = tuple(row for row in found if row)
            if None in found:
                raise InputError(
                    f"cells: {name} on {group.scene} at {level} lacks seeds that others have; allowed: a whole sweep; "
                    "run the same rodcone sweep again, which makes what is missing"
                )
        contests.append(Contest(group, level, next(iter(by_processor.values()))[0].luminance_cd_m2, by_processor))
    groups = groups_of(contests)
    return sorted(contests, key=lambda contest: (groups.index(contest.group), contest.luminance_cd_m2))


def groups_of(contests: Sequence[Contest]) -> list[Group]:
    """Return the groups, each once, in the order in which they come."""
    return list(dict.fromkeys(contest.group for contest in contests))


def group_name(group: Group, groups: Sequence[Group]) -> str:
    """Name what tells a group from the others; the scene in any case."""
    parts = [group.scene]
    told = {"spectrum": "", "exposure": "exposure ", "sensor": "", "white_balance": "balance ", "frames": "frames "}
    for name, before in told.items():
        if len({getattr(other, name) for other in groups}) > 1:
            parts.append(f"{before}{getattr(group, name)}")
    return ", ".join(parts)


def opponents_of(contests: Sequence[Contest], camera: str) -> list[str]:
    """Every other processor of the sweep, by its form with a noise-aware colour matrix where the sweep has that.

    Raises
    ------
    InputError
        Where the camera isn't in the sweep, or is alone in it.
    """
    there = list(contests[0].rows) if contests else []
    if camera not in there:
        raise unknown("camera", camera, there)
    if len(there) == 1:
        raise InputError(f"processors: {there} is not allowed; give the camera and an opponent or more")
    return [name for name in there if name != camera and name + FAIR not in there]


def plain_opponents_of(contests: Sequence[Contest], camera: str) -> list[str]:
    """Processors that `opponents_of` has in another form: those whose matrix knows nothing of noise."""
    there = list(contests[0].rows)
    return [name for name in there if name != camera and name + FAIR in there]


def duels(contests: Sequence[Contest], camera: str, opponent: str, metric: Metric) -> list[Duel]:
    """Lead of a camera over one opponent in each condition that is ranked."""
    return [
        Duel(contest, opponent, lead_over(contest, camera, opponent, metric))
        for contest in contests
        if is_ranked(contest, camera)
    ]


def no_worse(contests: Sequence[Contest], camera: str, opponents: Sequence[str], metric: Metric) -> int:
    """Conditions in which the camera is ahead of every one of these opponents, or level with it.

    Level is a lead whose whole 95 % interval is above minus the metric's margin of `MARGINS`.
    """
    least = [[duel.lead.low for duel in duels(contests, camera, name, metric)] for name in opponents]
    return sum(low >= -MARGINS[metric.key] for low in map(min, zip(*least, strict=True)))


def lead_over(contest: Contest, camera: str, opponent: str, metric: Metric) -> SeedMean:
    """How much better a camera is than another: mean over the seeds' pairs, with its 95 % interval."""
    sign = 1 if metric.higher else -1
    pairs = zip(contest.rows[camera], contest.rows[opponent], strict=True)
    return mean_with_confidence([sign * (getattr(a, metric.key) - getattr(b, metric.key)) for a, b in pairs])


def is_ranked(contest: Contest, camera: str) -> bool:
    """Whether the camera has a signal to rank: W's SNR is 1 or more, or it has no W, or its noise isn't known here."""
    snr = snr_db(contest, camera, "W")
    return isnan(snr) or snr >= 0


def snr_db(contest: Contest, camera: str, channel: str) -> float:
    """SNR of a channel's mean expected electrons [dB], shot and dark noise; NaN where channel or noise isn't known.

    A burst's is that of its frames together. A sensor or processor of the user's own file is known to the results
    database by its name alone.
    """
    row = contest.rows[camera][0]
    electrons = json.loads(row.mean_electrons).get(channel)
    if electrons is None or electrons <= 0 or row.sensor not in names() or camera not in PROCESSORS:
        return nan
    electrons *= row.frames
    sensor = merged_sensor(vary(preset(row.sensor), PROCESSORS[camera].mosaic), row.frames)
    exposure_s = row.exposure_s * row.frames
    dark_e = as_raw(
        np.zeros((len(sensor.cfa), len(sensor.cfa[0])), np.uint16), sensor, exposure_s, row.readout_engine
    ).dark_noise_e
    return 20 * log10(electrons / sqrt(electrons + dark_e**2))
