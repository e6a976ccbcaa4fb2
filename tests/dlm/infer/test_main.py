"""`python -m dlm.infer` as a user runs it: what it writes, and everything that can be wrong with a video."""

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dlm.infer.__main__ import main
from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.inverse_dynamics.parameters import Layout
from dlm.simulator.__main__ import main as simulate
from dlm.tasks import TaskBatch
from dlm.thesis.derender import NetworkSizes
from dlm.thesis.losses import ParameterLoss
from dlm.thesis.policies import ThesisArchitecture
from dlm.training.loop import Record, Training
from dlm.training.stage import Schedule, Stage
from expert.__main__ import main as expert
from tests.support.clips import drawn, write_clip


@pytest.fixture(scope="module")
def folder(tasks: TaskBatch, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Good and bad clips."""
    folder = tmp_path_factory.mktemp("videos")
    task = tasks.samples[0].task
    good = drawn(task.body.vertices, task.trajectory.poses)
    aside = task.trajectory.poses * [0, 1, 0]
    left, right = (drawn(0.6 * task.body.vertices, aside + [x, 0, 0]) for x in (-0.05, 0.05))
    empty = drawn(task.body.vertices, aside + [0, 5, 0])
    leaving = drawn(task.body.vertices, aside + np.linspace(0, 0.12, 5)[:, None] * [1, 0, 0])
    write_clip(folder / "good.mp4", good)
    write_clip(folder / "one frame.mp4", good[:1])
    write_clip(folder / "background.mp4", empty)
    write_clip(folder / "leaves.mp4", leaving)
    write_clip(folder / "vanishes.mp4", np.concatenate([good[:3], empty[:2]]))
    two = np.where(np.abs(left.astype(int) - empty).max(-1, keepdims=True) > 40, left, right)
    write_clip(folder / "two.mp4", two)
    (folder / "text.mp4").write_text("not a video\n" * 100)
    (folder / "empty.mp4").write_bytes(b"")
    small = NetworkSizes(channels=(2, 3, 4), latent=8, recurrent_layers=1, hidden_layers=1)
    policy = ThesisArchitecture(sizes=small, layout=Layout()).build("perceptron", InverseDynamics(), seed=0)
    stage = Stage(name="nn", policy="perceptron", loss=ParameterLoss(), dataset="train")
    training = Training(policy, stage.loss, tasks, Schedule())
    record = Record(path=folder / "thesis.safetensors", stage=stage, model="thesis", settings={})
    training.checkpoint(record).save(record.path)
    whole = (folder / "good.mp4").read_bytes()
    (folder / "cut.mp4").write_bytes(whole[: len(whole) // 2])
    return folder


@pytest.fixture
def run(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Callable[..., tuple[object, str, str]]:
    """The command in `folder`: exit code, stdout, stderr (of the process, libraries included)."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")

    def run(*arguments: str) -> tuple[object, str, str]:
        monkeypatch.setattr(sys, "argv", ["infer", *arguments])
        code: object = 0
        try:
            main()
        except SystemExit as exit_:
            code = exit_.code
        return code, *capfd.readouterr()

    return run


def test_a_video_becomes_actions_that_others_can_read(
    run: Callable[..., tuple[object, str, str]], folder: Path
) -> None:
    code, said, errors = run("video=good.mp4", "scale=0.001", "mass=0.2")
    assert (code, errors) == (0, "")
    assert re.search(r"simulated: ends 0\.\d+ mm", said)
    out = folder / "outputs" / "infer" / "good"
    assert json.loads((out / "actions.json").read_text())["problem"]["object"]["mass"] == 0.2
    assert expert(["verify", str(out / "actions.json")]) == 0
    assert expert(["draw", str(out / "actions.json"), "-o", str(folder / "plan.png")]) == 0
    assert simulate([str(out / "actions.json")]) == 0
    assert (out / "motion.gif").stat().st_size > 10_000


GOOD = ["video=good.mp4", "scale=0.001"]


def test_the_shipped_weights_find_a_plan_too(
    run: Callable[..., tuple[object, str, str]], folder: Path
) -> None:
    code, said, errors = run(*GOOD, "checkpoint=shipped", "out=shipped")
    assert (code, errors) == (0, "")
    assert re.search(r"simulated: ends [01]\.\d+ mm", said)


WRONG = {
    "no video": ([], "video"),
    "no such file": (["video=none.mp4", "scale=0.001"], "video: expected a file, got none.mp4"),
    "not a video": (["video=text.mp4", "scale=0.001"], "video: expected a file that OpenCV can decode"),
    "an empty file": (["video=empty.mp4", "scale=0.001"], "video: expected a file that OpenCV can decode"),
    "half a file": (["video=cut.mp4", "scale=0.001"], "video: expected"),
    "one frame": (["video='one frame.mp4'", "scale=0.001"], "video: expected at least 2 frames, got 1"),
    "background": (["video=background.mp4", "scale=0.001"], "video: expected an object .* background only"),
    "two objects": (["video=two.mp4", "scale=0.001"], "video: expected one object, got 2"),
    "leaves": (["video=leaves.mp4", "scale=0.001"], "video: expected the whole object .* leaves frame"),
    "vanishes": (["video=vanishes.mp4", "scale=0.001"], "video: expected .* frame 3"),
    "no scale": (["video=good.mp4"], "scale: expected scale .* or object_size"),
    "scale is no number": (["video=good.mp4", "scale=big"], "scale"),
    "floor elsewhere": (["video=good.mp4", "scale=0.001", "floor=900"], "floor: expected a row"),
    "late": (["video=good.mp4", "scale=0.001", "start=7"], "start: expected a time before the end"),
    "too long": (["video=good.mp4", "scale=0.001", "end=7"], "end: expected a time within the clip"),
    "no mass": (["video=good.mp4", "scale=0.001", "mass=-1"], "mass: expected a positive number"),
    "refine": (["video=good.mp4", "scale=0.001", "refine=magic"], "refine: expected expert"),
    "unknown option": (["video=good.mp4", "metres=1"], "metres"),
    "out is a file": (["video=good.mp4", "scale=0.001", "out=text.mp4"], "out: expected a folder"),
    "no weights": ([*GOOD, "checkpoint=none.safetensors"], "checkpoint: expected the file none.safetensors"),
    "no safetensors": ([*GOOD, "checkpoint=text.mp4"], "text.mp4: expected a whole checkpoint"),
    "another model": ([*GOOD, "checkpoint=thesis.safetensors"], "expected weights of model structured, got .* thesis"),
    "no background": (["video=good.mp4", "scale=0.001", "background=none.png"], "background: expected a picture"),
}  # fmt: skip


def contents(folder: Path) -> dict[Path, int]:
    """Everything that is there, and when files were written; a folder's own time tells that a place was tried out."""
    return {p: p.stat().st_mtime_ns if p.is_file() else 0 for p in folder.rglob("*")}


@pytest.mark.parametrize("name", WRONG)
def test_bad_input_gets_one_line_and_code_2_and_writes_nothing(
    name: str, run: Callable[..., tuple[object, str, str]], folder: Path
) -> None:
    arguments, words = WRONG[name]
    before = contents(folder)
    code, said, errors = run(*arguments)
    assert (code, said) == (2, "")
    assert re.fullmatch(r"error: [^\n]+\n", errors)
    assert re.search(words, errors), errors
    assert contents(folder) == before
