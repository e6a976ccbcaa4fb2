"""The house rules that a reader relies on: imports run one way, files and functions are short, checkers stand alone."""

import ast
import graphlib
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PRODUCT = sorted(
    p for room in ("expert", "datasets", "dlm", "certmanip") for p in (ROOT / room).rglob("*.py")
)
ENTRY_POINTS = [ROOT / "train.py", ROOT / "evaluate.py"]
LONGEST_FILE, LONGEST_FUNCTION = 300, 40
LONGER = {"_push": 45, "fit_pose": 44}
"""Functions that are still too long: they may not grow, and no other may join them."""


def module_name(path: Path) -> str:
    """expert/files/__init__.py is expert.files."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in PRODUCT}


def imported(path: Path) -> set[str]:
    """Modules of the product that a file imports, at its top, inside functions or for types alone."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            members = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in MODULES else node.module for name in members}
    return {name for name in found if name in MODULES} - {module_name(path)}


IMPORTS = {name: imported(path) for name, path in MODULES.items()}


def room(module: str) -> str:
    """expert.verify.cage.check is in expert.verify."""
    return ".".join(module.split(".")[:2])


def cycle(graph: dict[str, set[str]]) -> str:
    """A cycle of a directed graph, as a chain of names; empty if there is none."""
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        return " <- ".join(error.args[1])
    return ""


def test_the_search_for_cycles_finds_one() -> None:
    assert cycle({"a": {"b"}, "b": {"c"}, "c": set()}) == ""
    assert set(cycle({"a": {"b"}, "b": {"c"}, "c": {"a"}}).split(" <- ")) == {"a", "b", "c"}


def test_the_imports_of_files_are_found() -> None:
    assert "expert.geometry.pose" in IMPORTS["expert.world.frame"]
    assert "expert.errors" in IMPORTS["expert.__main__"]
    assert all(names <= MODULES.keys() for names in IMPORTS.values())
    assert sum(map(len, IMPORTS.values())) > len(MODULES)


def test_no_file_imports_itself_through_others() -> None:
    assert cycle(IMPORTS) == ""


def test_no_room_imports_itself_through_others() -> None:
    rooms: dict[str, set[str]] = {}
    for module, names in IMPORTS.items():
        rooms.setdefault(room(module), set()).update(room(name) for name in names)
    assert cycle({name: others - {name} for name, others in rooms.items()}) == ""


def test_checkers_import_nothing_that_finds_answers() -> None:
    allowed = {"verify", "world", "problems", "geometry", "mechanics", "errors", "budget"}
    for module, names in IMPORTS.items():
        if room(module) == "expert.verify":
            assert {room(name) for name in names} <= {f"expert.{name}" for name in allowed}, module


@pytest.mark.parametrize("path", [*PRODUCT, *ENTRY_POINTS], ids=lambda p: str(p.relative_to(ROOT)))
def test_files_and_functions_are_short_and_point_at_no_tests(path: Path) -> None:
    text = path.read_text()
    assert len(text.splitlines()) <= LONGEST_FILE
    assert [(name, n) for name, n in function_lengths(text) if n > LONGER.get(name, LONGEST_FUNCTION)] == []
    assert [line for line in text.splitlines() if re.search(r"\btests[./]\w", line)] == []


def function_lengths(text: str) -> Iterator[tuple[str, int]]:
    """Lines of each function from `def` on."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name, (node.end_lineno or node.lineno) - node.lineno + 1


WITHOUT_TORCH = """
import importlib, sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {blocked}:
            raise ModuleNotFoundError(f"{{name}} is not installed here", name=name)
sys.meta_path.insert(0, Refuse())
for name in {modules}:
    importlib.import_module(name)
"""


def import_without(blocked: set[str], modules: Iterable[str]) -> str:
    """What Python complains of when it imports modules while some packages cannot be imported; empty: nothing."""
    code = WITHOUT_TORCH.format(blocked=blocked, modules=sorted(modules))
    answer = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=300, check=False
    )
    return answer.stderr if answer.returncode else ""


LEARNING = {
    "torch",
    "cvxpylayers",
    "diffcp",
    "hydra",
    "omegaconf",
    "tensorboard",
    "cv2",
    "safetensors",
    "joblib",
}


def test_planning_needs_nothing_that_learning_needs() -> None:
    assert import_without(LEARNING, (name for name in MODULES if name.startswith("expert"))) == ""
