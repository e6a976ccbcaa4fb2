"""The object under one straight push, integrated by Heun's rule from its pose before it."""

from dataclasses import dataclass, field

import numpy as np

from expert.geometry.pose import Array, rotation, to_body, to_world
from expert.problems.push import PushProblem
from expert.verify.push.law import Support, answer, vote

TOUCHING = 1e-5
"""Distance that counts as contact, over the object's size."""
SAME_NORMAL = 0.95
"""Cosine: what touches with normals nearer than that is one contact."""


@dataclass(frozen=True)
class Touch:
    """Distance of the disc from the object, nearest point (2,) and inward normal (2,) in the object's frame; if several."""

    gap: float
    point: Array
    normal: Array
    several: bool


@dataclass
class Course:
    """Poses (3,) of the object's frame, and how far the finger had gone at each [m].

    At each step in contact: how the contact moved, and the vote on the sense of turning.  several: it ended at a second contact.
    """

    poses: list[Array]
    gone: list[float] = field(default_factory=lambda: [0.0])
    modes: list[str] = field(default_factory=list)
    votes: list[float] = field(default_factory=list)
    several: bool = False


def course(
    problem: PushProblem, under: Support, pose: Array, start: Array, end: Array, step: float
) -> Course:
    """Of the object at a pose (3,) while the finger goes from start to end (2,); step [m] is the longest.

    Ends where the finger touches the object at two places at once, which the law of one contact does not cover.
    """
    length = float(np.linalg.norm(end - start))
    direction = (end - start) / max(length, 1e-300)
    found, gone = Course([pose]), 0.0
    while gone < length - 1e-12 and not found.several:
        here, finger = found.poses[-1], start + gone * direction
        near = touch(problem, here, finger)
        if near.gap > TOUCHING * problem.shape.size:
            gone += min(near.gap, length - gone)
        elif near.several:
            found.several = True
        else:
            ahead = min(step, length - gone)
            here = _moved(problem, under, found, near, finger, direction, ahead)
            gone += ahead
        found.poses.append(here)
        found.gone.append(gone)
    return found


def _moved(
    problem: PushProblem,
    under: Support,
    found: Course,
    near: Touch,
    finger: Array,
    direction: Array,
    ahead: float,
) -> Array:
    """Pose (3,) after a step in contact, which is noted in the course."""
    here = found.poses[-1]
    first, mode, sense = _velocity(problem, under, here, near, direction, ahead)
    if mode == "free":
        return here
    found.modes.append(mode)
    found.votes.append(sense)
    probe = here + ahead * first
    there = touch(problem, probe, finger + ahead * direction)
    second, _, _ = _velocity(problem, under, probe, there, direction, ahead)
    return here + ahead * (first + second) / 2


def touch(problem: PushProblem, pose: Array, finger: Array) -> Touch:
    """How the finger's disc lies to the object at a pose."""
    v = problem.shape.vertices
    p, ahead = to_body(pose, finger[None])[0], np.roll(v, -1, axis=0) - v
    share = np.clip(((p - v) * ahead).sum(1) / (ahead**2).sum(1), 0.0, 1.0)
    points = v + share[:, None] * ahead
    off = points - p
    distances = np.linalg.norm(off, axis=1)
    normals = off / np.maximum(distances, 1e-15)[:, None]
    nearest = int(distances.argmin())
    also = distances - problem.radius <= TOUCHING * problem.shape.size
    several = bool((also & (normals @ normals[nearest] < SAME_NORMAL)).any())
    return Touch(float(distances[nearest]) - problem.radius, points[nearest], normals[nearest], several)


def _velocity(
    problem: PushProblem, under: Support, pose: Array, near: Touch, direction: Array, step: float
) -> tuple[Array, str, float]:
    """Of the frame (3,) per length of the finger's way, what the contact does, and the vote; what has sunk in comes back."""
    turn = rotation(pose[2])
    sunk = max(-near.gap, 0.0) / step
    velocity = turn.T @ direction + 0.5 * min(sunk, 1.0) * near.normal
    at, friction = near.point - problem.centroid, problem.finger.friction
    moved = answer(under, at, near.normal, velocity, friction)
    origin = moved.velocity - moved.spin * np.array([-problem.centroid[1], problem.centroid[0]])
    sense = vote(at, near.normal, velocity, friction)
    return np.concatenate([turn @ origin, [moved.spin]]), moved.mode, sense


def centroids(problem: PushProblem, poses: Array) -> Array:
    """Of the object in the world (..., 2)."""
    return to_world(poses, problem.centroid[None])[..., 0, :]
