"""Directions of contacts that hold an object: outward normals that positively span the plane."""

import itertools

import numpy as np

from expert.geometry.pose import Array, cross

PARALLEL = 1e-6
"""Normals whose cross product is smaller have one direction."""


def same_direction(u: Array, v: Array) -> bool:
    """Whether two unit vectors point the same way."""
    return bool(abs(cross(u, v)) < PARALLEL and u @ v > 0)


def rays(normals: Array) -> Array:
    """Extreme rays (k, N), each of sum 1, of {lambda >= 0 : sum lambda n = 0}; normals (N, 2).

    Two antiparallel normals, or three that positively span the plane.
    """
    count = len(normals)
    found = []
    for i, j in itertools.combinations(range(count), 2):
        if same_direction(normals[i], -normals[j]):
            found.append(_ray(count, (i, j), np.ones(2)))
    for support in itertools.combinations(range(count), 3):
        u, v, w = normals[list(support)]
        weights = np.array([cross(v, w), cross(w, u), cross(u, v)])
        if (weights > PARALLEL).all() or (weights < -PARALLEL).all():
            found.append(_ray(count, support, weights))
    return np.array(found).reshape(-1, count)


def _ray(count: int, support: tuple[int, ...], weights: Array) -> Array:
    ray = np.zeros(count)
    ray[list(support)] = weights / weights.sum()
    return ray


def spans(normals: Array) -> bool:
    """Whether the normals positively span the plane: all gaps between neighbours are narrower than half a turn."""
    return widest_gap(normals) < np.pi - PARALLEL


def widest_gap(normals: Array) -> float:
    """Largest angle [rad] between neighbouring directions (N, 2)."""
    angles = np.sort(np.arctan2(normals[:, 1], normals[:, 0]))
    return float(np.diff(np.append(angles, angles[0] + 2 * np.pi)).max())
