"""Files that come along are found by their name, from anywhere."""

from pathlib import Path

import pytest

from expert.errors import InvalidProblem
from expert.files import read_problem
from expert.shipped import CONFIGS, HOME, located, problem_names


def test_home_holds_configurations_and_commands() -> None:
    assert (HOME / "train.py").is_file()
    assert (HOME / "evaluate.py").is_file()
    assert (CONFIGS / "infer.yaml").is_file()


def test_every_problem_file_has_a_name() -> None:
    names = problem_names()
    assert len(names) == len(list((CONFIGS / "problem").rglob("*.yaml")))
    assert {"cage/t_4", "contact_trajectory/block_slide_one_finger", "certified_grasp/t"} <= set(names)
    assert all(located(f"shipped:{name}").is_file() for name in names)


def test_a_shipped_name_is_its_file_wherever_the_reader_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert read_problem(located("shipped:cage/i_given")).kind == "cage"


def test_other_names_are_paths() -> None:
    assert located("problem.yaml") == Path("problem.yaml")


@pytest.mark.parametrize("name", ["shipped:cage/t_44", "shipped:../train", "shipped:"])
def test_an_unknown_name_is_refused(name: str) -> None:
    with pytest.raises(InvalidProblem, match="expected shipped: and one of"):
        located(name)
