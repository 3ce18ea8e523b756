"""Names for the types of Mitsuba's variant and of Dr.Jit's kernels, which hold one value per thread.

Their classes depend on the variant, which is set while the program runs. To a type checker each is therefore `Any`; the
names show a reader which class is meant. `mi` is Mitsuba's module with that variant.
"""

from typing import Any, TypeAlias

from rodcone.jit import Float, Mask, UInt

SPECTRUM_SIZE = 4  # wavelengths of a spectral variant's `Spectrum`

Spectrum4: TypeAlias = Any  # `Spectrum`: four wavelengths of a path
Spectra: TypeAlias = list[Spectrum4]  # all bands of a path, four per entry
Point2: TypeAlias = Any
Vector: TypeAlias = Any
Ray: TypeAlias = Any
Interaction: TypeAlias = Any  # `SurfaceInteraction3f`: where a ray meets a surface
DirectionSample: TypeAlias = Any  # a position that was sampled on a lamp, and its direction from the point it lights
Bsdf: TypeAlias = Any
BsdfSample: TypeAlias = Any
BsdfContext: TypeAlias = Any
Properties: TypeAlias = Any  # a plug-in's parameters
Emitter: TypeAlias = Any
MitsubaScene: TypeAlias = Any

# Start of a path: ray, surface that it leaves, density of its direction, whether no light was sampled, light so far.
Start: TypeAlias = tuple[Ray, Interaction, Float, Mask, Spectra]
Channels: TypeAlias = dict[str, list[Float]]  # results of a tracer by name: one number per channel and thread

__all__ = [
    "SPECTRUM_SIZE",
    "Bsdf",
    "BsdfContext",
    "BsdfSample",
    "Channels",
    "DirectionSample",
    "Emitter",
    "Float",
    "Interaction",
    "Mask",
    "MitsubaScene",
    "Point2",
    "Properties",
    "Ray",
    "Spectra",
    "Spectrum4",
    "Start",
    "UInt",
    "Vector",
]
