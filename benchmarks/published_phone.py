"""Noise of a telephone's sensor as Stanford measured it, beside the noise of a preset of the published numbers.

    python benchmarks/published_phone.py

Lyu, Goossens, Wandell and Farrell ("Validation of Physics-Based Image Systems Simulation with 3-D Scenes", arXiv
2201.07411; IEEE Sensors Journal 2022) measure the Google Pixel 4a (Sony IMX363) at ISO 55. Two of their figures need no
scene:

- Figure 11: green samples of a window of 11 x 11 in 15 frames of an integrating sphere, over black and with vignetting
  divided out, have a mean of 320.7 DN and a variance of 57.8 DN^2. (The caption's numbers; the script that its authors
  publish as ``papers/IEEE_2022/Figure_11`` of https://github.com/ISET/isetcornellbox says how they were taken.)
- Figure 8 (b): standard deviation of green in regions of 10 x 10 pixels of one picture that pass for even, over their
  mean with black. The values here were read off that figure where its measured points aren't hidden: the centre of
  their ink in five intervals of the mean.

The sensor is ISETCam's model of the IMX363 with the noise that the same authors measured (``cbSensorCreate``): 0.44875
mV a DN, a well of 6000 e- at 1023 DN, black at 64 DN; read noise 0.226 mV, DSNU 0.038 mV, PRNU 0.5444 %.
"""

from dataclasses import replace

import numpy as np

from rodcone.types import Floats
from sensor.config import SensorConfig
from sensor.device import draw_device
from sensor.presets import low_noise
from sensor.readout import read_out

VOLT_PER_DN = 0.44875e-3
BLACK_DN, WHITE_DN = 64, 1023
VOLT_PER_E = WHITE_DN * VOLT_PER_DN / 6000
DN_PER_E = VOLT_PER_E / VOLT_PER_DN
MEAN_DN, VARIANCE_DN2 = 320.7, 57.8  # Figure 11
WINDOW, FRAMES = 11, 15
# Figure 8 (b): mean with black and standard deviation, DN.
REGIONS_DN = ((468.5, 8.79), (524.4, 9.56), (591.2, 10.13), (641.0, 10.41), (679.7, 11.26))
REGION = 10  # pixels
CHIPS = 400
EXPOSURE_S = 0.01


def phone() -> SensorConfig:
    """IMX363 by its published numbers."""
    sensor = low_noise("bayer")
    pixel = replace(
        sensor.pixel,
        pitch_um=1.4,
        full_well_e=(WHITE_DN - BLACK_DN) / DN_PER_E,
        read_noise_e=0.226e-3 / VOLT_PER_E,
        dsnu_e=0.038e-3 / VOLT_PER_E,
        prnu=0.005444,
        dark_current_e_per_s=0.0,
    )
    return replace(sensor, pixel=pixel, bits=10, black_level_dn=BLACK_DN)


def green_dn(sensor: SensorConfig, mean_dn: float, side_px: int, frames: int, chip: int) -> Floats:
    """Green samples of one row parity over black, of several frames of one chip in even light, shape (frame, n)."""
    shape = (side_px, side_px)
    expected_e = np.full(shape, mean_dn / DN_PER_E)
    device = draw_device(sensor, shape, np.random.default_rng([chip, 0]))
    noise = np.random.default_rng([chip, 1])
    return np.array(
        [
            (read_out(expected_e, sensor, device, EXPOSURE_S, noise).dn[1::2, ::2] - float(BLACK_DN)).ravel()
            for _ in range(frames)
        ]
    )


def main() -> None:
    sensor = phone()
    variances = [green_dn(sensor, MEAN_DN, 2 * WINDOW, FRAMES, chip).var() for chip in range(CHIPS)]
    low, high = np.quantile(variances, [0.025, 0.975])
    print(f"Figure 11: mean {MEAN_DN} DN, variance {VARIANCE_DN2} DN^2; ours {np.mean(variances):.1f}, and of 95 % of")
    print(f"{CHIPS} such windows {low:.1f} to {high:.1f}")
    print("\nFigure 8 (b): mean of a region, DN   measured   ours (standard deviation, DN)")
    for mean_dn, measured_dn in REGIONS_DN:
        ours = [green_dn(sensor, mean_dn - BLACK_DN, REGION, 1, chip).std(ddof=1) for chip in range(CHIPS)]
        print(f"{mean_dn:35.1f}{measured_dn:11.2f}{np.mean(ours):7.2f}")


if __name__ == "__main__":
    main()
