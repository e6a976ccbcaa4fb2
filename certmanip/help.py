"""What `--help` prints: purpose, options with units, an example, exit codes."""

import textwrap

from certmanip.commands import COMMANDS, USUAL, Command
from certmanip.options import options_of

WIDTH = 100


def overview() -> str:
    """All commands and the grammar that they share."""
    wide = max(map(len, COMMANDS))
    return "\n".join(
        [
            "usage: certmanip COMMAND [FILE] [--option value ...] [-o OUTPUT]",
            "",
            "Plan, learn and certify how point fingers move a polygon in the plane.",
            "",
            "commands",
            *_listed([(name, command.purpose) for name, command in COMMANDS.items()], wide),
            "",
            "`certmanip COMMAND --help` lists options with their units, an example and exit codes.",
            "A problem file that comes along is named like shipped:cage/t_4.  SI units, angles in rad.",
        ]
    )


def help_page(name: str, command: Command) -> str:
    """Help of a command whose options are in a configuration file."""
    first, output = command.first.upper(), command.output
    rows = [
        (first if option.name == command.first else f"--{option.name} {option.default}", option.about)
        for option in options_of(command.config)
    ]
    return "\n".join(
        [
            f"usage: certmanip {name} {first}{' ' * bool(first)}[--option value ...] [-o {output.upper()}]",
            "",
            *textwrap.wrap(f"{command.purpose[0].upper()}{command.purpose[1:]}.", WIDTH),
            "",
            "options, with their defaults",
            *_listed([*rows, (f"-o {output.upper()}", f"the same as --{output}")], 32),
            "",
            "What Hydra reads works too: name=value, --cfg job, -m seed=0,1,2.",
            "",
            f"example: {command.example}",
            "",
            f"exit codes: {exit_codes(command)}",
        ]
    )


def exit_codes(command: Command) -> str:
    """Each with its meaning."""
    return ", ".join(f"{code} {text}" for code, text in sorted({**USUAL, **dict(command.codes)}.items()))


def _listed(rows: list[tuple[str, str]], wide: int) -> list[str]:
    """A column of names, `wide` letters wide, and one of what they mean."""
    lines = []
    for name, about in rows:
        first, *more = textwrap.wrap(about, WIDTH - wide - 4) or [""]
        lines.append(f"  {name:<{wide}}  {first}".rstrip())
        lines += [" " * (wide + 4) + line for line in more]
    return lines
