"""What grippers ask of two fingers a and b: low <= u . (b - a) <= high in some directions u (Thesis 5.1.7, 5.2.5)."""

from dataclasses import dataclass

import numpy as np

from expert.geometry.pose import Array, perpendicular

DIRECTIONS = 16
"""Distances are bounded in so many directions."""


@dataclass(frozen=True)
class Jaws:
    """u (m, 2), low (m,), high (m,)."""

    u: Array
    low: Array
    high: Array


def parallel_jaws(least: float, most: float, axis: Array) -> Jaws:
    """They face each other along a unit axis: b - a = opening * axis."""
    return Jaws(np.stack([perpendicular(axis), axis]), np.array([0.0, least]), np.array([0.0, most]))


def free_jaws(most: float, along: Array) -> Jaws:
    """At most `most` apart: so in every direction of a polygon inside the circle, of which `along` is the first."""
    u = circle(DIRECTIONS, float(np.arctan2(along[1], along[0])))
    return Jaws(u, np.full(DIRECTIONS, -np.inf), np.full(DIRECTIONS, most * np.cos(np.pi / DIRECTIONS)))


def circle(count: int, first: float = 0.0) -> Array:
    """Unit vectors (count, 2), evenly spread from the angle `first` [rad]."""
    angles = first + 2 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(angles), np.sin(angles)])
