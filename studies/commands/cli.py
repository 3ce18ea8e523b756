"""The command `rodcone`. Results on stdout, progress and errors on stderr; bad input exits with code 2."""

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, CycloptsError, Parameter
from rich.console import Console
from rich.markup import escape
from rich.table import Table

# Packages named render, sensor, ... exist in other distributions: `doctor` tells which ones Python finds, and must
# come so far. So nothing of them is imported at the top.

BAD_INPUT = 2

app = App(
    name="rodcone",
    help="Camera simulation from spectral scene to developed picture: interleaved RGBW beside Bayer.",
    version=lambda: metadata.version("rodcone"),
)


@app.command
def demo(
    *,
    out: Annotated[Path, Parameter(name=["--out", "-o"])] = Path("out/demo"),
    scene: str = "still_life",
    size: int = 256,
    sensor: Annotated[list[str] | None, Parameter(negative_iterable=())] = None,
    level: Annotated[list[str] | None, Parameter(negative_iterable=())] = None,
    longest_exposure_s: float = 0.066,
    spp: int = 512,
    max_seconds: float = 65.0,
    seed: int = 0,
    light: str | None = None,
    force: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Photograph one scene from moonlight to daylight with both cameras and write a report.

    Parameters
    ----------
    out
        Folder for report.html, results.json and overview.png.
    scene
        Scene by name, such as still_life, still_life_outdoor, night_street or cornell_box. Or a file of spectral
        radiance: OpenEXR (.exr) or an ISETCam scene (.mat).
    size
        Side of the picture in pixels; a file has its own.
    sensor
        Sensor preset; may be given several times (low_noise and table1_output by default).
    level
        Light level such as 25cd/m2 (mean scene luminance) or 500lux (on the scene's reference plane); may be given
        several times (seven levels from moonlight to daylight by default).
    longest_exposure_s
        Longest exposure time in seconds.
    spp
        Samples a pixel of the render, at most.
    max_seconds
        Time for the render, at most.
    seed
        Seed of the render, the chips and the exposures.
    light
        Light of the scene by name, such as A; for a file the light that its colours are judged under (D65 by default).
    force
        Go on where more memory is needed than is free.
    """
    from rodcone.memory import require_memory
    from rodcone.progress import progress
    from studies.commands import demo as job
    from studies.commands.estimate import demo_memory

    defaults = job.Demo()
    task = job.Demo(
        scene=scene,
        size=size,
        sensors=tuple(sensor) if sensor else defaults.sensors,
        levels=tuple(level) if level else None,
        longest_s=longest_exposure_s,
        seed=seed,
        spp=spp,
        max_seconds=max_seconds,
        light=light,
    )
    job.check(task)
    require_memory(demo_memory(task), force)
    out.mkdir(parents=True, exist_ok=True)  # a place that can't be written is told before the render, not after
    with progress(sys.stderr) as step:
        outcome = job.run(task, step)
    for note in outcome.results["notes"]:
        print(f"rodcone: {note}", file=sys.stderr)
    print(job.write(outcome, out))


@app.command
def doctor() -> int:
    """Print versions, the LLVM library, the engine, and whether rodcone's packages are its own; exit 1 if not."""
    from studies.commands.doctor import report

    found = report()
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for row in found.rows:
        table.add_row(row.name, escape(row.value) if row.ok else f"[red]{escape(row.value)}[/red]")
    Console().print(table)
    return 0 if found.ok else 1


app.command("studies.commands.bench:bench", name="bench", help="Measure speed against error, stage by stage.")
app.command("studies.commands.capture:capture", name="capture", help="Photograph a scene into raw files.")
app.command("studies.commands.characterise:characterise", name="characterise", help="Measure a chip after EMVA 1288.")
app.command("studies.commands.develop:develop", name="develop", help="Develop a raw file into a PNG.")
app.command("studies.commands.new:app", name="new", help="Write files to start from: preset, study, cluster.")
app.command("studies.commands.opponents:opponents", name="opponents", help="Rank a sweep's cameras on one page.")
app.command("studies.commands.paper:paper", name="paper", help="Compute the paper's figures and judge its claims.")
app.command("studies.commands.plan:plan", name="plan", help="Compute a study's error budget and the cheapest model.")
app.command("studies.commands.render:render", name="render", help="Render a scene into a spectral OpenEXR file.")
app.command("studies.commands.report:report", name="report", help="Write the report of a sweep as one HTML file.")
app.command(
    "studies.commands.sweep:sweep", name="sweep", help="Make every picture of a study, and go on after any end."
)
app.command("studies.commands.sweep:export", name="export", help="Write a sweep's ledger as CSV or Parquet.")
app.command("studies.commands.table:table", name="table", help="Print a sweep's figures as a Markdown table.")
app.register_install_completion_command(help="Complete rodcone's commands and options in this shell from now on.")


def main(arguments: list[str] | None = None) -> Any:
    """Run the command; one line on stderr and exit code 2 for bad input, 1 for a file that can't be written."""
    try:
        with _warnings_in_one_line():
            code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        fail(" ".join(str(error).split()), BAD_INPUT)
    except OSError as error:
        fail(f"{error.filename or 'file'}: {error.strerror or error}; choose another place with --out", 1)
    except ValueError as error:
        from rodcone.errors import InputError  # late, so that a foreign `render` doesn't keep the doctor from starting

        if not isinstance(error, InputError):
            raise
        fail(str(error), BAD_INPUT)
    except KeyboardInterrupt:
        fail("stopped; nothing was written", 130)
    sys.exit(code or 0)


@contextmanager
def _warnings_in_one_line() -> Iterator[None]:
    """Print warnings as errors are, without the place in the code, each once."""
    told: set[str] = set()

    def tell(message: str) -> None:
        if message not in told:
            told.add(message)
            print(f"rodcone: {message}", file=sys.stderr)

    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_: tell(str(message))
        yield


def fail(message: str, code: int) -> None:
    """Print one line on stderr and exit."""
    print(f"rodcone: {message}", file=sys.stderr)
    sys.exit(code)
