"""A run that may need more memory than there is, in a process of its own: its sudden end becomes one line.

Where memory runs out while LLVM compiles, or the system ends the process, nothing is raised that Python could catch.
"""

import os
import resource
import signal
from collections.abc import Sequence
from pathlib import Path

from rodcone.child_process import end_with_parent

COMMANDS = ("capture", "demo", "render", "sweep")  # commands that render
SUDDEN = (signal.SIGSEGV, signal.SIGBUS, signal.SIGABRT, signal.SIGILL, signal.SIGTRAP, signal.SIGKILL)
_OUT = "shot.dng", "render.exr"  # outputs of commands whose file wasn't named


def survive_sudden_end(arguments: Sequence[str]) -> None:
    """Go on in a child process, whose sudden end raises `MemoryError` here; else this process ends as the child did.

    A child is made for a command that renders, where it is forced beyond what memory is free, or where the address
    space has a limit. Dr.Jit, whose threads a child would lack, must not be imported yet.

    Parameters
    ----------
    arguments : sequence of str
        Arguments of the command line.

    Raises
    ------
    MemoryError
        If a signal that no person sends ended the child; the message names the render that is kept.
    """
    limited = resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY
    if not arguments or arguments[0] not in COMMANDS or not (limited or "--force" in arguments):
        return
    child = os.fork()
    if not child:
        end_with_parent()
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the terminal sends Ctrl-C to the child too, which reports on it
    signal.signal(signal.SIGTERM, lambda *_: os.kill(child, signal.SIGTERM))
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if status >= 0:
        os._exit(status)
    ended_by = signal.Signals(-status)
    if ended_by not in SUDDEN:
        os._exit(128 - status)
    error = MemoryError(f"the system ended the run by {ended_by.name}, as where a compiler gets no more")
    from render.cache import note_kept  # imported late, because it imports Dr.Jit

    named = any(text.startswith(("-o", "--out")) for text in arguments)
    for text in arguments[1:] if named else _OUT:
        note_kept(error, Path(text.partition("=")[2] or text))
    raise error
