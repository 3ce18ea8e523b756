"""Dr.Jit compiles with the LLVM library that `rodcone.llvm` has chosen."""

from pathlib import Path

import pytest
from command_line import in_new_python

from rodcone import jit
from rodcone.llvm import OLDEST_LLVM, llvm_version


def test_a_new_python_keeps_the_users_value_and_goes_without_llvm_where_it_is_wrong(tmp_path: Path) -> None:
    own = str(tmp_path / "libLLVM-99.so")
    code = "import os; from rodcone import jit; print(os.environ['DRJIT_LIBLLVM_PATH'], jit.LIBLLVM, jit.backend())"
    variable, library, backend = in_new_python(code, DRJIT_LIBLLVM_PATH=own).split()
    assert (variable, library) == (own, own)
    assert backend != "llvm"


def test_a_new_python_compiles_a_kernel_with_the_library_found() -> None:
    if jit.backend() != "llvm":
        pytest.skip(f"Dr.Jit's backend here is {jit.backend()}")
    code = (
        "import os, rodcone.jit as jit; import drjit\n"
        "x = jit.arrays().Float([1.0, 2.0, 5.0])\n"
        "print(drjit.sum(drjit.maximum(x, 3.0))[0], jit.backend(), os.environ['DRJIT_LIBLLVM_PATH'])"
    )
    total, backend, library = in_new_python(code).split()
    assert (float(total), backend) == (11.0, "llvm")  # `maximum` is what LLVM 15 and 16 abort on
    assert (llvm_version(Path(library)) or 0) >= OLDEST_LLVM


def test_arrays_name_the_doctor_where_dr_jit_has_no_backend(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jit, "backend", lambda: "numpy")
    with pytest.raises(RuntimeError, match="rodcone doctor"):
        jit.arrays()
