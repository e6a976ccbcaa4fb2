"""Real mp4 files of rendered tasks in, actions out; what the object then does in the simulator is held against the truth."""

import re
from pathlib import Path

import numpy as np
import pytest
import shapely

from datasets.render import Colour, Frames, Palette
from datasets.specification import Sample
from dlm.infer import Clip, Given, Inference, infer, read_clip
from dlm.simulator.replay import replay
from dlm.tasks import TaskBatch
from expert.errors import InvalidProblem
from expert.files import read_solution
from expert.files.document import save
from expert.verify.plan.check import check_plan
from tests.support.clips import SCALE, drawn, with_discs, with_fingers, write_clip

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


def clip_of(frames: Frames) -> Clip:
    return Clip(frames=frames, times=0.1 * np.arange(len(frames)))


def plain_video(sample: Sample) -> Frames:
    return drawn(sample.task.body.vertices, sample.task.trajectory.poses)


def assert_follows_truth(answer: Inference, sample: Sample, within: float = 0.1) -> None:
    """Planned, for the very motion, to so many mm and degrees."""
    error = np.abs(answer.planned.perceived.poses - sample.task.trajectory.poses).max(axis=0)
    assert answer.status == "planned", answer.reason
    assert np.all(error < [1e-3 * within, 1e-3 * within, np.deg2rad(within)])


BESIDE: dict[str, tuple[slice, slice]] = {
    "strip at the left edge": (slice(None), slice(0, 12)),
    "strip at the top": (slice(0, 14), slice(None)),
    "strip at the bottom": (slice(196, None), slice(None)),
    "patch": (slice(20, 50), slice(150, 190)),
}


@pytest.mark.parametrize(
    "colour", [Palette().object, (40, 120, 200), (20, 20, 20)], ids=["own", "blue", "black"]
)
@pytest.mark.parametrize("where", BESIDE)
def test_what_stands_still_beside_the_object_is_not_taken_for_it(
    where: str, colour: Colour, tasks: TaskBatch
) -> None:
    sample = tasks.samples[2]
    frames = plain_video(sample)
    frames[:, *BESIDE[where]] = colour
    assert_follows_truth(infer(clip_of(frames), KNOWN), sample)


@pytest.mark.parametrize("colour", [(200, 60, 40), (40, 100, 200), (20, 20, 20)])
@pytest.mark.parametrize("where", ["strip at the top", "strip at the bottom"])
def test_strips_of_wide_pictures_are_not_taken_for_the_floor_or_the_object(
    where: str, colour: Colour, tasks: TaskBatch
) -> None:
    """A pale object, from whose colour the strip's is further than its own is from the wall's."""
    sample = tasks.samples[2]
    pale = Palette(background=(200, 200, 195), object=(170, 150, 140), ground=(90, 100, 110))
    frames = np.pad(
        drawn(sample.task.body.vertices, sample.task.trajectory.poses, pale),
        [(0, 0), (0, 0), (120, 120), (0, 0)],
        "edge",
    )
    frames[:, *BESIDE[where]] = colour
    assert_follows_truth(infer(clip_of(frames), KNOWN), sample)


@pytest.mark.parametrize("k", range(4))
@pytest.mark.parametrize("colour", [(40, 40, 40), (50, 90, 200)])
def test_fingers_that_move_along_are_no_part_of_the_object(k: int, colour: Colour, tasks: TaskBatch) -> None:
    sample = tasks.samples[k]
    answer = infer(clip_of(with_fingers(sample, colour)), KNOWN)
    assert_follows_truth(answer, sample, within=0.3)
    outlines = (
        shapely.Polygon(v).exterior for v in (answer.planned.perceived.vertices, sample.task.body.vertices)
    )
    # A finger would stand out by 8 mm; what one hides in every frame may be anything.
    assert shapely.hausdorff_distance(*outlines) < 3e-3


def test_something_else_that_moves_is_not_taken_for_the_object(tasks: TaskBatch) -> None:
    sample = tasks.samples[0]
    path = np.column_stack([np.linspace(30, 60, 5), np.full(5, 40.0)])
    for colour in ((40, 40, 40), (150, 200, 150)):
        frames = with_discs(plain_video(sample), path, colour, radius=9.0)
        assert_follows_truth(infer(clip_of(frames), KNOWN), sample)


@pytest.mark.parametrize("amplitude", [1, 3])
@pytest.mark.parametrize("k", [0, 2])
def test_a_shaking_camera_is_a_poor_fit_and_said_so(k: int, amplitude: int, tasks: TaskBatch) -> None:
    frames = plain_video(tasks.samples[k])
    for t, way in enumerate((0, 1, -1, 1, -1)):
        frames[t] = np.roll(frames[t], amplitude * way, axis=0)
    answer = infer(clip_of(frames), KNOWN)
    assert answer.status == "poor_fit"
    assert re.search(r"the camera moves, by up to \d|along the outline", answer.reason)
