"""`import certmanip` is quick, and gives every public name."""

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import certmanip

SOURCE = Path(certmanip.__file__)
ROOT = SOURCE.parents[1]


def loaded_after(code: str) -> set[str]:
    """Packages that are imported once the code has run in a fresh process."""
    answer = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys\nprint(*sys.modules)"],
        cwd=ROOT, capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    return {name.partition(".")[0] for name in answer.stdout.split()}


def test_importing_imports_no_library() -> None:
    heavy = {"torch", "numpy", "numba", "matplotlib", "cv2", "hydra", "scipy", "shapely"}
    assert loaded_after("import certmanip") & heavy == set()


def test_problems_need_no_learning_library() -> None:
    code = "import certmanip\ncertmanip.load('shipped:cage/i_given').verify()\ncertmanip.outline"
    assert loaded_after(code) & {"torch", "hydra", "cvxpylayers", "cv2", "datasets", "dlm"} == set()


def test_every_public_name_is_what_type_checkers_see() -> None:
    typed = {
        (alias.name, node.module)
        for block in ast.parse(SOURCE.read_text()).body
        if isinstance(block, ast.If)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert typed == set(certmanip._HOMES.items())
    assert {name for name, _ in typed} == set(certmanip.__all__)
    for name, module in typed:
        if name != "infer":  # needs torch
            assert getattr(certmanip, name) is getattr(import_module(module or ""), name)
    assert set(certmanip.__all__) <= set(dir(certmanip))


def test_no_module_hides_behind_a_public_name() -> None:
    modules = {path.stem for path in SOURCE.parent.glob("*.py")}
    assert modules & set(certmanip.__all__) == set()


def test_it_knows_its_version_and_no_other_name() -> None:
    assert certmanip.__version__.count(".") == 2
    with pytest.raises(AttributeError, match="no attribute 'cge'"):
        certmanip.cge  # noqa: B018


@pytest.mark.parametrize("package", ["certmanip", "expert", "datasets", "dlm"])
def test_type_hints_are_shipped(package: str) -> None:
    assert (ROOT / package / "py.typed").is_file()
