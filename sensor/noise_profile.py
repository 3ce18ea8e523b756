"""NoiseProfile of a digital negative of any camera (DNG 1.4 specification, tag 51041)."""

from pathlib import Path

import numpy as np

from sensor.noise_estimate import NoiseEstimate

NOISE_PROFILE = 51041


def read_noise_profile(path: Path, full_dn: float) -> NoiseEstimate | None:
    """Gain and dark noise from the profile; None where the file has none, or one that says nothing of use.

    N(x)^2 = S x + O for x from black (0) to white (1), so the full scale is 1 / S electrons and a dark pixel's standard
    deviation sqrt(O) of it. Files with one pair a channel: their mean.

    Parameters
    ----------
    full_dn : float
        White level above black [DN].
    """
    values = _values(path)
    if values is None or values.size < 2 or values.size % 2 or not np.all(np.isfinite(values)):
        return None
    with np.errstate(over="ignore"):
        slope, offset = values.reshape(-1, 2).mean(axis=0)
    if not (1e-9 < slope < 1.0 and 0.0 <= offset < 1.0):
        return None
    return NoiseEstimate(float(1.0 / slope / full_dn), float(np.sqrt(offset) / slope))


def _values(path: Path) -> np.ndarray[tuple[int], np.dtype[np.float64]] | None:
    """Numbers of the tag, from the first directory that has it."""
    import tifffile

    try:
        with tifffile.TiffFile(path) as file:
            pages = [page for first in file.pages for page in (first, *(getattr(first, "pages", None) or ()))]
            tags = [page.tags.get(NOISE_PROFILE) for page in pages if hasattr(page, "tags")]
            found = next((tag.value for tag in tags if tag is not None), None)
            return None if found is None else np.atleast_1d(np.asarray(found, dtype=np.float64))
    except Exception:  # of many kinds, tifffile's own among them
        return None  # no TIFF: most cameras' own formats; LibRaw has read the picture all the same
