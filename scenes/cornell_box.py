"""The Cornell box: a white room with a red and a green wall and two blocks, measured at Cornell University.

Source of geometry and spectra: Cornell University Program of Computer Graphics, "Cornell Box Data", 1998
(www.graphics.cornell.edu/online/box/data.html); Goral, Torrance, Greenberg and Battaile, SIGGRAPH 1984.
"""

import numpy as np

from render.geometry import camera, look_at, rotate, translate
from render.illuminants import illuminant, unit_luminance
from render.scene import LightGroup, Node, Scene
from render.spectrum import Spectrum
from scenes.materials import block, floor, matte, panel
from scenes.reflectances import resampled

LAMP_LUMINANCE_CD_M2 = 10_000.0  # that of a fluorescent tube (IES Lighting Handbook); the data states no luminance
# Inner size. The published floor and left wall are out of square by up to 6 mm; here they are squared up.
WIDTH_M, HEIGHT_M, DEPTH_M = 0.5560, 0.5488, 0.5592
CAMERA_FOV_DEG = 2 * np.degrees(np.arctan(0.025 / 2 / 0.035))  # film of 25 mm behind a lens of 35 mm

# Reflectance in thousandths, 400 to 700 nm in steps of 4 nm.
_PAINTS = {
    "white": "343 445 551 624 665 687 708 723 715 710 745 758 739 767 777 765 751 745 748 729 745 757 753 750 746 747 "
    "735 732 739 734 725 721 733 725 732 743 744 748 728 716 733 726 713 740 754 764 752 736 734 741 740 732 745 755 "
    "751 744 731 733 744 731 712 708 729 730 727 707 703 729 750 760 751 739 724 730 740 737",
    "green": "92 96 98 97 98 95 95 97 95 94 97 98 96 101 103 104 107 109 112 115 125 140 160 187 229 285 343 390 435 "
    "464 472 476 481 462 447 441 426 406 373 347 337 314 285 277 266 250 230 207 186 171 160 148 141 136 130 126 123 "
    "121 122 119 114 115 117 117 118 120 122 128 132 139 144 146 150 152 157 159",
    "red": "40 46 48 53 49 50 53 55 57 56 59 57 61 61 60 62 62 62 61 62 60 59 57 58 58 58 56 55 56 59 57 55 59 59 58 "
    "59 61 61 63 63 67 68 72 80 90 99 124 154 192 255 287 349 402 443 487 513 558 584 620 606 609 651 612 610 650 638 "
    "627 620 630 628 642 639 657 639 635 642",
}


def cornell_box(light: str | None = None) -> Scene:
    """Build a box of 0.55 m with one lamp in its ceiling (group ``lamp``); light goes from wall to wall many times.

    Parameters
    ----------
    light : str, optional
        Illuminant of the lamp; by default the measured lamp's, a warm one (400-700 nm: 0, 8, 15.6, 18.4).
    """
    white = matte(paint("white"))
    x, y, z = WIDTH_M / 2, HEIGHT_M / 2, DEPTH_M / 2
    left = look_at((WIDTH_M, y, z), (0, y, z))  # the picture's left: x grows to the left of a camera that looks at +z
    right = look_at((0, y, z), (WIDTH_M, y, z))
    down = rotate((1, 0, 0), 90)
    # Middle, rotation and mean edge of each block, from its published corners.
    short = translate(0.1855, 0, 0.169) @ rotate((0, 1, 0), -16.6)
    tall = translate(0.3685, 0, 0.35125) @ rotate((0, 1, 0), 17.2)
    lamp = translate(0.278, HEIGHT_M - 0.0005, 0.2795) @ down
    geometry: Node = {
        "type": "scene",
        "sensor": camera(float(CAMERA_FOV_DEG), (0.278, 0.273, -0.8), (0.278, 0.273, 0.0)),
        "floor": panel(floor(x, 0, z), WIDTH_M, DEPTH_M, white),
        "ceiling": panel(translate(x, HEIGHT_M, z) @ down, WIDTH_M, DEPTH_M, white),
        "back": panel(look_at((x, y, DEPTH_M), (x, y, 0)), WIDTH_M, HEIGHT_M, white),
        "left": panel(left, DEPTH_M, HEIGHT_M, matte(paint("red"))),
        "right": panel(right, DEPTH_M, HEIGHT_M, matte(paint("green"))),
        "meter_card": panel(floor(x, 0.0002, 0.06), 0.10, 0.06, white),
        "short": block(short, 0.1650, 0.165, 0.1673, white),
        "tall": block(tall, 0.1655, 0.330, 0.1675, white),
        "lamp": panel(lamp, 0.130, 0.105, white, emitter={"type": "area"}),
    }
    # Measured emission of the box's lamp, held beyond 700 nm.
    measured = Spectrum(np.array([400.0, 500, 600, 700, 780]), np.array([0.0, 8.0, 15.6, 18.4, 18.4]))
    spectrum = illuminant(light) if light else unit_luminance(measured)
    groups = {"lamp": LightGroup(("lamp/emitter",), spectrum, LAMP_LUMINANCE_CD_M2)}
    return Scene("cornell_box", geometry, groups, reference_plane="meter_card")


def paint(colour: str) -> Spectrum:
    """Return the measured reflectance of ``white``, ``green`` or ``red``, with its end values outside 400-700 nm."""
    values = np.array(_PAINTS[colour].split(), dtype=np.float64) / 1000
    return resampled(np.arange(400.0, 701.0, 4.0), values)
