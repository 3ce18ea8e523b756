"""`import rodcone`: the public names, what it loads, and that LLVM is chosen first whatever is imported."""

import ast
import sys
from functools import partial
from importlib import import_module, metadata
from inspect import signature, unwrap
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pytest
from command_line import in_new_python
from refusal import refusal

import rodcone as public
from rodcone.doors import CHECKS, check_of
from sensor.calibration import ColourCalibration
from sensor.config import SensorConfig
from sensor.curves import Responses
from sensor.emva1288.characterise import Characterisation

ROOT = Path(public.__file__).resolve().parent
sys.path.insert(0, str(ROOT.parent / "docs" / "make"))
from public_stub import WIDER, stub_text  # noqa: E402

HEAVY = ("mitsuba", "drjit", "colour", "numpy", "scipy", "skimage", "OpenEXR", "render", "scenes", "sensor", "isp")


def test_every_name_is_the_object_of_its_module() -> None:
    for name, (module, attribute) in public._PUBLIC.items():
        of_module = getattr(import_module(module), attribute)
        found = unwrap(getattr(public, name))
        assert (found.__module__, found.__qualname__) == (of_module.__module__, of_module.__qualname__), name
        assert getattr(public, name) is getattr(public, name), name


def test_tab_the_star_and_the_stub_show_the_same_names() -> None:
    stub = ast.parse((ROOT / "__init__.pyi").read_text("utf-8"))
    typed = {
        alias.asname: (node.module, alias.name)
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname
    }
    named = {node.name: node.args for node in stub.body if isinstance(node, ast.FunctionDef)}
    assert typed == {name: place for name, place in public._PUBLIC.items() if name not in named}
    for name, arguments in named.items():
        stated = [*arguments.args, arguments.vararg, *arguments.kwonlyargs, arguments.kwarg]
        assert [one.arg for one in stated if one] == list(signature(getattr(public, name)).parameters)
    (listed,) = (ast.literal_eval(node.value) for node in stub.body if isinstance(node, ast.Assign))
    assert public.__all__ == listed == sorted(public._PUBLIC)
    assert dir(public) == sorted([*public.__all__, "__version__"])


def test_the_stub_is_what_its_program_writes() -> None:
    """One list, `public.toml`, says what is public; docs/make/public_stub.py makes the stub of it."""
    assert (ROOT / "__init__.pyi").read_text("utf-8") == stub_text(), "run python docs/make/public_stub.py"


# A type of a parameter, and one thing of another type that the door takes for it.
STAND_INS = {
    "SensorConfig": "low_noise",
    "Scene": "flat_field",
    "Spectrum": "D65",
    "float": "20ms",
    "Waveform": "fluorescent@100Hz",
}


def test_the_stub_lets_a_name_stand_where_the_door_takes_one_and_nowhere_else() -> None:
    asked = 0
    for name in public.__all__:
        function = unwrap(getattr(public, name))
        if isinstance(function, type):
            continue
        for parameter in signature(function).parameters.values():
            said = str(parameter.annotation).split(" | ")[0].removeprefix("<class '").removesuffix("'>").split(".")[-1]
            if said not in STAND_INS or "| str" in str(parameter.annotation):
                continue
            asked += 1
            wide = (parameter.name, said) in WIDER
            assert passes(name, parameter.name, STAND_INS[said]) == wide, f"{name}.{parameter.name}: {said}"
    assert asked > 40


def test_each_parameter_has_a_check_and_each_rule_a_parameter() -> None:
    """A parameter is checked by its type; what a type doesn't say is a rule of `CHECKS`."""
    used = set()
    classes = [SensorConfig, ColourCalibration, Characterisation, Responses]
    classes += [found for found in map(partial(getattr, public), public.__all__) if isinstance(found, type)]
    doors = {name: unwrap(getattr(public, name)) for name in public.__all__}
    doors |= {
        f"{kind.__name__}.{name}": unwrap(found)
        for kind in classes
        for name, found in vars(kind).items()
        if hasattr(found, "__wrapped__") and not name.startswith("__")
    }
    for name, function in doors.items():
        if isinstance(function, type):
            continue
        hints = get_type_hints(function, include_extras=True)
        for parameter in signature(function).parameters:
            assert check_of(name, parameter, hints.get(parameter, Any)), f"{name}.{parameter}"
            used |= {f"{name}.{parameter}", parameter}
    assert CHECKS.keys() <= used


def passes(name: str, parameter: str, value: object) -> bool:
    """Return whether a public function's door takes a value for a parameter."""
    hints = get_type_hints(unwrap(getattr(public, name)), include_extras=True)
    check = check_of(name, parameter, hints[parameter])
    try:
        check(parameter, value)
    except public.InputError:
        return False
    return True


def test_the_version_is_the_installed_one_and_is_read_when_it_is_asked_for() -> None:
    assert public.__version__ == metadata.version("rodcone")
    code = "import rodcone; print('__version__' in vars(rodcone), rodcone.__version__, '__version__' in vars(rodcone))"
    assert in_new_python(code) == f"False {metadata.version('rodcone')} True"


def test_neither_import_nor_help_loads_what_it_does_not_need() -> None:
    code = "import sys, rodcone; print(sorted({'tomllib', 'importlib.metadata', 'numpy'} & sys.modules.keys()))"
    assert in_new_python(code) == "[]"
    show = (
        "import sys, rodcone\nfrom studies.commands.cli import main\ntry: main(['--help'])\nexcept SystemExit: pass\n"
    )
    code = show + "print(sorted({'rich.markdown', 'importlib.metadata', 'numpy'} & sys.modules.keys()))"
    assert in_new_python(code).splitlines()[-1] == "[]"


def test_no_ground_module_bears_a_public_name() -> None:
    modules = {path.stem for path in ROOT.iterdir()}
    assert not modules & public._PUBLIC.keys(), "the module's import would hide the public name"


def test_an_unknown_name_is_told_as_python_tells_it() -> None:
    with pytest.raises(AttributeError, match="module 'rodcone' has no attribute 'reconstruct_all'"):
        _ = public.reconstruct_all  # type: ignore[attr-defined]
    with pytest.raises(ImportError, match="reconstruct_all"):
        exec("from rodcone import reconstruct_all")


def test_everything_that_has_a_name_can_be_listed() -> None:
    assert "still_life" in public.scenes()
    assert "low_noise" in public.sensors()
    assert "rgbw" in public.mosaics()
    assert "D65" in public.illuminants()
    assert np.array_equal(public.illuminant("3000 K").values, public.illuminant("3000K").values)
    assert public.processors()[:3] == ("ple", "interleaved", "bayer")


def test_the_import_loads_nothing_heavy() -> None:
    code = f"import rodcone, sys; dir(rodcone); print([name for name in {HEAVY} if name in sys.modules])"
    assert in_new_python(code) == "[]"


def test_a_name_loads_no_more_than_it_needs() -> None:
    code = (
        "import rodcone, sys; rodcone.InputError; print([name for name in ('numpy', 'drjit') if name in sys.modules])"
    )
    assert in_new_python(code) == "[]"


PACKAGES = ("rodcone.errors", "render.spectrum", "scenes.catalogue", "sensor.presets", "isp.settings")


@pytest.mark.sample(1)
@pytest.mark.parametrize("module", PACKAGES)
def test_any_package_names_the_llvm_library_before_dr_jit_is_loaded(module: str) -> None:
    code = (
        "import builtins, os, sys\n"
        "real = builtins.__import__\n"
        "def spy(name, *rest):\n"
        "    assert name.split('.')[0] not in ('drjit', 'mitsuba') or 'DRJIT_LIBLLVM_PATH' in os.environ, name\n"
        "    return real(name, *rest)\n"
        "builtins.__import__ = spy\n"
        f"import {module}\n"
        "print(os.environ['DRJIT_LIBLLVM_PATH'])"
    )
    assert in_new_python(code) == in_new_python("from rodcone.llvm import LIBLLVM; print(LIBLLVM)")


def test_rodcone_before_mitsuba_gives_the_library_chosen() -> None:
    code = "import rodcone, mitsuba; from rodcone import jit, llvm; print(jit.backend(), llvm.LIBLLVM)"
    backend, library = in_new_python(code).split()
    if library == "None":
        pytest.skip("no LLVM of version 17 or newer is installed here")
    assert backend in ("llvm", "cuda")
    maps = "import rodcone, mitsuba; import rodcone.jit as j; j.backend(); print(open('/proc/self/maps').read())"
    if Path("/proc/self/maps").is_file() and backend == "llvm":
        loaded = {line.split()[-1] for line in in_new_python(maps).splitlines() if "libLLVM" in line}
        assert {Path(path).resolve() for path in loaded} == {Path(library).resolve()}


def test_mitsuba_before_rodcone_is_told_where_it_loaded_a_library_that_aborts(tmp_path: Path) -> None:
    """Dr.Jit is taken for loaded, and a file of the name of LLVM 15 is mapped into the process."""
    old = tmp_path / "libLLVM-15.so"
    old.write_bytes(bytes(4096))
    code = (
        "import mmap, sys, types, warnings\n"
        f"file = open({str(old)!r}, 'rb'); kept = mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ)\n"
        "sys.modules['drjit'] = types.ModuleType('drjit')\n"
        "with warnings.catch_warnings(record=True) as told:\n"
        "    warnings.simplefilter('always')\n"
        "    import rodcone.llvm\n"
        "print(rodcone.llvm.LIBLLVM, *[each.message for each in told])"
    )
    if not Path("/proc/self/maps").is_file():
        pytest.skip("no /proc: the libraries that a process has loaded can't be listed")
    said = in_new_python(code)
    assert said.startswith(f"None Dr.Jit was imported before rodcone and loaded {old}")
    assert "import rodcone first" in said


def small():
    return public.render("flat_field", (4, 4), wavelength_nm=np.arange(400.0, 780.0, 40.0), spp=2)


def test_a_number_is_the_power_of_all_lights():
    made = small()
    (group,) = made.groups
    assert np.array_equal(made.relight(0.5).values, made.relight(powers={group: 0.5}).values)


def test_other_objects_are_refused_in_one_line_with_the_call_that_helps():
    made = small()
    device = public.draw_device(public.low_noise(), (4, 4), np.random.default_rng(0))
    calls = {
        "relight()": lambda: public.capture(made, "low_noise", 0.01, device, np.random.default_rng(1)),
        "SpectralRadiance(": lambda: public.capture(np.ones((4, 4, 10)), "low_noise", 0.01, device, None),
        "rodcone.load(": lambda: public.render(42, (4, 4)),
        "draw_device(": lambda: public.capture(made.relight(), "low_noise", 0.01, (4, 4), np.random.default_rng(1)),
        "capture or read_raw": lambda: public.develop(made.relight()),
        "call its relight()": lambda: public.write_exr(made, "a.exr"),
        "form_image(radiance, sensor)": lambda: public.auto_exposure_s(made.relight(), public.low_noise()),
        "in quotes": lambda: public.illuminant(3000),
        "still_life": lambda: public.render("still_lif", (4, 4)),
        "low_noise": lambda: public.capture(made.relight(), "low_nois", 0.01, device, np.random.default_rng(1)),
    }
    for words, call in calls.items():
        refusal(call, words=[words])
