"""Names that README, docs and notebooks have told users to import stay importable; `contract_names.py` lists them."""

import subprocess
import sys

import pytest
from contract_names import LEFT_OUT, LIST, PACKAGES, imports

NAMES = [tuple(line.split()) for line in LIST.read_text("utf-8").splitlines()]


@pytest.mark.parametrize(("module", "name"), NAMES, ids=[f"{module}.{name}" for module, name in NAMES])
def test_a_name_of_the_contract_is_importable(module, name):
    exec(f"from {module} import {name}", {})  # as a page writes it: a submodule counts too


def test_each_module_of_the_contract_may_be_the_first_that_a_program_imports():
    """A circle of imports shows where one of its modules comes first; so each is, with none of the project's loaded."""
    program = """
import sys
from importlib import import_module
packages, *modules = sys.argv[1:]
wrong = {}
for module in modules:
    for name in [name for name in sys.modules if name.partition(".")[0] in packages.split(",")]:
        del sys.modules[name]
    try:
        import_module(module)
    except ImportError as error:
        wrong[module] = str(error)
print(wrong)
"""
    modules = dict.fromkeys(module for module, _ in NAMES)
    command = [sys.executable, "-c", program, ",".join(PACKAGES), *modules]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "{}"


def test_the_list_is_the_whole_contract():
    assert len(NAMES) == len(set(NAMES)) >= 50
    assert not set(NAMES) & set(LEFT_OUT)
    assert {"render.engine", "isp.pipeline", "sensor.capture", "studies.study_file"} <= {module for module, _ in NAMES}


def test_a_name_that_is_gone_is_seen():
    with pytest.raises(ImportError):
        test_a_name_of_the_contract_is_importable("render.engine", "no_such_name")


def test_imports_are_found_in_programs_commands_and_diffs():
    text = """
from isp.picture import Picture, finish as end
    from render.scene import (
        LightGroup,  # one light
        Scene,
    )
+from isp.two_by_two import picture_two_by_two
python -c "from studies.cli import app; app()"
from numpy import array
"""
    assert imports(text) == {
        ("isp.picture", "Picture"),
        ("isp.picture", "finish"),
        ("render.scene", "LightGroup"),
        ("render.scene", "Scene"),
        ("isp.two_by_two", "picture_two_by_two"),
        ("studies.cli", "app"),
    }
