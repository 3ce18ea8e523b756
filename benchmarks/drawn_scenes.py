r"""How like photographs drawn scenes are: contrasts, edges, textures, depths and colours of both.

    rodcone dataset benchmarks/small_network.toml -o out/drawn --set 'scenes=["generated", "diorama"]' \
        --generated 19 --diorama 5 --seed 4 --crop 128 --truth rgb,depth
    pip download --no-deps -d wheels scikit-learn
    python benchmarks/drawn_scenes.py out/drawn wheels

Differences are those of neighbours in ln(Y + 1 % of the mean), horizontal and vertical, of pictures reduced to 256
pixels by boxes; photographs went through a camera's tone curve, drawn scenes didn't.
"""

import argparse
import io
from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.stats import kurtosis
from skimage.color import rgb2lab

from rodcone.colour_spaces import decode_srgb, encode_srgb
from rodcone.csv_file import csv_text
from rodcone.files import write_files
from studies.dataset.shards import read_shard

# By the wheel and the folder in it that holds them: things, people and landscapes, no instrument's pictures.
PHOTOGRAPHS = {
    "skimage/data": ("astronaut.png", "chelsea.png", "coffee.png", "motorcycle_left.png", "rocket.jpg"),
    "sklearn/datasets/images": ("china.jpg", "flower.jpg"),
    "matplotlib/mpl-data/sample_data": ("grace_hopper.jpg",),
}
RESULTS = Path(__file__).parents[1] / "docs" / "results" / "drawn_scenes.csv"
PICTURE = RESULTS.parents[1] / "pictures" / "drawn_scenes.webp"
LARGEST, SIDE = 256, 128
TO_Y = np.array([0.2126, 0.7152, 0.0722])
Picture = NDArray[np.float64]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="of rodcone dataset, with rgb and depth")
    parser.add_argument("wheels", type=Path)
    given = parser.parse_args()
    drawn: dict[str, dict[tuple[int, ...], tuple[Picture, Picture]]] = {}
    for shard in sorted((given.folder / "set").glob("*.tar")):
        for arrays, facts in read_shard(shard):
            parts = drawn.setdefault(facts["scene"], {})
            parts.setdefault(tuple(facts["window"]), (arrays["rgb"].astype(float), arrays["depth"].astype(float)))
    photographs = [_windows(decode_srgb(picture)) for picture in _photographs(given.wheels)]
    families = {scene.partition("-")[0]: list[dict[str, float]]() for scene in drawn}
    for scene, parts in drawn.items():
        figures = statistics([rgb for rgb, _ in parts.values()])
        figures |= depth_statistics([depth for _, depth in parts.values()])
        families[scene.partition("-")[0]].append(figures)
    pair = depth_statistics([_photographed_depth()])
    of_photographs = [statistics(parts) | pair for parts in photographs]
    kinds = [f"{len(family)} {name}" for name, family in families.items()] + [f"{len(photographs)} photographs"]
    columns = [*families.values(), of_photographs]
    rows = [[name, *(word for column in columns for word in _range(column, name))] for name in of_photographs[0]]
    head = ["", *(f"{kind}, {word}" for kind in kinds for word in ("median", "least", "most"))]
    print(csv_text(head, rows))
    write_files({RESULTS: csv_text(head, rows)})
    dioramas = [_shown(parts) for scene, parts in drawn.items() if scene.startswith("diorama")]
    Image.fromarray(np.concatenate(dioramas[:6], axis=1)).save(PICTURE, quality=80)


def _shown(parts: Mapping[tuple[int, ...], tuple[Picture, Picture]]) -> NDArray[np.uint8]:
    """Scene's colours, its mean luminance a grey of 18 %."""
    whole = np.block([[[parts[row, column, SIDE, SIDE][0]] for column in (0, SIDE)] for row in (0, SIDE)])
    return np.asarray(255 * encode_srgb(np.clip(whole * 0.18 / (whole @ TO_Y).mean(), 0, 1)), np.uint8)


def _range(figures: Sequence[Mapping[str, float]], name: str) -> list[str]:
    values = [of_picture[name] for of_picture in figures]
    return [f"{value:.3g}" for value in (np.median(values), min(values), max(values))]


def statistics(parts: list[Picture]) -> dict[str, float]:
    """Figures of a picture's parts (h, w, 3), linear sRGB."""
    mean = float(np.mean([part @ TO_Y for part in parts]))
    logs = [np.log(np.maximum(part @ TO_Y, 0) + 0.01 * mean) for part in parts]
    steps = np.concatenate([np.diff(log, axis=axis).ravel() for log in logs for axis in (0, 1)])
    chroma = np.concatenate([_chroma(part, mean).ravel() for part in parts])
    return {
        "contrast, standard deviation of ln Y": float(np.std(np.concatenate([log.ravel() for log in logs]))),
        "kurtosis of differences (3 is Gaussian)": float(kurtosis(steps, fisher=False)),
        "differences under 0.01, share": float((np.abs(steps) < 0.01).mean()),
        "differences over 0.2, share": float((np.abs(steps) > 0.2).mean()),
        "slope of the power spectrum": float(np.mean([_slope(log) for log in logs])),
        "chroma in CIELAB, median": float(np.median(chroma)),
        "chroma, 95 %": float(np.quantile(chroma, 0.95)),
        "pixels of chroma under 10, share": float((chroma < 10).mean()),
    }


def _chroma(part: Picture, mean: float) -> Picture:
    """Chroma where the picture's mean luminance is shown as a grey of 18 %."""
    lab = rgb2lab(encode_srgb(np.clip(part * 0.18 / mean, 0, 1)))
    return np.asarray(np.hypot(lab[..., 1], lab[..., 2]))


def _slope(log: Picture) -> float:
    """Exponent of the power spectrum over frequency, between 4 and 40 periods of a part's side."""
    window = np.hanning(len(log))
    power = np.abs(np.fft.fft2((log - log.mean()) * np.outer(window, window))) ** 2
    frequency = np.hypot(*np.meshgrid(*(np.fft.fftfreq(n) * n for n in log.shape), indexing="ij"))
    bands = np.geomspace(4, 40, 9)
    means = [power[(frequency >= low) & (frequency < high)].mean() for low, high in pairwise(bands)]
    return float(np.polyfit(np.log(np.sqrt(bands[1:] * bands[:-1])), np.log(means), 1)[0])


def depth_statistics(parts: list[Picture]) -> dict[str, float]:
    """Figures of depths (h, w), 0 for none; of the stereo pair alone there is a photograph's."""
    logs = [np.log(np.where(part > 0, part, np.nan)) for part in parts]
    steps = np.concatenate([np.diff(log, axis=axis).ravel() for log in logs for axis in (0, 1)])
    steps = steps[np.isfinite(steps)]
    return {
        "depth: steps over 3 %, share": float((np.abs(steps) > 0.03).mean()),
        "depth: kurtosis of steps": float(kurtosis(steps, fisher=False)),
    }


def _photographed_depth() -> Picture:
    """Depth in scikit-image's stereo pair, in a unit of its own."""
    package = find_spec("skimage")
    assert package
    assert package.origin
    with np.load(Path(package.origin).with_name("data") / "motorcycle_disp.npz") as file:
        disparity = np.asarray(file["arr_0"], dtype=float)
    # It falls as disparity and the offset of the cameras' centres, of the pair's calibration at a quarter of the size.
    depth = 1 / (np.where(np.isfinite(disparity), disparity, np.nan) + 31.086)
    step = -(-max(depth.shape) // LARGEST)
    return np.asarray(np.nan_to_num(depth[::step, ::step]))


def _photographs(wheels: Path) -> Iterable[Picture]:
    for folder, names in PHOTOGRAPHS.items():
        package = find_spec(folder.split("/")[0])
        for name in names:
            if package and package.origin:
                content = Path(package.origin).parents[1].joinpath(folder, name).read_bytes()
            else:
                content = ZipFile(next(wheels.glob("scikit_learn-*.whl"))).read(f"{folder}/{name}")
            picture = Image.open(io.BytesIO(content)).convert("RGB")
            picture.thumbnail((LARGEST, LARGEST), Image.Resampling.BOX)
            yield np.asarray(picture) / 255.0


def _windows(picture: Picture) -> list[Picture]:
    rows, columns = (range(0, size - SIDE + 1, SIDE) for size in picture.shape[:2])
    return [picture[row : row + SIDE, column : column + SIDE] for row in rows for column in columns]


if __name__ == "__main__":
    main()
