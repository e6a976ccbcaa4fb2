"""Real mp4 files of rendered tasks in, actions out; what the object then does in the simulator is held against the truth."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from datasets.render import Palette, render
from datasets.specification import Sample
from dlm.infer import Clip, Given, Inference, Segmentation, VideoFile, infer, read_clip
from dlm.infer.drawing import draw_inference
from dlm.infer.view import find_floor, view_of
from dlm.simulator.replay import replay
from dlm.tasks import TaskBatch
from expert.errors import InvalidProblem
from expert.files import read_solution
from expert.files.document import save
from expert.verify.plan.check import check_plan
from tests.support.clips import CAMERA, SCALE, SIZE, drawn, write_clip

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


def test_frames_are_taken_at_equally_spaced_times(tmp_path: Path) -> None:
    grey = np.arange(0, 210, 10, dtype=np.uint8)
    frames = np.broadcast_to(grey[:, None, None, None], (21, 32, 48, 3))
    path = write_clip(tmp_path / "grey.mp4", frames, rate=20.0)
    clip = read_clip(path, steps=5)
    assert clip.times.tolist() == pytest.approx([0, 0.25, 0.5, 0.75, 1.0])
    np.testing.assert_allclose(clip.frames.mean(axis=(1, 2, 3)), grey[::5], atol=4.5)
    part = read_clip(VideoFile(path=path, start=0.5, end=0.7), steps=3)
    np.testing.assert_allclose(part.frames.mean(axis=(1, 2, 3)), [100, 120, 140], atol=4.5)
    assert read_clip(VideoFile(path=path, rate=10.0), steps=5).duration == pytest.approx(2.0)


def test_a_wide_video_is_cut_to_the_motion(tasks: TaskBatch) -> None:
    sample = tasks.samples[1]
    frames = drawn(sample.task.body.vertices, sample.task.trajectory.poses)
    wide = np.concatenate([np.repeat(frames[:, :, :1], 200, axis=2), frames], axis=2)
    view = view_of(wide, scale=SCALE, floor=180.0, extent=28.0)
    assert view.camera.size < 80
    answer = infer(Clip(frames=wide, times=0.1 * np.arange(5)), KNOWN)
    poses = answer.planned.perceived.poses - [
        0.1,
        0,
        0,
    ]  # the middle of the picture is 100 pixels further left
    assert np.abs(poses - sample.task.trajectory.poses).max() < 5e-3


def test_the_floor_is_found_to_a_part_of_a_pixel(tasks: TaskBatch) -> None:
    sample = tasks.samples[0]
    for below in (0.0203, 0.0207):
        camera = replace(CAMERA, below=below)
        frames = render(sample.task.body.vertices, sample.task.trajectory.poses, camera)
        assert find_floor(frames) == pytest.approx(SIZE - below / SCALE, abs=0.05)
    assert find_floor(np.full((2, 50, 50, 3), 200, dtype=np.uint8)) is None


def test_a_floor_that_cannot_be_seen_is_where_the_object_stands(tasks: TaskBatch) -> None:
    sample, plain = tasks.samples[0], Palette(ground=Palette().background)
    frames = drawn(sample.task.body.vertices, sample.task.trajectory.poses, plain)
    answer = infer(Clip(frames=frames, times=0.1 * np.arange(5)), KNOWN)
    assert answer.view.floor == pytest.approx(180, abs=2)
    assert answer.follows


@pytest.mark.parametrize("way", ["colour", "background"])
def test_an_object_before_a_patterned_wall_is_told_apart(tasks: TaskBatch, tmp_path: Path, way: str) -> None:
    sample = tasks.samples[0]
    rng = np.random.default_rng(0)
    pattern = np.kron(rng.integers(40, 220, (20, 20, 1)), np.ones((10, 10, 3))).astype(np.uint8)
    pattern[180:] = (60, 80, 100)
    frames = drawn(sample.task.body.vertices, sample.task.trajectory.poses)
    empty = drawn(sample.task.body.vertices, sample.task.trajectory.poses + [0, 5, 0])
    inside = np.linalg.norm(frames.astype(float) - empty, axis=-1, keepdims=True) > 40
    clip = Clip(frames=np.where(inside, frames, pattern), times=0.1 * np.arange(5))
    Image.fromarray(pattern).save(tmp_path / "empty.png")
    told = (
        Segmentation(colour=Palette().object)
        if way == "colour"
        else Segmentation(background=tmp_path / "empty.png")
    )
    answer = infer(clip, replace(KNOWN, floor=180.0), segmentation=told)
    error = np.abs(answer.planned.perceived.poses - sample.task.trajectory.poses).max(axis=0)
    assert np.all(error < [1e-3, 1e-3, np.deg2rad(1.5)])
    assert answer.follows


def test_the_animation_shows_video_and_simulation(answers: list[Inference], tmp_path: Path) -> None:
    draw_inference(answers[2], tmp_path / "motion.gif")
    with Image.open(tmp_path / "motion.gif") as film:
        assert film.n_frames == 41
        film.seek(0)
        first = np.array(film.convert("RGB")).astype(int)
        film.seek(40)
        last = np.array(film.convert("RGB")).astype(int)
    for half in (slice(0, 420), slice(420, 840)):  # both the video and the simulated object move
        assert (np.abs(first[:, half] - last[:, half]).max(axis=-1) > 60).sum() > 500


@pytest.mark.parametrize(
    ("scene", "field"),
    [
        ({}, "scale: expected scale .* neither"),
        ({"scale": 0.001, "object_size": 0.1}, "both"),
        ({"scale": -1.0}, "scale: expected a positive number"),
        ({"scale": 0.001, "duration": 0.0}, "duration"),
    ],
)
def test_a_scene_says_what_a_video_cannot(scene: dict[str, float], field: str) -> None:
    with pytest.raises(InvalidProblem, match=field):
        Given(**scene)


def test_a_segmentation_takes_one_way(tmp_path: Path) -> None:
    with pytest.raises(InvalidProblem, match="both"):
        Segmentation(colour=(1, 2, 3), background="x.png")
    with pytest.raises(InvalidProblem, match="three integers"):
        Segmentation(colour=(1, 2, 300))
    with pytest.raises(InvalidProblem, match="a picture"):
        Segmentation(background=tmp_path / "none.png").mask(np.zeros((2, 9, 9, 3), dtype=np.uint8))
