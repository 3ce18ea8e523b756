"""A learned network on Bayer: weights read as arrays, the layers beside plain sums, and what the released weights do.

``DEMOSAICNET=FILE.whl python -m pytest tests/isp/processors/test_network.py`` runs the last kind, on the wheel itself.
"""

import os
import pickle
import runpy
import sys
import zipfile
from contextlib import suppress
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from builders import BAYER_PHASES, random_weights, raw_image, wheel_of
from skimage import data

from isp.colour.colour_fit import ColourFit
from isp.processors import network
from isp.processors.own import own_version, processor_of, require_consent
from rodcone.digests import digest_file
from rodcone.errors import InputError
from sensor.cfa import mask

RELEASED = os.environ.get("DEMOSAICNET", "")
released = pytest.mark.skipif(not RELEASED, reason="DEMOSAICNET names no wheel of demosaicnet")


def test_weights_are_read_as_arrays() -> None:
    weights = random_weights()
    found = network.read_weights(wheel_of(weights))
    assert set(found) == set(weights)
    for name, array in weights.items():
        assert np.array_equal(found[name], array), name


def test_nothing_that_a_pickle_names_is_run(tmp_path: Path) -> None:
    class Runs:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return os.system, (f"touch {tmp_path / 'ran'}",)

    with pytest.raises(ValueError, match=r"can.t be read|not in list"):
        network.read_weights(wheel_of(random_weights(), pickle.dumps(Runs(), 2)))
    assert not (tmp_path / "ran").exists()


@pytest.mark.filterwarnings("error")
def test_a_damaged_wheel_is_refused_in_a_line_or_read(tmp_path: Path) -> None:
    whole, rng = wheel_of(random_weights()), np.random.default_rng(3)
    content = bytearray(whole)
    spoilt = [b"", b"PK", whole[: len(whole) // 2]]
    for at in rng.choice([*range(3000), *range(len(content) - 200, len(content))], 60):
        content[at] ^= 1 << rng.integers(8)
        spoilt.append(bytes(content))
        content[at] = whole[at]
    weights = random_weights()
    spoilt.append(wheel_of(weights | {"upsampler.bias": np.zeros(2, np.float32)}))
    read = 0
    for number, wheel in enumerate(spoilt):
        path = tmp_path / f"{number}.whl"
        path.write_bytes(wheel)
        with suppress(InputError):
            processor_of(f"{path}:bayer_net")
            read += 1
    assert read < 0.5 * len(spoilt)
    weights["residual_predictor.bias"][0] = np.nan
    with pytest.raises(ValueError, match="what is no number"):
        network.read_weights(wheel_of(weights))


def test_a_wheel_is_named_as_a_file_of_ones_own_and_needs_no_consent(tmp_path: Path) -> None:
    path = tmp_path / "net.whl"
    path.write_bytes(wheel_of(random_weights()))
    require_consent("isp", f"{path}:bayer_net", trust_code=False)
    assert own_version(f"{path}:bayer_net") == {"net.whl": digest_file(path)}
    assert processor_of(f"{path}:bayer_net").extra is None
    assert processor_of(f"{path}:bayer_net_bm3d").extra == "bm3d"
    with pytest.raises(InputError, match=r"no 'bayer', only bayer_net and bayer_net_bm3d.* pip download --no-deps"):
        processor_of(f"{path}:bayer")
    with pytest.raises(InputError, match=r"absent.whl.*No such file.*pip download --no-deps demosaicnet"):
        processor_of(f"{tmp_path / 'absent.whl'}:bayer_net")


def correlated(values: np.ndarray, filters: np.ndarray, bias: np.ndarray, step: int = 1) -> np.ndarray:
    """Valid correlation of (in, h, w) by torch's definition, a sum over windows."""
    side = filters.shape[-1]
    windows = np.lib.stride_tricks.sliding_window_view(values, (side, side), axis=(1, 2))[:, ::step, ::step]
    return np.einsum("ihwrc,oirc->ohw", windows, filters, optimize=True) + bias[:, None, None]


@pytest.mark.parametrize("cfa", BAYER_PHASES)
def test_the_network_is_its_layers_in_torchs_order(cfa: tuple[str, ...]) -> None:
    weights = random_weights()
    mosaic = np.random.default_rng(4).uniform(1.0, 9.0, (7, 10))
    white = np.quantile(mosaic, network.WHITE)
    # All phases as the one that begins with G in a row of R, within a wider reflection
    down, right = next((y, x) for y, x in product((0, 1), (0, 1)) if cfa[y][x] == "G" and cfa[y][1 - x] == "R")
    wide = np.pad(mosaic / white, ((34 + down, 35 - down), (34 + right, 34 - right)), mode="reflect")
    values = np.zeros((3, *wide.shape))
    values[1, ::2, ::2], values[0, ::2, 1::2] = wide[::2, ::2], wide[::2, 1::2]
    values[2, 1::2, ::2], values[1, 1::2, 1::2] = wide[1::2, ::2], wide[1::2, 1::2]

    def layer(x: np.ndarray, name: str, step: int = 1) -> np.ndarray:
        return correlated(x, weights[f"{name}.weight"], weights[f"{name}.bias"], step)

    x = layer(values, "main_processor.pack_mosaic", 2)
    for n in range(15):
        x = np.maximum(layer(x, f"main_processor.conv{n + 1}"), 0)
    x = layer(x[:64] * x[64:], "residual_predictor")
    finer = np.zeros((3, 2 * x.shape[1], 2 * x.shape[2])) + weights["upsampler.bias"][:, None, None]
    for k, r, c in product(range(12), (0, 1), (0, 1)):  # a transposed convolution in three groups
        finer[k // 4, r::2, c::2] += weights["upsampler.weight"][k, 0, r, c] * x[k]
    edge = (values.shape[1] - finer.shape[1]) // 2
    both = np.concatenate([values[:, edge:-edge, edge:-edge], finer])
    x = layer(np.maximum(layer(both, "fullres_processor.post_conv"), 0), "fullres_processor.output") * white
    top, left = 34 + down - edge - 1, 34 + right - edge - 1
    expected = np.moveaxis(x, 0, -1)[top : top + 7, left : left + 10]
    found = network.demosaic(mosaic, cfa, weights)
    assert found.shape == (7, 10, 3)
    assert found == pytest.approx(expected, rel=1e-4, abs=1e-4 * np.abs(expected).max())


@released
@pytest.mark.parametrize("cfa", BAYER_PHASES)
def test_released_weights_keep_a_field_and_each_sample(cfa: tuple[str, ...]) -> None:
    processor = processor_of(f"{RELEASED}:bayer_net")
    colours = ColourFit(("R", "G", "B"), np.ones(3), np.eye(3), np.eye(3), plain=np.eye(3))
    field = raw_image(np.full((40, 52), 4100), cfa)
    found = processor.develop(field, colours, balance=np.ones(3)).rgb
    assert found == pytest.approx(4000.0, rel=0.01)
    photograph = data.coffee()[100:200, 100:260] / 255.0
    sites = np.stack([mask(cfa, colour, photograph.shape[:2]) for colour in "RGB"], axis=-1)
    mosaic = np.where(sites, photograph, 0).sum(axis=-1)
    weights = network.read_weights(Path(RELEASED).read_bytes())
    picture = network.demosaic(mosaic, cfa, weights)
    assert np.abs((picture - photograph)[sites]).mean() < 1e-3
    assert -10 * np.log10(np.mean((np.clip(picture, 0, 1) - photograph) ** 2)) > 36.0


@released
def test_released_network_in_torch_gives_the_same_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    torch = pytest.importorskip("torch", reason="torch is not installed")
    with zipfile.ZipFile(RELEASED) as members:
        members.extractall(tmp_path)
    resources = SimpleNamespace(resource_filename=lambda _, name: str(tmp_path / "demosaicnet" / name))
    monkeypatch.setitem(sys.modules, "pkg_resources", resources)
    released_network = runpy.run_path(str(tmp_path / "demosaicnet" / "modules.py"))["BayerDemosaick"]()
    cfa, edge = ("GR", "BG"), 32
    photograph = data.coffee()[100:200, 100:260] / 255.0
    samples = photograph * np.stack([mask(cfa, colour, photograph.shape[:2]) for colour in "RGB"], axis=-1)
    white = np.quantile(samples.sum(axis=-1), network.WHITE)
    wide = np.pad(samples / white, ((edge, edge), (edge, edge), (0, 0)), mode="reflect").transpose(2, 0, 1)
    with torch.no_grad():
        picture = released_network(torch.from_numpy(wide[None].astype(np.float32)))[0].numpy()
    lost = (wide.shape[1] - picture.shape[1]) // 2
    inside = slice(edge - lost, lost - edge)
    weights = network.read_weights(Path(RELEASED).read_bytes())
    found = network.demosaic(samples.sum(axis=-1), cfa, weights)
    assert found == pytest.approx(picture[:, inside, inside].transpose(1, 2, 0) * white, abs=1e-5)
