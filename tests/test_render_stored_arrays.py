"""Arrays of known shapes from .npz files: what `numpy.savez` wrote, and nothing that differs from it."""

import io
import zipfile
from typing import Any

import numpy as np
import pytest

from render.stored_arrays import Form, read_arrays

NUMBERS = np.arange(24, dtype=np.float32).reshape(2, 3, 4)
FORMS: dict[str, Form] = {"numbers": ("<f4", (2, 3, 4)), "flags": ("?", (2, 2))}
WHOLE: dict[str, Any] = {"numbers": NUMBERS, "flags": np.eye(2, dtype=np.bool_), "text": np.array('{"a": "ü"}')}


def saved(**arrays: Any) -> io.BytesIO:
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file


def test_what_numpy_wrote_is_read_bit_by_bit() -> None:
    arrays, text = read_arrays(saved(**WHOLE), FORMS, "text")
    assert text == '{"a": "ü"}'
    for name, (dtype, shape) in FORMS.items():
        assert (arrays[name].dtype, arrays[name].shape) == (np.dtype(dtype), shape)
        assert np.array_equal(arrays[name], WHOLE[name])


@pytest.mark.parametrize(
    "changes",
    [
        {"numbers": NUMBERS.astype(np.float64)},
        {"numbers": NUMBERS.astype(">f4")},
        {"numbers": NUMBERS.reshape(3, 2, 4)},
        {"numbers": np.asfortranarray(NUMBERS)},
        {"numbers": NUMBERS[:1]},
        {"numbers": np.array([{"a": print}], dtype=np.object_)},  # a pickle
        {"text": np.array(20_000 * "x")},
        {"text": np.array(["a", "b"])},
        {"text": np.array(3.0)},
        {"more": NUMBERS},
    ],
    ids=range(10),
)
def test_other_shapes_types_orders_and_pickles_are_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"is not|other arrays|a text of"):
        read_arrays(saved(**(WHOLE | changes)), FORMS, "text")


def test_compressed_arrays_are_refused_before_they_swell() -> None:
    file = io.BytesIO()
    np.savez_compressed(file, **WHOLE)
    with pytest.raises(ValueError, match="numbers is not float32"):
        read_arrays(file, FORMS, "text")


def test_a_head_that_claims_more_than_the_file_is_refused() -> None:
    with zipfile.ZipFile(saved(**WHOLE)) as archive:
        held = {name: archive.read(name) for name in archive.namelist()}
    held["numbers.npy"] = held["numbers.npy"].replace(b"(2, 3, 4)", b"(9, 9, 9)")  # the same length
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in held.items():
            archive.writestr(name, content)
    with pytest.raises(ValueError, match="numbers is not float32"):
        read_arrays(file, FORMS, "text")


@pytest.mark.parametrize("content", [b"", b"PK\5\6" + bytes(18), b"no archive at all", bytes(100_000)])
def test_what_is_no_archive_is_refused(content: bytes) -> None:
    with pytest.raises(ValueError, match=r"not a zip file|other arrays"):
        read_arrays(io.BytesIO(content), FORMS, "text")


def test_a_changed_number_fails_the_archives_own_sum() -> None:
    stored = bytearray(saved(**WHOLE).getvalue())
    stored[stored.index(NUMBERS.tobytes()) + 3] ^= 1
    with pytest.raises(ValueError, match="Bad CRC-32"):
        read_arrays(io.BytesIO(bytes(stored)), FORMS, "text")


def test_a_name_twice_is_refused() -> None:
    file = saved(**WHOLE)
    with zipfile.ZipFile(file, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        archive.writestr("numbers.npy", b"")
    with pytest.raises(ValueError, match="other arrays"):
        read_arrays(file, FORMS, "text")
