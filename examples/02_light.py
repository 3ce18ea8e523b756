"""Other lamps and levels out of one render.

    python examples/02_light.py [SIZE]

Writes moonlight.png, day.png, tungsten.png and sodium.png.

New here: `relight` gives any lamp and level from one render.
Expect: four pictures of one scene; the sodium one has no colour, because such a lamp has a single one.
"""

import sys

import numpy as np

import rodcone

size = int(sys.argv[1]) if sys.argv[1:] else 256

print("scenes:", ", ".join(rodcone.scenes()))
transport = rodcone.render("still_life", (size, size), spp=64)
(softbox,) = transport.groups
print("the scene's light:", softbox, "; lights by name:", ", ".join(rodcone.illuminants()[:6]), "...")

# A level in cd/m2 is the picture's mean luminance; in lux it is the light on the scene's plane of reference.
lit = {
    "moonlight": transport.relight(illuminance_lux=0.25),
    "day": transport.relight({softbox: rodcone.illuminant("D65")}, luminance_cd_m2=1000.0),
    "tungsten": transport.relight({softbox: rodcone.illuminant("A")}, luminance_cd_m2=10.0),
}
sensor = rodcone.low_noise()
for name, radiance in lit.items():
    device = rodcone.draw_device(sensor, radiance.shape, np.random.default_rng(1))
    irradiance = rodcone.form_image(radiance, sensor)
    time_s = rodcone.auto_exposure_s(irradiance, sensor)  # bright green at 80 % of the well; at most 66 ms
    # The light that the camera's neutral and colour matrix are set to.
    light = "A" if name == "tungsten" else "D65"
    raw = rodcone.capture(radiance, sensor, time_s, device, np.random.default_rng(2), light=light)
    rodcone.write_picture(rodcone.develop(raw), f"{name}.png")
    print(
        f"{name:9}  {radiance.luminance().mean():8.3f} cd/m2  {1000 * time_s:6.2f} ms  {raw.electrons.mean():6.0f} e-"
    )

# The lines of a lamp are narrower than the bands of 10 nm: render each in a band of its own.
centre_nm, width_nm = rodcone.line_bands(rodcone.lines_nm("sodium_low"))
lines = rodcone.render(rodcone.load("still_life"), (size, size), wavelength_nm=centre_nm, width_nm=width_nm, spp=16)
orange = lines.relight({softbox: "sodium_low"}, luminance_cd_m2=10.0)
raw = rodcone.capture(orange, "low_noise", "20ms", light="sodium_low")
rodcone.write_picture(rodcone.develop(raw, processor="interleaved"), "sodium.png")  # `ple` knows no light of one colour
