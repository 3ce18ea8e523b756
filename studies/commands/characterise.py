"""The command `rodcone characterise`, which measures a chip as a laboratory does."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from rodcone.errors import InputError, require_absent, require_name, require_whole
from rodcone.files import check_place, write_files
from sensor.cameras.frame_sets import is_set
from sensor.cameras.frames import frame_numbers, measure_files, measure_place
from sensor.cameras.numbers import preset_text
from sensor.config import SensorConfig
from sensor.emva1288.characterise import Characterisation
from sensor.emva1288.characterise import characterise as measure
from sensor.presets import preset as sensor_preset
from sensor.readings.resolve import at_channel, chip_readings
from studies.commands.console import Time, print_json, print_table, require_new, require_place, say
from studies.pages.plots import transfer_svg

HEAD = ("figure", "unit", "configured", "measured", "std. error", "in std. errors")
FRAMES_HEAD = ("figure", "unit", "measured", "95 % from", "to")


@dataclass(frozen=True, kw_only=True)
class Frames:
    """Frames to measure: raw files, or a part of a simulated chip.

    Attributes
    ----------
    flats : tuple of Path
        Raw files of a real camera instead: an evenly lit surface, two or more at each light. Or one set of frames by
        light: a folder, a zip file, a descriptor of EMVA 1288 (.txt), a list of files by exposure (.csv).
    dark : tuple of Path
        Raw files with the cap on, two or more, at the same exposure index and time; a set has its own.
    reading : int, optional
        Reading to measure, of a sensor that has several: 1 for the first.
    channel : str, optional
        Channel to measure, such as W, of a sensor that reads channels apart: its pixels alone, in the electrons that
        they hold, and at the longest time of a metered channel.
    window : int, optional
        Width in pixels of the square in the middle of the frames to measure; the whole frame by default.
    height : int
        Height of the chip in pixels; a larger chip has smaller standard errors.
    width : int
        Width of the chip in pixels; more columns measure the column noise better.
    exposure : float
        Exposure time of the photon-transfer series, such as 10ms, the default.
    seed : int
        Seed of the chip and of its frames.
    """

    flats: Annotated[tuple[Path, ...], Parameter(name="--from", consume_multiple=True)] = ()
    dark: Annotated[tuple[Path, ...], Parameter(consume_multiple=True)] = ()
    reading: int | None = None
    channel: str | None = None
    window: int | None = None
    height: int = 256
    width: int = 320
    exposure: Time = 0.01
    seed: int = 0

    def part_of(self, preset: str) -> SensorConfig:
        """Return the preset's sensor; if it has several readings or channels, a sensor with only the chosen one."""
        require_absent(f"for {preset!r}; allowed: with --from and --dark", window=self.window)
        sensor = sensor_preset(preset)
        readings = chip_readings(sensor, self.exposure)
        apart = readings[0].sites is not None
        if self.reading is not None:
            if len(readings) == 1 or apart:
                raise InputError(f"reading: {self.reading} of {preset!r}, whose pixels are read once; leave it out")
            require_whole("reading", self.reading, 1, len(readings), f"{preset!r} has so many")
        if self.channel is not None:
            if not apart:
                raise InputError(
                    f"channel: {self.channel!r} of {preset!r}, whose channels are read alike; leave it out"
                )
            require_name(f"channel of {preset!r}, which reads channels apart", self.channel, sensor.channels)
        if self.reading is not None:
            return readings[self.reading - 1].sensor
        return at_channel(readings, self.channel)[0].sensor if apart else sensor


DEFAULT = Frames()


def characterise(
    preset: str | None = None,
    /,
    frames: Annotated[Frames, Parameter(name="*")] = DEFAULT,
    *,
    out: Path | None = None,
    json: bool = False,
) -> None:
    """Measure a simulated chip as an EMVA 1288 laboratory does, or a camera of your own from its raw files.

    Parameters
    ----------
    preset
        Sensor preset by name, or a .toml file (see `rodcone new preset`): its figures are printed beside the measured.
    out
        With a preset, plot to write as well: photon transfer (linear and logarithmic), SNR and linearity, as .svg. With
        raw files, preset file of the camera (.toml), every number with its interval.
    json
        Print one JSON object, which also holds the photon-transfer series, instead of the table.
    """
    if frames.flats or frames.dark:
        beside = "beside raw files; allowed: a sensor, or --from and --dark"
        require_absent(beside, preset=preset, reading=frames.reading, channel=frames.channel)
        _measure_files(frames, out, json)
        return
    if preset is None:
        raise InputError("preset: none is given; allowed: PRESET, or raw files by --from and --dark; give one")
    sensor = frames.part_of(preset)
    require_place(out, ".svg")
    chip = measure(sensor, (frames.height, frames.width), frames.seed, frames.exposure)
    if out is not None:
        write_files({out: transfer_svg(chip, f"{preset}, characterised after EMVA 1288")})
    if json:
        print_json(_facts(chip))
        return
    # The last column is the difference of measured and configured value in standard errors, if there is an error.
    rows = []
    for figure in chip.figures:
        error = f"{figure.error:.2g}"
        off = f"{(figure.measured - figure.configured) / (figure.error or 1.0):+.1f}"
        errors = (error, off) if figure.error > 0 else ("", "")
        rows.append((figure.name, figure.unit, f"{figure.configured:.5g}", f"{figure.measured:.5g}", *errors))
    print_table(HEAD, rows, words=2)
    print("\n".join(["", *(f"- {note}" for note in chip.notes)]))


def _measure_files(frames: Frames, out: Path | None, json: bool) -> None:
    """Print the figures that are measured from raw files, and write them as a preset."""
    if out is not None:
        require_new(out, ".toml")
        check_place(out)
    sets = [path for path in frames.flats if is_set(path)]
    if sets:
        if len(frames.flats) > 1 or frames.dark:
            raise InputError(f"from: {sets[0]} is a set of frames; allowed: alone, as it has its dark frames; give it")
        camera = measure_place(sets[0], frames.window)
    else:
        camera = measure_files(frames.flats, frames.dark, frames.window)
    rows = (
        ("gain", "DN/e-", camera.gain_dn_per_e),
        ("read noise", "e-", camera.read_noise_e),
        ("DSNU", "e-", camera.dsnu_e),
        ("PRNU", "1", camera.prnu),
    )
    if out is not None:
        title = f"A camera measured from {frames.flats[0].name} and others."
        write_files({out: preset_text(title, frame_numbers(camera, frames.flats), None, "")})
    if json:
        print_json(_plain(asdict(camera)))
        return
    print_table(
        FRAMES_HEAD,
        [(name, unit, *(f"{value:.5g}" for value in (x.value, x.low, x.high))) for name, unit, x in rows],
        words=2,
    )
    scatter, model = camera.gain_error
    print(f"standard error of K: {scatter:.2%} by frames and lights, {model:.2%} by its change with light")
    print("\n".join(["", *(f"- {note}" for note in camera.notes)]))
    if out is not None:
        say(f"{out}: add pitch_um and fill_factor, which frames don't show")


def _plain(value: object) -> Any:
    """Return a value for JSON, with lists in place of arrays."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _facts(chip: Characterisation) -> dict[str, Any]:
    """Return the measurement as values for JSON."""
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
