"""Every hard case through the whole chain, and the margins by which the invariants are kept."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from rodcone.errors import unknown
from studies.stress_case import Case, Margin, Measure
from studies.stress_cases_camera import EXPOSURE_CASES, FRAME_CASES, PIXEL_CASES
from studies.stress_cases_light import LIGHT_CASES
from studies.stress_cases_picture import PICTURE_CASES
from studies.stress_cases_spectrum import SPECTRUM_CASES
from studies.stress_electrons import linear, monotone, reciprocal, shifted
from studies.stress_pictures import equivariant
from studies.stress_raw import bounded, pictures_unbiased, raw_unbiased

CASES: tuple[Case, ...] = (
    *LIGHT_CASES,
    *SPECTRUM_CASES,
    *EXPOSURE_CASES,
    *PIXEL_CASES,
    *FRAME_CASES,
    *PICTURE_CASES,
)

# In the order of the chain; every case is measured by all of them, as far as they say something about it.
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
_CLAMP = "the image of a point, sampled once a pixel, has lobes under 0, which are cut: 4 samples a pixel have none"
_COARSE = "a step of 3922 e⁻ hides 1000 e⁻: without noise as wide as a step, rounding isn't evened out"

# What isn't kept, and why: exactly these. A fault is mended, not listed.
LIMITS: Mapping[tuple[str, str], str] = MappingProxyType(
    {
        ("glint_with_diffraction", "monotone"): _CLAMP,
        ("glint_with_diffraction", "linear"): _CLAMP,
        ("glint_with_diffraction", "shifted"): _BORDER,
        ("glint_with_diffraction_4", "shifted"): _BORDER,
        ("glint_out_of_focus", "monotone"): _CLAMP,
        ("glint_out_of_focus", "linear"): _CLAMP,
        ("glint_out_of_focus", "shifted"): _BORDER,
        ("neighbours_1e8_diffraction", "shifted"): _BORDER,
        ("f_64_diffraction", "shifted"): _BORDER,
        (
            "even_2_e",
            OWN,
        ): "similarity of noisy samples takes those that noise raised alike together: 0.5 % of a sample's "
        "noise in W at 6 e⁻; from 10 e⁻ a pixel on under 0.1 %, which 48 frames don't tell from none",
        ("largest_number", "linear"): "the readout holds means at 1e30 e⁻, over any well",
        (
            "read_noise_0",
            "raw unbiased",
        ): "whole electrons on steps of 0.92 e⁻: without dark noise their rounding isn't evened out",
        ("well_1e6_8bit", "raw unbiased"): _COARSE,
        ("well_1e6_8bit", "pictures unbiased"): _COARSE,
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


def choose(names: Sequence[str] | None) -> tuple[Case, ...]:
    """Cases by name, in the catalogue's order; all of them without names.

    Raises
    ------
    InputError
        For a name that isn't in the catalogue.
    """
    known = [case.name for case in CASES]
    for name in names or ():
        if name not in known:
            raise unknown("case", name, known)
    return tuple(case for case in CASES if not names or case.name in names)


def run_case(case: Case) -> Result:
    """Measure one case."""
    situation = case.situation()
    margins = {name: measure(situation) for name, measure in INVARIANTS.items()}
    margins[OWN] = case.own(situation) if case.own else None
    return Result(case, margins)


def run_cases(cases: Sequence[Case], step: Callable[[str, float], None] = lambda what, share: None) -> list[Result]:
    """Measure cases one after the other; `step` is told each one's name and the share that is done."""
    results = []
    for number, case in enumerate(cases):
        step(case.name, number / len(cases))
        results.append(run_case(case))
    return results


def unexpected(results: Sequence[Result]) -> list[str]:
    """What isn't kept though no limit says so, and limits that are kept after all: one line each."""
    faults = []
    for result in results:
        for name, margin in result.margins.items():
            known = (result.case.name, name) in LIMITS
            if margin is not None and not margin.kept and not known:
                faults.append(
                    f"case {result.case.name}, {name}: {margin.worst:.3g} {margin.unit} where {margin.allowed:.3g} is "
                    "allowed; a fault, or a limit to be listed with its reason"
                )
            elif known and (margin is None or margin.kept):
                faults.append(f"case {result.case.name}, {name}: kept, though listed as a limit; take it off the list")
    return faults
