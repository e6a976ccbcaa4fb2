"""YAML and JSON text to plain mappings and back.  Reads strictly."""

import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from expert.errors import InvalidProblem
from expert.files.output import write_atomically


class _StrictLoader(yaml.SafeLoader):
    """YAML with unique keys, numbers such as 1e-3 as in YAML 1.2, and no dates."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        mapping = super().construct_mapping(node, deep=deep)
        if len(mapping) < len(node.value):
            line = node.start_mark.line + 1
            raise yaml.constructor.ConstructorError(
                problem=f"a key stands twice in the mapping of line {line}"
            )
        return mapping


_StrictLoader.yaml_implicit_resolvers = {
    first: [
        (tag, pattern)
        for tag, pattern in resolvers
        if not tag.endswith((":timestamp", ":float", ":int", ":merge"))
    ]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_StrictLoader.add_implicit_resolver(
    "tag:yaml.org,2002:int", re.compile(r"^[-+]?[0-9]+$"), list("-+0123456789")
)
_StrictLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(
        r"^([-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN))$"
    ),
    list("-+.0123456789"),
)
# YAML 1.1 reads 010 as eight: count in tens as YAML 1.2 does.
_StrictLoader.add_constructor(
    "tag:yaml.org,2002:int", lambda loader, node: int(loader.construct_scalar(node))
)


def load(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Mapping held by a YAML (.yaml, .yml) or JSON file.  Raises InvalidProblem for anything else, in one line."""
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InvalidProblem("file", expected="a readable file", got=f"{error.strerror}: {path}") from None
    except UnicodeDecodeError:
        raise InvalidProblem("file", expected="UTF-8 text", got="other bytes") from None
    return parse(text, json_only=path.suffix.lower() == ".json")


def parse(text: str, *, json_only: bool = False) -> dict[str, Any]:
    """Mapping held by YAML or JSON text.  Raises InvalidProblem."""
    form = "JSON" if json_only else "YAML"
    try:
        data = json.loads(text, object_pairs_hook=_unique) if json_only else yaml.load(text, _StrictLoader)
    except (ValueError, yaml.YAMLError, RecursionError) as error:
        raise InvalidProblem("file", expected=f"valid {form}", got=_reason(error)) from None
    if not isinstance(data, dict):
        raise InvalidProblem(
            "file", expected=f"a {form} mapping that begins with schema: 1", got=type(data).__name__
        )
    return data


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    mapping = dict(pairs)
    if len(mapping) < len(pairs):
        raise ValueError(f"a key stands twice in the mapping with keys {', '.join(mapping)}")
    return mapping


def _reason(error: Exception) -> str:
    """The parser's complaint and its place, without its picture of the text."""
    if isinstance(error, yaml.MarkedYAMLError):
        mark = error.problem_mark or error.context_mark
        return f"{error.problem}" + (f" at line {mark.line + 1}, column {mark.column + 1}" if mark else "")
    if isinstance(error, RecursionError):
        return "nesting that is too deep"
    return str(error)[:200]


def save(path: str | os.PathLike[str], data: Mapping[str, Any]) -> None:
    """Write JSON, all or nothing.  Raises InvalidProblem where the place cannot be written."""
    write_atomically(path, encoded(data))


def encoded(data: Mapping[str, Any]) -> bytes:
    """JSON, one line per top-level key."""
    lines = ",\n".join(f" {json.dumps(k)}: {json.dumps(v, allow_nan=False)}" for k, v in data.items())
    return f"{{\n{lines}\n}}\n".encode()
