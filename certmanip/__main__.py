"""Command line: `certmanip COMMAND [FILE] [--option value ...] [-o OUTPUT]`, the same grammar for every command.

Each command is that of a package: certmanip reads no option itself, it hands them on in the form that the program knows.
"""

import os
import runpy
import sys
from collections.abc import Sequence

from certmanip.commands import COMMANDS, Command, unknown
from certmanip.help import help_page, overview
from certmanip.installation import IncompleteInstallation, explained, require_own_datasets
from certmanip.overrides import overrides
from expert.errors import InvalidProblem
from expert.shipped import HOME

BAD_INPUT, INTERRUPTED = 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; what is wrong with the installation or the words becomes one line on stderr."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not words or words[0] in ("-h", "--help", "help"):
        print(overview())
        return 0 if words else BAD_INPUT
    name, *rest = words
    try:
        command = COMMANDS.get(name) or unknown("command", name, COMMANDS)
        if command.config and {"-h", "--help"} & set(rest):
            print(help_page(name, command))
            return 0
        return _run(name, command, rest)
    except (InvalidProblem, IncompleteInstallation) as error:
        print(f"error: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED


def _run(name: str, command: Command, words: list[str]) -> int:
    """As `python -m PROGRAM` or `python PROGRAM.py` would; its exit code."""
    if not command.config:
        from expert.__main__ import main as expert

        return expert([name, *words], program="certmanip")
    require_own_datasets()
    sys.argv = [command.program, *overrides(command, words)]
    try:
        with explained():
            if command.program.endswith(".py"):
                runpy.run_path(os.fspath(HOME / command.program), run_name="__main__")
            else:
                runpy.run_module(command.program, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0


if __name__ == "__main__":
    sys.exit(main())
