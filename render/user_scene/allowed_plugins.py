"""Mitsuba plug-ins that a user's scene may name, and why some of Mitsuba's own are left out.

Mitsuba loads ``plugins/<type>.so`` for any type that a scene names, from any folder on its search path: a name outside
this list may be native code. The list is what Mitsuba 3.9 ships, less what the integrator doesn't simulate and less
``blender``, which reads memory at addresses that the scene states.
"""

from typing import Any

from render.scene import COLOURED_EMITTERS, EMISSION_PARAMETER
from rodcone.errors import InputError, unknown

CAMERAS = ("perspective", "thinlens")
METER = "irradiancemeter"  # in a shape it marks the plane on which illuminance is measured
SPECTRA = ("blackbody", "d65", "irregular", "rawconstant", "regular", "srgb", "uniform")

# By kind. Films, filters, samplers and integrators are read and left out: the engine brings its own.
_STOCK = {
    "scene": "scene",
    "shape": "bsplinecurve cube cylinder disk instance linearcurve obj ply rectangle sdfgrid serialized shapegroup "
    "sphere",
    "bsdf": "blendbsdf bumpmap conductor dielectric diffuse hair mask measured normalmap null plastic principled "
    "principledthin roughconductor roughdielectric roughplastic thindielectric twosided",
    "texture": "bitmap checkerboard mesh_attribute",
    "film": "hdrfilm specfilm",
    "rfilter": "box catmullrom gaussian lanczos mitchell tent",
    "sampler": "independent ldsampler multijitter orthogonal stratified",
    "integrator": "aov depth direct direct_projective moment path prb prb_basic prb_projective prbvolpath ptracer "
    "stokes volpath volpathmis",
}
ALLOWED: dict[str, tuple[str, ...]] = {kind: tuple(names.split()) for kind, names in _STOCK.items()}
ALLOWED["texture"] += SPECTRA
ALLOWED |= {"emitter": (*EMISSION_PARAMETER, *COLOURED_EMITTERS), "sensor": (*CAMERAS, METER)}
_KIND = {name: kind for kind, names in ALLOWED.items() for name in names}

_MEDIA = "participating media aren't simulated", "remove the medium"
_POLARISED = "polarisation isn't simulated", "replace it by its plain form"
_RELIT = "its light can't be relit", f"allowed: {', '.join(ALLOWED['emitter'])}"
_CAMERA = "the camera is a perspective one", f"allowed: {', '.join(CAMERAS)}"
_VOLUME = "it needs an integrator of its own", "replace it by a mesh"
_REASONS: dict[str, tuple[str, str]] = {
    **dict.fromkeys(("homogeneous", "heterogeneous"), _MEDIA),
    **dict.fromkeys(("hg", "isotropic", "rayleigh", "sggx", "tabphase", "blendphase"), _MEDIA),
    **dict.fromkeys(("constvolume", "gridvolume", "volume"), _MEDIA),
    **dict.fromkeys(("circular", "polarizer", "retarder", "pplastic", "measured_polarized"), _POLARISED),
    **dict.fromkeys(("directionalarea", "projector", "timed_sunsky"), _RELIT),
    **dict.fromkeys(("batch", "distant", "orthographic", "radiancemeter"), _CAMERA),
    **dict.fromkeys(("ellipsoids", "ellipsoidsmesh", "volprim_rf_basic"), _VOLUME),
}


def require_allowed(plugin: str, tag: str = "") -> None:
    """Raise `InputError` for a plug-in that isn't on the list; `tag` narrows the names that the error tells."""
    if plugin in _REASONS:
        reason, fix = _REASONS[plugin]
        raise InputError(f"plug-in {plugin!r} is refused, {reason}; {fix}")
    if plugin not in _KIND:
        refusal = unknown("plug-in", plugin, ALLOWED.get(tag) or _KIND)
        raise InputError(f"{refusal}; or, if you trust the scene, trust=True or --trust-scene")


def kind_of(mi: Any, plugin: str) -> str:
    """Kind of a plug-in that has been allowed; Mitsuba itself is asked, and loads it, only where it isn't listed.

    Raises
    ------
    InputError
        For an emitter or sensor of a trusted scene's own, and what isn't simulated.
    """
    if plugin in _KIND:
        return _KIND[plugin]
    if plugin in _REASONS:
        raise InputError(f"plug-in {plugin!r} is refused also in a trusted scene, {'; '.join(_REASONS[plugin])}")
    kind = mi.PluginManager.instance().plugin_type(plugin).name.lower()  # "unknown" where it finds none
    if kind in ("emitter", "sensor"):
        raise InputError(f"{kind} {plugin!r} is refused also in a trusted scene; allowed: {', '.join(ALLOWED[kind])}")
    return str(kind)
