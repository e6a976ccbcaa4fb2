"""From videos to polygons and poses, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from datasets.disturb import DISTURBANCES, noisy
from datasets.motions import FAMILIES, sample_task
from datasets.render import Camera, Frames, render
from datasets.shapes import Shapes
from datasets.shapes_omnipush import OmniPush
from datasets.specification import generator
from dlm.perception import Perceived, PerceptionSettings, perceive
from expert.errors import InvalidProblem
from expert.geometry.polygon import mass_properties, signed_area, simple_polygon
from expert.geometry.pose import to_world
from expert.mechanics import external_contacts
from expert.problems.contact import ContactTask
from expert.world.motion import Trajectory
from expert.world.shape import Body
from tests.support.mujoco_video import mujoco_videos
from tests.support.videos import LEANING, PATH, errors, task_of, video_of


def perceived_task(seen: Perceived, task: ContactTask) -> ContactTask:
    body, _ = Body.uniform(seen.vertices, task.body.mass)
    return replace(task, body=body, trajectory=Trajectory.of(seen.poses, task.trajectory.dt, "rest"))


def test_turns_run_on_from_step_to_step_where_the_fit_ends_a_whole_turn_away() -> None:
    """Here the last two frames' alignment, with something in front of the object, ends one turn too far."""
    family = list(FAMILIES)[15 % len(FAMILIES)]
    task = sample_task(generator("perception12", 0, 15, 0), family, Shapes(facets=(12, 12)))
    seen = perceive(DISTURBANCES["occlusion"](video_of(task), np.random.default_rng([15, 17])))
    assert seen.status == "ok"
    np.testing.assert_allclose(seen.poses, task.trajectory.poses, atol=np.radians(0.5))


@pytest.mark.parametrize("family", FAMILIES)
def test_labels_are_found_in_clean_videos(family: str) -> None:
    """In their order and frame: the very vertices, and the same floor contacts with the same directions."""
    task = task_of(family)
    seen = perceive(video_of(task))
    assert seen.status == "ok"
    angle, position, outline = errors(seen, task.body.vertices, task.trajectory.poses)
    assert angle < 0.4
    assert position < 0.15
    assert outline < 0.4
    assert seen.vertices.shape == task.body.vertices.shape
    assert np.abs(seen.vertices - task.body.vertices).max() < 5e-4
    assert seen.poses[0, 2] == 0
    contacts = [
        [(c.step, c.vertex, *np.sign(np.round(c.rays[:, 0], 9))) for c in external_contacts(t)]
        for t in (task, perceived_task(seen, task))
    ]
    assert contacts[0] == contacts[1]


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32), family=st.sampled_from(list(FAMILIES)), facets=st.sampled_from([5, 12]))
def test_answers_are_centred_simple_and_above_the_floor(seed: int, family: str, facets: int) -> None:
    task = task_of(family, Shapes(facets=(facets, facets)), seed)
    seen = perceive(noisy(video_of(task), 10, np.random.default_rng(seed)))
    assert np.array_equal(simple_polygon(seen.vertices, field="seen"), seen.vertices)
    assert signed_area(seen.vertices) > 0
    assert np.abs(mass_properties(seen.vertices).centroid).max() < 1e-9
    assert to_world(seen.poses, seen.vertices)[..., 1].min() > -1e-8
    perceived_task(seen, task)  # would refuse an object inside the floor


@pytest.mark.parametrize("name", [n for n in DISTURBANCES if n != "clean"])
def test_disturbances_cost_little(name: str) -> None:
    task = task_of("pivot_lift", seed=4)
    video = DISTURBANCES[name](video_of(task), np.random.default_rng(2))
    seen = perceive(video, settings=PerceptionSettings(blur=1.0 if name.startswith("blur") else 0.0))
    angle, position, outline = errors(seen, task.body.vertices, task.trajectory.poses)
    assert seen.status == "ok"
    assert angle < 1
    assert position < 0.5
    assert outline < 1


def test_blur_that_is_not_modelled_rounds_the_corners() -> None:
    task = task_of("lift", seed=3)
    video = DISTURBANCES["blur 1"](video_of(task), np.random.default_rng(0))
    known, unknown = (perceive(video, settings=PerceptionSettings(blur=blur)) for blur in (1.0, 0.0))
    truth = task.body.vertices, task.trajectory.poses
    assert errors(known, *truth)[2] < 0.5 * errors(unknown, *truth)[2]


def test_objects_of_four_sides_are_seen_whether_convex_or_not() -> None:
    poses = []
    for seed in range(6):
        task = task_of(list(FAMILIES)[seed], OmniPush(), seed)
        seen = perceive(video_of(task))
        angle, position, _ = errors(seen, task.body.vertices, task.trajectory.poses)
        poses.append(angle < 0.5 and position < 0.3)
        assert poses[-1] or seen.status != "ok"
    assert sum(poses) >= 5


def test_without_a_floor_nothing_is_snapped() -> None:
    """Seen from above: the floor's line is moved out of view."""
    camera = Camera(below=0.0)
    high = PATH + [0.0, 0.03, 0.0]
    seen = perceive(render(LEANING, high, camera), camera, PerceptionSettings(floor=False))
    angle, position, _ = errors(seen, LEANING, high)
    assert angle < 0.5
    assert position < 0.15


def test_finer_cameras_see_more_exactly() -> None:
    camera = Camera(size=100, scale=0.002)
    seen = perceive(render(LEANING, PATH, camera), camera)
    angle, position, outline = errors(seen, LEANING, PATH)
    assert angle < 0.15
    assert position < 0.06
    assert outline < 0.15


@pytest.mark.parametrize("perspective", [False, True])
def test_videos_of_another_engine_are_understood(perspective: bool) -> None:
    tasks = [task_of(family, seed=7) for family in ("pivot", "lift_rotate")]
    scenes = [(t.body.vertices, t.trajectory.poses) for t in tasks]
    videos = mujoco_videos(scenes, Camera(), perspective=perspective)
    if videos is None:
        pytest.skip("MuJoCo cannot draw without a screen here")
    for scene, video in zip(scenes, videos, strict=True):
        assert video.std() > 5
        angle, position, outline = errors(perceive(video), *scene)
        assert angle < 0.4
        assert position < 0.2
        assert outline < 0.4


def two_objects() -> Frames:
    video, other = render(LEANING / 2, PATH - [0.03, 0, 0]), render(LEANING / 2, PATH + [0.03, 0.05, 0])
    background = render(LEANING, PATH + [0, 5, 0])
    return np.where(other == background, video, other)


BAD = {
    "empty": (np.zeros((0, 50, 50, 3), np.uint8), "at least 2 frames, got 0"),
    "single frame": (render(LEANING, PATH[:1]), "at least 2 frames, got 1"),
    "background": (render(LEANING, PATH + [0, 5, 0]), "got background only"),
    "one colour": (np.full((5, 50, 50, 3), 90, np.uint8), "got background only"),
    "all object": (render(LEANING * 50, PATH), ""),
    "noise alone": (np.random.default_rng(0).integers(0, 255, (5, 50, 50, 3)).astype(np.uint8), ""),
    "several objects": (two_objects(), "one object, got 2 separate ones in frame 0"),
    "leaves at the side": (
        render(LEANING, PATH + [0.08, 0, 0]),
        "inside every frame, got one that leaves frame",
    ),
    "leaves at the top": (
        render(LEANING, PATH + [0, 0.1, 0]),
        "inside every frame, got one that leaves frame",
    ),
    "gone in the end": (
        np.concatenate([render(LEANING, PATH[:4]), render(LEANING, PATH[4:] + [0, 5, 0])]),
        "got background only in frame 4",
    ),
    "nan": (np.full((5, 50, 50, 3), np.nan), "uint8 grey levels from 0 to 255, got float64 with nan or inf"),
    "floats": (np.zeros((5, 50, 50, 3)), "uint8 grey levels from 0 to 255, got float64"),
    "grey": (np.zeros((5, 50, 50), np.uint8), r"an array \(T, height, width, 3\), got shape \(5, 50, 50\)"),
    "a list": ([[1]], r"an array \(T, height, width, 3\), got list"),
    "another size": (
        np.zeros((5, 40, 60, 3), np.uint8),
        "frames of 50 x 50 pixels as the camera's, got 60 x 40",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_videos_are_refused_in_one_line(name: str) -> None:
    video, message = BAD[name]
    with pytest.raises(InvalidProblem, match=f"^video: expected .*{message}") as refusal:
        perceive(video)
    assert "\n" not in str(refusal.value)
    assert refusal.value.remedy
