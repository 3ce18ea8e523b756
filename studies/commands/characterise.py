"""The command `rodcone characterise`."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from rodcone.errors import InputError, require_absent, require_whole, unknown
from rodcone.files import check_place, write_files
from sensor.cameras.frames import frame_numbers, measure_files
from sensor.cameras.numbers import preset_text
from sensor.cfa import channels
from sensor.emva1288.characterise import Characterisation
from sensor.emva1288.characterise import characterise as measure
from sensor.presets import preset as sensor_preset
from sensor.readings.by_channel import of_channel
from sensor.readings.noise import of_reading
from studies.commands.console import Time, print_json, print_table, require_new, require_place, say
from studies.pages.plots import transfer_svg

HEAD = ("figure", "unit", "configured", "measured", "std. error", "in std. errors")
FRAMES_HEAD = ("figure", "unit", "measured", "95 % from", "to")
Files = list[Path] | None


def characterise(
    preset: str | None = None,
    /,
    *,
    flats: Annotated[Files, Parameter(name="--from", consume_multiple=True)] = None,
    dark: Annotated[Files, Parameter(consume_multiple=True)] = None,
    reading: int | None = None,
    channel: str | None = None,
    window: int | None = None,
    out: Path | None = None,
    json: bool = False,
    height: int = 256,
    width: int = 320,
    exposure: Time = 0.01,
    seed: int = 0,
) -> None:
    """Measure a simulated chip as an EMVA 1288 laboratory does, or a camera of your own from its raw files.

    Parameters
    ----------
    preset
        Sensor preset by name, or a .toml file (see `rodcone new preset`): its figures are printed beside the measured.
    flats
        Raw files of a real camera instead: an evenly lit surface, two or more at each light.
    dark
        Raw files with the cap on, two or more, at the same exposure index and time.
    reading
        Of a sensor with several readings, which: 1 for the first; it is measured alone.
    channel
        Of a sensor that reads channels apart, which, such as W: a chip of such pixels alone, in the electrons that they
        hold; of a metered one, after its longest time.
    window
        Width in pixels of the square in the middle of the frames to measure; the whole frame by default.
    out
        With a preset, plot to write as well: photon transfer (linear and logarithmic), SNR and linearity, as .svg. With
        raw files, preset file of the camera (.toml), every number with its interval.
    json
        Print one JSON object, which also holds the photon-transfer series, instead of the table.
    height
        Height of the chip in pixels; a larger chip has smaller standard errors.
    width
        Width of the chip in pixels; more columns measure the column noise better.
    exposure
        Exposure time of the photon-transfer series, such as 10ms, the default.
    seed
        Seed of the chip and of its frames.
    """
    if flats or dark:
        require_absent(
            "beside raw files; allowed: a sensor, or --from and --dark", preset=preset, reading=reading, channel=channel
        )
        _measure_files(flats or [], dark or [], window, out, json)
        return
    if preset is None:
        raise InputError("preset: none is given; allowed: PRESET, or raw files by --from and --dark; give one")
    require_absent(f"for {preset!r}; allowed: with --from and --dark", window=window)
    # Which of a sensor's readings or channels
    sensor = sensor_preset(preset)
    if reading is not None:
        if not sensor.chip.readings:
            raise InputError(f"reading: {reading} of {preset!r}, whose pixels are read once; leave it out")
        require_whole("reading", reading, 1, len(sensor.chip.readings), f"{preset!r} has so many")
        sensor = of_reading(sensor, reading - 1)
    if sensor.chip.channels:
        if channel not in channels(sensor.cfa):
            raise unknown(f"channel of {preset!r}, which reads channels apart", str(channel), channels(sensor.cfa))
        sensor = of_channel(sensor, channel)[0]
    elif channel is not None:
        raise InputError(f"channel: {channel!r} of {preset!r}, whose channels are read alike; leave it out")

    # Measure and print
    require_place(out, ".svg")
    chip = measure(sensor, (height, width), seed, exposure)
    if out is not None:
        write_files({out: transfer_svg(chip, f"{preset}, characterised after EMVA 1288")})
    if json:
        print_json(_facts(chip))
        return
    # The last column is measured less configured in standard errors; a figure without an error has none.
    rows = []
    for figure in chip.figures:
        error, off = f"{figure.error:.2g}", f"{(figure.measured - figure.configured) / (figure.error or 1.0):+.1f}"
        errors = (error, off) if figure.error > 0 else ("", "")
        rows.append((figure.name, figure.unit, f"{figure.configured:.5g}", f"{figure.measured:.5g}", *errors))
    print_table(HEAD, rows, words=2)
    print("\n".join(["", *(f"- {note}" for note in chip.notes)]))


def _measure_files(flats: list[Path], dark: list[Path], window: int | None, out: Path | None, json: bool) -> None:
    """Print what raw files tell, and write it as a preset."""
    if out is not None:
        require_new(out, ".toml")
        check_place(out)
    camera = measure_files(flats, dark, window)
    rows = (
        ("gain", "DN/e-", camera.gain_dn_per_e),
        ("read noise", "e-", camera.read_noise_e),
        ("DSNU", "e-", camera.dsnu_e),
        ("PRNU", "1", camera.prnu),
    )
    if out is not None:
        title = f"A camera measured from {flats[0].name} and others."
        write_files({out: preset_text(title, frame_numbers(camera, flats), None, "")})
    if json:
        print_json({**asdict(camera), "levels_dn": camera.levels_dn.tolist()})
        return
    print_table(
        FRAMES_HEAD,
        [(name, unit, *(f"{value:.5g}" for value in (x.value, x.low, x.high))) for name, unit, x in rows],
        words=2,
    )
    if out is not None:
        say(f"{out}: pitch_um and fill_factor are yours to add, no frame tells them")


def _facts(chip: Characterisation) -> dict[str, Any]:
    """Return the measurement as JSON holds it."""
    series = {
        "light_e": chip.transfer.light_e,
        "mean_dn": chip.transfer.mean_dn,
        "variance_dn2": chip.transfer.variance_dn2,
        "snr": chip.snr,
        "linearity_share": chip.linearity_share,
    }
    return {
        "figures": [vars(figure) for figure in chip.figures],
        "series": {name: values.tolist() for name, values in series.items()},
        "dark_mean_dn": chip.dark_mean_dn,
        "dark_variance_dn2": chip.dark_variance_dn2,
        "notes": list(chip.notes),
    }
