"""Find figures of an EMVA 1288 report that contradict one another, or seem to be in another unit than the required one.

K, saturation, dark noise, SNR, dynamic range and the converter's range determine one another (release 4.0 Linear):
SNR_max = sqrt(mu_e.sat), mu_e.min = sqrt(sigma_d^2 + sigma_q^2 / K^2) + 1/2 with sigma_q^2 = 1/12 DN^2, DR = mu_e.sat /
mu_e.min, and K mu_e.sat fits between black and the converter's top.
"""

from collections.abc import Mapping
from math import log10, sqrt

MOST_OFF_DB = 1.5  # allowed error of SNR and dynamic range: measured saturation scatters by some per cent
MOST_OVER = 1.1  # allowed saturation over the converter's range: noise and offset shift it by a few per cent
LEAST_PER_CENT = {"eta": 1.0, "PRNU1288": 0.03}  # less looks like a fraction; sensors have 10 to 95 % and 0.2 to 2 %
LEAST_SATURATION_E = 200.0  # less looks like thousands of electrons; sensors have 2000 to 200 000 electrons


def doubts(figures: Mapping[str, float], bits: int | None, black_dn: int | None) -> list[str]:
    """Return a sentence per doubtful figure: its value, the value that the other figures imply, and the likely unit.

    Parameters
    ----------
    figures : mapping of str to float
        The report's figures by symbol; those that it lacks are left out.
    bits, black_dn : int or None
        The converter's bits and the black level of the operating point; None if the report doesn't state them.
    """
    told = [
        f"{name} = {figures[name]:g} per cent looks like a fraction; give {100 * figures[name]:g} if it is one"
        for name, least in LEAST_PER_CENT.items()
        if 0 < figures.get(name, least) < least
    ]
    saturation_e, gain = figures.get("mu_e_sat"), figures.get("K")
    if saturation_e is not None and saturation_e < LEAST_SATURATION_E:
        told.append(f"mu_e_sat = {saturation_e:g} e- looks like thousands; give {1000 * saturation_e:g} if it is")
    elif saturation_e is not None:
        told += _of_saturation(figures, saturation_e)
    if None not in (saturation_e, gain, bits):
        told += _of_gain(float(gain or 0), float(saturation_e or 0), 2 ** int(bits or 0) - 1 - (black_dn or 0))
    return told


def _of_saturation(figures: Mapping[str, float], saturation_e: float) -> list[str]:
    """Return the doubts about SNR and dynamic range, which follow from saturation, dark noise and K."""
    expected = {"SNR_max_dB": (10 * log10(saturation_e), f"sqrt(mu_e_sat) of {saturation_e:g} e-")}
    if "sigma_d" in figures and "K" in figures:
        least_e = sqrt(figures["sigma_d"] ** 2 + 1 / 12 / figures["K"] ** 2) + 0.5
        expected["DR_dB"] = 20 * log10(saturation_e / least_e), f"mu_e_sat over {least_e:.3g} e- of sigma_d and K"
    told = [
        f"{name} = {figures[name]:g} dB, but {words} is {value:.1f} dB; correct one of them"
        for name, (value, words) in expected.items()
        if abs(figures.get(name, value) - value) > MOST_OFF_DB
    ]
    if "mu_e_min" in figures and "DR_dB" in figures and figures["mu_e_min"] > 0:
        value = 20 * log10(saturation_e / figures["mu_e_min"])
        if abs(value - figures["DR_dB"]) > MOST_OFF_DB:
            told.append(f"DR_dB = {figures['DR_dB']:g} dB, but mu_e_sat over mu_e_min is {value:.1f} dB; correct one")
    return told


def _of_gain(gain: float, saturation_e: float, range_dn: int) -> list[str]:
    """Return the doubt about K if it puts saturation far above the converter's range over black."""
    if gain * saturation_e <= MOST_OVER * range_dn:
        return []
    other = f"; K looks like e-/DN: give {1 / gain:.4g} DN/e- if it is" if saturation_e / gain < range_dn else ""
    return [
        f"K = {gain:g} DN/e- puts mu_e_sat = {saturation_e:g} e- at {gain * saturation_e:.4g} DN above black; the "
        f"converter has {range_dn} there{other}"
    ]
