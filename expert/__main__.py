"""Command line: python -m expert solve problem.yaml -o solution.json | verify solution.json | draw solution.json -o picture.png

Exit codes: 0 solved, sound or drawn; 1 refuted (or a solver that failed); 2 bad input; 3 proved infeasible;
4 limit hit or unknown; 130 interrupted.
"""

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn, get_args, get_type_hints

from expert import commands
from expert.errors import ExpertError, InvalidProblem
from expert.files import FORMATS
from expert.shipped import located

CODES = """exit codes: 0 solved, sound or drawn; 1 refuted, or a solver failed; 2 bad input; 3 proved infeasible;
4 limit hit or unknown; 130 interrupted"""


def main(arguments: Sequence[str] | None = None, program: str = "python -m expert") -> int:
    """Run one command and return its exit code; whatever is wrong with the input becomes one line on stderr.

    program: how the user calls it, for help.
    """
    options = _parser(program).parse_args(arguments)
    try:
        options.file = located(options.file)
        code: int = options.command(options)
    except InvalidProblem as error:
        print(f"error: {options.file}: {error}", file=sys.stderr)
        return commands.BAD_INPUT
    except ExpertError as error:
        print(f"error: {error}", file=sys.stderr)
        return commands.REFUTED
    except KeyboardInterrupt:
        print(
            "interrupted: nothing was written; run the same command to start again",
            file=sys.stderr,
            flush=True,
        )
        # A computation may still run in its thread, in compiled code that cannot be stopped otherwise.
        os._exit(commands.INTERRUPTED)
    except BrokenPipeError:  # whoever reads the output has had enough: nothing to complain about
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return commands.REFUTED
    return code


class _Parser(argparse.ArgumentParser):
    """Says in one line what is wrong with a command line."""

    def error(self, message: str) -> NoReturn:
        self.exit(commands.BAD_INPUT, f"error: {message}; see {self.prog} --help\n")


def _parser(program: str) -> argparse.ArgumentParser:
    parser = _Parser(prog=program, description="Plan, check and draw planar manipulation.", epilog=CODES)
    subparsers = parser.add_subparsers(required=True, metavar="solve | verify | draw")

    def add(name: str, purpose: str, example: str) -> argparse.ArgumentParser:
        epilog = f"example: {program} {name} {example}\n\n{CODES}"
        layout = argparse.RawDescriptionHelpFormatter
        return subparsers.add_parser(
            name, help=purpose, description=purpose, epilog=epilog, formatter_class=layout
        )

    solve = add("solve", "read a problem file, write a solution file", "shipped:cage/t_4 -o cage.json")
    solve.add_argument("file", type=Path, help="problem file, YAML or JSON, in SI units (docs/files.md)")
    solve.add_argument("-o", "--output", type=Path, help="solution file, JSON; without it nothing is written")
    solve.add_argument("--method", help=f"instead of the file's options.method.  {_methods()}")
    solve.add_argument("--summary", action="store_true", help="print one JSON line")
    solve.set_defaults(command=commands.solve)

    verify = add("verify", "check a solution file without solving anything", "cage.json -o certificate.json")
    verify.add_argument("file", type=Path, help="solution file, or a problem file that states what to check")
    verify.add_argument("-o", "--output", type=Path, help="certificate file, JSON")
    verify.set_defaults(command=commands.verify)

    draw = add("draw", "picture or animation of a solution file", "cage.json -o cage.png")
    draw.add_argument("file", type=Path, help="solution file")
    draw.add_argument("-o", "--output", type=Path, required=True, help=".png, .svg, .pdf, .gif or .mp4")
    draw.add_argument("--view", help="one part of the picture of a cage: workspace, slice or component")
    draw.set_defaults(command=commands.draw)
    return parser


def _methods() -> str:
    """Of each kind, as its options state them."""
    return "; ".join(
        f"{kind}: {', '.join(get_args(get_type_hints(form.OPTIONS)['method']))}"
        for kind, form in FORMATS.items()
    )


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # asked to end, it cleans up as after Ctrl-C
    sys.exit(main())
