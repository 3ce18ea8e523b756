"""A scene of your own as a Python value: a ball before a wall, a sky and a lamp that dim separately.

    python examples/05_scene.py [SIZE]

Writes evening.png, night.png, explorer.png and night.exr, the night's radiance as spectral OpenEXR.

New here: a scene from Python values, light groups that dim separately, spectral OpenEXR.
Expect: the ball red in the evening, and lit from one side at night.
"""

import sys

import numpy as np

import rodcone

size = int(sys.argv[1]) if sys.argv[1:] else 256

# A dict as Mitsuba takes it, and named groups of its lights, each with a spectrum and a power.
camera = rodcone.look_at((0, 0, 4), (0, 0, 0))
nm = np.array([380.0, 550.0, 600.0, 780.0])
red = rodcone.Spectrum(nm, np.array([0.05, 0.1, 0.6, 0.7]))
nodes = {
    "type": "scene",
    "sensor": {"type": "perspective", "fov": 40.0, "to_world": rodcone.to_world(camera)},
    "wall": rodcone.panel(rodcone.look_at((0, 0, -1), (0, 0, 1)), 12.0, 12.0, rodcone.matte(rodcone.grey(0.4))),
    "ball": {"type": "sphere", "radius": 0.8, "bsdf": rodcone.matte(red)},
    "sky": {"type": "constant"},
    "lamp": {"type": "point", "position": [2.0, 2.0, 3.0]},
}
groups = {
    "sky": rodcone.LightGroup(("sky",), rodcone.illuminant("D65"), power=20.0),  # 20 cd/m2 from all around
    "lamp": rodcone.LightGroup(("lamp",), rodcone.illuminant("3000K"), power=3.0),  # 3 cd
}
scene = rodcone.Scene("ball", nodes, groups, reference_plane="wall")
transport = rodcone.render(scene, (size, size), spp=64)

for name, sky_cd_m2, balance in (("evening", 1.0, "D65"), ("night", 0.002, "3000K")):
    radiance = transport.relight(powers={"sky": sky_cd_m2})
    raw = rodcone.capture(radiance, "low_noise", "66ms", light=balance)
    rodcone.write_picture(rodcone.develop(raw), f"{name}.png")
    print(f"{name}: {radiance.luminance().mean():.3f} cd/m2, {raw.electrons.mean():.0f} e-")

rodcone.write_exr(radiance, "night.exr", scene="ball")  # `rodcone capture night.exr` photographs it again
again = rodcone.load_radiance("night.exr")
print("read back as written:", np.allclose(again.values, radiance.values, rtol=1e-6))

# What the explorer shows of the file at these settings: its *Copy Python* writes this call.
picture = rodcone.explorer_view(rodcone.load_transport("night.exr"), level_cd_m2=0.05, frames=4)
rodcone.write_picture(picture / 255, "explorer.png")
