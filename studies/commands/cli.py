"""The command `rodcone`. It prints results on stdout, progress and errors on stderr; bad input exits with code 2."""

import re
import sys
import warnings
from collections.abc import Sequence
from functools import cache, partial
from importlib import import_module
from typing import Any, get_args

from cyclopts import App, CycloptsError, Parameter, Token, convert

from rodcone.errors import InputError, is_out_of_memory
from studies.commands.console import INTERRUPTED, say
from studies.commands.watched import survive_sudden_end

# A command is imported only when it runs. Another distribution may have a package named render or sensor that hides
# ours, and `doctor`, which says whose packages Python finds, has to start even in that case.

BAD_INPUT = 2
_BELOW_ZERO = re.compile(r"-[\d.]")
_NUMBER = re.compile(r"^-?[\d.]+$")
_FRACTION = re.compile(r"^[-+]?\d*\.\d+$")
_UNITS = {"us", "ms", "s", "lux", "lx", "cd/m2", "cd/m²", "K"}


def _converted(kind: object, tokens: Sequence[Token]) -> Any:
    """Convert a value as Cyclopts does, but refuse a fraction for a whole number, which Cyclopts would round."""
    if kind is int or int in get_args(kind):
        for token in tokens:
            if _FRACTION.match(token.value) and float(token.value) % 1:
                raise ValueError(f"{token.value!r} is not a whole number")
    return convert(kind, tokens)


app = App(
    name="rodcone",
    help="Camera simulation from spectral scene to developed picture: interleaved RGBW beside Bayer.",
    help_epilogue=(
        "-o is short for --out. Beside a NAME.dng of RGBW, or of another mosaic that raw converters take for a wrong "
        "one such as GMCY, lies NAME_bayer.dng: give them that one."
    ),
    help_format="plaintext",  # because importing Markdown's parser takes a third of the time of --help
    version=lambda: import_module("importlib.metadata").version("rodcone"),
    # A flag has no --no-flag and a list no --empty-list: flags are off and lists are empty by default.
    default_parameter=Parameter(
        negative=(), converter=_converted, show_default=lambda value: None if value is False or value == () else value
    ),
)

_command = partial(app.command, help_format="markdown")
_command("studies.commands.bench:bench", name="bench", help="Measure speed against error, stage by stage.")
_command("studies.commands.capture:capture", name="capture", help="Photograph a scene into raw files.")
_command("studies.commands.characterise:characterise", name="characterise", help="Measure a chip after EMVA 1288.")
_command("studies.commands.dataset:dataset", name="dataset", help="Make raw frames and their truth to train on.")
_command("studies.commands.demo:demo", name="demo", help="Compare RGBW and Bayer from moonlight to daylight.")
_command("studies.commands.develop:develop", name="develop", help="Develop a raw file into a picture.")
_command("studies.commands.doctor:doctor", name="doctor", help="Say what is installed, and whether all is well.")
_command("studies.commands.expect:expect", name="expect", help="Compute which error to expect in which light.")
_command("studies.commands.explore:explore", name="explore", help="Open a page on which sliders change a camera.")
_command("studies.commands.judge:judge", name="judge", help="Measure pictures of a set against its truth.")
_command("studies.commands.list:list_names", name="list", help="List scenes, lights, sensors and other names.")
_command("studies.commands.mtf:mtf", name="mtf", help="Measure the sharpness of an edge in a picture.")
app.command("studies.commands.new.app:app", name="new", help="Write files to start from: preset, study, cluster.")
_command("studies.commands.paper:paper", name="paper", help="Compute the paper's figures and check its claims.")
_command("studies.commands.plan:plan", name="plan", help="Compute a study's error budget and the cheapest model.")
_command("studies.commands.plot:plot", name="plot", help="Draw a metric of a sweep over light into a file.")
_command("studies.commands.reference:reference", name="reference", help="Render the light that studies photograph.")
_command("studies.commands.render:render", name="render", help="Render a scene into a spectral OpenEXR file.")
_command("studies.commands.report:report", name="report", help="Write the report of a sweep as one HTML file.")
_command("studies.commands.schema:schema", name="schema", help="Print the JSON Schema of sensor or study files.")
_command("studies.commands.score:score", name="score", help="Print figures of merit, computed beside measured.")
_command("studies.commands.snr:snr", name="snr", help="Print the light in which a pixel reaches an SNR.")
_command("studies.commands.sweep:sweep", name="sweep", help="Make every picture of a study, or those still missing.")
_command("studies.commands.export:export", name="export", help="Write a sweep's results as CSV.")
_command("studies.commands.table:table", name="table", help="Print a sweep's figures as a Markdown table.")
_command("studies.commands.train:train", name="train", help="Train the prior of ple, ple_rgbw and ple_bayer.")
_command("studies.commands.twin:twin", name="twin", help="Set a real camera beside its simulated twin.")
app.register_install_completion_command(help="Let this shell complete rodcone's commands and options.")


def joined(arguments: Sequence[str]) -> list[str]:
    """Return the arguments with ``-o`` and ``-D`` written out, and with some numbers and units joined to other words.

    A number below 0 is joined with the option before it, such as ``--level -5lux``, and a unit with the number before
    it, such as ``--exposure 20 ms``.
    """
    result: list[str] = []
    short = {"-o": "--out", "-D": "--define"}
    for text in (
        short[text[:2]] + text[2:] if text in short or text[:3] in ("-o=", "-D=") else text for text in arguments
    ):
        before = result[-1] if result else ""
        if before.startswith("--") and "=" not in before and _BELOW_ZERO.match(text):
            result[-1] += f"={text}"
        elif text in _UNITS and _NUMBER.search(before) and len(result) > 1 and result[-2].startswith("-"):
            result[-1] += f" {text}"
        else:
            result.append(text)
    return result


def main(arguments: list[str] | None = None) -> Any:
    """Run the command. For bad input, print one line on stderr and exit with 2; for a file error exit with 1."""
    try:
        with warnings.catch_warnings():
            # Warnings are printed like errors, without the place in the code, and each only once.
            once = cache(say)
            warnings.showwarning = lambda message, *_: once(str(message))
            given = joined(sys.argv[1:] if arguments is None else arguments)
            if arguments is None:
                survive_sudden_end(given)
            code = app(given, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        fail(" ".join(str(error).split()), BAD_INPUT)
    except InputError as error:
        fail(_with_notes(str(error), error), BAD_INPUT)
    except (MemoryError, RuntimeError) as error:
        what = " ".join(str(error).split()) or "the system gave no more"
        if isinstance(error, RuntimeError) and not is_out_of_memory(error):
            raise
        fix = "take a smaller picture (--size), fewer bands or fewer workers"
        fail(_with_notes(f"memory: it ran out ({what}); {fix}", error), BAD_INPUT)
    except BrokenPipeError:  # the reader, such as head, wants no more
        sys.stdout = None  # because Python would flush it at the end, with nobody to read it
        sys.exit(0)
    except OSError as error:
        where = f"{error.filename or 'file'}: {error.strerror or error}; choose another place with --out"
        fail(_with_notes(where, error), 1)
    except KeyboardInterrupt as error:
        fail(_with_notes("stopped; nothing was written", error), INTERRUPTED)
    sys.exit(code or 0)


def _with_notes(message: str, error: BaseException) -> str:
    """Return the message and the notes that were added to the error, such as where a render is kept."""
    return "; ".join([message, *getattr(error, "__notes__", [])])


def fail(message: str, code: int) -> None:
    """Print one line on stderr and exit."""
    say(message)
    sys.exit(code)
