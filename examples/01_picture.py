"""A first picture: a scene, its light, a sensor, a raw image, a developed picture.

    python examples/01_picture.py [SIZE]

SIZE is the picture's side in pixels. Writes picture.png.

New here: the whole chain in eight calls, from light transport to a developed picture and its error.
Expect: a grainy night picture, some 26 dB from the noise-free one, and a mean of some tens of electrons.
"""

import sys

import numpy as np

import rodcone

size = int(sys.argv[1]) if sys.argv[1:] else 256

# Light transport, once: what a camera would see for unit emission of each light of the scene.
transport = rodcone.render("still_life", (size, size), spp=64)
# Radiance [W m^-2 sr^-1 nm^-1] at any level or spectrum, without another render. 0.5 cd/m2 is a street at night.
radiance = transport.relight(luminance_cd_m2=0.5)
print(f"radiance {radiance.values.shape}, mean luminance {radiance.luminance().mean():.2f} cd/m2")

# A preset is a frozen value. A device is one chip of it, with the fixed patterns drawn for that chip.
sensor = rodcone.low_noise(cfa="rgbw")
device = rodcone.draw_device(sensor, radiance.shape, np.random.default_rng(1))

# One exposure: photons, electrons, noise, digital numbers. The same generator gives the same frame.
raw = rodcone.capture(radiance, sensor, "66ms", device, np.random.default_rng(2))
print(f"raw image {raw.dn.dtype}, mean {raw.electrons.mean():.1f} electrons")

# The camera's software knows the raw image and its calibration, nothing of the truth.
picture = rodcone.develop(raw)
print(f"picture {picture.rgb.shape}, mean {picture.rgb.mean():.1f} electrons of a green pixel")
rodcone.write_picture(picture, "picture.png")

# How far it is from the scene without noise: a study's metrics.
told = rodcone.measure(picture, rodcone.reference_picture(radiance))
print(f"PSNR {told['psnr_db']:.1f} dB, median CIEDE2000 {told['delta_e_median']:.1f}")
