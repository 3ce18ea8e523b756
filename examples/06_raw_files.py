"""Raw files: an array as a DNG that raw converters open, and a burst that is merged.

    python examples/06_raw_files.py [SIZE]

Writes ramp.dng, night_1.dng to night_4.dng, one.png and four.png.

New here: `expose` reads out any array of electrons; raw files; a burst that is merged by the noise model.
Expect: four merged frames with half the read noise of one.
"""

import sys
from dataclasses import replace

import numpy as np

import rodcone

size = int(sys.argv[1]) if sys.argv[1:] else 256

# Expected electrons from anywhere go through the readout: shot noise, fixed patterns, read noise, quantisation.
bayer = rodcone.low_noise(cfa="bayer")
rng = np.random.default_rng(1)
expected_e = np.linspace(5.0, 4000.0, size) * np.ones((size, 1))
device = rodcone.draw_device(bayer, expected_e.shape, rng)
ramp = rodcone.expose(expected_e, bayer, "20ms", device, rng)
colour = rodcone.calibrate(bayer, "D65")  # what a DNG says about the camera's colours
rodcone.write_raw(replace(ramp, colour=colour, f_number=2.8, iso=100.0), "ramp.dng")
same = np.array_equal(rodcone.read_raw("ramp.dng").dn, ramp.dn)
print("the file holds the same numbers:", same)

# Four exposures by one chip, merged before they are developed: shot and read noise fall, fixed patterns stay.
radiance = rodcone.render("still_life", (size, size), spp=64).relight(luminance_cd_m2=1.0)
device = rodcone.draw_device(bayer, radiance.shape, np.random.default_rng(1))
for number in range(1, 5):
    frame = rodcone.capture(radiance, bayer, "10ms", device, np.random.default_rng([2, number]))
    rodcone.write_raw(frame, f"night_{number}.dng", frame=number)
frames = [rodcone.read_raw(f"night_{number}.dng") for number in range(1, 5)]
merged = rodcone.merged_raw(frames)
print(f"one:    {1000 * frames[0].exposure_s:g} ms, read noise {frames[0].read_noise_e:.2f} e-")
print(f"merged: {1000 * merged.exposure_s:g} ms, read noise {merged.read_noise_e:.2f} e-")
rodcone.write_picture(rodcone.develop(frames[0]), "one.png")
rodcone.write_picture(rodcone.develop(merged), "four.png")
