"""Views of a shot: 8-bit pictures, and figures as numbers for JSON."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import hypot
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skimage.color import deltaE_ciede2000, rgb2lab

from render.spectrum import photons_per_joule
from render.transport import Transport
from rodcone.colour_spaces import encode_srgb, luminance_of_srgb
from rodcone.errors import require_name, require_whole
from rodcone.types import Image
from sensor.cfa import channel_map, mask
from sensor.raw import RawImage
from sensor.readings.resolve import PlainReading, at_channel, resolve
from sensor.readout import collected_e, sources_of, unclipped_variance
from sensor.response import electrons_per_irradiance
from studies.explore.chain import Exposure, GroupFrame, Shot, expose_scene, photograph
from studies.explore.controls import controls_of
from studies.explore.memo import Memo
from studies.metrics.flip import flip

Bytes = NDArray[np.uint8]

MOST_SIGMAS = 4.0  # standard deviations of noise at which the picture is black or white
MOST_LUMINANCE_ERROR = 0.25  # luminance error that is shown as black or white, as a share of white
MOST_DELTA_E, MOST_SNR_DB = 10.0, 40.0
BINS, LEAST_E = 80, 0.5  # bins of the histogram, and its lower end [e-]
# Linear colours in which the raw mosaic's channels are shown; W is white.
_TINTS = {"R": (1, 0.1, 0.1), "G": (0.1, 1, 0.1), "B": (0.15, 0.2, 1), "C": (0, 1, 1), "M": (1, 0, 1), "Y": (1, 1, 0)}


# Pictures


def raw_picture(shot: Shot) -> Bytes:
    """Show the mosaic with each pixel in its channel's colour, encoded as sRGB; a full well is white."""
    raw = shot.exposed.raw
    wells_e = np.array([raw.noise_of(channel).full_well_e for channel in raw.channels])
    tints = np.array([_TINTS.get(channel, (1, 1, 1)) for channel in raw.channels])
    index = np.vectorize(raw.channels.index)(channel_map(raw.cfa, raw.shape))
    share = np.clip(raw.electrons / wells_e[index], 0.0, 1.0)
    return _bytes(encode_srgb(share[..., None] * tints[index]))


def noise_picture(shot: Shot) -> Bytes:
    """Show the raw image less the expected electrons: grey is 0, black and white are four standard deviations."""
    exposed = shot.exposed
    # For a burst, the number of its frames; for several readings, the share of the exposure time that they have.
    light = exposed.raw.exposure_s / exposed.exposure_s
    noise_e = exposed.raw.electrons / light - _collected_e(exposed)
    return _grey(0.5 + 0.5 * noise_e * round(light) ** 0.5 / (MOST_SIGMAS * noise_scale_e(exposed)))


def luminance_error_picture(shot: Shot) -> Bytes:
    """Show the picture's luminance less the truth's: grey is 0, white and black are a quarter of white."""
    error = luminance_of_srgb(shot.linear) - luminance_of_srgb(shot.true)
    return _grey(0.5 + 0.5 * error / MOST_LUMINANCE_ERROR)


def colour_error_picture(shot: Shot) -> Bytes:
    """Show CIEDE2000 between the encoded picture and the truth: 0 is dark, 10 and more are bright."""
    error = deltaE_ciede2000(rgb2lab(encode_srgb(shot.linear)), rgb2lab(encode_srgb(shot.true)))
    return _coloured(error / MOST_DELTA_E)


def flip_picture(shot: Shot) -> Bytes:
    """Show FLIP between the encoded picture and the truth: 0 is dark, 1 is bright."""
    return _coloured(flip(encode_srgb(shot.linear), encode_srgb(shot.true)))


def snr_picture(shot: Shot) -> Bytes:
    """Show the expected electrons over the noise of one frame's pixel: 0 dB is dark, 40 dB and more are bright."""
    exposed = shot.exposed
    with np.errstate(divide="ignore"):
        snr_db = 10 * np.log10(_collected_e(exposed) ** 2 / _variance_e2(exposed))
    return _coloured(snr_db / MOST_SNR_DB)


VIEWS: Mapping[str, Callable[[Shot], Bytes]] = MappingProxyType(
    {
        "picture": lambda shot: shot.picture,
        "truth": lambda shot: shot.truth,
        "raw": raw_picture,
        "noise": noise_picture,
        "luminance error": luminance_error_picture,
        "colour error": colour_error_picture,
        "flip": flip_picture,
        "snr": snr_picture,
    }
)


def explorer_view(transport: Transport, view: str = "picture", **controls: object) -> Any:
    """Return a picture or figure of the explorer's page, as the page's *Copy Python* asks for it.

    Parameters
    ----------
    transport : Transport
        As `rodcone.render` or `rodcone.load_transport` returns it.
    view : str
        ``picture``, ``truth``, ``raw``, ``noise``, ``luminance error``, ``colour error``, ``flip``, ``snr``;
        ``histogram`` or ``pixel ROW COLUMN``.
    **controls
        Fields of `studies.explore.controls.Controls` that differ from the page's defaults, such as
        ``level_cd_m2=0.05``, ``lens={"f_number": 4.0}`` or ``lamps={"softbox": {"spectrum": "A"}}``.

    Returns
    -------
    (h, w, 3) uint8, or dict
        Picture in sRGB; what `histogram` or `pixel` gives.

    Raises
    ------
    InputError
        For an unknown view or control, or a value that the chain refuses.
    """
    place = re.fullmatch(r"pixel (\d{1,9}) (\d{1,9})", view)
    if not place:
        require_name("view", view, (*VIEWS, "histogram", "pixel ROW COLUMN"))
    settings = controls_of(controls, "see help(rodcone.explorer_view)")
    if view in VIEWS:
        return VIEWS[view](photograph(transport, settings))
    exposed = expose_scene(transport, settings, Memo())
    return pixel(exposed, int(place[1]), int(place[2])) if place else histogram(exposed.raw)


def noise_scale_e(exposed: Exposure) -> float:
    """Return the root mean square over the pixels of one frame's noise [e-]."""
    return float(np.sqrt(_variance_e2(exposed).mean()))


def _readings(exposed: Exposure) -> tuple[PlainReading, ...]:
    readings = resolve(exposed.sensor, exposed.expected_e, exposed.exposure_s)
    return readings if exposed.shot_noise else tuple(replace(x, poisson=0.0) for x in readings)


def _variance_e2(exposed: Exposure) -> Image:
    """Return the variance of each pixel of one frame as if nothing clipped [e-^2]."""
    return unclipped_variance(exposed.expected_e, _readings(exposed))


def _collected_e(exposed: Exposure) -> Image:
    """Return the expected photo-electrons of each pixel of one frame, with crosstalk from its neighbours."""
    return collected_e(exposed.expected_e, _readings(exposed))


def _grey(share: Image) -> Bytes:
    return _bytes(np.repeat(np.clip(share, 0.0, 1.0)[..., None], 3, axis=2))


def _coloured(share: Image) -> Bytes:
    from matplotlib import colormaps  # imported here, because it loads slowly and few views need it

    return np.asarray(colormaps["viridis"](np.clip(np.nan_to_num(share, neginf=0.0), 0.0, 1.0), bytes=True)[..., :3])


def _bytes(encoded: Image) -> Bytes:
    return np.asarray(np.rint(encoded * 255), dtype=np.uint8)


# Figures


def facts(shot: Shot) -> dict[str, Any]:
    """Return figures of a shot: exposure time, gain, speed, share of full pixels, green's SNR if it was measured."""
    exposed = shot.exposed
    saturated = float(exposed.raw.saturated.mean())
    return {
        "exposure_s": exposed.exposure_s,
        "gain": exposed.sensor.gain,
        "iso": exposed.iso,
        "saturated": saturated,
        "snr_db": shot.developed.snr_db,
    }


def histogram(raw: RawImage) -> dict[str, Any]:
    """Count the samples of each channel by their electrons, in bins of equal width on a logarithmic scale.

    Returns
    -------
    dict
        ``edges_e`` (n + 1,), the bins' edges; ``counts`` by channel, (n,), where the first and the last bin also count
        samples beyond them; ``well_e``, the full well; and ``floor_e``, the dark noise of a pixel.
    """
    deepest_e = max(raw.full_well_e, *(raw.noise_of(channel).full_well_e for channel in raw.channels))
    edges = np.geomspace(LEAST_E, 1.05 * deepest_e, BINS + 1)
    electrons = np.clip(raw.electrons, edges[0], edges[-1])
    counts = {
        channel: np.histogram(electrons[mask(raw.cfa, channel, raw.shape)], edges)[0].tolist()
        for channel in raw.channels
    }
    return {"edges_e": edges.tolist(), "counts": counts, "well_e": raw.full_well_e, "floor_e": raw.dark_noise_e}


def pixel(exposed: Exposure, row: int, column: int) -> dict[str, Any]:
    """Return the light budget and the spectrum of one pixel in one frame.

    Returns
    -------
    dict
        ``photons`` on the pixel's area; ``electrons`` by channel, as if the pixel had that channel's filter;
        ``channel``, its own; ``read_e``, the electrons that the raw image reads there, summed over a burst, and
        ``well_e``, the most that it can read; ``noise_e``, the standard deviation of each noise source [e-], and their
        ``total``, as if nothing clipped. ``wavelength_nm``, ``photons_nm`` (by band, per nanometre) and
        ``electrons_nm`` (by channel and band, per nanometre) are the spectrum of the light, and of the electrons.

    Raises
    ------
    InputError
        For a pixel outside the frame.
    """
    sensor, raw, time_s = exposed.sensor, exposed.raw, exposed.exposure_s
    require_whole("row", row, 0, raw.shape[0] - 1, "give a row of the frame")
    require_whole("column", column, 0, raw.shape[1] - 1, "give a column of the frame")
    nm, width = exposed.transport.wavelength_nm, exposed.transport.width_nm

    # The light of all groups on the pixel.
    def light(name: str, frame: GroupFrame) -> Image:
        factor = exposed.transport.groups[name].power * exposed.scale
        return factor * np.asarray(frame.irradiance.values[row, column], dtype=np.float64)

    of_groups = {name: light(name, frame) for name, frame in exposed.frames.items()}
    irradiance = np.sum(list(of_groups.values()), axis=0)
    area_m2 = (sensor.pixel.pitch_um * 1e-6) ** 2
    photons = irradiance * photons_per_joule(nm) * width * area_m2 * time_s
    electrons = np.sum(
        [
            electrons_per_irradiance(sensor, nm, width, time_s, exposed.frames[name].irradiance.light) * values
            for name, values in of_groups.items()
        ],
        axis=0,
    )
    names = sensor.channels
    channel = str(channel_map(sensor.cfa, raw.shape)[row, column])
    return {
        "row": row,
        "column": column,
        "channel": channel,
        "photons": float(photons.sum()),
        "electrons": dict(zip(names, electrons.sum(axis=1).tolist(), strict=True)),
        "read_e": float(raw.electrons[row, column]),
        "well_e": raw.noise_of(channel).full_well_e,
        "noise_e": noise_sources_e(exposed, row, column),
        "wavelength_nm": nm.tolist(),
        "photons_nm": (photons / width).tolist(),
        "electrons_nm": dict(zip(names, (electrons / width).tolist(), strict=True)),
    }


def noise_sources_e(exposed: Exposure, row: int, column: int) -> dict[str, float]:
    """Return the standard deviation of each noise source of one pixel of a random chip, and of all together [e-]."""
    channel = str(channel_map(exposed.sensor.cfa, exposed.raw.shape)[row, column])
    sources = sources_of(float(_collected_e(exposed)[row, column]), at_channel(_readings(exposed), channel))
    return {**sources, "total": hypot(*sources.values())}
