"""Photograph and develop: colours calibrated on the ColorChecker, a frame's notes, pictures in the truth's scale."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import skimage
from numpy.typing import ArrayLike, NDArray

from isp.colour.colour_fit import ColourFit, fit_colours, fit_through_neutral, grey_of, training
from isp.colour.white_balance import WhiteBalance
from isp.crosstalk import is_undone, without_crosstalk
from isp.picture import Picture
from isp.planes import bilinear
from isp.processors.catalogue import Processor
from render.illuminants import illuminant
from render.radiance import SpectralRadiance
from render.spectrum import Spectrum, fine_bands, photons_per_joule, tristimulus
from rodcone.colour_spaces import D50_XYZ, SRGB_TO_XYZ, adapt_to_d65, xyz_to_srgb
from rodcone.errors import InputError
from rodcone.types import Floats
from scenes.reflectances import color_checker_reflectances, held
from sensor.calibration import ColourCalibration
from sensor.capture import expose_channels
from sensor.capture import photograph_radiance as frame_of
from sensor.cfa import mask
from sensor.config import SensorConfig
from sensor.device import Device, draw_device
from sensor.exposure import AUTO_INFORMATION, exposed_by_rule
from sensor.flicker.photograph import frame_starts_s, photograph_flickering
from sensor.flicker.rows import check_flicker, steady_exposure_s
from sensor.flicker.waveform import Waveform
from sensor.lens.illumination import darkens, falloff
from sensor.optics import camera_equation, form_image, pixel_shape
from sensor.photodiodes import Gain
from sensor.presets import preset
from sensor.raw import RawImage
from sensor.readout import spread_charge
from sensor.response import behind_filters, electrons_per_irradiance, imaged_electrons, mixing_of
from sensor.shake import held_lens
from studies.metrics.truth import GREY, Light, light_in_bands, lit_range, neutral_electrons
from studies.study.gain import at_gain, gain_text, iso_speed

LEAST_COLOUR = 1e-5  # differences between balanced channels below this share of the signals are rounding, not colour
BAND_NM = 10.0  # width of the bands of calibration [nm]
GREY_COLOUR = 0.01  # under a light that shows no colours, the matrix keeps this share of the channels' differences


def calibrate(sensor: SensorConfig, light: Spectrum) -> ColourCalibration:
    """Fit a camera's colours under the light of an exposure, illuminant A and D65.

    Parameters
    ----------
    sensor : SensorConfig
        The first three channels of its mosaic, R, G and B where it has them, give the colours. Further channels, such
        as W, are fitted to XYZ, but nothing is computed back from them. One or two channels give grey.
    light : Spectrum
        Light that the camera's white balance is set to.

    Raises
    ------
    InputError
        For a channel that collects nothing, or three channels that can't tell colours apart under any light. If only
        the given light shows no colours, as sodium's lines don't, the result is nearly grey.

    Examples
    --------
    >>> import rodcone
    >>> colours = rodcone.calibrate(rodcone.low_noise("bayer"), rodcone.illuminant("D65"))
    >>> colours.to_srgb.shape
    (3, 3)
    """
    neutral, to_srgb, _, _ = _under(sensor, light)
    _, _, to_camera_a, to_xyz_a = _under(sensor, illuminant("A"))
    _, _, to_camera_d65, to_xyz_d65 = _under(sensor, illuminant("D65"))
    return ColourCalibration(
        neutral=neutral,
        to_srgb=to_srgb,
        xyz_to_camera_a=to_camera_a,
        xyz_to_camera_d65=to_camera_d65,
        camera_to_xyz_a=to_xyz_a,
        camera_to_xyz_d65=to_xyz_d65,
    )


def _in_bands(spectrum: Spectrum, window_nm: tuple[float, float]) -> Light:
    return light_in_bands(spectrum, *fine_bands([spectrum], lit_range(window_nm, BAND_NM)))


def _under(sensor: SensorConfig, spectrum: Spectrum) -> tuple[Floats, Floats, Floats, Floats]:
    """Return a camera's neutral and its matrices to sRGB, from XYZ, and to XYZ (D50), all under one light."""
    light = _in_bands(spectrum, sensor.window_nm)
    nm, width = light.wavelength_nm, light.width_nm
    behind_filters_e = electrons_per_irradiance(sensor, nm, width, 1.0, light.lamp)
    mixing = mixing_of(sensor)
    electrons = mixing @ behind_filters_e
    response = electrons / (photons_per_joule(nm) * width)  # 0 outside the camera's window
    names = sensor.channels
    three = list(range(min(len(names), 3)))
    collected = electrons @ light.spectrum
    if not np.all(collected > 0):
        raise InputError(
            f"responses: {names[int(np.argmin(collected))]} collects nothing under the light; "
            "allowed: a channel that sees light; give another curve, or colours under a broad light, such as D65"
        )
    surfaces = np.array([reflectance.band_average(nm, width) for _, reflectance in color_checker_reflectances()])
    signals, _ = training(response[three], nm, light.spectrum, surfaces, width, light.lamp)
    white = tristimulus(light.spectrum, nm, width, light.lamp)  # Y = 1
    colours = xyz_to_srgb(adapt_to_d65(tristimulus(surfaces * light.spectrum, nm, width, light.lamp), white))
    to_srgb = fit_through_neutral(signals, colours if len(three) == 3 else grey_of(colours))
    if len(three) == 3 and not _tells_colours(signals):
        if _tells_colours(training(response[three], nm, np.ones_like(nm), surfaces, width)[0]):
            to_srgb = _nearly_grey(collected[three])  # the light shows no colours, as sodium's lines don't
        else:
            three_names = ", ".join(names[:3])
            raise InputError(
                f"responses: {three_names} can't tell colours apart; allowed: three different curves; correct one"
            )
    from_xyz = _srgb_of_xyz(white)

    def rows_from_srgb(weights: Floats, of_three: Floats) -> Floats:
        """Return the matrix from linear sRGB to balanced channels: the inverse of three, and fits of the others."""
        rows = fit_through_neutral(colours, (surfaces * light.spectrum) @ weights.T / (weights @ light.spectrum))
        if len(three) == 3:
            rows[three] = np.linalg.inv(of_three)
        return rows

    from_srgb = rows_from_srgb(electrons, to_srgb)
    if sensor.pixel.crosstalk and len(names) > 3:
        # These rows give the light behind each filter, which is then mixed as crosstalk mixes the channels. So they
        # say how much of W's charge is in its neighbours, and has to be subtracted from them.
        plain = (surfaces * light.spectrum) @ behind_filters_e[three].T / (behind_filters_e[three] @ light.spectrum)
        from_srgb = mixing * (behind_filters_e @ light.spectrum) / collected[:, None]
        from_srgb = from_srgb @ rows_from_srgb(behind_filters_e, fit_through_neutral(plain, colours))
    neutral = collected / collected[names.index(sensor.unit_channel)]
    to_xyz = np.zeros((3, len(names)))
    to_xyz[:, three] = (
        np.linalg.inv(_srgb_of_xyz(D50_XYZ)) @ to_srgb
    )  # D50 is the connection space of DNG's ForwardMatrix
    return neutral, to_srgb, neutral[:, None] * from_srgb @ from_xyz, to_xyz


def _tells_colours(signals: Floats) -> bool:
    """Return whether the balanced signals (patch, 3) hold colour in two directions, beyond rounding."""
    differences = signals[:, :2] - signals[:, 2:]
    return bool(np.linalg.svd(differences, compute_uv=False)[-1] > LEAST_COLOUR * np.linalg.norm(signals))


def _nearly_grey(collected: Floats) -> Floats:
    """Return a matrix from balanced R, G and B to their mean, weighted by electrons, that still has an inverse."""
    return (1 - GREY_COLOUR) * np.tile(collected / collected.sum(), (3, 1)) + GREY_COLOUR * np.eye(3)


def _srgb_of_xyz(white: Floats) -> NDArray[np.float64]:
    """Return the matrix from XYZ under a light to linear sRGB, adapted to D65."""
    return np.asarray(xyz_to_srgb(adapt_to_d65(np.eye(3), white)).T)


def colour_fit(sensor: SensorConfig, processor: Processor, light: Light) -> ColourFit:
    """Fit the processor's colours and the mosaic's other channels under a light, on the ColorChecker's patches.

    The channels are those of the light behind each filter, because development undoes crosstalk first
    (`isp.crosstalk`). Where that doesn't undo it, they are the channels as they are read, with crosstalk.
    """
    nm, width = light.wavelength_nm, light.width_nm
    surfaces = np.array([held(reflectance).band_average(nm, width) for _, reflectance in color_checker_reflectances()])
    colours = processor.colours or sensor.channels
    names = (*colours, *(x for x in sensor.channels if x not in colours))
    index = [sensor.channels.index(x) for x in names]
    weights = electrons_per_irradiance(sensor, nm, width, 1.0, light.lamp)
    weights = (weights if is_undone(sensor.pixel.crosstalk) else mixing_of(sensor) @ weights)[index]
    responses = weights / (photons_per_joule(nm) * width)
    return fit_colours(names, responses, nm, light.spectrum, surfaces, width, light.lamp)


def develop_to_scale(
    raw: RawImage,
    processor: Processor,
    colours: ColourFit,
    sensor: SensorConfig,
    neutral: Floats,
    white_cd_m2: float,
    **options: Any,
) -> tuple[NDArray[np.float64], Picture]:
    """Develop an exposure, and scale it to the truth by the electrons that the camera is known to collect.

    The noisy picture has no part in the scale. The falloff that the sensor's lens is known to have is corrected.

    Parameters
    ----------
    raw : RawImage
    processor : Processor
        Processor as from `isp.processors.own.processor_of`.
    colours : ColourFit
        Fit of the processor's balanced colours; for the camera exactly as the paper states it, a (3, 3) matrix.
    sensor : SensorConfig
        The sensor that took the exposure.
    neutral : (channel,) float64
        Electrons of a neutral surface of 1 cd/m^2 in the exposure time, as from
        `studies.metrics.truth.neutral_electrons`.
    white_cd_m2 : float
        Luminance shown as white [cd m^-2].
    **options
        Options of the processor.

    Returns
    -------
    linear : (h, w, 3) float64
        Linear sRGB, in which `white_cd_m2` is 1; not clipped.
    picture : Picture
        The processor's own result, in electrons of its unit channel.

    Raises
    ------
    InputError
        As the processor does.
    """
    picture = processor.develop(raw, colours, neutral=neutral, **options)
    unit_e = float(neutral[sensor.channels.index(processor.unit or sensor.unit_channel)])
    linear = picture.rgb / (unit_e * white_cd_m2)
    if darkens(sensor.lens):
        linear = linear / falloff(sensor.lens, linear.shape[:2])[..., None]
    return linear, picture


def balance_delta_e(
    raw: RawImage, colours: ColourFit, sensor: SensorConfig, light: Light, balance: ArrayLike | None = None
) -> float:
    """Return how far the white balance of an exposure is off: CIEDE2000 of a grey card that is developed with it.

    The card fills a noise-free frame of the sensor under the scene's light; its pixels exchange charge. It is
    interpolated linearly and developed with the colour matrix for no noise, whatever the processor, because the figure
    measures a balance, not a picture.

    Parameters
    ----------
    raw : RawImage
        The exposure.
    colours : ColourFit
        Fit of the processor's balanced colours.
    sensor : SensorConfig
        The sensor that took the exposure.
    light : Light
        The light of the scene.
    balance : (channel,) array_like, optional
        Each channel's response to a surface that is developed as neutral; left out, Gray World finds it in the
        exposure.
    """
    neutral = neutral_electrons(sensor, light, 1.0)
    card, scale = _even_field(raw, sensor, light)
    white_balance = WhiteBalance.of(raw, neutral, balance).without_crosstalk(raw)
    raw, card = (without_crosstalk(x, neutral) for x in (raw, card))
    gains, _ = white_balance.gains(raw, bilinear(raw))
    down, across = len(raw.cfa), len(raw.cfa[0])
    tiles = bilinear(card)[2 * down : 4 * down, 2 * across : 4 * across]
    read = dict(zip(raw.channels, tiles.mean(axis=(0, 1)) * gains, strict=True))
    unit_e = scale * white_balance.response(raw)[raw.channels.index(raw.unit_channel)]
    names = colours.channels[:3]
    developed = GREY * colours.matrix(names) @ [read[name] / unit_e for name in names]
    lab, grey = (skimage.color.xyz2lab(SRGB_TO_XYZ @ rgb) for rgb in (developed, np.full(3, GREY)))
    return float(skimage.color.deltaE_ciede2000(lab, grey))


def _even_field(raw: RawImage, sensor: SensorConfig, light: Light) -> tuple[RawImage, float]:
    """Return a noise-free raw image of an even neutral field, six tiles wide and high, and the scale of its electrons.

    The scale is the ratio of its electrons to those that the field gives at 1 cd/m^2 in 1 s.
    """
    weights = electrons_per_irradiance(sensor.undivided, light.wavelength_nm, light.width_nm, 1.0, light.lamp)
    shape = 6 * len(raw.cfa), 6 * len(raw.cfa[0])
    field = np.broadcast_to(weights @ light.spectrum * camera_equation(sensor.lens), (*shape, len(raw.channels)))
    through = np.ones(shape)
    for reading in sensor.chip.channels:
        through[mask(raw.cfa, reading.channel, shape)] = reading.light_share
    light_e = behind_filters(field, sensor.undivided) * through
    electrons = spread_charge(light_e, sensor.pixel.crosstalk) / through
    scale = 0.5 * max(raw.saturation_e, raw.gain_e_per_dn) / electrons.max()
    dn = electrons * scale / raw.gain_e_per_dn + raw.black_dn
    return replace(raw, dn=dn, defects=None), scale


def capture(  # noqa: PLR0913  its calls in README and tutorials go on
    radiance: SpectralRadiance,
    sensor: SensorConfig | None = None,
    exposure_s: float | None = None,
    device: Device | None = None,
    rng: np.random.Generator | None = None,
    *,
    light: Spectrum | None = None,
    exact: bool = False,
    samples_per_pixel: int = 1,
    shake: str | None = None,
    gain: Gain | None = None,
    iso: Annotated[float, (1e-3, 1e9, "give a speed, such as 400")] | None = None,
    flicker: Waveform | None = None,
) -> RawImage:
    """Take one exposure; the raw image holds what `develop` needs.

    Parameters
    ----------
    radiance : SpectralRadiance
    sensor : SensorConfig or str, optional
        Or a preset's name or file, such as ``"low_noise"`` or ``"mine.toml"``; left out, the preset ``low_noise``.
    exposure_s : float or str, optional
        0 or more [s], or a time such as ``"66ms"``; left out, by the rule ``auto:information`` of
        `sensor.exposure.exposed_by_rule`, which may raise the gain of a camera that states a `SensorConfig.gain_limit`.
    device, rng, exact, samples_per_pixel
        As in `sensor.capture.photograph_radiance`.
    light : Spectrum or str, optional
        Light that the camera's neutral and colour matrix are set to; left out, the lamp that the radiance states, else
        D65, as in `reference_picture`. If the mosaic tells no colours under it, the raw image holds no calibration, and
        `calibrate` says why.
    shake : str, optional
        ``hand`` for a camera held in the hand (`sensor.shake`); left out, what the sensor's lens states.
    gain : float, optional
        Fixed gain between pixel and converter, 1 or more; left out, the sensor's own.
    iso : float, optional
        Saturation-based speed in the gain's place.
    flicker : Waveform or str, optional
        Flicker of the lamps, such as ``"fluorescent@100Hz"``; `radiance` is then their mean. `rng` decides the moment
        in the lamps' cycle at which the exposure starts. Bands appear where the sensor's `row_time_us` isn't 0.

    Raises
    ------
    InputError
        As `sensor.capture.photograph_radiance`, and for flicker with a camera that `sensor.flicker.rows` leaves out.

    Warns
    -----
    UserWarning
        For a frame that is nearly all full or all dark, and as `sensor.capture.photograph_radiance`.

    Examples
    --------
    >>> import numpy as np
    >>> import rodcone
    >>> light = rodcone.SpectralRadiance(np.full((8, 8, 4), 1e-3), np.arange(430.0, 780.0, 100.0))
    >>> raw = rodcone.capture(light, rodcone.low_noise(), 0.01)
    >>> raw.dn.shape, raw.cfa
    ((8, 8), ('RG', 'BW'))
    """
    sensor = preset("low_noise") if sensor is None else sensor
    sensor = at_gain(replace(sensor, lens=held_lens(sensor.lens, shake)), gain_text(gain, iso))
    shape = pixel_shape(radiance, samples_per_pixel)
    per_second_e = None
    if exposure_s is None:
        per_second_e = imaged_electrons(radiance, sensor, 1.0, samples_per_pixel)
        exposure_s, sensor = exposed_by_rule(AUTO_INFORMATION, per_second_e, sensor)
        exposure_s = exposure_s if flicker is None else steady_exposure_s([flicker], exposure_s)
    device = device or draw_device(sensor, shape, np.random.default_rng([0, 0]))
    rng = rng or np.random.default_rng([0, 1])
    if flicker is not None:
        check_flicker(sensor, held=True)
        image = form_image(radiance, sensor, samples_per_pixel)
        starts_s = frame_starts_s(sensor, shape, exposure_s, rng)
        (raw,) = photograph_flickering(image, [(flicker, image)], sensor, exposure_s, device, rng, starts_s, exact)
    elif per_second_e is not None:
        raw = expose_channels(per_second_e * exposure_s, sensor, exposure_s, device, rng, exact)
    else:
        raw = frame_of(radiance, sensor, exposure_s, device, rng, exact=exact, samples_per_pixel=samples_per_pixel)
    try:
        colour = calibrate(sensor, light or radiance.light or illuminant("D65"))
    except InputError:
        colour = None
    return with_notes(raw, sensor, colour)


def with_notes(
    raw: RawImage, sensor: SensorConfig, colour: ColourCalibration | None, source: str | Path = ""
) -> RawImage:
    """Return the raw image with what a camera states beside a frame: its name, f-number, ISO speed and colours.

    `source` is the preset's file. If it is given, the camera's name is the file's without its ending.
    """
    name = Path(source).stem.encode("ascii", "replace").decode() or raw.camera
    return replace(raw, camera=name, f_number=sensor.lens.f_number, iso=iso_speed(sensor), colour=colour)
