"""Metrics by which pictures are compared: what each one means, and how large a difference a person sees."""

import tomllib
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Metric:
    """Number by which pictures of cameras are compared.

    Attributes
    ----------
    key : str
        Name of the metric's column in `studies.sweep.row.Row`.
    name : str
        Name for a reader.
    digits : int
        Number of decimals that are shown.
    unit : str
    higher : bool
        Whether higher is better.
    threshold : float
        Smallest difference between two pictures that is called visible, in the metric's unit; see `SEEN_BY`.
    """

    key: str
    name: str
    digits: int
    unit: str
    higher: bool
    threshold: float


PSNR = Metric("psnr_db", "PSNR", 1, "dB", higher=True, threshold=0.5)
SSIM = Metric("ssim", "SSIM", 3, "", higher=True, threshold=0.02)
DELTA_E = Metric("delta_e_median", "ΔE2000, median", 1, "", higher=False, threshold=1.0)
DELTA_E_95 = Metric("delta_e_p95", "ΔE2000, 95 %", 1, "", higher=False, threshold=1.0)
S_CIELAB = Metric("s_cielab_median", "S-CIELAB, median", 1, "", higher=False, threshold=1.0)
S_CIELAB_95 = Metric("s_cielab_p95", "S-CIELAB, 95 %", 1, "", higher=False, threshold=1.0)
FLIP = Metric("flip_mean", "FLIP", 3, "", higher=False, threshold=0.02)
PU21 = Metric("pu21_psnr_db", "PU21-PSNR", 1, "dB", higher=True, threshold=0.5)
MTF50 = Metric("mtf50_cy_per_px", "MTF50", 3, "cy/px", higher=True, threshold=0.02)
CHART = Metric("chart_delta_e_mean", "ΔE2000 of the chart", 1, "", higher=False, threshold=1.0)
PATCHES = Metric("patch_snr_db", "SNR of the patches", 1, "dB", higher=True, threshold=0.5)
_TEXTS = tomllib.loads(Path(__file__).with_name("meanings.toml").read_text("utf-8"))
# Sources for the values of `Metric.threshold`; and, by each metric's key, what it means and where it misleads.
SEEN_BY: str = _TEXTS["seen_by"]
MEANINGS: dict[str, str] = _TEXTS["meanings"]
ON_TARGETS = (MTF50, CHART, PATCHES)  # metrics that exist only for the scene of their test target
METRICS = (PSNR, SSIM, DELTA_E, DELTA_E_95, S_CIELAB, S_CIELAB_95, FLIP, PU21, *ON_TARGETS)
# Metrics that a report draws at first, and on which its verdict in words is based, so that a reader finds in the charts
# what the words claim.
HEADLINE = (PSNR, DELTA_E, FLIP)
# One metric of each family that exists for every scene. They are the columns of `rodcone judge`. Two levels count as
# one if a person sees no difference in any of them. PU21 isn't among them, because it weighs errors by the light.
DECIDING = (PSNR, SSIM, DELTA_E, FLIP)
