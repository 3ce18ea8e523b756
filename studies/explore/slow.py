"""A slow processor at work in a process of its own, which can be ended at any time."""

import pickle
import subprocess
import sys
import threading
from collections.abc import Callable

from isp.picture import Picture
from isp.processors.bm3d import EXTRA as BM3D
from isp.processors.catalogue import PROCESSORS
from rodcone.errors import InputError
from studies.explore.chain import Development, Image

_RUN = "from studies.explore.slow import work; work()"


def is_slow(processor: str) -> bool:
    """Whether a processor takes seconds: BM3D and the piecewise linear ones, where others take 0.02 to 0.15 s."""
    return PROCESSORS[processor].extra == BM3D or processor.startswith("ple")


def stand_in(processor: str) -> str | None:
    """Quick processor of the same mosaic, which the page shows, under its own name, until a slow one is done."""
    mosaic = PROCESSORS[processor].mosaic
    return next((name for name, each in PROCESSORS.items() if each.mosaic == mosaic and not is_slow(name)), None)


def begin(development: Development, done: Callable[[tuple[Image, Picture] | InputError], None]) -> Callable[[], None]:
    """Develop in a process of its own; returns what ends it.

    Parameters
    ----------
    development : Development
    done : callable
        Called in a thread of its own with what came of it; not where it was ended.
    """
    process = subprocess.Popen([sys.executable, "-c", _RUN], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    ended = threading.Event()

    def wait() -> None:
        output, _ = process.communicate(pickle.dumps(development))
        if ended.is_set():
            return
        if process.returncode:
            done(
                InputError(
                    f"processor: {development.processor} ended with code {process.returncode}; see the messages above"
                )
            )
        else:
            done(pickle.loads(output))

    def end() -> None:
        ended.set()
        process.kill()

    threading.Thread(target=wait, daemon=True).start()
    return end


def work() -> None:
    """Develop what standard input holds; what comes of it goes to standard output."""
    development: Development = pickle.load(sys.stdin.buffer)
    try:
        result: tuple[Image, Picture] | InputError = development.develop()
    except InputError as error:
        result = error
    sys.stdout.buffer.write(pickle.dumps(result))
