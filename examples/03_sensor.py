"""A sensor from the numbers of a data sheet: its SNR over light, and its numbers measured back as EMVA 1288 does.

    python examples/03_sensor.py [SIZE]

SIZE is the side of the chip that is measured.

New here: `PixelConfig` holds a data sheet's numbers, `characterise` measures them back from simulated frames.
Expect: an SNR that follows shot noise in the light and falls below it in the dark, and measured figures within a few
per cent of the configured ones.
"""

import sys
from dataclasses import replace

import numpy as np

import rodcone

size = int(sys.argv[1]) if sys.argv[1:] else 256

print("presets:", ", ".join(rodcone.sensors()))
try:
    rodcone.preset("low_nois")
except rodcone.InputError as error:  # one line: the name, its value, what is allowed
    print(error)

pixel = rodcone.PixelConfig(
    pitch_um=3.0,
    fill_factor=0.95,
    full_well_e=20_000.0,
    read_noise_e=2.0,
    dsnu_e=1.5,
    prnu=0.008,
    dark_current_e_per_s=5.0,
)
sensor = replace(rodcone.low_noise(), pixel=pixel)  # with the lens and the responses of a preset

# Signal over noise of one pixel, in closed form; shot noise alone would give the square root of the electrons.
electrons = np.array([1.0, 10.0, 100.0, 1000.0, 10_000.0])
for light_e, ratio in zip(electrons, rodcone.snr(electrons, sensor, "20ms"), strict=True):
    print(f"{light_e:7.0f} e-: SNR {ratio:6.2f}, by shot noise alone {light_e**0.5:6.2f}")

# In how little light does a pixel reach an SNR of 10, by channel?
for light in rodcone.light_for_snr(10.0, sensor, "D65", "33ms"):
    print(f"SNR 10 in {light.channel}: {light.electrons:.0f} e-, {light.luminance_cd_m2:.2f} cd/m2")

# The photon-transfer procedure on one simulated chip: it sees frames alone, and finds the numbers above.
chip = rodcone.characterise(sensor, (size, size), seed=1)
for figure in chip.figures:
    print(f"{figure.name:14} configured {figure.configured:10.4g}  measured {figure.measured:10.4g} {figure.unit}")
