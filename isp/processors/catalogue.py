"""Every way to make a picture from a raw file, by name: the interleaved camera and its opponents."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from types import MappingProxyType
from typing import Any

from numpy.typing import ArrayLike

from isp.colour.colour_fit import ColourFit
from isp.colour.white_balance import WhiteBalance
from isp.defects import mend
from isp.picture import Picture
from isp.pipeline import picture_bayer, picture_interleaved
from isp.processors.bayer_denoised import EXTRA as BM3D
from isp.processors.bayer_denoised import picture_bayer_bm3d, picture_bayer_nlm
from isp.processors.demosaic import EXTRA as DEMOSAICKING
from isp.processors.demosaic import malvar, menon, picture_demosaicked
from isp.processors.fusion import picture_complementary, picture_kijima, picture_sato, picture_yamagami
from isp.processors.gindele import picture_gindele
from isp.processors.piecewise import picture_ple_bayer, picture_ple_rgbw
from rodcone.errors import InputError
from sensor.raw import RawImage

_LIBRARIES = {DEMOSAICKING: ("colour_demosaicing",), BM3D: ("bm3d", "colour_demosaicing")}  # what an extra brings


@dataclass(frozen=True)
class Processor:
    """A camera's software, and the mosaic that it needs.

    Attributes
    ----------
    mosaic : str
        Name that `sensor.variations.vary` takes: one of `sensor.cfa.MOSAICS`, or a variation with curves of its own.
    picture : callable
        ``picture(raw, colours, *, balance) -> Picture`` with a `ColourFit` and a `WhiteBalance`; `develop` calls it.
    source : str
        Where it is published.
    extra : str or None
        What ``pip install rodcone[...]`` has to bring; None: nothing.
    colours : tuple of str
        Channels whose balanced planes the matrix takes to linear sRGB.
    unit : str
        Channel whose electrons a neutral reads in the developed picture.
    on_backend : bool
        Whether it runs in Dr.Jit where there is a backend; NumPy else.
    """

    mosaic: str
    picture: Callable[..., Picture]
    source: str
    extra: str | None = None
    colours: tuple[str, ...] = ("R", "G", "B")
    unit: str = "G"
    on_backend: bool = False

    def develop(
        self,
        raw: RawImage,
        matrix: ArrayLike | ColourFit,
        *,
        neutral: ArrayLike | None = None,
        balance: ArrayLike | None = None,
        **options: Any,
    ) -> Picture:
        """Develop a raw image; no processor sees defective pixels: they are replaced first.

        Parameters
        ----------
        raw, neutral, balance
            As `isp.pipeline.picture_interleaved`.
        matrix : (3, 3) array_like or ColourFit
            From the balanced channels `colours` to linear sRGB.
        **options
            The processor's own, such as `substitution_snr`.
        """
        raw = mend(raw)
        white_balance = WhiteBalance.of(raw, neutral, balance)
        return self.picture(raw, ColourFit.of(matrix), balance=white_balance, **options)


_MALVAR = partial(picture_demosaicked, demosaic=malvar)
_MENON = partial(picture_demosaicked, demosaic=menon)
_EARLY = "W as luminance by early fusion"
_PIECEWISE = "piecewise linear: Yu, Sapiro & Mallat 2012 with a fixed prior, Zoran & Weiss 2011"
# The first two are the paper's.
PROCESSORS: Mapping[str, Processor] = MappingProxyType(
    {
        "interleaved": Processor("rgbw", picture_interleaved, "Parmar & Wandell 2009, eqs. (1)-(6)", on_backend=True),
        "bayer": Processor("bayer", picture_bayer, "bilinear, the conventional camera of Parmar & Wandell 2009"),
        "bayer_malvar": Processor("bayer", _MALVAR, "Malvar, He & Cutler 2004", extra=DEMOSAICKING),
        "bayer_menon": Processor("bayer", _MENON, "Menon, Andriani & Calvagno 2007", extra=DEMOSAICKING),
        "bayer_nlm": Processor(
            "bayer", picture_bayer_nlm, "the interleaved camera's non-local means on Bayer", on_backend=True
        ),
        "bayer_bm3d": Processor("bayer", picture_bayer_bm3d, "BM3D, Dabov et al. 2007, then Menon", extra=BM3D),
        "rgbw_sato": Processor("rgbw", picture_sato, f"{_EARLY}: Sato 1983"),
        "rgbw_kijima": Processor("rgbw", picture_kijima, f"{_EARLY}: Kijima 2007"),
        "rgbw_yamagami": Processor("rgbw_nd", picture_yamagami, "neutral density on W: Yamagami 1994"),
        "cmyw_yamagami": Processor(
            "cmyw", picture_complementary, "complementary colours: Yamagami 1994", colours=("C", "Y", "M"), unit="Y"
        ),
        "rgbw_gindele": Processor("rgbw", picture_gindele, "colours alone where W is full: Gindele & Gallagher 2002"),
        "ple_rgbw": Processor("rgbw", picture_ple_rgbw, _PIECEWISE),
        "ple_bayer": Processor("bayer", picture_ple_bayer, _PIECEWISE),
    }
)


def names() -> tuple[str, ...]:
    """Names of all processors, installed or not."""
    return tuple(PROCESSORS)


def libraries(name: str) -> tuple[str, ...]:
    """Libraries that a processor of `PROCESSORS` needs beside rodcone's own."""
    extra = PROCESSORS[name].extra
    return () if extra is None else _LIBRARIES[extra]


def require_libraries(name: str) -> None:
    """Raise `InputError` where the extra of a processor of `PROCESSORS` is not installed."""
    for library in libraries(name):
        if find_spec(library) is None:
            raise InputError(
                f"processors: {name!r} needs {library}, which is not installed; allowed without it: other processors; "
                f"leave {name} out, or pip install 'rodcone[{PROCESSORS[name].extra}]'"
            )
