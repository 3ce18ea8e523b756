"""The figures that tell pictures apart: what each says, and which difference a person sees."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Metric:
    """A number that tells cameras apart.

    Attributes
    ----------
    key : str
        In a cell and in a row.
    name : str
    digits : int
        Decimals.
    unit : str
    higher : bool
        Whether higher is better.
    seen : float
        Smallest difference of two pictures that is called visible, in the metric's unit; see `SEEN_BY`.
    """

    key: str
    name: str
    digits: int
    unit: str
    higher: bool
    seen: float


PSNR = Metric("psnr_db", "PSNR", 1, "dB", higher=True, seen=0.5)
SSIM = Metric("ssim", "SSIM", 3, "", higher=True, seen=0.02)
DELTA_E = Metric("delta_e_median", "ΔE2000, median", 1, "", higher=False, seen=1.0)
DELTA_E_95 = Metric("delta_e_p95", "ΔE2000, 95 %", 1, "", higher=False, seen=1.0)
S_CIELAB = Metric("s_cielab_median", "S-CIELAB, median", 1, "", higher=False, seen=1.0)
S_CIELAB_95 = Metric("s_cielab_p95", "S-CIELAB, 95 %", 1, "", higher=False, seen=1.0)
FLIP = Metric("flip_mean", "FLIP", 3, "", higher=False, seen=0.02)
PU21 = Metric("pu21_psnr_db", "PU21-PSNR", 1, "dB", higher=True, seen=0.5)
MTF50 = Metric("mtf50_cy_per_px", "MTF50", 3, "cy/px", higher=True, seen=0.02)
CHART = Metric("chart_delta_e_mean", "ΔE2000 of the chart", 1, "", higher=False, seen=1.0)
PATCHES = Metric("patch_snr_db", "SNR of the patches", 1, "dB", higher=True, seen=0.5)
# Where the sizes in `Metric.seen` come from, as the page says it.
SEEN_BY = (
    "0.5 dB of PSNR is what video coding groups long took for visible; it isn't a measured threshold. A CIEDE2000 of 1 "
    "is about the just noticeable difference of two large patches side by side; between pictures it takes more, 2.5 of "
    "CIELAB in the mean (Song and Luo, Color and Imaging Conference 9, 2001). For FLIP and SSIM nobody has published a "
    "size: 0.02, a fiftieth of their scales, is this program's choice, as is 0.02 cycles per pixel of MTF50."
)
ON_TARGETS = (MTF50, CHART, PATCHES)  # known on the scene alone that they are made for
# What each says, and where it misleads: in one sentence.
MEANINGS = {
    PSNR.key: "Mean squared error of the encoded picture: noise counts wherever it is, seen or not.",
    SSIM.key: "How alike the structure is around each pixel, from 0 to 1; flat surfaces under noise count heavily.",
    DELTA_E.key: "Difference of colour in half of the pixels, pixel by pixel: of a large patch, 1 is just seen.",
    DELTA_E_95.key: "The same, exceeded in 5 % of the pixels only: fringes, highlights, lost colours.",
    S_CIELAB.key: "The same after the eye's own blur: fine noise no longer counts, blotches and casts do.",
    S_CIELAB_95.key: "The same, exceeded in 5 % of the pixels only.",
    FLIP.key: "The difference that is seen when picture and truth alternate on a screen, from 0 to 1.",
    PU21.key: "What an eye that is adapted to the scene's own light sees of the error: by moonlight it sees so little "
    "that even a picture full of noise gets some 45 dB, and figures of two light levels don't compare.",
    MTF50.key: "Spatial frequency at which an edge's contrast has fallen to a half.",
    CHART.key: "Mean difference of colour over the chart's patches.",
    PATCHES.key: "Signal over noise within the chart's patches.",
}  # fmt: skip
METRICS = (PSNR, SSIM, DELTA_E, DELTA_E_95, S_CIELAB, S_CIELAB_95, FLIP, PU21, *ON_TARGETS)
# Metrics that say much the same: the largest of each family is named, and none is a vote.
FAMILIES = ((PSNR, PU21, PATCHES), (SSIM, MTF50), (DELTA_E, DELTA_E_95, S_CIELAB, S_CIELAB_95, CHART), (FLIP,))
# One of each family, known on every scene: an undecided one leaves a level so, and two levels whose pictures are alike
# by all of them give one picture. PU21 weighs errors by the light.
DECIDING = (PSNR, SSIM, DELTA_E, FLIP)
