"""Run a slow processor in a process of its own, which can be ended at any time."""

import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import replace

from isp.picture import Picture
from isp.processors.catalogue import PROCESSORS
from isp.processors.sub_images import EXTRA as BM3D
from rodcone.child_process import safe_environment
from rodcone.errors import InputError
from rodcone.types import Image
from studies.explore.chain import Development
from studies.explore.controls import Controls, options_of

MOST_SUMS = 65_536 * 4_000  # most pixels x neighbourhood^2 x patch that count as quick: half a second of processor time
_RUN = "from studies.explore.slow import work; work()"


def is_slow(processor: str) -> bool:
    """Return whether a processor takes seconds: BM3D and the piecewise linear ones do, others take 0.02 to 0.15 s."""
    return PROCESSORS[processor].extra == BM3D or processor.startswith("ple")


def stand_in(controls: Controls, pixels: int) -> Controls:
    """Return the controls whose picture is shown until a slow processor is done; the given ones if it is quick.

    A slow processor is replaced by ``any_mosaic``. It develops every mosaic, so that two cameras with the same slow
    method are shown by the same quick one. Settings that take too long are replaced by the processor's defaults.
    """
    if is_slow(controls.processor):
        return replace(controls, processor="any_mosaic", settings={})
    settings = options_of(controls).get("settings")
    if settings and pixels * settings.neighbourhood**2 * settings.patch > MOST_SUMS:
        return replace(controls, settings={})
    return controls


def begin(
    name: str, development: Development, report: Callable[[tuple[Image, Picture] | InputError], None]
) -> Callable[[], None]:
    """Develop in a process of its own; return the function that ends it.

    Parameters
    ----------
    name : str
        Name of the processor.
    development : callable
        As `studies.explore.chain.development_of` returns it.
    report : callable
        Function that is called with the result in a thread of its own, unless the process was ended.
    """
    process = subprocess.Popen(
        [sys.executable, "-c", _RUN], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=safe_environment()
    )
    ended = threading.Event()

    def wait() -> None:
        output, _ = process.communicate(pickle.dumps(development))
        if ended.is_set():
            return
        if process.returncode:
            report(InputError(f"processor: {name} ended with code {process.returncode}; see the messages above"))
        else:
            report(pickle.loads(output))

    def end() -> None:
        ended.set()
        process.kill()

    threading.Thread(target=wait, daemon=True).start()
    return end


def work() -> None:
    """Read a pickled `Development` from standard input, call it, and pickle the result to standard output."""
    development: Development = pickle.load(sys.stdin.buffer)
    try:
        result: tuple[Image, Picture] | InputError = development()
    except InputError as error:
        result = error
    sys.stdout.buffer.write(pickle.dumps(result))
