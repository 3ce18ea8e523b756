"""What the white pixel brings: one pixel, well and lens behind two mosaics, in one light, developed by one method.

    python examples/04_mosaics.py [SIZE]

Writes mosaics.png: above in moonlight, below in an office; left Bayer, right RGBW.

New here: two mosaics over one pixel, compared by one method, and the error to expect in closed form before a render.
Expect: RGBW ahead by one or two dB in moonlight, and nearly level in the office.
"""

import sys

import numpy as np

import rodcone

size = int(sys.argv[1]) if sys.argv[1:] else 256

print("mosaics:", ", ".join(rodcone.mosaics()))
# What to expect of each before anything is rendered, in closed form.
for mosaic in ("bayer", "rgbw"):
    dark, light = rodcone.expect(rodcone.low_noise(cfa=mosaic), [0.05, 25.0])
    print(f"{mosaic:5}  {dark.psnr_db:.1f} dB to expect at 0.05 cd/m2, {light.psnr_db:.1f} at 25")
# In bright light W is full first; its sites can be read after a time of their own (`white_apart` by name).
apart = rodcone.with_channel_readings(rodcone.low_noise(), [rodcone.ChannelReading("W", metered=True)])
for name, sensor in (("rgbw", rodcone.low_noise()), ("W apart", apart)):
    luminance_db = rodcone.expect(sensor, [100.0], exposure="auto")[0].luminance_db
    print(f"{name:7}  {luminance_db:.1f} dB of luminance to expect at 100 cd/m2")
transport = rodcone.render("still_life", (size, size), spp=256)
rows = []
for level_cd_m2 in (0.05, 25.0):
    radiance = transport.relight(luminance_cd_m2=level_cd_m2)
    pictures = []
    for mosaic in ("bayer", "rgbw"):
        sensor = rodcone.low_noise(cfa=mosaic)
        time_s = rodcone.auto_exposure_s(rodcone.form_image(radiance, sensor), sensor)
        device = rodcone.draw_device(sensor, radiance.shape, np.random.default_rng(1))
        # Two exposures of what stands still differ by their noise alone.
        shots = []
        for seed in (2, 3):
            raw = rodcone.capture(radiance, sensor, time_s, device, np.random.default_rng(seed))
            # `ple`, piecewise linear estimation, develops both mosaics: what differs is the mosaic.
            linear = rodcone.develop(raw).rgb
            shots.append(linear / linear.mean())
        noise = np.std(shots[0] - shots[1]) / np.sqrt(2)
        print(f"{level_cd_m2:5g} cd/m2  {mosaic:5}  {1000 * time_s:5.1f} ms  noise {noise:.1%} of the mean")
        pictures.append(shots[0])
    white = np.percentile(pictures, 99)  # one brightness for both
    rows.append(np.hstack([rodcone.encode_srgb(np.clip(linear / white, 0, 1)) for linear in pictures]))

rodcone.write_picture(np.vstack(rows), "mosaics.png")
