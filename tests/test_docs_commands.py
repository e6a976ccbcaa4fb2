"""Every command of the documents is understood by the program that it calls; short ones of the how-to pages are run."""

import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from omegaconf import DictConfig

from certmanip.commands import COMMANDS as ENTRANCES
from certmanip.overrides import overrides
from tests.support.commands import ROOT, blocks, commands, fresh_checkout, parse, run, words

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
COMMANDS = sorted({command for page in PAGES for command in commands(page.read_text())})
HYDRA = {
    "datasets.generate": "generate",
    "train.py": "train",
    "evaluate.py": "evaluate",
    "dlm.infer": "infer",
    "dlm.control": "control",
}
"""Commands that read their options from configs/<name>.yaml."""
BARE = {"dlm.structured.weights", "dlm.neural.weights"}
"""Commands without a parser: they take one file."""
ELSEWHERE = "examples/"
"""Run by tests of their own."""


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_is_understood(
    command: str, composed: Callable[..., DictConfig], monkeypatch: pytest.MonkeyPatch
) -> None:
    program, *arguments = words(command)
    if program == "make":
        targets = [word for word in arguments if "=" not in word]
        assert set(targets) <= set(
            re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
        )
        return
    if program == "pip":
        extras = re.findall(r"(?<=[\[,])\w+(?=[\],])", command)
        assert all(f"\n{extra} = [" in (ROOT / "pyproject.toml").read_text() for extra in extras)
        return
    if program == "certmanip":
        name, *arguments = arguments if ENTRANCES[arguments[0]].config else ("expert", *arguments)
        arguments = overrides(ENTRANCES[name], arguments) if name in ENTRANCES else arguments
    else:
        name, *arguments = arguments[1:] if arguments[0] == "-m" else arguments
    if name in HYDRA or name in ENTRANCES:
        assert composed(HYDRA.get(name, name), *(word for word in arguments if not word.startswith("-")))
    elif name in BARE:
        assert len(arguments) == 1
    elif len(arguments) == 1:  # mentioned in passing: `python -m expert verify`
        with pytest.raises(SystemExit) as stop:
            parse(name, [*arguments, "--help"], monkeypatch)
        assert stop.value.code == 0
    else:
        options = parse(name, arguments, monkeypatch)
        files = [value for value in vars(options).values() if isinstance(value, Path)]
        missing = [
            file for file in files if file.parts[0] in ("configs", "docs") and not (ROOT / file).exists()
        ]
        assert missing == []


def test_a_wrong_command_is_not_understood(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SystemExit):
        parse("expert", ["solve", "problem.yaml", "--colour", "red"], monkeypatch)


@pytest.mark.slow
def test_snippets_of_the_python_page_run(tmp_path: Path) -> None:
    snippets = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs/how-to/python.md").read_text(), re.M | re.S)
    assert len(snippets) == 4
    output = run([sys.executable, "-c", "\n".join(snippets)], fresh_checkout(tmp_path))
    assert re.search(r"^caged caged$.*^optimal sound \(4, 1, 2\)$.*^planned .*^sound$", output, re.M | re.S)
    assert (tmp_path / "cage.png").stat().st_size > 1000


@pytest.mark.slow
@pytest.mark.parametrize("page", ["contact-trajectories", "cages", "certified-grasps"])
def test_short_commands_of_the_how_to_pages_run(page: str, tmp_path: Path) -> None:
    folder = fresh_checkout(tmp_path)
    for block in blocks((ROOT / "docs/how-to" / f"{page}.md").read_text()):
        for command in block:
            if ELSEWHERE in command:
                continue
            refuted = "hooks_given" in command and "verify" in command
            run(f"{command} || [ $? -eq 1 ]" if refuted else command, folder)
            for written in re.findall(r" -o (\S+)", command):
                assert (folder / written).stat().st_size > 100
