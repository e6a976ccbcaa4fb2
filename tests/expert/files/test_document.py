"""Text to mappings and back: strictly read, written all or nothing."""

import json
import math
from pathlib import Path

import pytest

from expert.errors import InvalidProblem
from expert.files import problem_of, read_problem
from expert.files.document import parse, save


@pytest.mark.parametrize(
    ("text", "value"),
    [("1e-3", 0.001), ("1.0e-3", 0.001), (".5", 0.5), ("+3", 3), ("010", 10), ("-0.0", 0.0), ("5.", 5.0)],
)
def test_yaml_numbers_are_read_in_tens(text: str, value: float) -> None:
    assert parse(f"a: {text}") == {"a": value}


@pytest.mark.parametrize("text", ["2020-01-01", "1:30", "0x1F", "1_000"])
def test_yaml_words_that_only_look_like_numbers_stay_words(text: str) -> None:
    assert parse(f"a: {text}") == {"a": text}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "mapping"),
        ("- 1", "mapping"),
        ("a: [1", "line 1"),
        ("a: 1\na: 2", "twice"),
        ("&a [*a, *a]", "mapping"),
        ("a: \x00", "YAML"),
        ("!!python/object/apply:os.system ['true']", "YAML"),
        ("[" * 5000, "deep"),
        ("{[1]: 2}", "YAML"),
    ],
)
def test_text_that_is_no_mapping_is_refused_in_one_line(text: str, message: str) -> None:
    with pytest.raises(InvalidProblem, match=message) as caught:
        problem_of(parse(text))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["{", '{"a": 1, "a": 2}', "[1]", "NaN", "[" * 100_000, ""])
def test_json_text_that_is_no_mapping_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(InvalidProblem) as caught:
        parse(text, json_only=True)
    assert "\n" not in str(caught.value)


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "latin.yaml").write_bytes(b"a: \xff")
    for path in (tmp_path, tmp_path / "absent.yaml", tmp_path / "latin.yaml"):
        with pytest.raises(InvalidProblem, match="file"):
            read_problem(path)


def test_writing_is_all_or_nothing(tmp_path: Path) -> None:
    path = tmp_path / "s.json"
    save(path, {"a": 1})
    with pytest.raises(ValueError, match="JSON"):
        save(path, {"a": math.nan})
    with pytest.raises(TypeError):
        save(path, {"a": object()})
    assert json.loads(path.read_text()) == {"a": 1}
    assert [p.name for p in tmp_path.iterdir()] == ["s.json"]
    with pytest.raises(InvalidProblem, match="output"):
        save(tmp_path / "absent" / "s.json", {"a": 1})
