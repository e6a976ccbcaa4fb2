"""What a command says and leaves with, whatever its job raises."""

import sys
from pathlib import Path

import pytest
from omegaconf import DictConfig

from datasets.entry import entry_point, swept
from expert.errors import InvalidProblem, SolverFailed

WRONG = InvalidProblem("mass", expected="a positive number", got="-1\nor so")


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (WRONG, 2, "error: mass: expected a positive number, got -1 or so\n"),
        (SolverFailed("no\nanswer"), 1, "error: no answer\n"),
        (KeyboardInterrupt(), 130, ""),
    ],
)
def test_expected_errors_are_one_line_and_a_telling_code(
    error: BaseException,
    code: int,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    @entry_point("generate")
    def main(cfg: DictConfig) -> None:
        raise error

    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    monkeypatch.setattr(sys, "argv", ["generate.py"])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == code
    assert capsys.readouterr().err == said


def test_a_defect_of_ours_keeps_its_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    @entry_point("generate")
    def main(cfg: DictConfig) -> None:
        raise ZeroDivisionError

    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    monkeypatch.setattr(sys, "argv", ["generate.py"])
    with pytest.raises(ZeroDivisionError):
        main()


def test_the_job_gets_the_configuration_with_its_overrides(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []

    @entry_point("generate")
    def main(cfg: DictConfig) -> None:
        seen.append(cfg.seed)

    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    monkeypatch.setattr(sys, "argv", ["generate.py", "seed=7"])
    main()
    assert seen == [7]


@pytest.mark.parametrize(
    ("named", "parts"),
    [
        (
            (),
            [
                "dataset.count=2,seed=0",
                "dataset.count=2,seed=1",
                "dataset.count=3,seed=0",
                "dataset.count=3,seed=1",
            ],
        ),
        (("seed",), ["dataset.count=2", "dataset.count=2", "dataset.count=3", "dataset.count=3"]),
        (("seed", "dataset.count"), [""] * 4),
    ],
)
def test_jobs_of_a_multirun_are_told_apart_by_what_is_swept(
    named: tuple[str, ...], parts: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    found: list[str] = []

    @entry_point("generate")
    def main(cfg: DictConfig) -> None:
        found.append(swept(*named))

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    monkeypatch.setattr(sys, "argv", ["generate.py", "-m", "dataset.count=2,3", "seed=0,1", "jobs=1"])
    main()
    assert found == parts
    monkeypatch.setattr(sys, "argv", ["generate.py", "dataset.count=2"])
    main()
    assert found[-1] == ""
