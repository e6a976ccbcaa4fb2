"""Commands as documents state them: found in a page, parsed without being run, and run in a fresh folder."""

import argparse
import os
import re
import runpy
import shlex
import subprocess
import sys
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
CODE = re.compile(r"^```(?:bash|sh)?\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)
LINKED = (
    "expert", "datasets", "dlm", "certmanip", "configs", "examples", "tests", "docs", "train.py", "evaluate.py", "Makefile",
)  # fmt: skip


def blocks(page: str) -> Iterator[list[str]]:
    """Commands of each fenced block of shell code, without their comments."""
    for block in CODE.findall(page):
        lines = (line.split("  #")[0].strip() for line in block.splitlines())
        if commands := [line for line in lines if re.match(r"(python|certmanip|make|for|pip) ", line)]:
            yield commands


def commands(page: str) -> Iterator[str]:
    """All commands of a page: in fenced blocks, indented, and within the text; loops over names are unrolled."""
    found = [command for block in blocks(page) for command in block]
    outside = CODE.sub("", page)
    found += [
        line.split("  #")[0].strip() for line in re.findall(r"^    (python .*)$", outside, re.MULTILINE)
    ]
    found += re.findall(r"`((?:python|certmanip|make|pip) [^`]+)`", outside)
    for command in found:
        loop = re.fullmatch(r"for name in ([^;]+); do (.*); done", command)
        names = loop[1].split() if loop else [""]
        yield from ((loop[2] if loop else command).replace("$name", name) for name in names)


class Parsed(Exception):
    """The command's arguments are understood."""


def parse(program: str, arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> argparse.Namespace:
    """What the parser of a module, or of a script, makes of arguments; nothing else runs.  Leaves with SystemExit if it refuses."""
    answers = []
    original = argparse.ArgumentParser.parse_args

    def stop(parser: argparse.ArgumentParser, *args: object) -> None:
        answers.append(original(parser, *args))
        raise Parsed

    with monkeypatch.context() as patched, warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # runpy minds modules that are imported already
        patched.setattr(argparse.ArgumentParser, "parse_args", stop)
        patched.setattr(sys, "argv", [program, *arguments])
        execute = (
            partial(runpy.run_path, str(ROOT / program))
            if program.endswith(".py")
            else partial(runpy.run_module, program)
        )
        with pytest.raises(Parsed):
            execute(run_name="__main__")
    return answers[0]


def words(command: str) -> list[str]:
    """A command's words; brackets around optional arguments of a benchmark are dropped."""
    if "tests.benchmarks" in command:
        command = re.sub(r"[\[\]]", " ", command)
    return shlex.split(command)


def run(command: list[str] | str, cwd: Path) -> str:
    """Standard output of a command, a list of words or a line for the shell, which must succeed."""
    environment = {
        **os.environ,
        "OMP_NUM_THREADS": "1",
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    }
    answer = subprocess.run(
        command,
        cwd=cwd,
        env=environment,
        shell=isinstance(command, str),
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert answer.returncode == 0, answer.stderr
    return answer.stdout


def fresh_checkout(folder: Path) -> Path:
    """The repository as a fresh folder: code by links, results apart."""
    for name in LINKED:
        (folder / name).symlink_to(ROOT / name)
    binaries = folder / ".venv" / "bin"
    binaries.mkdir(parents=True)
    (binaries / "python").write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    (binaries / "python").chmod(0o755)
    (folder / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text())
    (folder / ".venv" / "installed").touch()
    return folder
