"""Every way to make a picture from a raw file, by name: the interleaved camera and its opponents."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.util import find_spec
from types import MappingProxyType

from numpy.typing import ArrayLike

from isp.colour.colour_fit import ColourFit
from isp.colour.noise_gains import NoiseGains, colours_in_noise, measured_gains
from isp.colour.white_balance import WhiteBalance
from isp.crosstalk import without_crosstalk
from isp.defects import interpolate_defects
from isp.interleaved.pipeline import picture_bayer, picture_interleaved, picture_interleaved_paper
from isp.picture import Picture
from isp.processors.any_mosaic import picture_any_mosaic
from isp.processors.bayer_denoised import picture_bayer_nlm, picture_demosaicked_first, picture_denoised_first
from isp.processors.corrected import picture_corrected_bayer, picture_corrected_rgbw
from isp.processors.demosaic import EXTRA as DEMOSAICKING
from isp.processors.demosaic import malvar, menon, picture_demosaicked
from isp.processors.fusion import picture_complementary, picture_kijima, picture_sato, picture_yamagami
from isp.processors.gindele import picture_gindele, picture_rgbw_park
from isp.processors.piecewise import picture_ple, picture_ple_bayer, picture_ple_rgbw, takes
from isp.processors.residual import residual_interpolation
from isp.processors.sub_images import EXTRA as BM3D
from isp.processors.sub_images import hadamard, principal_components
from rodcone.errors import InputError
from sensor.cfa import OWN, Tile
from sensor.raw import RawImage

_LIBRARIES = {DEMOSAICKING: ("colour_demosaicing",), BM3D: ("bm3d", "colour_demosaicing")}  # libraries of each extra


@dataclass(frozen=True)
class Processor:
    """A camera's software, and the mosaic that it needs.

    Attributes
    ----------
    mosaic : str
        Name for `sensor.presets.vary`: one of `sensor.cfa.MOSAICS`, a variation with its own curves, or ``own`` for the
        sensor's own mosaic.
    picture : callable
        Function ``picture(raw, colours, *, balance) -> Picture`` with a `ColourFit` and a `WhiteBalance`, which
        `develop` calls.
    source : str
        Publication of the method.
    extra : str or None
        Extra that ``pip install rodcone[...]`` has to install, if any.
    colours : tuple of str
        Channels from which the matrix computes linear sRGB; empty for all channels of the mosaic.
    unit : str
        Channel that sets the picture's scale: a neutral surface gets the electrons of this channel. It is empty for
        `sensor.cfa.unit_channel`.
    on_backend : bool
        Whether it runs in Dr.Jit, if there is a backend, rather than in NumPy.
    noise_gains : NoiseGains or None
        Measured error of its planes, for a noise-aware colour matrix; None if the processor decides itself which noise
        its matrix takes into account.
    file_version : mapping of str to str
        Name of a user's own file and the hash of the bytes from which it was loaded; empty for the catalogue.
    """

    mosaic: str
    picture: Callable[..., Picture]
    source: str
    extra: str | None = None
    colours: tuple[str, ...] = ("R", "G", "B")
    unit: str = "G"
    on_backend: bool = False
    noise_gains: NoiseGains | None = None
    file_version: Mapping[str, str] = field(default_factory=dict)

    def develop(
        self,
        raw: RawImage,
        matrix: ArrayLike | ColourFit,
        *,
        neutral: ArrayLike | None = None,
        balance: ArrayLike | WhiteBalance | None = None,
        **options: object,
    ) -> Picture:
        """Replace defective pixels, undo crosstalk, and develop the picture.

        Parameters
        ----------
        raw : RawImage
        matrix : (3, 3) array_like or ColourFit
            From the balanced channels `colours` to linear sRGB (`isp.colour.colour_fit.fit_matrix`, `fit_colours`),
            each channel as its own filter makes it, whatever the raw image's crosstalk.
        neutral : (channel,) array_like, optional
            Calibrated response to a neutral, in the order of `sensor.cfa.channels`, as the raw image reads it with its
            crosstalk, for the white balance of pictures that are too dark for Gray World; by default that of the
            project's own curves under D65.
        balance : (channel,) array_like or WhiteBalance, optional
            Response to what should become neutral, such as a file's as-shot neutral, instead of Gray World's means. A
            `WhiteBalance` holds both responses.
        **options
            The processor's own options, such as `substitution_snr`.
        """
        raw = interpolate_defects(raw)
        white_balance = WhiteBalance.of(raw, neutral, balance)
        scale = 1.0
        if raw.crosstalk:
            # In the picture a neutral has the electrons that the unit channel reads, with crosstalk.
            unit = raw.channels.index(self.unit or raw.unit_channel)
            behind_filters = white_balance.without_crosstalk(raw)
            scale = float(white_balance.response(raw)[unit] / behind_filters.response(raw)[unit])
            raw, white_balance = without_crosstalk(raw, white_balance.expected(raw)), behind_filters
        colours = ColourFit.of(matrix)
        if self.noise_gains is not None and set(self.colours) <= set(raw.channels):  # other mosaics are refused below
            colours = colours_in_noise(raw, colours, white_balance, self.unit, self.noise_gains)
        picture = self.picture(raw, colours, balance=white_balance, **options)
        return picture if scale == 1.0 else replace(picture, rgb=picture.rgb * scale)


_MALVAR = partial(picture_demosaicked, demosaic=malvar)
_MENON = partial(picture_demosaicked, demosaic=menon)
_RESIDUAL = partial(picture_demosaicked, demosaic=residual_interpolation)
_BM3D_FIRST = partial(picture_denoised_first, mix=hadamard, demosaic=menon)
_PARK = partial(picture_denoised_first, mix=principal_components, demosaic=residual_interpolation)
_RESIDUAL_BM3D = partial(picture_demosaicked_first, demosaic=residual_interpolation)
_EARLY = "W as luminance by early fusion"
_PIECEWISE = "piecewise linear: Yu, Sapiro & Mallat 2012 with a fixed prior, Zoran & Weiss 2011"
_CORRECTED = "ple, corrected by a small network that was trained for RGBW and Bayer alike"
_ANY = "interleaved reconstruction, a matrix over all channels; one or two give a grey picture"
# Processors with the plain matrix of their publications. The first is the default; the next two are the paper's
# cameras.
_PLAIN: Mapping[str, Processor] = MappingProxyType(
    {
        "ple": Processor(
            OWN, picture_ple, f"any mosaic of R, G, B, W, {_PIECEWISE}; it removes noise", colours=(), unit=""
        ),
        "interleaved": Processor(
            "rgbw", picture_interleaved, "Parmar & Wandell 2009, eqs. (1)-(6); it removes noise", on_backend=True
        ),
        "bayer": Processor(
            "bayer", picture_bayer, "bilinear, the conventional camera of Parmar & Wandell 2009; it removes no noise"
        ),
        "interleaved_paper": Processor(
            "rgbw", picture_interleaved_paper, "the same to the letter, its own matrix and switch", on_backend=True
        ),
        "bayer_bilinear": Processor("bayer", picture_bayer, "bilinear, with a colour matrix that knows its noise"),
        "bayer_malvar": Processor("bayer", _MALVAR, "Malvar, He & Cutler 2004", extra=DEMOSAICKING),
        "bayer_menon": Processor("bayer", _MENON, "Menon, Andriani & Calvagno 2007", extra=DEMOSAICKING),
        "bayer_residual": Processor("bayer", _RESIDUAL, "residual interpolation, Kiku et al. 2016"),
        "bayer_nlm": Processor(
            "bayer", picture_bayer_nlm, "the interleaved camera's non-local means on Bayer", on_backend=True
        ),
        "bayer_bm3d": Processor("bayer", _BM3D_FIRST, "BM3D, Dabov et al. 2007, then Menon", extra=BM3D),
        "bayer_park": Processor("bayer", _PARK, "BM3D as Park et al. 2009, then residual", extra=BM3D),
        "bayer_residual_bm3d": Processor("bayer", _RESIDUAL_BM3D, "residual, then BM3D as Jin et al. 2020", extra=BM3D),
        "rgbw_sato": Processor("rgbw", picture_sato, f"{_EARLY}: Sato 1983"),
        "rgbw_kijima": Processor("rgbw", picture_kijima, f"{_EARLY}: Kijima 2007"),
        "rgbw_yamagami": Processor("rgbw_nd", picture_yamagami, "neutral density on W: Yamagami 1994"),
        "cmyw_yamagami": Processor(
            "cmyw", picture_complementary, "complementary colours: Yamagami 1994", colours=("C", "Y", "M"), unit="Y"
        ),
        "rgbw_gindele": Processor("rgbw", picture_gindele, "colours alone where W is full: Gindele & Gallagher 2002"),
        "rgbw_park": Processor("rgbw", picture_rgbw_park, "BM3D as Park et al. 2009, then Gindele", extra=BM3D),
        **{
            name: Processor(
                *(name, partial(picture_any_mosaic, mosaic=name), _ANY), on_backend=True, colours=(), unit=""
            )
            for name in ("rccb", "rccc", "ryyb", "mono")
        },
        "any_mosaic": Processor(OWN, picture_any_mosaic, _ANY, on_backend=True, colours=(), unit=""),
        "ple_rgbw": Processor("rgbw", picture_ple_rgbw, _PIECEWISE),
        "ple_bayer": Processor("bayer", picture_ple_bayer, _PIECEWISE),
        "ple_rgbw_net": Processor("rgbw", picture_corrected_rgbw, _CORRECTED),
        "ple_bayer_net": Processor("bayer", picture_corrected_bayer, _CORRECTED),
    }
)
_GAINS = measured_gains()
PROCESSORS: Mapping[str, Processor] = MappingProxyType(
    {name: replace(processor, noise_gains=_GAINS.get(name)) for name, processor in _PLAIN.items()}
)
# Names that a study may use. Under NAME_published a processor with measured noise gains has the plain colour matrix of
# its publication instead.
NAMED: Mapping[str, Processor] = MappingProxyType(
    {
        **PROCESSORS,
        **{f"{name}_published": _PLAIN[name] for name in _PLAIN if name in _GAINS and name != "bayer_bilinear"},
    }
)


# Processors of a study that names none: one method on both mosaics.
DEFAULT_PAIR = ("ple_rgbw", "ple_bayer")


def default_processor(tile: Tile) -> str:
    """Return the default processor of a mosaic: ``ple``, so that all mosaics are developed by one method.

    For tiles that ``ple`` doesn't take, because of other channels than R, G, B and W or of another size, it is
    ``any_mosaic``.
    """
    return "ple" if takes(tile) else "any_mosaic"


def processor_names() -> tuple[str, ...]:
    """List the names of all processors, whether or not their libraries are installed.

    Examples
    --------
    >>> import rodcone
    >>> "ple_rgbw" in rodcone.processors()
    True
    """
    return tuple(PROCESSORS)


def libraries(name: str) -> tuple[str, ...]:
    """Return the libraries that a processor of `NAMED` needs beside rodcone's own; for a user's file, none."""
    extra = NAMED[name].extra if name in NAMED else None
    return () if extra is None else _LIBRARIES[extra]


def require_libraries(name: str) -> None:
    """Raise `InputError` if the extra of a processor of `NAMED` is not installed."""
    for library in libraries(name):
        if find_spec(library) is None:
            raise InputError(
                f"processors: {name!r} needs {library}, which is not installed; allowed without it: other processors; "
                f"leave {name} out, or pip install 'rodcone[{NAMED[name].extra}]'"
            )
