"""What the paper's figures share: sizes, seeds, one render a scene, sensors under both readings of Table 1."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType

from isp.substitution import SUBSTITUTION_SNR, SUBSTITUTION_SNR_TABLE1_PIXEL
from rodcone.errors import require_whole
from sensor.config import SensorConfig
from sensor.presets import preset
from sensor.variations import vary
from studies.budget.model_plan import as_stated
from studies.paper.camera import View, view_of
from studies.study.lit_scene import make_transport, open_choice
from studies.study.study import RenderLimits, SceneChoice, Study
from studies.study.study_file import read_study
from studies.sweep.export import read_rows
from studies.sweep.prepare import RENDERS
from studies.sweep.row import Row
from studies.sweep.run_sweep import sweep
from studies.sweep.workers import InThisProcess, run

CONFIGS = Path(__file__).parent.parent / "configs"
SWEEP = "sweep"  # folder of the ledger and of all renders, below the command's own
# Readings of Table 1, each with the SNR under which W replaces the luminance (docs/decisions/0005).
READINGS: Mapping[str, float] = MappingProxyType(
    {"table1_pixel": SUBSTITUTION_SNR_TABLE1_PIXEL, "table1_output": SUBSTITUTION_SNR}
)
TODAY = "low_noise"  # a pixel of today with Table 1's geometry, for comparison
Step = Callable[[str, float], None]  # what is being done, and the share of it (0..1)


@dataclass(frozen=True)
class Setup:
    """How large and how often; where renders are kept.

    Attributes
    ----------
    out : Path
        The command's folder.
    size : int
        Side of the pictures [pixels].
    spp : int
        Samples a pixel of the renders.
    band_nm : float
        Width of their bands.
    seeds : int
        Exposures of one condition, 2 or more: noise is their scatter.
    step : callable

    Raises
    ------
    InputError
        For a number out of its range.
    """

    out: Path
    size: int = 192
    spp: int = 256
    band_nm: float = 20.0
    seeds: int = 4
    step: Step = lambda what, share: None

    def __post_init__(self) -> None:
        require_whole("size", self.size, 16, 1024, "give the side of the pictures in pixels")
        require_whole("spp", self.spp, 1, 1 << 16, "give samples per pixel")
        require_whole("seeds", self.seeds, 2, 1000, "give 2 exposures or more: noise is their scatter")


def sensor_of(reading: str, mosaic: str = "rgbw", pitch_um: int | None = None) -> SensorConfig:
    """Table 1's camera under one reading, or the figures' variation of it with pixels of 2, 3 or 6 um."""
    own = preset(reading)
    if pitch_um is not None:
        noise = {name: getattr(own.pixel, name) for name in ("read_noise_e", "dsnu_e")}
        other = preset(f"table1_output_{pitch_um}um")
        own = replace(other, pixel=replace(other.pixel, **noise))
    return vary(own, mosaic)


# Samples over those of the setup: the dark half's own noise hides far more, and a constant environment needs few.
_SPP_SHARE = {"lit_and_shadowed": 0.25, "slanted_edge": 0.25}


def view(setup: Setup, scene: str, luminance_cd_m2: float | None, white: str | None = None) -> View:
    """A scene at a mean luminance, None for its lights' own powers; rendered once, then read from the folder.

    Parameters
    ----------
    white : str, optional
        Light group whose colour the cameras are set to; the scene's first where left out.
    """
    spp = max(1, round(setup.spp * _SPP_SHARE.get(scene, 1.0)))
    study = Study((SceneChoice(scene),), ("1cd/m2",), render=RenderLimits(setup.size, setup.band_nm, spp))
    opened = open_choice(study.scenes[0], study)
    model = as_stated(study).renders[opened.choice]
    folder = setup.out / SWEEP / RENDERS  # the sweeps' own: one render serves them and this
    transport, _ = make_transport(opened, study, model, folder, lambda share, _: setup.step(f"render {scene}", share))
    group = transport.groups[white or next(iter(transport.groups))]
    return view_of(transport, group.spectrum, luminance_cd_m2)


def swept(setup: Setup, figure: str) -> list[Row]:
    """Rows of a figure's study (`studies/configs/paper_*.toml`), swept at this size into the folder's ledger."""
    study = read_study(CONFIGS / f"paper_{figure}.toml")
    study = replace(
        study,
        seeds=tuple(range(setup.seeds)),
        render=RenderLimits(setup.size, setup.band_nm, setup.spp),
    )
    folder = setup.out / SWEEP
    plan = as_stated(study)
    sweep(study, folder, plan, partial(run, executor=InThisProcess()), setup.step)
    return read_rows(folder)
