"""The command `rodcone characterise`."""

import json as notation
from typing import Any

from rodcone.files import check_place, replacing
from rodcone.json_values import finite
from sensor.emva1288.characterise import Characterisation
from sensor.emva1288.characterise import characterise as measure
from sensor.presets import preset as sensor_preset
from studies.commands.console import Flag, OutOrNone, Seconds, print_table, require_ending
from studies.pages.transfer_chart import transfer_svg

HEAD = ("figure", "unit", "configured", "measured", "std. error", "in std. errors")


def characterise(
    preset: str,
    /,
    *,
    out: OutOrNone = None,
    json: Flag = False,
    height: int = 256,
    width: int = 320,
    exposure_s: Seconds = 0.01,
    seed: int = 0,
) -> None:
    """Measure a simulated chip as an EMVA 1288 laboratory does and print the figures beside the configured ones.

    Parameters
    ----------
    preset
        Sensor preset by name, or a .toml file (see `rodcone new preset`).
    out
        Plot to write as well: photon transfer (linear and logarithmic), SNR and linearity, as .svg.
    json
        Print one JSON object, which also holds the photon-transfer series, instead of the table.
    height
        Height of the chip in pixels; a larger chip has smaller standard errors.
    width
        Width of the chip in pixels; more columns measure the column noise better.
    exposure_s
        Exposure time of the photon-transfer series, in seconds or such as 10ms.
    seed
        Seed of the chip and of its frames.
    """
    sensor = sensor_preset(preset)
    if out is not None:
        require_ending(out, ".svg")
        check_place(out)
    found = measure(sensor, (height, width), seed, exposure_s)
    if out is not None:
        with replacing(out) as (place,):
            place.write_text(transfer_svg(found, f"{preset}, characterised after EMVA 1288"), "utf-8")
    if json:
        print(notation.dumps(finite(_facts(found)), allow_nan=False))
        return
    # The last column is measured less configured in standard errors; a figure without an error has none.
    rows = []
    for figure in found.figures:
        error, off = f"{figure.error:.2g}", f"{(figure.measured - figure.configured) / (figure.error or 1.0):+.1f}"
        errors = (error, off) if figure.error > 0 else ("", "")
        rows.append((figure.name, figure.unit, f"{figure.configured:.5g}", f"{figure.measured:.5g}", *errors))
    print_table(HEAD, rows, words=2)
    print("\n".join(["", *(f"- {note}" for note in found.notes)]))


def _facts(found: Characterisation) -> dict[str, Any]:
    """Return the measurement as JSON holds it."""
    series = {
        "light_e": found.transfer.light_e,
        "mean_dn": found.transfer.mean_dn,
        "variance_dn2": found.transfer.variance_dn2,
        "snr": found.snr,
        "linearity_share": found.linearity_share,
    }
    return {
        "figures": [vars(figure) for figure in found.figures],
        "series": {name: values.tolist() for name, values in series.items()},
        "dark_mean_dn": found.dark_mean_dn,
        "dark_variance_dn2": found.dark_variance_dn2,
        "notes": list(found.notes),
    }
