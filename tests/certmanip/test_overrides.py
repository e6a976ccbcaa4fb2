"""One grammar for all commands, and what Hydra makes of it."""

from collections.abc import Callable

import pytest
from omegaconf import DictConfig

from certmanip.commands import COMMANDS
from certmanip.overrides import overrides, quoted
from expert.errors import InvalidProblem


def test_words_become_overrides() -> None:
    words = ["clip.mp4", "--scale", "0.001", "--mass=0.2", "-o", "my clip", "friction=1", "--cfg", "job"]
    assert overrides(COMMANDS["infer"], words) == [
        "video=clip.mp4", "scale=0.001", "mass=0.2", "out='my clip'", "friction=1", "--cfg", "job",
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["a b.mp4", "a=b,c.mp4", "it's {1}.mp4", "[x](y).mp4", "plain/name-1.mp4"])
def test_hydra_reads_any_file_s_name_as_it_is(name: str, composed: Callable[..., DictConfig]) -> None:
    assert composed("infer", *overrides(COMMANDS["infer"], [name])).video == name


def test_hydra_understands_sections_lists_and_groups(composed: Callable[..., DictConfig]) -> None:
    words = ["--stage", "mdr", "--schedule.iterations", "7", "--seeds", "[0,1]", "-o", "elsewhere"]
    read = composed("train", *overrides(COMMANDS["train"], words))
    assert (read.schedule.iterations, list(read.seeds), read.output) == (7, [0, 1], "elsewhere")
    assert list(read.stages) == ["mdr"]


def test_a_data_set_is_named_first(composed: Callable[..., DictConfig]) -> None:
    read = composed("generate", *overrides(COMMANDS["generate"], ["smoke", "--jobs", "1"]))
    assert (read.dataset.name, read.jobs) == ("smoke", 1)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [(["--scal", "1"], r"did you mean --scale\?"), (["--scale"], "--scale: expected a value"), (["-o"], "-o: expected")],
)  # fmt: skip
def test_wrong_words_are_refused(words: list[str], complaint: str) -> None:
    with pytest.raises(InvalidProblem, match=complaint):
        overrides(COMMANDS["infer"], words)


def test_plain_names_need_no_quotes() -> None:
    assert quoted("data/smoke-seed0") == "data/smoke-seed0"
