"""README's commands do what it says; slow ones in the small form that it names."""

import re
import sys
from pathlib import Path

import pytest

from tests.support.commands import ROOT, blocks, fresh_checkout, run

README = (ROOT / "README.md").read_text()
SMALL_FORMS = {"make demo": "make demo EXPERIMENT=smoke", "make test": "make --dry-run test"}
"""`make test` runs this very test: only its recipe is looked at."""
BASH = re.findall(r"^```bash\n.*?^```$", README, flags=re.MULTILINE | re.DOTALL)
COMMANDS = [command for text in BASH for block in blocks(text) for command in block]
"""Fences without a language, or with `sh`, are not run: they take hours."""


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The repository as a fresh folder."""
    return fresh_checkout(tmp_path_factory.mktemp("checkout"))


def test_there_are_commands_for_all_parts() -> None:
    text = "\n".join(COMMANDS)
    for word in ("make demo", "make test", "expert solve", "expert verify", "expert draw"):
        assert word in text
    for word in ("datasets.generate", "train.py", "evaluate.py", "dlm.infer"):
        assert word in text


@pytest.mark.slow
def test_commands_run_in_their_order(checkout: Path) -> None:
    for command in COMMANDS:
        output = run(SMALL_FORMS.get(command, command), checkout)
        if command == "make demo":
            assert "| DLM |" in output
            report = Path(re.findall(r"^report: (.+)$", output, flags=re.MULTILINE)[-1])
            assert report.stat().st_size > 1e5
    assert (checkout / "pivot.png").stat().st_size > 1000
    assert (checkout / "clip" / "motion.gif").stat().st_size > 1e4
    assert (checkout / "grasp.png").stat().st_size > 1000
    assert (checkout / "runs" / "smoke" / "table_4_1.csv").is_file()


def test_python_examples_run(checkout: Path) -> None:
    snippets = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert snippets
    for snippet in snippets:
        output = run([sys.executable, "-c", snippet], checkout)
        assert output.splitlines()[0].startswith("optimal")
        assert output.splitlines()[1] == "sound"
