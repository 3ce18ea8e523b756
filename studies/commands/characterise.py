"""The command `rodcone characterise`."""

import json as notation
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

if TYPE_CHECKING:
    from sensor.emva1288.characterise import Characterisation


def characterise(
    preset: str,
    /,
    *,
    out: Annotated[Path | None, Parameter(name=["--out", "-o"])] = None,
    json: Annotated[bool, Parameter(negative="")] = False,
    height: int = 256,
    width: int = 320,
    exposure_s: float = 0.01,
    seed: int = 0,
) -> None:
    """Measure a simulated chip as an EMVA 1288 laboratory does and print the figures beside the configured ones.

    Parameters
    ----------
    preset
        Sensor preset by name, or a .toml file (see `rodcone new preset`).
    out
        Plot to write besides: photon transfer (linear and logarithmic), SNR and linearity, as .svg.
    json
        Print one JSON object in place of the table, with the photon-transfer series in it.
    height
        Of the chip in pixels; more of them make the standard errors smaller.
    width
        Of the chip in pixels; column noise needs width.
    exposure_s
        Exposure time of the photon-transfer series in seconds.
    seed
        Seed of the chip and of its frames.
    """
    from rodcone.errors import InputError
    from rodcone.files import check_place, replacing
    from sensor.emva1288.characterise import characterise as run
    from sensor.presets import preset as camera
    from studies.pages.transfer_chart import transfer_svg

    if out is not None and out.suffix.lower() != ".svg":
        raise InputError(f"out: {str(out)!r} has another ending; allowed: .svg; rename it")
    sensor = camera(preset)
    if out is not None:
        check_place(out)
    result = run(sensor, (height, width), seed, exposure_s)
    if out is not None:
        with replacing(out) as (place,):
            place.write_text(transfer_svg(result, f"{preset}, characterised after EMVA 1288"), "utf-8")
    print(notation.dumps(as_data(result), allow_nan=False) if json else as_table(result))


def as_data(result: "Characterisation") -> dict[str, Any]:
    """Plain data; what isn't finite becomes None."""
    series = {
        "light_e": result.transfer.light_e,
        "mean_dn": result.transfer.mean_dn,
        "variance_dn2": result.transfer.variance_dn2,
        "snr": result.snr,
        "linearity_share": result.linearity_share,
    }
    return {
        "figures": [
            {key: _finite(value) if isinstance(value, float) else value for key, value in vars(figure).items()}
            for figure in result.figures
        ],
        "series": {name: [_finite(float(value)) for value in values] for name, values in series.items()},
        "dark_mean_dn": result.dark_mean_dn,
        "dark_variance_dn2": result.dark_variance_dn2,
        "notes": list(result.notes),
    }


def _finite(value: float) -> float | None:
    return value if abs(value) < float("inf") else None


def as_table(result: "Characterisation") -> str:
    """Aligned text; the last column is measured less configured in standard errors."""
    rows = [("figure", "unit", "configured", "measured", "std. error", "in std. errors")]
    for figure in result.figures:
        off = f"{(figure.measured - figure.configured) / figure.error:+.1f}" if figure.error > 0 else ""
        error = f"{figure.error:.2g}" if figure.error > 0 else ""
        rows.append((figure.name, figure.unit, f"{figure.configured:.5g}", f"{figure.measured:.5g}", error, off))
    widths = [max(len(row[column]) for row in rows) for column in range(6)]
    lines = [
        "  ".join(cell.ljust(width) if index < 2 else cell.rjust(width) for index, (cell, width) in enumerate(pair))
        for pair in (list(zip(row, widths, strict=True)) for row in rows)
    ]
    return "\n".join([*(line.rstrip() for line in lines), "", *(f"- {note}" for note in result.notes)])
