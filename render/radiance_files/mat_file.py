"""Numbers from MATLAB level 5 files (``save -v6`` and ``-v7``), read by SciPy in a child process.

A few changed bytes make SciPy's reader access memory outside its buffers: version 1.17 crashes within some thousand
random changes. A scene may come from anywhere, so `mat_reader` runs the reader in a child process, whose memory, output
and time are bounded by the file's size. If the child crashes, the caller gets an error of one line.
"""

import subprocess
import sys
import tempfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render.radiance_files import mat_reader
from render.radiance_files.file_checks import MOST_BYTES, MOST_EXPANSION, SMALL_BYTES, require_file
from rodcone.child_process import safe_environment
from rodcone.errors import InputError

_HEADER_BYTES = 128
_SECONDS, _BYTES_PER_SECOND = 120, 1e6  # time limit of the child with its start: a hundred times what it needs


def read_numbers(path: Path, keys: Collection[str]) -> Mapping[str, NDArray[Any]]:
    """Read arrays of a file, as (row, column, ...) in the types that MATLAB would give them.

    Parameters
    ----------
    path : Path
    keys : collection of str
        Variables, or fields of structs such as ``scene/data/photons``. A key that isn't there, or is no array of real
        numbers, is missing from the result.

    Raises
    ------
    InputError
        If there is no file, it isn't of level 5 (the message names MATLAB's ``-v7.3`` and ``-v4``) or is damaged; if
        the arrays take over 8 GiB, or over both 64 MiB and 2000 times the file.
    """
    size = require_file(path)
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES)
    if header.startswith((b"MATLAB 7.3", b"\x89HDF")):
        raise InputError(
            f"{path}: it is a -v7.3 (HDF5) file; allowed: level 5; in MATLAB save it with save -v7; or convert it: "
            f"pip install mat73 scipy; python -c \"import mat73, scipy.io; scipy.io.savemat('{path.stem}_v7.mat', "
            f"mat73.loadmat('{path.name}'))\""
        )
    if header[126:128] not in (b"IM", b"MI"):
        raise InputError(f"{path}: it is no level 5 .mat file; allowed: MATLAB's -v6 or -v7; save it with save -v7")
    most = min(MOST_BYTES, max(SMALL_BYTES, MOST_EXPANSION * size))
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "numbers.npz"
        _run_reader(path, output, most, keys, _SECONDS + size / _BYTES_PER_SECOND)
        with np.load(output) as numbers:
            return dict(numbers)


def _run_reader(path: Path, output: Path, most_bytes: int, keys: Collection[str], seconds: float) -> None:
    command = [sys.executable, mat_reader.__file__, str(path.resolve()), str(output), str(most_bytes), *keys]
    environment = safe_environment(OPENBLAS_NUM_THREADS="1")
    try:
        done = subprocess.run(command, env=environment, capture_output=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        raise InputError(f"{path}: the .mat file took over {seconds:.0f} s to read; save it again") from None
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        reason = said if done.returncode > 0 else f"it ended the reader by signal {-done.returncode}"
        raise InputError(f"{path}: SciPy can't read the .mat file: {reason}; save it again")
