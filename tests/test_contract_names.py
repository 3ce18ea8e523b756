"""Names that README, docs and notebooks have told users to import stay importable; `contract_names.py` lists them."""

import pytest
from contract_names import LEFT_OUT, LIST, imports

NAMES = [tuple(line.split()) for line in LIST.read_text("utf-8").splitlines()]


@pytest.mark.parametrize(("module", "name"), NAMES, ids=[f"{module}.{name}" for module, name in NAMES])
def test_a_name_of_the_contract_is_importable(module, name):
    exec(f"from {module} import {name}", {})  # as a page writes it: a submodule counts too


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
