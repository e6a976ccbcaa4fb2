"""`certmanip COMMAND`: every command reaches its program, wrong words get one line."""

import json
import re
import sys
from pathlib import Path

import pytest

from certmanip.__main__ import main
from certmanip.commands import COMMANDS


@pytest.fixture(autouse=True)
def fresh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Programs that other tests have imported are run as if they had not."""
    for command in COMMANDS.values():
        for name in (command.program, f"{command.program}.__main__"):
            monkeypatch.delitem(sys.modules, name, raising=False)


def test_solve_verify_and_draw(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["solve", "shipped:cage/t_4", "-o", "cage.json"]) == 0
    assert main(["verify", "cage.json", "-o", "certificate.json"]) == 0
    assert json.loads(Path("certificate.json").read_text())["verdict"] == "caged"
    assert main(["draw", "cage.json", "-o", "cage.png", "--view", "workspace"]) == 0
    assert Path("cage.png").stat().st_size > 1000
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["infre", "clip.mp4"], r"command: .*did you mean infer\?"),
        (["infer", "clip.mp4", "--scal", "1"], r"option: .*did you mean --scale\?"),
        (["infer", "clip.mp4", "--scale", "0.001"], "video: expected a file, got clip.mp4"),
        (["generate", "nothing"], "nothing"),
        (["train", "--experiment", "smoke"], "data/smoke-seed0"),
        (["evaluate", "--seeds", "[]"], "seeds: expected at least one"),
        (["control", "--world", "chess"], "world: "),
        (["solve", "shipped:cage/t_44"], r"did you mean shipped:cage/t_4\?"),
        (["verify", "nothing.json"], "No such file"),
    ],
)
def test_wrong_words_get_one_line_and_code_2(
    words: list[str],
    complaint: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    said = capsys.readouterr()
    assert re.fullmatch(r"error: [^\n]+\n", said.err)
    assert re.search(complaint, said.err)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", COMMANDS)
def test_help_says_how(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    try:
        code: object = main([name, "--help"])
    except SystemExit as end:  # argparse's way
        code = end.code
    page = capsys.readouterr().out
    assert code == 0
    assert page.startswith(f"usage: certmanip {name} ")
    assert re.search(rf"^example: certmanip {name} ", page, flags=re.MULTILINE)
    assert re.search(r"^exit codes: 0 ", page, flags=re.MULTILINE)


def test_without_a_command_it_explains_itself(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    assert main(["--help"]) == 0
    assert "usage: certmanip COMMAND" in capsys.readouterr().out
