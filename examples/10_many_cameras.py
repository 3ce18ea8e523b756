"""One light into several cameras: what each records of exactly the same photons, and which lamp lights each pixel.

    python examples/10_many_cameras.py [SIZE]

Writes shares.png, the part of each pixel's light that comes from the sun.

New here: another camera needs no other render, and light adds, so that maps of mixed light are exact.
Expect: sensors with less read noise are closer to the noise-free picture in this dim light. Even in the shadows about
half of the light is the sun's, because the ground and the wall send it there.
"""

import sys

import numpy as np

import rodcone

size = int(sys.argv[1]) if sys.argv[1:] else 256

transport = rodcone.render("still_life_outdoor", (size, size), spp=64)
print("groups of lights:", ", ".join(transport.groups))
radiance = transport.relight(luminance_cd_m2=2.0)
reference = rodcone.reference_picture(radiance)
for name in ("low_noise", "table1_output", "dual_gain"):
    sensor = rodcone.preset(name)
    raw = rodcone.capture(radiance, sensor, "33ms", rng=np.random.default_rng(1))
    told = rodcone.measure(rodcone.develop(raw), reference)
    dark_e = sensor.pixel.read_noise_e
    print(
        f"{name:14} read noise {dark_e:6.2f} e-, PSNR {told['psnr_db']:4.1f} dB, CIEDE2000 {told['delta_e_median']:.1f}"
    )

# The radiance under all lamps is the sum of the radiances under each: here the sun by itself, over both.
off = dict.fromkeys(transport.groups, 0.0)
light = {
    name: transport.relight(powers={**off, name: group.power}).luminance() for name, group in transport.groups.items()
}
share = light["sun"] / sum(light.values())
print(f"the sun's part: {np.percentile(share, 5):.2f} in the shadows, {np.percentile(share, 95):.2f} in the light")
rodcone.write_picture(np.repeat(share[..., None], 3, axis=2), "shares.png")
