"""Real mp4 files of rendered tasks in, actions out; what the object then does in the simulator is held against the truth."""

from pathlib import Path

import numpy as np
import pytest

from datasets.specification import Sample
from dlm.infer import Clip, Given, Inference, infer, read_clip
from dlm.simulator.replay import replay
from dlm.tasks import TaskBatch
from expert.errors import InvalidProblem
from expert.files import read_solution
from expert.files.document import save
from expert.verify.plan.check import check_plan
from tests.support.clips import SCALE, drawn, write_clip

KNOWN = Given(scale=SCALE)


@pytest.fixture(scope="module")
def clips(tasks: TaskBatch, tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Sample, Path]]:
    folder = tmp_path_factory.mktemp("clips")
    return [
        (s, write_clip(folder / f"{s.index}.mp4", drawn(s.task.body.vertices, s.task.trajectory.poses)))
        for s in tasks.samples
    ]


@pytest.fixture(scope="module")
def answers(clips: list[tuple[Sample, Path]]) -> list[Inference]:
    return [infer(path, KNOWN) for _, path in clips]


def test_actions_from_a_compressed_video_move_the_true_object(
    clips: list[tuple[Sample, Path]], answers: list[Inference]
) -> None:
    for (sample, _), answer in zip(clips, answers, strict=True):
        truth = sample.task.trajectory.poses
        error = np.abs(answer.planned.perceived.poses - truth).max(axis=0)
        assert np.all(error < [0.3e-3, 0.3e-3, np.deg2rad(0.5)]), sample.family
        assert answer.status == "planned"
        assert answer.follows
        assert answer.plan is not None
        mm, deg = replay(sample.task, answer.plan.positions, answer.plan.forces).final_error
        assert mm < 2, sample.family
        assert deg < 2, sample.family


def test_actions_are_a_solution_file_that_the_checker_finds_sound(
    answers: list[Inference], tmp_path: Path
) -> None:
    for answer in answers:
        save(tmp_path / "actions.json", answer.solution())
        solution = read_solution(tmp_path / "actions.json")
        assert answer.plan is not None
        np.testing.assert_array_equal(solution.answer.positions, answer.plan.positions)
        assert check_plan(solution.problem.task, solution.answer).verdict == "sound"


def test_the_expert_plans_for_what_was_perceived(clips: list[tuple[Sample, Path]]) -> None:
    answer = infer(clips[0][1], KNOWN, refine="expert")
    assert answer.plan is not None
    assert answer.plan.status == "optimal"
    assert answer.follows


def test_a_known_size_gives_the_scale(clips: list[tuple[Sample, Path]], answers: list[Inference]) -> None:
    (sample, path), known = clips[0], answers[0]
    answer = infer(path, Given(object_size=sample.task.body.size))
    assert answer.view.scale == pytest.approx(SCALE, rel=0.02)  # as well as a compressed outline is seen
    np.testing.assert_allclose(answer.planned.perceived.poses, known.planned.perceived.poses, atol=2e-3)


def test_more_or_fewer_frames_than_steps_are_resampled(tasks: TaskBatch, tmp_path: Path) -> None:
    """At constant velocity between two poses, in 21 frames, and in 3 of them."""
    task = tasks.samples[2].task
    times = np.linspace(0, 1, 21)[:, None]
    first, last = task.trajectory.poses[[0, -1]]
    path = write_clip(tmp_path / "dense.mp4", drawn(task.body.vertices, first + times * (last - first)), 50.0)
    dense = read_clip(path, steps=5)
    assert dense.times == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])
    few = Clip(frames=dense.frames[[0, 1, 4]], times=dense.times[[0, 1, 4]])
    for clip in (dense, few):
        seen = infer(clip, KNOWN).planned.perceived
        wanted = first + np.linspace(0, 1, 5)[:, None] * (last - first)
        assert np.abs(seen.poses - wanted).max() < 5e-3


@pytest.mark.parametrize(
    ("scene", "field"),
    [
        ({}, "scale: expected scale .* neither"),
        ({"scale": 0.001, "object_size": 0.1}, "both"),
        ({"scale": -1.0}, "scale: expected a positive number"),
        ({"scale": 0.001, "duration": 0.0}, "duration"),
        (
            {"scale": 0.001, "mass": -1.0},
            "mass: expected a positive number of kilograms, at most 1000000, got -1.0",
        ),
        ({"scale": 0.001, "friction": 0.0}, "friction: expected a positive number, at most 100, got 0.0"),
        ({"scale": 0.001, "floor": float("nan")}, "floor: expected a number of pixels, got nan"),
        ({"scale": "1 mm"}, "scale: expected a positive number of metres per pixel, .* got '1 mm'"),
    ],
)
def test_a_scene_says_what_a_video_cannot(scene: dict[str, float], field: str) -> None:
    with pytest.raises(InvalidProblem, match=field):
        Given(**scene)


def test_frames_without_their_times_are_no_clip(tasks: TaskBatch) -> None:
    with pytest.raises(
        InvalidProblem, match=r"video: expected a file, or Clip\(frames=..., times=...\), got ndarray"
    ):
        infer(tasks.samples[0].video, KNOWN)  # type: ignore[arg-type]
