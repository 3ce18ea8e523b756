"""How wrong a render is, in units of the sensor's own noise, and what that costs.

Share = (d - r1)(d - r2) over the `low_noise` sensor's noise variance, in electrons, a pixel and RGBW channel, in the
sunlit day with auto exposure, below full well and where no light is seen directly, pooled over 3x3 pixels, without the
lens's spread. r1 and r2 are two long renders, independent of each other and of d: their noise falls out of the mean. A
figure in brackets is one of which the references' own is more than a tenth; only the means hold then.

- ``python benchmarks/bench_share.py references --scene still_life --samples 16384`` makes the two references, in
  ``out/references``; Ctrl-C ends it, and the same command goes on.
- ``... judge --scene still_life --samples 512`` renders by ``render(...).relight()``, each picture in a process of its
  own that has compiled before, and prints the share: median, mean, value that 95 % stay under, and mean over the
  99.5 % of the pixels that are least uncertain in the references' variance map, each with its standard deviation over
  seeds. Several ``--samples`` and ``--bands`` are choices; ``*`` marks those that no other beats in processor time and
  mean. References have 20 bands: with another number the share holds what 20 bands themselves miss.
- ``--denoise`` judges denoised light beside the unbiased, the time of its folds included, and sets the mean share that
  the render tells of itself, by its folds, beside the one found.
- ``--against CHECKOUT`` renders with another checkout too, in turn. Without ``--samples`` this one draws as many as
  take the same processor time.
- ``--rows FILE`` keeps what was measured; ``... show FILE`` prints it again, and draws ``--figure FILE.svg``.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from environment import print_environment
from matplotlib import rc_context
from numpy.typing import NDArray
from references import SEEDS, Film, both, make

from render.denoised.relight import measured_error
from render.radiance import SpectralRadiance
from rodcone.errors import InputError
from rodcone.types import Image
from scenes.catalogue import load
from scenes.levels import DEMO_LEVELS
from sensor.presets import low_noise
from studies.pages.plots import CHART, COLOURS, SOFT, STYLE, blank, plain_ticks, svg_text
from studies.speed.points import NoiseReference, electrons, front, pooled_share, share_map, yardstick

ROOT = Path(__file__).resolve().parents[1]
THIS = "this checkout"
LEVEL = DEMO_LEVELS[-1]
KEPT = 0.995  # share of the pixels whose mean is told beside the whole: without those that rare paths rule
PARTS_OF_FIGURE = 0.1  # of a figure, that the references' own may reach
TRIED = (128, 512)  # samples whose times tell how many take a given time
# Of denoised light: mean share by its folds, its standard error and limit, and by the references; none of them pooled.
TOLD = ("told", "told_error", "limit", "alike")
HEAD = ("samples", "processor, s", "clock, s", "median", "mean", "95 %", "mean of 99.5 %")


@dataclass(frozen=True)
class Shares:
    """Squared error over the sensor's noise variance, over pixels and channels.

    Attributes
    ----------
    median, mean, p95 : float
        `p95` is the value that 95 % stay under.
    mean_of_kept : float
        Mean over the 99.5 % of the pixels that were least uncertain beforehand.
    """

    median: float
    mean: float
    p95: float
    mean_of_kept: float


FIGURES = tuple(Shares.__dataclass_fields__)


@dataclass(frozen=True)
class Choice:
    """A way to render: whose `render`, in how many bands, with how many samples a pixel, denoised or not.

    The time of denoised light has that of the folds in it, by which its error is measured.
    """

    checkout: str
    bands: int
    samples: int
    denoised: bool = False


@dataclass(frozen=True)
class Picture:
    """Radiance under the scene's own lights, the samples drawn, and seconds: on the clock, of the processor.

    Denoised light has two folds, under the same lights.
    """

    radiance: SpectralRadiance
    folds: list[SpectralRadiance]
    samples: float
    seconds: float
    processor_s: float


def picture(scene: str, size: int, choice: Choice, seed: int) -> Picture:
    """Render with a checkout's own `render`, in a process of its own."""
    root = ROOT if choice.checkout == THIS else Path(choice.checkout)
    with TemporaryDirectory() as folder:
        out = Path(folder) / "picture.npz"
        asked = (scene, size, choice.bands, choice.samples, seed, choice.denoised, out)
        command = [sys.executable, "-W", "ignore", ROOT / "benchmarks" / "one_picture.py", *map(str, asked)]
        subprocess.run(command, env=os.environ | {"PYTHONPATH": str(root)}, cwd=root, check=True)
        with np.load(out) as made:
            radiance = SpectralRadiance(made["radiance"], made["wavelength_nm"])
            folds = [SpectralRadiance(values, made["wavelength_nm"]) for values in made["folds"]]
            return Picture(radiance, folds, *(float(made[name]) for name in ("samples", "seconds", "processor_s")))


def scaled(radiance: SpectralRadiance, factor: float) -> SpectralRadiance:
    return SpectralRadiance(radiance.values * np.float32(factor), radiance.wavelength_nm)


def own_share_map(yard: NoiseReference) -> Image:
    """The same of the references themselves: the mean of what each is off, from the difference of the two."""
    one, other = yard.references
    return pooled_share((one - other) ** 2 / 2, yard)


def least_uncertain(deviation_e: Image, yard: NoiseReference) -> NDArray[np.bool_]:
    """Find the 99.5 % of the pixels inside with the smallest variance over the sensor's, (channel, h, w).

    Parameters
    ----------
    deviation_e : (channel, h, w) float64
        Standard deviation of the references.
    """
    share = np.where(yard.inside, deviation_e**2 / yard.noise_e2, np.inf)
    return np.asarray(share <= np.quantile(share[yard.inside], KEPT))


def shares(share: Image, kept: NDArray[np.bool_]) -> Shares:
    """Sum a map up; NaN counts for nothing."""
    inside = np.isfinite(share)
    values = share[inside]
    median, p95 = np.quantile(values, [0.5, 0.95]).tolist()
    return Shares(median, float(values.mean()), p95, float(share[inside & kept].mean()))


def is_known(figure: float, of_references: float) -> bool:
    """Whether the references' own figure is small enough beside the one that is judged."""
    return abs(of_references) <= PARTS_OF_FIGURE * figure


def judge_of(folder: Path, name: str, film: Film) -> tuple[Callable[[Picture], dict[str, float]], Shares]:
    """Return what judges a picture, as figures by name, and the references' own shares."""
    references, sensor = both(folder, load(name), film), low_noise()
    factor = LEVEL.luminance_cd_m2 / float(np.mean([each.level_cd_m2 for each in references]))
    one, other = (scaled(each.radiance, factor) for each in references)
    yard = yardstick((one, other), references[0].lamps | references[1].lamps, sensor)
    # Bands share their paths, so that their deviations add up: a limit, which the true sum is near.
    deviations = [electrons(scaled(each.deviation, factor), sensor, yard.exposure_s) for each in references]
    kept = least_uncertain(np.sqrt(np.mean(np.square(deviations), axis=0)), yard)
    own = shares(own_share_map(yard), kept)
    facts = ", ".join(f"{each.facts['samples']} (engine {each.facts['engine_version']})" for each in references)
    told = ", ".join(f"{getattr(own, figure):.3g}" for figure in FIGURES)
    print(f"references of {name}: {facts} samples; their own {', '.join(HEAD[3:])}: {told}", flush=True)

    weight = yard.inside / yard.noise_e2 / yard.inside.mean()

    def judge(made: Picture) -> dict[str, float]:
        seen, *folds = (electrons(scaled(x, factor), sensor, yard.exposure_s) for x in (made.radiance, *made.folds))
        found = asdict(shares(share_map(seen, yard), kept))
        if folds:
            told = measured_error(seen - folds[0], seen - folds[1], weight)
            alike = measured_error(seen - yard.references[0], seen - yard.references[1], weight).mean
            found |= dict(zip(TOLD, (told.mean, told.standard_error, told.upper, alike), strict=True))
        return found

    return judge, own


def samples_in(processor_s: float, tried_s: Mapping[int, float]) -> int:
    """Number of samples that takes a time, by the line through two numbers tried; an eighth of an octave is a step."""
    (few, few_s), (many, many_s) = sorted(tried_s.items())
    asked = few + (processor_s - few_s) * (many - few) / (many_s - few_s)
    step = max(2, (1 << max(int(asked), 16).bit_length() >> 1) // 8)
    return max(16, int(asked) // step * step)


def choices_of(given: argparse.Namespace) -> list[Choice]:
    """Choices asked for; the samples that take another checkout's time are found by trying."""
    kinds = [(bands, denoised) for bands in given.bands for denoised in (False, *[True] * given.denoise)]
    own = [Choice(THIS, bands, samples, kind) for bands, kind in kinds for samples in given.samples or ()]
    if not given.against:
        return own or [Choice(THIS, bands, 512, kind) for bands, kind in kinds]
    others = [Choice(str(given.against), bands, given.against_samples) for bands in given.bands]
    for other in others if not own else ():
        other_s = picture(given.scene, given.size, other, given.seeds[0]).processor_s
        for bands, kind in kinds:
            if bands == other.bands:
                tried = [Choice(THIS, bands, samples, kind) for samples in TRIED]
                tried_s = {x.samples: picture(given.scene, given.size, x, given.seeds[0]).processor_s for x in tried}
                own.append(Choice(THIS, bands, samples_in(other_s, tried_s), kind))
    return [*others, *own]


def measure(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Measure each choice with each seed, in turn."""
    wrong = sorted(set(given.seeds) & set(SEEDS))
    if wrong:
        raise InputError(f"seeds: {wrong[0]} is a reference's; allowed: any but {SEEDS}; give another")
    judge, own = judge_of(given.references, given.scene, Film(given.size, given.reference_bands))
    choices = choices_of(given)
    for seed in given.seeds:
        for choice in choices:
            made = picture(given.scene, given.size, choice, seed)
            yield {
                "scene": given.scene,
                "size": given.size,
                **asdict(choice),
                "drawn": made.samples,
                "seed": seed,
                "seconds": made.seconds,
                "processor_s": made.processor_s,
                **judge(made),
                "own": asdict(own),
            }


def summed_up(rows: Sequence[dict[str, Any]]) -> dict[Choice, dict[str, Any]]:
    """Means and standard deviations over seeds of each choice, and whether it is on the front."""
    found: dict[Choice, list[dict[str, Any]]] = {}
    for row in rows:
        found.setdefault(Choice(**{x.name: row[x.name] for x in fields(Choice) if x.name in row}), []).append(row)
    table: dict[Choice, dict[str, Any]] = {}
    for choice, of_choice in found.items():
        table[choice] = {"drawn": of_choice[0]["drawn"], "own": of_choice[0]["own"]}
        for name in ("processor_s", "seconds", *FIGURES, *(TOLD if TOLD[0] in of_choice[0] else ())):
            values = [row[name] for row in of_choice]
            table[choice][name] = float(np.mean(values)), float(np.std(values, ddof=1)) if len(values) > 1 else np.nan
    flags = front([(row["processor_s"][0], row["mean"][0]) for row in table.values()])
    for row, on_front in zip(table.values(), flags, strict=True):
        row["on_front"] = on_front
    return table


def print_table(rows: Sequence[dict[str, Any]]) -> None:
    """Print a table of each scene and size, in Markdown."""
    for place in dict.fromkeys((row["scene"], row["size"]) for row in rows):
        of_place = [row for row in rows if (row["scene"], row["size"]) == place]
        seeds = len({row["seed"] for row in of_place})
        print(f"\n`{place[0]}`, {place[1]}x{place[1]}, seeds: {seeds}\n")
        print(f"| choice | {' | '.join(HEAD)} |\n{'|---' * (len(HEAD) + 1)}|")
        for choice, row in summed_up(of_place).items():
            told = [told_figure(row, name) for name in FIGURES]
            times = [with_spread(*row[name], ".1f", ".1f") for name in ("processor_s", "seconds")]
            name = f"{'*' if row['on_front'] else ''}{kind_of(choice)}"
            print(f"| {' | '.join([name, format(row['drawn'], '.0f'), *times, *told])} |", flush=True)
        for choice, row in summed_up(of_place).items():
            if choice.denoised and TOLD[0] in row:
                told, error, limit, found = (with_spread(*row[name], ".3g", ".2g") for name in TOLD)
                told += f" (standard error {error}, limit {limit})"
                print(f"\n{kind_of(choice)}: mean share told {told}, found {found}")


def kind_of(choice: Choice) -> str:
    """Write all of a choice but its samples."""
    return f"{Path(choice.checkout).name}, {choice.bands} bands{', denoised' if choice.denoised else ''}"


def with_spread(mean: float, spread: float, form: str, spread_form: str) -> str:
    """Write a mean and its standard deviation; one seed has none."""
    return f"{mean:{form}}" if np.isnan(spread) else f"{mean:{form}} ± {spread:{spread_form}}"


def told_figure(row: Mapping[str, Any], name: str) -> str:
    """Write a figure with its spread; in brackets where the references' own is too large beside it."""
    mean, spread = row[name]
    told = with_spread(mean, spread, ".3g", ".2g")
    return told if "mean" in name or is_known(mean, row["own"][name]) else f"({told})"


@rc_context(STYLE)
def figure_of(rows: Sequence[dict[str, Any]]) -> str:
    """Draw mean share over processor time: a line each number of bands, filled marks on the front. SVG."""
    table = summed_up(rows)
    figure = blank(*CHART)
    axes = figure.subplots()
    for kind, colour in zip(dict.fromkeys(kind_of(choice) for choice in table), COLOURS, strict=False):
        of_kind = [(x.samples, row) for x, row in table.items() if kind_of(x) == kind]
        points = sorted((row["processor_s"][0], row["mean"][0], samples, row["on_front"]) for samples, row in of_kind)
        label = kind.removeprefix(f"{THIS}, ")
        axes.loglog([x for x, *_ in points], [y for _, y, *_ in points], color=colour, label=label)
        for x, y, samples, on_front in points:
            axes.loglog(x, y, marker="o", color=colour, markerfacecolor=colour if on_front else "white")
            axes.annotate(str(samples), (x, y), (4, 4), textcoords="offset points", color=colour, fontsize=8)
    axes.axhline(1.0, color=SOFT, linestyle="--")
    axes.annotate("the sensor's own noise", (0.01, 1.0), (0, 3), axes.get_yaxis_transform(), "offset points")
    axes.set(title="mean share of the sensor's noise variance", xlabel="processor seconds")
    plain_ticks(axes)
    axes.legend(loc="upper right")
    return svg_text(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("references", "judge", "show"))
    parser.add_argument("file", nargs="?", type=Path, help="rows to show")
    parser.add_argument("--scene", default="still_life")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--bands", type=int, nargs="+", default=[20])
    parser.add_argument("--reference-bands", type=int, default=20)
    parser.add_argument("--samples", type=int, nargs="+")
    parser.add_argument("--denoise", action="store_true", help="judge denoised light too")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3, 4])
    parser.add_argument("--against", type=Path, help="another checkout")
    parser.add_argument("--against-samples", type=int, default=512)
    parser.add_argument("--references", type=Path, default=Path("out/references"), help="folder")
    parser.add_argument("--rows", type=Path, help="file to which what is measured is added")
    parser.add_argument("--figure", type=Path)
    given = parser.parse_args()
    try:
        if given.what == "references":
            make(
                given.references,
                load(given.scene),
                Film(given.size, given.reference_bands),
                max(given.samples or [16384]),
            )
            return
        if given.what == "show":
            rows = [json.loads(line) for line in given.file.read_text("utf-8").splitlines()]
        else:
            print_environment()
            rows = []
            for row in measure(given):
                rows.append(row)
                print(json.dumps(row), flush=True)
                if given.rows:
                    with given.rows.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(row) + "\n")
    except InputError as error:
        sys.exit(f"error: {error}")
    print_table(rows)
    if given.figure:
        given.figure.write_text(figure_of(rows), "utf-8")


if __name__ == "__main__":
    main()
