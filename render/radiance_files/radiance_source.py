"""Radiance that is read from a file instead of rendered."""

from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from render.bands.known_lamp import over_lamp
from render.error_estimates import Halves
from render.illuminants import illuminant
from render.level import SceneMeans
from render.radiance import SpectralRadiance
from render.radiance_files import cube, photo
from render.radiance_files.cube import REFLECTANCE, cube_holds, description, read_cube
from render.radiance_files.envi import data_file
from render.radiance_files.exr import exr_holds_reflectance, read_exr, read_exr_lamp
from render.radiance_files.iset import read_iset_illuminant, read_iset_scene
from render.reference import open_reference
from render.scene import LightGroup
from render.spectrum import DEFAULT_WAVELENGTH_NM, LONGEST_NM, SHORTEST_NM, Spectrum, band_widths
from render.transport import Transport
from rodcone.errors import unknown
from rodcone.memory import file_extent
from rodcone.types import Floats, Planes

MOST_WHOLE_BYTES = 1 << 28  # size of a photograph's bands together, above which they are computed one at a time
WHITE_CD_M2 = 100.0  # luminance of a reflectance of 1, if no level is asked for
_READERS = {
    ".exr": read_exr,
    ".mat": lambda path: read_iset_scene(path) if is_iset(path) else read_cube(path),
    **dict.fromkeys((".npy", ".hdr"), read_cube),
    **dict.fromkeys(photo.EXTENSIONS, photo.read_photo),
}
REFERENCE = ".npz"  # ending of the files that `rodcone reference` writes
ENDINGS = (*_READERS, REFERENCE)


def is_radiance_file(name: str | Path) -> bool:
    """Return whether a name has the ending of a file that `load_radiance` reads."""
    return Path(name).suffix.lower() in ENDINGS


def is_reference(path: str | Path) -> bool:
    """Return whether a file's ending is that of reference light, whose lamps can be replaced by any light."""
    return Path(path).suffix.lower() == REFERENCE


def is_iset(path: str | Path) -> bool:
    """Return whether a file is read as an ISETCam scene: a ``.mat`` without a description beside it."""
    return Path(path).suffix.lower() == ".mat" and not description(path).is_file()


def is_reflectance(path: str | Path) -> bool:
    """Return whether a file holds reflectances: a photograph, or a cube or OpenEXR file that says so.

    Raises
    ------
    InputError
        For a cube without a description, and an OpenEXR file that can't be read.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".exr":
        return exr_holds_reflectance(path)
    if suffix in cube.EXTENSIONS and not is_iset(path):
        return cube_holds(path) == REFLECTANCE
    return suffix in photo.EXTENSIONS


def files_of(path: str | Path) -> list[Path]:
    """List the files from which a picture is read: itself, the description beside a cube, and ENVI's numbers."""
    suffix = Path(path).suffix.lower()
    described = description(path)
    beside = [described] if suffix in cube.EXTENSIONS and described.is_file() else []
    return [Path(path), *beside, *([data_file(path)] if suffix == ".hdr" else [])]


def extent_of(path: str | Path) -> tuple[int, int, int]:
    """Estimate the numbers of a picture file's pixels, bands and light groups.

    They are exact for photographs (by the header) and reference light, and estimated from the size of other files.
    """
    if Path(path).suffix.lower() in photo.EXTENSIONS:
        height, width = photo.photo_size(path)
        return height * width, DEFAULT_WAVELENGTH_NM.size, 1
    if is_reference(path):
        groups, bands, height, width = open_reference(path).transport.radiance.shape
        return height * width, bands, groups
    pixels, bands, groups = zip(*(file_extent(file) for file in files_of(path)), strict=True)
    return sum(pixels), bands[0], groups[0]


def comes_by_band(path: str | Path) -> bool:
    """Return whether a file is a photograph so large that its bands are computed one at a time."""
    if Path(path).suffix.lower() not in photo.EXTENSIONS:
        return False
    pixels, bands, _ = extent_of(path)
    return 4 * pixels * bands > MOST_WHOLE_BYTES


def load_radiance(path: str | Path, light: str | None = None, spectra: str = photo.SURFACES) -> SpectralRadiance:
    """Read spectral OpenEXR (``.exr``), an ISETCam scene (``.mat``), a cube, a photograph, reference light (``.npz``).

    Parameters
    ----------
    path : str or Path
        A cube (``.npy``, ENVI's ``.hdr``, a plain ``.mat``) has its description beside it
        (`render.radiance_files.cube.read_cube`). The spectra of a photograph (``.jpg``, ``.png``) are derived from its
        colours (`render.radiance_files.photo.read_photo`).
    light : str, optional
        For reflectances, the illuminant, by default D65; a reflectance of 1 then has 100 cd/m^2. For radiance that
        states no lamp, the lamp under which it was taken: the light then follows this lamp's lines, in bands of at most
        10 nm. For an ISETCam scene, the illuminant that replaces the stored one.
    spectra : str
        How a photograph's spectra are derived: ``surfaces`` or ``srgb_basis``, as in `read_photo`.

    Raises
    ------
    InputError
        For another ending, and as `read_exr`, `read_iset_scene`, `read_cube` and `read_photo`.
    """
    if light is None and not (is_reflectance(path) or is_reference(path)):
        return _read(path)
    return load_picture(path, illuminant(light or "D65"), spectra, named=light is not None).relight()


def load_picture(path: str | Path, light: Spectrum, spectra: str = photo.SURFACES, *, named: bool = False) -> Transport:
    """Read a file as `load_radiance` does, but as light transport, so that reflectances can be relit later.

    Parameters
    ----------
    light : Spectrum
        Light of 1 cd/m^2. It applies to reflectances, and to radiance if it is `named`. Reference light has its own.
    spectra : str
        As in `load_radiance`.
    named : bool
        Whether the user named the light. If so, it is the lamp behind radiance that states none, and replaces the
        illuminant of an ISETCam scene.

    Warns
    -----
    OtherLampWarning
        If the file holds light in bands that the lamp leaves dark. The light is then assumed to be smooth.
    """
    if is_reference(path):
        return open_reference(path).transport
    is_photo = Path(path).suffix.lower() in photo.EXTENSIONS
    if spectra == photo.SURFACES and comes_by_band(path):
        planes = photo.PhotoPlanes(*photo.read_upsampled(path))
        means = np.array([[planes[0, band].mean(dtype=np.float64) for band in range(planes.shape[1])]])
        nm = DEFAULT_WAVELENGTH_NM
        of_file = _transport(cast(Planes, planes), means, nm, band_widths(nm), "scene")
        return replace(of_file, groups={"light": LightGroup((), light, WHITE_CD_M2)})
    radiance = photo.read_photo(path, spectra) if is_photo else _read(path)
    if is_reflectance(path):
        return _lit(radiance, light, WHITE_CD_M2)
    if named and radiance.light is not None and is_iset(path):
        radiance = radiance.relight(light)
    lamp = radiance.light or (light if named else None)
    transport = None if lamp is None else over_lamp(radiance, lamp)
    return as_transport(radiance) if lamp is None or transport is None else _lit(transport, lamp, 1.0)


def _lit(transport: SpectralRadiance, lamp: Spectrum, power: float) -> Transport:
    """Make the transport of one lamp from reflectances, or from radiance divided by the lamp."""
    return replace(as_transport(transport), groups={"light": LightGroup((), lamp, power)})


def stored_illuminant(path: str | Path) -> Spectrum | None:
    """Read the lamp that a picture file of rodcone or ISETCam states, scaled to 1 cd/m^2, or return None."""
    if Path(path).suffix.lower() == ".exr":
        return read_exr_lamp(path)
    return read_iset_illuminant(path) if is_iset(path) else None


def _read(path: str | Path) -> SpectralRadiance:
    suffix = Path(path).suffix.lower()
    if suffix not in _READERS:
        raise unknown(f"{path}: ending", suffix, ENDINGS)
    return _READERS[suffix](path)


def as_transport(radiance: SpectralRadiance, name: str = "scene") -> Transport:
    """Make a transport with one light group, which at a spectrum of 1 gives the radiance unchanged.

    It has no reference plane, and no light counts as directly visible. The variance follows from the radiance's
    relative Monte Carlo error, which is assumed to be the same in every pixel. The halves' difference is 0, because one
    picture holds no halves.

    Parameters
    ----------
    radiance : SpectralRadiance
    name : str
        Name of the light group. Its spectrum is a factor on the file's own light, 1 in every band.
    """
    planes = np.ascontiguousarray(np.moveaxis(radiance.values, -1, 0), dtype=np.float32)[None]
    means = planes.mean(axis=(2, 3), dtype=np.float64)
    of_file = _transport(planes, means, radiance.wavelength_nm, radiance.widths_nm, name)
    error = radiance.relative_mc_error
    if not error:
        return of_file
    most = np.finfo(np.float32).max
    variance = np.empty_like(planes)
    for plane, squares in zip(planes[0], variance[0], strict=True):
        squares[:] = np.minimum((error * plane.astype(np.float64)) ** 2, most)
    return replace(of_file, variance=variance, relative_mc_error=error)


def _transport(planes: Planes, means: Floats, nm: Floats, width: Floats, name: str) -> Transport:
    """Make a transport without noise from planes (1, band, h, w) whose means are known; see `as_transport`."""
    ends = np.clip([(nm - width).min(), (nm + width).max()], SHORTEST_NM, LONGEST_NM)
    whole = Spectrum(ends, np.ones(2))
    none = np.broadcast_to(np.float32(0), planes.shape)
    shape = planes.shape[2:]
    return Transport(
        light=Halves(planes, none),
        variance=none,
        relative_mc_error=0.0,
        coverage=Halves.zeros(*shape),
        seen=(Halves.zeros(1, *shape),),
        scene_means=SceneMeans(means, 1.0, np.zeros((means.size + 1,) * 2)),
        groups={name: LightGroup((), whole)},
        wavelength_nm=nm,
        width_nm=width,
        counts=np.zeros(shape, np.uint32),
        stopped_by="samples",
        seconds=0.0,
        integrator="file",
        variant="none",
    )
