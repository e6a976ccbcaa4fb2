"""How many corners?  Those whose removal the data would notice (Bayesian information criterion)."""

from dataclasses import replace

import numpy as np

from dlm.perception.fit import MovingPolygon, Observation, Quadratic, crossed, fit
from expert.geometry.polygon import crossing_edges, facets
from expert.geometry.pose import Array, cross

SHORTEST = 0.6
"""No facet is shorter than this [pixels]."""


def prune(scene: MovingPolygon, seen: Observation) -> tuple[MovingPolygon, Quadratic]:
    """Remove corners, the least noticed first, while that pays; the scene is fitted again each time."""
    scene, best = fit(scene, seen)
    while len(scene.vertices) > 3:
        tidy = without_tangles(scene.vertices)
        if len(tidy) < len(scene.vertices):
            scene, best = fit(replace(scene, vertices=tidy), seen, iterations=15)
            continue
        # A corner is two parameters; each is worth log(n) / 2, in units of the residual variance.
        pixels, variance = boundary_variance(scene, seen)
        worth = np.log(pixels) * variance
        for k in np.argsort(straightness(scene, best))[:2]:
            fewer = replace(scene, vertices=np.delete(scene.vertices, k, axis=0))
            trial, value = fit(fewer, seen, iterations=15, precision=1e-4)
            if value.cost - best.cost < worth:
                scene, best = trial, value
                break
        else:
            break
    return scene, best


def without_tangles(vertices: Array) -> Array:
    """Without facets that are too short, and without the smaller of the loops of an outline that crosses itself."""
    while len(vertices) > 3:
        a, b = facets(vertices)
        length = np.linalg.norm(b - a, axis=1)
        if length.min() < SHORTEST:
            vertices = np.delete(vertices, (length.argmin() + 1) % len(vertices), axis=0)
        elif crossing := crossing_edges(vertices):
            first, second = crossing
            inner = np.arange(first + 1, second + 1)
            outer = np.setdiff1d(np.arange(len(vertices)), inner)
            smaller = min(inner, outer, key=len)
            vertices = np.delete(vertices, smaller[len(smaller) // 2], axis=0)
        else:
            break
    return vertices


def boundary_variance(scene: MovingPolygon, seen: Observation) -> tuple[int, float]:
    """Number of pixels that the outline crosses, and the mean weighted square of their errors (1: noise alone), at least 1."""
    squares, edge = crossed(scene, seen)
    count = int(edge.sum())
    spare = max(count - scene.vertices.size - 3 * len(scene.motion) + 3, 1)
    return count, max(1.0, float(squares[edge].sum()) / spare)


def straightness(scene: MovingPolygon, quadratic: Quadratic) -> Array:
    """What the cost would rise by if each corner lay on the line between its neighbours, to first order (V,)."""
    v = scene.vertices
    count, size = len(v), len(quadratic.gradient)
    before, after = np.roll(v, 1, axis=0), np.roll(v, -1, axis=0)
    slopes = np.zeros((count, size))
    for k in range(count):
        # Twice the area of (before, corner, after) moves with each of them across the line through the other two.
        for corner, side in ((k - 1, after[k] - v[k]), (k, before[k] - after[k]), (k + 1, v[k] - before[k])):
            place = 2 * (corner % count)
            slopes[k, place : place + 2] = [-side[1], side[0]]
    bend = cross(v - before, after - before)
    damped = quadratic.matrix + 1e-6 * np.diag(quadratic.matrix).mean() * np.eye(size)
    variance = (slopes * np.linalg.solve(damped, slopes.T).T).sum(axis=1)
    return 0.5 * bend**2 / variance
