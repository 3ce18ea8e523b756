"""Arrays of known shapes from NumPy's ``.npz`` files, read so that a file can neither choose a size nor run anything.

`numpy.load` believes what a file says of its arrays: a few hundred bytes may claim a terabyte, or inflate to one. Here
the caller knows every shape and type; what differs from `numpy.savez`'s own bytes for them, but for the numbers, is
refused. Format: NumPy, NEP 1.
"""

import struct
import zipfile
from collections.abc import Mapping
from io import BytesIO
from math import prod
from typing import Any, BinaryIO, TypeAlias

import numpy as np
from numpy.typing import NDArray

Form: TypeAlias = tuple[Any, tuple[int, ...]]  # type of an array's numbers, and its shape

MOST_TEXT = 1 << 14  # characters of a text
_TEXT_HEAD_BYTES = 128  # of an array without dimensions
_CHUNK_BYTES = 1 << 22


def read_arrays(file: BinaryIO, forms: Mapping[str, Form], text: str) -> tuple[dict[str, NDArray[Any]], str]:
    """Arrays of a file, and the text under the name `text`.

    Raises
    ------
    ValueError
        Where the file doesn't hold exactly these, uncompressed and in C's order.
    OSError
        Where it can't be read.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            if sorted(archive.namelist()) != sorted(f"{name}.npy" for name in (*forms, text)):
                raise ValueError("it holds other arrays")
            length = (archive.getinfo(f"{text}.npy").file_size - _TEXT_HEAD_BYTES) // 4
            if not 0 < length <= MOST_TEXT:
                raise ValueError(f"a text of {length} characters")
            arrays = {name: _read(archive, name, form) for name, form in forms.items()}
            return arrays, str(_read(archive, text, (f"<U{length}", ())))
    except (zipfile.BadZipFile, RuntimeError, EOFError, OverflowError, struct.error) as error:
        raise ValueError(str(error)) from error


def _read(archive: zipfile.ZipFile, name: str, form: Form) -> NDArray[Any]:
    dtype, shape = np.dtype(form[0]), form[1]
    head, info = _head(dtype, shape), archive.getinfo(f"{name}.npy")
    plain = info.compress_type == zipfile.ZIP_STORED and info.file_size == len(head) + dtype.itemsize * prod(shape)
    with archive.open(info) as entry:
        if not plain or entry.read(len(head)) != head:
            raise ValueError(f"{name} is not {dtype} of {shape}")
        array = np.empty(shape, dtype)
        numbers = array.reshape(-1).view(np.uint8)
        for start in range(0, numbers.size, _CHUNK_BYTES):
            piece = entry.read(min(_CHUNK_BYTES, numbers.size - start))
            if len(piece) != min(_CHUNK_BYTES, numbers.size - start):
                raise ValueError(f"{name} ends early")
            numbers[start : start + len(piece)] = np.frombuffer(piece, np.uint8)
    return array


def _head(dtype: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    """What `numpy.save` writes before the numbers."""
    head = BytesIO()
    np.lib.format.write_array_header_1_0(
        head, {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    )
    return head.getvalue()
