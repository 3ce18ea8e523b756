"""The examples in the docstrings of public names run as they stand and print what they say."""

import doctest
from inspect import unwrap

import numpy as np
import pytest

import rodcone as public

# Names whose example would need a render, a file, a study's run or a browser.
WITHOUT = [
    "LightGroup",
    "Picture",
    "Processor",
    "RawImage",
    "Scene",
    "characterise",
    "develop",
    "develop_file",
    "expect",
    "explore",
    "explorer_view",
    "finish",
    "load",
    "load_radiance",
    "load_scene_file",
    "load_transport",
    "measure",
    "merged_raw",
    "panel",
    "plan",
    "read_raw",
    "read_rows",
    "reference_picture",
    "reference_plan",
    "relight_denoised",
    "render",
    "report",
    "run_in_processes",
    "sweep",
    "take",
    "to_world",
    "write_exr",
    "write_picture",
    "write_raw",
]


def examples(name: str) -> doctest.DocTest:
    function = unwrap(getattr(public, name))
    return doctest.DocTestParser().get_doctest(function.__doc__ or "", {}, name, None, None)


def test_a_public_name_that_needs_no_render_has_an_example() -> None:
    assert [name for name in public.__all__ if not examples(name).examples] == sorted(WITHOUT)


@pytest.mark.parametrize("name", [name for name in public.__all__ if name not in WITHOUT])
def test_an_example_prints_what_it_says(name: str) -> None:
    told: list[str] = []
    with np.printoptions(legacy=False):  # colour-science asks NumPy for the spaces of version 1.13
        result = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(examples(name), out=told.append)
    assert not result.failed, "".join(told)
