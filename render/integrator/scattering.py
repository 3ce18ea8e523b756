"""A surface at all wavelengths of a path, for one virtual call: what no wavelength changes is then computed once."""

from typing import Any

from render.integrator.reflectance_table import TableReader
from rodcone.jit import dr

# Sampling decides by the first four wavelengths. Where another's density differs by more than this, a BSDF chooses
# lobes by wavelength and one path can't serve all bands.
PDF_TOLERANCE = 1e-3


def scatter(
    table: TableReader | None,
    bsdf: Any,
    context: Any,
    interaction: Any,
    towards_light: Any,
    lobe: Any,
    angle: Any,
    wavelengths: list[Any],
    step: Any,
) -> tuple[list[Any], Any, Any, list[Any], Any]:
    """Evaluate and sample a BSDF: values towards a light, density, sample, its weights, whether wavelength chose it."""
    if hasattr(bsdf, "scatter_bands"):  # `render.integrator.matte`, whose sampling knows no wavelength
        values, pdf, sample, weights = bsdf.scatter_bands(interaction, towards_light, angle, wavelengths, table, step)
        return values, pdf, sample, weights, dr.zeros(dr.mask_t(pdf))
    drawn = []
    for group in wavelengths:
        interaction.wavelengths = group
        drawn.append(bsdf.eval_pdf_sample(context, interaction, towards_light, lobe, angle))
    _, pdf, sample, _ = drawn[0]
    chosen = _differs(sample, [other for _, _, other, _ in drawn[1:]])
    for _, other_pdf, _, _ in drawn[1:]:
        chosen |= abs(other_pdf - pdf) > PDF_TOLERANCE * pdf
    return [value for value, *_ in drawn], pdf, sample, [weight for *_, weight in drawn], chosen


def draw(
    table: TableReader | None,
    bsdf: Any,
    context: Any,
    interaction: Any,
    lobe: Any,
    angle: Any,
    wavelengths: list[Any],
    step: Any,
) -> tuple[Any, list[Any], Any]:
    """Sample a BSDF alone."""
    if hasattr(bsdf, "sample_bands"):
        sample, weights = bsdf.sample_bands(interaction, angle, wavelengths, table, step)
        return sample, weights, dr.zeros(dr.mask_t(sample.pdf))
    drawn = []
    for group in wavelengths:
        interaction.wavelengths = group
        drawn.append(bsdf.sample(context, interaction, lobe, angle))
    sample = drawn[0][0]
    return sample, [weight for _, weight in drawn], _differs(sample, [other for other, _ in drawn[1:]])


def _differs(sample: Any, others: list[Any]) -> Any:
    """Whether the BSDF sampled another way at other wavelengths."""
    chosen = dr.zeros(dr.mask_t(sample.pdf))
    for other in others:
        chosen |= abs(other.pdf - sample.pdf) > PDF_TOLERANCE * sample.pdf
        chosen |= other.sampled_component != sample.sampled_component
    return chosen
