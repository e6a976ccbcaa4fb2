"""README's commands do what it says; slow ones in the small form that it names."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text()
SMALL_FORMS = {"make demo": "make demo EXPERIMENT=smoke", "make test": "make --dry-run test"}
"""`make test` runs this very test: only its recipe is looked at."""


def blocks(language: str) -> list[str]:
    """Fenced code of one language."""
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


COMMANDS = [line.split("  #")[0].strip() for block in blocks("bash") for line in block.strip().splitlines()]


def run(command: list[str] | str, cwd: Path, *, shell: bool = False) -> str:
    environment = {
        **os.environ,
        "OMP_NUM_THREADS": "1",
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    }
    answer = subprocess.run(
        command,
        cwd=cwd,
        env=environment,
        shell=shell,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert answer.returncode == 0, answer.stderr
    return answer.stdout


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The repository as a fresh folder: code by links, results apart."""
    folder = tmp_path_factory.mktemp("checkout")
    for name in (
        "expert",
        "datasets",
        "dlm",
        "configs",
        "tests",
        "docs",
        "train.py",
        "evaluate.py",
        "Makefile",
    ):
        (folder / name).symlink_to(ROOT / name)
    binaries = folder / ".venv" / "bin"
    binaries.mkdir(parents=True)
    (binaries / "python").write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    (binaries / "python").chmod(0o755)
    (folder / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text())
    (folder / ".venv" / "installed").touch()
    return folder


def test_there_are_commands_for_all_parts() -> None:
    text = "\n".join(COMMANDS)
    for word in ("make demo", "make test", "expert solve", "expert verify", "expert draw"):
        assert word in text
    for word in ("datasets.generate", "train.py", "evaluate.py", "dlm.infer"):
        assert word in text


@pytest.mark.slow
def test_commands_run_in_their_order(checkout: Path) -> None:
    for command in COMMANDS:
        output = run(SMALL_FORMS.get(command, command), checkout, shell=True)
        if command == "make demo":
            assert "| DLM |" in output
            report = Path(re.findall(r"^report: (.+)$", output, flags=re.MULTILINE)[-1])
            assert report.stat().st_size > 1e5
    assert (checkout / "pivot.png").stat().st_size > 1000
    assert (checkout / "clip" / "motion.gif").stat().st_size > 1e4
    assert (checkout / "grasp.png").stat().st_size > 1000
    assert (checkout / "runs" / "smoke" / "table_4_1.csv").is_file()


def test_python_examples_run(checkout: Path) -> None:
    for block in blocks("python"):
        output = run([sys.executable, "-c", block], checkout)
        assert output.splitlines()[0].startswith("optimal")
        assert output.splitlines()[1] == "sound"


def test_links_lead_somewhere() -> None:
    targets = re.findall(r"\]\((?!http)([^)#]+)\)", README)
    assert targets
    missing = [target for target in targets if not (ROOT / target).exists()]
    assert missing == []
