"""Processors in a user's own file: what runs, what is refused before it runs, and what its faults look like."""

import os
from pathlib import Path

import numpy as np
import pytest
from builders import raw_image
from refusal import refusal

from isp.colour.colour_fit import ColourFit
from isp.processors.catalogue import PROCESSORS
from isp.processors.own import MOST_BYTES, own_version, processor_of, require_consent
from rodcone.digests import digest_file
from rodcone.errors import InputError
from sensor.cfa import BAYER

RAW = raw_image(np.random.default_rng(1).poisson(500.0, (8, 10)) + 100, BAYER)
COLOURS = ColourFit(("R", "G", "B"), np.ones(3), np.eye(3), np.eye(3))


def written(folder: Path, text: str) -> str:
    path = folder / "mine.py"
    path.write_text(text, "utf-8")
    return f"{path}:develop"


def told(name: str) -> str:
    return refusal(lambda: processor_of(name).develop(RAW, COLOURS))


def test_a_function_and_a_processor_of_ones_own_are_what_they_call(tmp_path: Path) -> None:
    expected = PROCESSORS["bayer"].develop(RAW, COLOURS)
    plain = "from isp.interleaved.pipeline import picture_bayer as develop\n"
    function = processor_of(written(tmp_path, plain))
    assert (function.mosaic, function.colours, function.unit) == ("own", (), "")
    assert np.array_equal(function.develop(RAW, COLOURS).rgb, expected.rgb)
    stated = "from isp.processors.catalogue import Processor\nfrom isp.interleaved.pipeline import picture_bayer\n"
    processor = processor_of(written(tmp_path, stated + "develop = Processor('bayer', picture_bayer, 'mine')\n"))
    assert (processor.mosaic, processor.source) == ("bayer", "mine")
    assert processor.develop(RAW, COLOURS).balance == expected.balance


def test_an_array_is_a_picture_and_a_changed_file_is_loaded_anew(tmp_path: Path) -> None:
    text = "import numpy as np\ndef develop(raw, matrix, **options):\n    return np.full((*raw.shape, 3), {})\n"
    for value in (1.0, 2.0):
        name = written(tmp_path, text.format(value))
        assert (processor_of(name).develop(RAW, COLOURS).rgb == value).all()


def test_nothing_runs_without_consent_nor_where_the_bytes_are_others(tmp_path: Path) -> None:
    name, trace = (
        written(tmp_path, "open(__file__ + '.ran', 'w').close()\ndef develop(raw, m, **o): pass\n"),
        "mine.py.ran",
    )
    with pytest.raises(InputError, match=r"^isp: .*mine.py:develop' is Python code.*--trust-code .*trust_code=True"):
        require_consent("isp", name, trust_code=False)
    for file, function in (("mine.py", "develop"), ("demosaicnet.whl", "bayer_net")):
        words = f"^isp: '{file}' names no function; .*; write {file}:{function}$"
        refusal(require_consent, "isp", file, trust_code=True, match=words)
    assert own_version(name) == {"mine.py": digest_file(tmp_path / "mine.py")}
    for expected in ({}, {"mine.py": "0" * 32}, {"other.py": digest_file(tmp_path / "mine.py")}):
        refusal(processor_of, name, expected, match="isn't the file that the sweep began with")
    assert not (tmp_path / trace).exists()
    processor_of(name, own_version(name))
    assert (tmp_path / trace).exists()


def test_a_file_that_fails_says_where_in_one_line(tmp_path: Path) -> None:
    for text, words in (
        ("def other(): pass", "has no function 'develop'"),
        ("develop = 3", "has no function 'develop'"),
        ("class develop: pass", "has no function 'develop'"),
        ("def develop(:", r"mine.py fails at line 1 (SyntaxError"),
        ("\0", "fails"),
        ("\nimport absent_of_all\n", "fails at line 2 (ModuleNotFoundError"),
        ("raise SystemExit(0)", "fails at line 1 (SystemExit: 0)"),
        ("def develop(raw): pass", "fails (TypeError"),
        ("def develop(raw, matrix, **options):\n    return {}['x']", "fails at line 2 (KeyError: 'x')"),
        ("def develop(raw, matrix, **options): raise SystemExit", "fails at line 1 (SystemExit"),
        ("def develop(raw, matrix, **options): raise SystemExit", "it was given a mosaic of RG/"),
        (
            "import rodcone\ndef develop(raw, matrix, **options):\n"
            "    return rodcone.finish(raw, raw.electrons[..., None], matrix, **options)",
            "mine.py fails at line 3 (InputError: planes: shape (8, 10, 1) is not allowed",
        ),
        ("def develop(raw, matrix, **options): pass", "gave NoneType of shape ()"),
        ("def develop(raw, matrix, **options): return 'x'", "gave str of shape (0,)"),
        ("def develop(raw, matrix, **options): return raw.electrons", "gave ndarray of shape (8, 10)"),
        (
            "import numpy as np\ndef develop(raw, matrix, **options): return np.full((*raw.shape, 3), np.nan)",
            "allowed: a Picture, or finite linear sRGB of shape (8, 10, 3)",
        ),
    ):
        assert words in told(written(tmp_path, text)), text


def test_what_is_no_plain_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "folder.py").mkdir()
    os.mkfifo(tmp_path / "pipe.py")
    (tmp_path / "long.py").write_bytes(b"#" * (MOST_BYTES + 1))
    for name, words in (("absent", "No such file"), ("folder", "device"), ("pipe", "device"), ("long", "it is over")):
        assert words in told(f"{tmp_path / name}.py:develop")
