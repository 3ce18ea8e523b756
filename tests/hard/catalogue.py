"""Every hard case, the invariants that all cases are measured by, and the limits that are known."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from hard.case import Case, Margin, Measure
from hard.cases_camera import EXPOSURE_CASES, FRAME_CASES, PIXEL_CASES
from hard.cases_light import LIGHT_CASES
from hard.cases_picture import PICTURE_CASES
from hard.cases_spectrum import SPECTRUM_CASES
from hard.invariants_electrons import linear, monotone, reciprocal, shifted
from hard.invariants_raw import bounded, pictures_unbiased, raw_unbiased
from hard.invariants_symmetry import equivariant

CASES: tuple[Case, ...] = (*LIGHT_CASES, *SPECTRUM_CASES, *EXPOSURE_CASES, *PIXEL_CASES, *FRAME_CASES, *PICTURE_CASES)

# In the order of the chain. The first line of each docstring stands on the page.
INVARIANTS: Mapping[str, Measure] = MappingProxyType(
    {
        "bounded": bounded,
        "monotone": monotone,
        "linear": linear,
        "reciprocal": reciprocal,
        "shifted": shifted,
        "raw unbiased": raw_unbiased,
        "pictures unbiased": pictures_unbiased,
        "equivariant": equivariant,
    }
)
OWN = "its own"

_BORDER = "beyond the border a lens sees the picture's mirror image, which doesn't move along"
_CLAMP = "out of focus the image of a point, sampled once a pixel, has lobes under 0, which are cut"
_COARSE = "a step of 3922 e⁻ hides 1000 e⁻: without noise as wide as a step, rounding isn't evened out"
_NEUTRAL = (
    "shares are shrunk towards a neutral of this balance, which is 10^6 times one channel; read by such shares, a "
    "pixel's own sample differs from a plane by over 40 %, and the plane follows it in part, as at a bar one pixel wide"
)
_GUIDE = (
    "a sample is read as W by its channel's share of the light around, shrunk towards neutral by the share's error; an "
    "even light whose channels are far from W's own shares keeps 2 to 7 % of that"
)
_TILES = (
    "what a channel reads of W's light is known by tiles of the mosaic, which begin at the frame's first row and "
    "column; in a frame of an odd length they lie elsewhere once it is mirrored"
)

# Exactly what isn't kept, and why. A fault is mended, not listed.
LIMITS: Mapping[tuple[str, str], str] = MappingProxyType(
    {
        ("glint_with_diffraction", "shifted"): _BORDER,
        ("glint_with_diffraction_4", "shifted"): _BORDER,
        ("glint_out_of_focus", "linear"): _CLAMP,
        ("glint_out_of_focus", "shifted"): _BORDER,
        ("neighbours_1e8_diffraction", "shifted"): _BORDER,
        ("f_64_diffraction", "shifted"): _BORDER,
        (
            "even_2_e",
            OWN,
        ): "similarity of noisy samples takes those that noise raised alike together: 0.6 % of a sample's "
        "noise in W at 6 e⁻, 0.2 % at 29 e⁻ and 0.1 % at 86 e⁻ (96 frames, ± 0.04 %)",
        ("red_alone", "pictures unbiased"): _GUIDE,
        ("balance_1e6", "pictures unbiased"): _NEUTRAL,
        ("largest_number", "linear"): "the readout holds means at 1e30 e⁻, over any well",
        (
            "read_noise_0",
            "raw unbiased",
        ): "whole electrons on steps of 0.92 e⁻: without dark noise their rounding isn't evened out",
        ("well_1e6_8bit", "raw unbiased"): _COARSE,
        ("well_1e6_8bit", "pictures unbiased"): _COARSE,
        ("frame_64x3", "equivariant"): _TILES,
        ("frame_5x7", "equivariant"): _TILES,
        ("frame_33x35", "equivariant"): _TILES,
        ("frame_61x67", "equivariant"): _TILES,
        ("prnu_50", OWN): "a response can't be negative: of a normal spread of 50 %, 2 % of the pixels are cut at 0, "
        "which raises the mean by 0.4 %",
    }
)


@dataclass(frozen=True)
class Result:
    """A case and its margins by invariant; None where an invariant says nothing about it."""

    case: Case
    margins: Mapping[str, Margin | None]

    @property
    def broken(self) -> tuple[str, ...]:
        """Invariants that are not kept."""
        return tuple(name for name, margin in self.margins.items() if margin is not None and not margin.kept)


def run_case(case: Case) -> Result:
    """Measure one case."""
    situation = case.situation()
    margins = {name: measure(situation) for name, measure in INVARIANTS.items()}
    margins[OWN] = case.own(situation) if case.own else None
    return Result(case, margins)


def unexpected(result: Result) -> list[str]:
    """One line for each invariant that is broken though no limit says so, or kept though a limit says otherwise."""
    faults = []
    for name, margin in result.margins.items():
        broken, known = name in result.broken, (result.case.name, name) in LIMITS
        if broken and not known:
            faults.append(
                f"{result.case.name}, {name}: {margin.worst:.3g} {margin.unit} where {margin.allowed:.3g} is allowed; "
                "mend the fault, or list the limit with its reason"
            )
        elif known and not broken:
            faults.append(f"{result.case.name}, {name}: kept, though listed as a limit; take it off the list")
    return faults
