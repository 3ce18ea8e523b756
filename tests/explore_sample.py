"""A small rendered scene of two lights, and random settings of the explorer's controls."""

import ast
import random
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

import rodcone as public
from render.radiance import SpectralRadiance
from render.transport import Transport
from studies.explore.controls import OF_TABLE, TIME, Controls, Lamp

BANDS = {"wavelength_nm": np.arange(405.0, 780.0, 50.0), "width_nm": np.full(8, 50.0)}
RENDER = (
    "import numpy as np\n"
    "bands = {'wavelength_nm': np.arange(405.0, 780.0, 50.0), 'width_nm': np.full(8, 50.0)}\n"
    "transport = rodcone.render('still_life_outdoor', (40, 48), spp=4, **bands)\n"
)
GAUSSIAN = tuple((float(nm), float(np.exp(-(((nm - 600) / 40) ** 2)))) for nm in range(380, 790, 10))


def lamps_apart(transport: Transport, level_cd_m2: float) -> list[SpectralRadiance]:
    """Radiance of each light group alone, at a level of all together, as the explorer keeps it."""
    over_own = level_cd_m2 / transport.level().value
    off = dict.fromkeys(transport.groups, 0.0)
    own = {name: group.power * over_own for name, group in transport.groups.items()}
    return [transport.relight(powers=off | {name: power}) for name, power in own.items()]


@cache
def small_transport() -> Transport:
    """What `RENDER` makes."""
    return public.render("still_life_outdoor", (40, 48), spp=4, **BANDS)


def ran(code: str) -> dict[str, Any]:
    """Names that copied Python makes, which imports what a user has: rodcone, NumPy, the standard library."""
    names: dict[str, Any] = {}
    nodes = list(ast.walk(ast.parse(code)))
    modules = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    modules |= {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    assert modules <= {"rodcone", "numpy", "dataclasses"}, code
    exec(code, names)
    return names


def random_controls(rng: random.Random) -> Controls:
    """Controls of which each may have been moved; processors that answer at once."""
    lamp = Lamp("own", 2 ** rng.uniform(-5, 5))
    lamps: list[dict[str, Lamp]] = [
        {}, {"sun": lamp}, {"sun": Lamp("A")}, {"sky": Lamp(f"{rng.randrange(2000, 9000)}K", 3.0)},
        {"sun": Lamp(power=0.0)}, {"sky": Lamp(table=GAUSSIAN)},
    ]  # fmt: skip
    pixel: list[dict[str, float]] = [
        {}, {"read_noise_e": rng.uniform(0, 20)}, {"dsnu_e": 0.0, "prnu": 0.03}, {"crosstalk": 0.05},
        {"column_gain_spread": 0.02, "column_offset_e": 3.0}, {"full_well_e": 2000.0, "dark_current_e_per_s": 500.0},
        {"hot_pixel_share": 0.01, "hot_pixel_dark_current_e_per_s": 1e5},
    ]  # fmt: skip
    lens: list[dict[str, float]] = [
        {}, {"f_number": rng.uniform(1, 16)}, {"diffraction": 1.0, "f_number": 8.0}, {"defocus_um": rng.uniform(0, 20)},
        {"veiling_glare": 0.05},
    ]  # fmt: skip
    cameras: list[dict[str, Any]] = [
        {}, {}, {"settings": {"sigma_s": rng.uniform(1, 6)}}, {"settings": {"neighbourhood": 11.0, "sigma_d": 3.0}},
        {"mosaic": "bayer", "processor": "bayer"}, {"processor": "rgbw_gindele"}, {"mosaic": "rgbw_4x4"},
    ]  # fmt: skip
    camera = {"processor": "interleaved"} | rng.choice(cameras)
    made = Controls(
        lamps=rng.choice(lamps),
        level_cd_m2=10 ** rng.uniform(-4, 5),
        exposure=rng.choice(["auto", "auto", "auto:W", "auto:information", TIME]),
        exposure_s=10 ** rng.uniform(-4, -0.5),
        sensor=rng.choice(["low_noise", "low_noise", "table1_output"]),
        pixel=rng.choice(pixel),
        lens=rng.choice(lens),
        bits=rng.choice([None, None, 10]),
        white_balance=rng.choice(["gray-world", "as-shot"]),
        seed=rng.randrange(50),
        exposure_number=rng.randrange(50),
        frames=rng.choice([1, 1, 1, 3]),
        flicker_depth=rng.choice([0.0, 0.0, 0.6]),
        flicker_hz=rng.choice([100.0, 120.0]),
        row_time_us=rng.choice([None, 0.0, 250.0, -250.0]),
        **camera,
    )
    made = replace(made, shot_noise=made.seed % 5 > 0)
    if made.seed % 16 or set(OF_TABLE) & set(made.lens):
        return made
    return replace(made, lens_table="double_gauss")
