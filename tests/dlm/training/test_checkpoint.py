import errno
import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from safetensors import safe_open

from dlm.training.checkpoint import (
    About,
    Checkpoint,
    load,
    optimiser_tensors,
    read_about,
    restore_optimiser,
    restore_weights,
)
from expert.errors import InvalidProblem

COMMAND = "python train.py stage=mdr"


@pytest.fixture
def saved() -> Checkpoint:
    model = torch.nn.Linear(3, 2)
    optimiser = torch.optim.Adam(model.parameters())
    model(torch.ones(1, 3)).sum().backward()
    optimiser.step()
    about = About(
        stage="mdr",
        model="thesis",
        iteration=7,
        settings={"seed": 3, "schedule": {"learning_rate": 1e-4}},
        data="abc",
        history=[{"iteration": 1.0, "loss": 0.1 + 0.2}],
    )
    return Checkpoint(
        about=about,
        model=model.state_dict(),
        optimiser=optimiser_tensors(optimiser),
        random=torch.get_rng_state(),
    )


def test_a_checkpoint_comes_back_bit_by_bit(saved: Checkpoint, tmp_path: Path) -> None:
    path = tmp_path / "deep" / "mdr.safetensors"
    saved.save(path)
    found = load(path, command=COMMAND)
    assert found.about == saved.about
    for part in ("model", "optimiser"):
        before, after = getattr(saved, part), getattr(found, part)
        assert before.keys() == after.keys()
        assert all(torch.equal(before[k], after[k]) for k in before)
    assert torch.equal(found.random, saved.random)


def test_the_header_says_what_made_it(saved: Checkpoint, tmp_path: Path) -> None:
    saved.save(tmp_path / "x.safetensors")
    with safe_open(tmp_path / "x.safetensors", framework="pt") as file:
        about = json.loads(file.metadata()["about"])
    assert about["settings"]["seed"] == 3
    assert about["data"] == "abc"
    assert about["versions"]["torch"] == torch.__version__


def test_an_optimiser_goes_on_as_if_it_had_never_stopped() -> None:
    def steps(model: torch.nn.Module, optimiser: torch.optim.Optimizer, count: int) -> None:
        for k in range(count):
            optimiser.zero_grad()
            (model(torch.full((1, 3), float(k + 1))) ** 2).sum().backward()
            optimiser.step()

    straight = torch.nn.Linear(3, 2)
    stopped = torch.nn.Linear(3, 2)
    stopped.load_state_dict(straight.state_dict())
    one, two = torch.optim.Adam(straight.parameters()), torch.optim.Adam(stopped.parameters())
    steps(straight, one, 3)
    steps(stopped, two, 3)
    fresh = torch.optim.Adam(stopped.parameters())
    restore_optimiser(fresh, optimiser_tensors(two))
    steps(straight, one, 2)
    steps(stopped, fresh, 2)
    assert torch.equal(straight.weight, stopped.weight)


def test_a_missing_checkpoint_names_the_command_that_makes_it(tmp_path: Path) -> None:
    with pytest.raises(InvalidProblem, match=r"make it with: python train\.py stage=mdr"):
        load(tmp_path / "mdr.safetensors", command=COMMAND)


@pytest.mark.parametrize("keep", [0, 5, 100, 1000])
def test_a_truncated_checkpoint_is_refused(saved: Checkpoint, tmp_path: Path, keep: int) -> None:
    path = tmp_path / "x.safetensors"
    saved.save(path)
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(InvalidProblem, match="expected a whole checkpoint file"):
        read_about(path, command=COMMAND)


def test_a_failed_write_leaves_the_old_file_alone(saved: Checkpoint, tmp_path: Path) -> None:
    path = tmp_path / "x.safetensors"
    saved.save(path)
    before = path.read_bytes()
    broken = Checkpoint(
        about=saved.about, model=saved.model, optimiser=saved.optimiser, random=torch.eye(2).to_sparse()
    )
    with pytest.raises(RuntimeError):
        broken.save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_weights_of_another_model_are_refused(saved: Checkpoint) -> None:
    weights = torch.nn.Linear(3, 2).state_dict()
    with pytest.raises(
        InvalidProblem, match="expected weights of model structured, got weights of model thesis"
    ):
        restore_weights(weights, saved, name="structured", source=Path("x"))
    with pytest.raises(InvalidProblem, match=r"expected weight of shape \(2, 4\), got shape \(2, 3\)"):
        restore_weights(
            {"weight": torch.zeros(2, 4), "bias": torch.zeros(2)}, saved, name="thesis", source=Path("x")
        )
    restore_weights(weights, saved, name="thesis", source=Path("x"))
    assert torch.equal(weights["weight"], saved.model["weight"])


@pytest.mark.parametrize("settings", [{"_target_": "os.system"}, {"a": [{"_target_": "subprocess.run"}]}])
def test_a_checkpoint_that_names_foreign_classes_is_refused(
    saved: Checkpoint, tmp_path: Path, settings: dict[str, object]
) -> None:
    path = tmp_path / "x.safetensors"
    replace(saved, about=replace(saved.about, settings=settings)).save(path)
    with pytest.raises(InvalidProblem, match="expected classes of dlm, got"):
        load(path, command=COMMAND)


def test_what_cannot_be_written_is_kept_elsewhere(
    saved: Checkpoint, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that is full when the work is done."""
    path, other = tmp_path / "x.safetensors", tmp_path / "elsewhere"
    saved.save(path)
    before = path.read_bytes()
    other.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(other))

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("os.replace", full)
        with pytest.raises(InvalidProblem, match=r"No space left on device.*the result is kept in"):
            saved.save(path)
    assert path.read_bytes() == before
    (kept,) = other.iterdir()
    assert load(kept, command=COMMAND).about == saved.about


def test_a_place_that_cannot_be_made_is_one_line(saved: Checkpoint, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidProblem, match=r"^output: expected a place to write, got Not a directory"):
        saved.save(tmp_path / "file" / "seed_0" / "x.safetensors")
