"""From a raw image to a picture at the scale of the truth, with the colours that the camera is calibrated to."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skimage.color import deltaE_ciede2000, xyz2lab

from isp.colour.colour_fit import ColourFit, fit_colours
from isp.colour.white_balance import WhiteBalance
from isp.picture import Picture
from isp.planes import bilinear
from isp.processors.catalogue import Processor
from render.spectrum import Floats
from rodcone.colour_spaces import SRGB_TO_XYZ
from scenes.reflectances import color_checker, held
from sensor.cfa import channels, mask, unit_channel
from sensor.config import SensorConfig
from sensor.optics import falloff
from sensor.raw import RawImage
from studies.metrics.truth import GREY, Light, neutral_electrons


def colour_fit(sensor: SensorConfig, processor: Processor, light: Light) -> ColourFit:
    """Fit of the processor's balanced colours, and the mosaic's other channels, under a light on the ColorChecker."""
    nm, width = light.wavelength_nm, light.width_nm
    surfaces = np.array([held(reflectance).band_average(nm, width) for _, reflectance in color_checker()])
    colours = processor.colours or channels(sensor.cfa)
    names = (*colours, *(x for x in channels(sensor.cfa) if x not in colours))
    responses = sensor.responses.band_average(names, nm, width)
    return fit_colours(names, responses, nm, light.spectrum, surfaces, width)


def develop_to_scale(
    raw: RawImage,
    processor: Processor,
    colours: ColourFit,
    sensor: SensorConfig,
    light: Light,
    white_cd_m2: float,
    **options: Any,
) -> tuple[NDArray[np.float64], Picture]:
    """Develop an exposure and bring it to the truth's scale by what the camera is known to collect.

    Nothing is taken from the noisy picture for the scale. The falloff that the sensor's lens is known to have is
    corrected.

    Parameters
    ----------
    raw : RawImage
    processor : Processor
        Of `isp.processors.own.processor_of`.
    colours : ColourFit
        Of the processor's balanced colours; the paper's literal camera has a (3, 3) matrix in its place.
    sensor : SensorConfig
        That took the exposure.
    light : Light
        That the camera's neutral is set to.
    white_cd_m2 : float
        Luminance shown as white [cd m^-2].
    **options
        Of the processor.

    Returns
    -------
    linear : (h, w, 3) float64
        Linear sRGB, in which `white_cd_m2` is 1; not clipped.
    picture : Picture
        The processor's own result, in electrons of its unit's channel.

    Raises
    ------
    InputError
        As the processor does.
    """
    neutral = neutral_electrons(sensor, light, raw.exposure_s)  # of 1 cd/m^2
    picture = processor.develop(raw, colours, neutral=neutral, **options)
    unit_e = float(neutral[channels(sensor.cfa).index(processor.unit or unit_channel(sensor.cfa))])
    linear = picture.rgb / (unit_e * white_cd_m2)
    if sensor.lens.horizontal_view_deg:
        linear = linear / falloff(sensor.lens, linear.shape[:2])[..., None]
    return linear, picture


def balance_delta_e(raw: RawImage, colours: ColourFit, neutral: Floats, balance: ArrayLike | None = None) -> float:
    """CIEDE2000 of a neutral grey of `GREY` under the scene's light, after the white balance of an exposure.

    The balance is that of the bilinear planes, and the colour matrix the one for no noise, whatever the processor: the
    figure tells a balance, not a picture.

    Parameters
    ----------
    raw : RawImage
    colours : ColourFit
        Of the processor's balanced colours.
    neutral : (channel,) float64
        What a neutral reads under the scene's light.
    balance : (channel,) array_like, optional
        Response to what should come out neutral; left out, Gray World finds it in the exposure.
    """
    white_balance = WhiteBalance.of(raw, neutral, balance)
    gains, _ = white_balance.gains(raw, bilinear(raw))
    balanced = dict(zip(channels(raw.cfa), gains * neutral, strict=True))
    unit = balanced[unit_channel(raw.cfa)]
    names = colours.channels[:3]
    card = GREY * colours.matrix(names) @ [balanced[name] / unit for name in names]
    lab, grey = (xyz2lab(SRGB_TO_XYZ @ rgb) for rgb in (card, np.full(3, GREY)))
    return float(deltaE_ciede2000(lab, grey))


def mean_electrons(sensor: SensorConfig, expected_e: NDArray[np.float64]) -> dict[str, float]:
    """Mean expected electrons of each channel's pixels in the raw image."""
    electrons = sensor.pixel_sums(expected_e)
    shape = (electrons.shape[0], electrons.shape[1])
    return {name: float(electrons[mask(sensor.cfa, name, shape)].mean()) for name in channels(sensor.cfa)}
