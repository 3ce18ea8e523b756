"""Which raw converter develops which file of ours: colour error, brightness, pattern and cast beside `rodcone develop`.

    python benchmarks/bench_converters.py            # every kind, with the converters that this machine has
    python benchmarks/bench_converters.py bayer hdr  # kinds whose names hold one of these words

A ColorChecker in front of grey is photographed under D65 by each camera, at its default exposure, and written as
`rodcone.write_raw` writes it. Each program develops the file without a tone curve, in linear light. Nothing is
installed here; Debian has the programs as darktable, rawtherapee, dcraw and libraw-bin, and rawpy brings a LibRaw.

- ``dE``: mean CIEDE2000 of the 24 patches from the chart's own colours, both brought to one brightness on the greys.
- ``over``: the same, less that of `develop` from the file beside which it stands (a mosaic by `develop` itself).
- ``stops``: brightness of the greys beside `rodcone develop --ev 0`. BaselineExposure is printed as ``base``, also
  behind the stops of a program that applies it.
- ``pattern``: how much more two neighbouring pixels differ than two next but one, in the grey patches, as a share of
  their level: a checkerboard or stripes that a wrong mosaic leaves; noise alone gives about 0 or less.
- ``cast``: CIELAB chroma of the mean of the grey patches.
"""

import argparse
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import tifffile
from skimage.color import deltaE_ciede2000, xyz2lab

from isp.converters import write_with_bayer
from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.spectrum import VISIBLE_NM, even_bands
from rodcone.colour_spaces import SRGB_TO_XYZ, decode_srgb, luminance_of_srgb
from rodcone.types import Image
from scenes.reflectances import color_checker_reflectances
from sensor.config import SensorConfig
from sensor.presets import preset
from sensor.raw import RawImage
from sensor.raw_files.dng import BASELINE_EXPOSURE, dng_tags
from sensor.raw_files.raw_file import read_raw
from studies.metrics.truth import light_in_bands, true_srgb
from studies.photograph.camera import capture
from studies.photograph.develop import develop

ROWS, COLUMNS = 4, 6
INNER = 0.3  # of a patch's side is left out at each edge: what filters and crops reach
GREYS = slice(18, 24)  # of the patches: the neutral row
LEVEL_CD_M2 = 200.0
BANDS = 20
LAMP = 40.0  # of white: a strip for cameras of high dynamic range
MOST_OVER, MOST_STOPS = 1.0, 0.2  # up to which a program develops a file right: CIEDE2000, stops
SECONDS = 240  # after which a program is ended


@dataclass(frozen=True)
class Kind:
    """A sort of file: its camera, the picture's height, and whether a lamp stands in it; the number of frames."""

    sensor: SensorConfig
    height: int = 240
    lamp: bool = False
    frames: int = 1


def kinds() -> dict[str, Kind]:
    """Every sort of file, by name."""
    plain = {
        f"bayer {size} px": Kind(preset("low_noise", "bayer"), size) for size in (64, 128, 240, 512, 1332)
    }  # 1332 high is 2000 wide
    plain |= {f"bayer {phase}": Kind(preset("low_noise", f"bayer_{phase}")) for phase in ("bggr", "grbg", "gbrg")}
    plain |= {f"bayer {bits} bits": Kind(replace(preset("low_noise", "bayer"), bits=bits)) for bits in (10, 12)}
    apart = {name: Kind(preset("low_noise", name)) for name in ("rgbw", "quad_bayer", "quad_rgbw")}
    apart |= {"white_apart": Kind(preset("white_apart"))}
    hdr = {
        f"hdr {name} {cfa}": Kind(preset(name, cfa), lamp=True)
        for name in ("dual_gain", "split_pixel", "staggered")
        for cfa in ("bayer", "rgbw")
    }
    return plain | apart | hdr | {"burst rgbw": Kind(preset("low_noise"), frames=3)}


def chart(kind: Kind) -> tuple[SpectralRadiance, Image]:
    """Radiance of the chart, patches of equal squares, and each patch's linear sRGB."""
    nm, width_nm = even_bands(VISIBLE_NM, BANDS)
    light = light_in_bands(illuminant("D65"), nm, width_nm)
    white = light.spectrum * LEVEL_CD_M2
    surfaces = np.array([curve.band_average(nm, width_nm) for _, curve in color_checker_reflectances()])
    side = kind.height // ROWS
    values = np.kron((surfaces * white).reshape(ROWS, COLUMNS, -1), np.ones((side, side, 1)))
    if kind.lamp:
        values = np.vstack([values, np.broadcast_to(white * LAMP, (side // 2, values.shape[1], nm.size))])
    seen = SpectralRadiance((surfaces * white)[None].astype(np.float32), nm, 0.0, width_nm)
    return SpectralRadiance(values.astype(np.float32), nm, 0.0, width_nm), np.clip(
        true_srgb(seen, light, LEVEL_CD_M2)[0], 0.0, None
    )  # cyan lies outside sRGB, where converters cut it


# The programs: each develops a file into linear sRGB, brightness as it comes.


def by_darktable(path: Path, folder: Path) -> Image:
    settings = {
        "plugins/darkroom/workflow": "none", "plugins/darkroom/chromatic-adaptation": "legacy",
        "plugins/imageio/format/tiff/bpp": "32", "plugins/imageio/format/tiff/compress": "0",
    }  # fmt: skip
    core = ["--core", "--library", ":memory:", "--configdir", folder / "darktable", "--disable-opencl"]
    core += [word for name, value in settings.items() for word in ("--conf", f"{name}={value}")]
    out = folder / f"{path.stem}.darktable.tif"
    run("darktable-cli", path, out, "--apply-custom-presets", "0", "--icc-type", "LIN_REC709", *core)
    return read_tiff(out)


def by_rawtherapee(path: Path, folder: Path) -> Image:
    out, profile = folder / f"{path.stem}.rawtherapee.tif", folder / "neutral.pp3"
    profile.write_text("[Version]\nAppVersion=5.9\nVersion=349\n", "utf-8")
    run("rawtherapee-cli", "-q", "-o", out, "-t", "-b32", "-Y", "-p", profile, "-c", path)
    return decode_srgb(np.clip(read_tiff(out), 0.0, None))  # its matrix leaves some light under zero


def by_dcraw(path: Path, folder: Path) -> Image:
    out = folder / f"{path.stem}.dcraw.tif"
    out.write_bytes(run("dcraw", "-T", "-4", "-w", "-c", path))
    return read_tiff(out)


def by_dcraw_emu(path: Path, folder: Path) -> Image:
    out = folder / f"{path.stem}.dcraw_emu.tif"
    run("dcraw_emu", "-T", "-4", "-w", "-c", "0", "-Z", out, path)
    return read_tiff(out)


def by_rawpy(path: Path, folder: Path) -> Image:
    """LibRaw in a process of its own: it may end the one that it runs in."""
    out = folder / f"{path.stem}.rawpy.tif"
    lines = (
        "import sys, rawpy, tifffile",
        "with rawpy.imread(sys.argv[1]) as raw:",
        "    made = raw.postprocess(adjust_maximum_thr=0, no_auto_bright=True, gamma=(1, 1), use_camera_wb=True,",
        "                           output_bps=16)",
        "tifffile.imwrite(sys.argv[2], made)",
    )
    run(sys.executable, "-c", "\n".join(lines), path, out)
    return read_tiff(out)


def run(*command: object) -> bytes:
    """Run a program in a home of its own; gives what it printed."""
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, timeout=SECONDS, check=False)
    if done.returncode:
        raise OSError(f"{words[0]} ended with {done.returncode}: {done.stderr.decode(errors='replace')[-200:]}")
    return done.stdout


def read_tiff(path: Path) -> Image:
    if not path.exists():
        raise OSError(f"no {path.name} was written")
    values = tifffile.imread(path)
    return np.asarray(values, np.float64) / (65_535.0 if values.dtype.kind == "u" else 1.0)


def programs() -> dict[str, Callable[[Path, Path], Image]]:
    """Converters that this machine has, by name."""
    found: dict[str, Callable[[Path, Path], Image]] = {
        name: call
        for name, call in (
            ("darktable-cli", by_darktable),
            ("rawtherapee-cli", by_rawtherapee),
            ("dcraw", by_dcraw),
            ("dcraw_emu", by_dcraw_emu),
        )
        if shutil.which(name)
    }
    return found | ({"rawpy": by_rawpy} if find_spec("rawpy") else {})


# What is measured.


@dataclass(frozen=True)
class Measured:
    """What a program made of a file, in the units of this module's head; `refused` says why it made nothing."""

    kind: str
    file: str
    base_ev: float
    program: str
    delta_e: float = np.nan
    over: float = np.nan
    stops: float = np.nan
    pattern: float = np.nan
    cast: float = np.nan
    refused: str = ""

    @property
    def is_right(self) -> bool:
        """Whether it is developed as `develop` does, by BaselineExposure or without."""
        return not self.refused and self.over <= MOST_OVER and (abs(self.stops) <= MOST_STOPS or self.applies_base)

    @property
    def applies_base(self) -> bool:
        """Whether its brightness is that of BaselineExposure."""
        return abs(self.stops - self.base_ev) <= MOST_STOPS < abs(self.stops)


def patches(picture: Image, height: int, shape: tuple[int, int]) -> list[Image]:
    """Inner part of each patch of a picture, which may lack as many pixels at opposite edges."""
    side = height // ROWS
    top, left = ((whole - part) // 2 for whole, part in zip(shape, picture.shape[:2], strict=True))
    edge = int(np.ceil(INNER * side))
    parts = []
    for number in range(ROWS * COLUMNS):
        row, column = (side * place for place in divmod(number, COLUMNS))
        rows, columns = (slice(at + edge - lost, at + side - edge - lost) for at, lost in ((row, top), (column, left)))
        parts.append(picture[rows, columns])
    return parts


def figures(picture: Image, kind: Kind, shape: tuple[int, int], truth: Image) -> tuple[float, float, float, float]:
    """Return dE, luminance of the greys, pattern and cast."""
    parts = patches(picture, kind.height, shape)
    means = np.array([part.mean(axis=(0, 1)) for part in parts])
    level = float(luminance_of_srgb(means[GREYS]).sum())
    scale = float(luminance_of_srgb(truth[GREYS]).sum()) / max(level, 1e-12)
    lab, true_lab = (xyz2lab(x @ SRGB_TO_XYZ.T) for x in (np.clip(means * scale, 0, None), truth))
    error = float(deltaE_ciede2000(lab, true_lab).mean())
    return error, level, pattern_of(parts[GREYS]), float(np.hypot(lab[GREYS, 1], lab[GREYS, 2]).mean())


def pattern_of(parts: Sequence[Image]) -> float:
    """How much more neighbours differ than pixels next but one, across and down, over the patches' level."""
    excess = []
    for part in parts:
        lines = [part, part.swapaxes(0, 1)]
        near, far = ([np.std(line[step:] - line[:-step]) for line in lines] for step in (1, 2))
        excess += [(a - b) / max(float(part.mean()), 1e-12) for a, b in zip(near, far, strict=True)]
    return float(np.median(excess))


def files_of(name: str, kind: Kind, folder: Path) -> tuple[Image, Iterator[tuple[Path, RawImage]]]:
    """Colours of the chart, and each file written of it with what it holds."""
    radiance, truth = chart(kind)
    stem = name.replace(" ", "_")

    def each() -> Iterator[tuple[Path, RawImage]]:
        for number in range(1, kind.frames + 1):
            raw = capture(radiance, kind.sensor, rng=np.random.default_rng(number), light=illuminant("D65"))
            frame = number if kind.frames > 1 else None
            for path in write_with_bayer(raw, folder / f"{stem}{f'_{number}' * bool(frame)}.dng", frame=frame):
                yield path, read_raw(path)

    return truth, each()


def measure(name: str, kind: Kind, converters: Mapping[str, Callable[[Path, Path], Image]]) -> Iterator[Measured]:
    """Develop each file of a kind by each program."""
    with TemporaryDirectory() as place:
        folder = Path(place)
        truth, files = files_of(name, kind, folder)
        for path, raw in files:
            picture = develop(raw).rgb / raw.full_well_e
            own = figures(picture, kind, raw.shape, truth)
            numerator, denominator = dng_tags(raw)[BASELINE_EXPOSURE][1]
            head = (name, path.stem, float(numerator) / float(denominator))
            yield Measured(*head, "develop", own[0], 0.0, 0.0, *own[2:])
            for program, call in converters.items():
                try:
                    found = figures(call(path, folder), kind, raw.shape, truth)
                except (OSError, ValueError, subprocess.TimeoutExpired) as error:
                    yield Measured(*head, program, refused=" ".join(str(error).split())[:120])
                    continue
                stops = float(np.log2(max(found[1], 1e-9) / own[1]))
                yield Measured(*head, program, found[0], found[0] - own[0], stops, *found[2:])


def cell(row: Measured | None) -> str:
    """Write what a program makes of a file: CIEDE2000 over development's, stops beside it; bold where that is wrong."""
    if row is None or row.refused:
        return "refused"
    figures = row.over, row.stops - row.base_ev * row.applies_base
    words = ", ".join(format(round(value, 1) + 0.0, "+.1f") for value in figures) + " B" * row.applies_base
    return words if row.is_right else f"**{words}**"


def print_table(rows: Sequence[Measured]) -> None:
    """Print a line of each file, a column of each program."""
    names = list(dict.fromkeys(row.program for row in rows if row.program != "develop"))
    found = {(row.file, row.program): row for row in rows}
    print(f"\n| file | base | develop | {' | '.join(names)} |\n|{'---|' * (len(names) + 3)}")
    for file in dict.fromkeys(row.file for row in rows):
        own = found[file, "develop"]
        cells = [cell(found.get((file, name))) for name in names]
        print(f"| `{file}` | {own.base_ev:+.1f} | {own.delta_e:.1f} | {' | '.join(cells)} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", help="parts of the names of kinds; all where left out")
    given = parser.parse_args()
    converters = programs()
    print(f"converters: {', '.join(converters) or 'none found'}", flush=True)
    rows = []
    for name, kind in kinds().items():
        if given.words and not any(word in name for word in given.words):
            continue
        for row in measure(name, kind, converters):
            rows.append(row)
            error = f"dE {row.delta_e:.2f} ({row.over:+.2f}), {row.stops:+.3f} stops"
            told = row.refused or f"{error}, pattern {row.pattern:+.3f}, cast {row.cast:.2f}"
            print(f"{row.file} (base {row.base_ev:+.2f}), {row.program}: {told}", flush=True)
    print_table(rows)


if __name__ == "__main__":
    main()
