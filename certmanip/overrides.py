"""The common grammar, as Hydra reads it: `clip.mp4 --scale 0.001 -o clip` is `video="clip.mp4" scale=0.001 out="clip"`."""

from collections.abc import Collection, Iterator, Sequence

from certmanip.commands import Command, unknown
from certmanip.options import options_of
from expert.errors import InvalidProblem

HYDRA = ("cfg", "config-dir", "config-name", "config-path", "info", "multirun", "package", "resolve", "run")
"""Long options of Hydra itself, which go on as they are."""


def overrides(command: Command, words: Sequence[str]) -> list[str]:
    """Hydra's words for those of a user; words of Hydra's own grammar stay.  Raises InvalidProblem for an unknown option."""
    known = [option.name for option in options_of(command.config)]
    sections = {name.partition(".")[0] for name in known}  # what is in one, Hydra knows
    rest, found = iter(words), []
    for position, word in enumerate(rest):
        name, equals, value = word.removeprefix("--").partition("=")
        if word == "-o":
            found.append(f"{command.output}={quoted(_next(rest, word))}")
        elif position == 0 and command.first and not _is_hydras(word, sections):
            found.append(f"{command.first}={quoted(word)}")
        elif not word.startswith("--") or name in HYDRA:
            found.append(word)
        elif name.partition(".")[0] in sections:
            found.append(f"{name}={value if equals else _next(rest, word)}")
        else:
            unknown("option", word, [f"--{option}" for option in known])
    return found


def _is_hydras(word: str, sections: Collection[str]) -> bool:
    """Whether this is an option, or an assignment to something that Hydra knows, and not the name of a file."""
    name, equals, _ = word.partition("=")
    head = name.partition(".")[0]
    return word.startswith(("-", "+", "~")) or bool(equals and (head in (*sections, "hydra") or "@" in head))


def quoted(text: str) -> str:
    """A name of a file or group as one value: blanks, commas, brackets and equals signs are part of it."""
    plain = all(letter.isalnum() or letter in "_-./~" for letter in text)
    return text if plain else "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"


def _next(rest: Iterator[str], option: str) -> str:
    for value in rest:
        return value
    raise InvalidProblem(option, expected="a value after it", got="nothing")
