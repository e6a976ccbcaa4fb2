"""How many corners?  Those whose removal the data would notice (Bayesian information criterion)."""

from dataclasses import replace

import numpy as np

from dlm.perception.fit import Observation, Quadratic, Scene, fit, modelled
from expert.geometry.pose import Array, cross


def prune(scene: Scene, seen: Observation) -> tuple[Scene, Quadratic]:
    """Remove corners, the least noticed first, while that pays; the scene is fitted again each time."""
    scene, best = fit(scene, seen)
    while len(scene.vertices) > 3:
        # A corner is two parameters; each is worth log(n) / 2, in units of the residual variance.
        pixels, variance = boundary_variance(scene, seen)
        worth = np.log(pixels) * variance
        found = False
        for k in np.argsort(straightness(scene, best))[:2]:
            fewer = replace(scene, vertices=np.delete(scene.vertices, k, axis=0))
            trial, value = fit(fewer, seen, iterations=15, precision=1e-4)
            if value.cost - best.cost < worth:
                scene, best, found = trial, value, True
                break
        if not found:
            break
    return scene, best


def boundary_variance(scene: Scene, seen: Observation) -> tuple[int, float]:
    """Number of pixels that the outline crosses, and the mean weighted square of their residuals (1: noise alone), at least 1."""
    share, gradient = modelled(scene, seen)
    crossed = (np.abs(gradient).sum(axis=(-1, -2)) > 1e-9) & (seen.weight > 0)
    squares = (seen.weight * (share - seen.share) ** 2)[crossed]
    spare = max(len(squares) - len(scene.vertices) * 2 - 3 * len(scene.motion) + 3, 1)
    return len(squares), max(1.0, float(squares.sum()) / spare)


def straightness(scene: Scene, quadratic: Quadratic) -> Array:
    """What the cost would rise by if each corner lay on the line between its neighbours, to first order."""
    v = scene.vertices
    before, after = np.roll(v, 1, axis=0), np.roll(v, -1, axis=0)
    count = len(v)
    size = len(quadratic.gradient)
    slopes = np.zeros((count, size))
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    for k in range(count):
        i, j = (k - 1) % count, (k + 1) % count
        slopes[k, 2 * k : 2 * k + 2] += turn @ (after[k] - before[k])
        slopes[k, 2 * i : 2 * i + 2] += turn @ (v[k] - after[k])
        slopes[k, 2 * j : 2 * j + 2] += turn @ (before[k] - v[k])
    bend = cross(v - before, after - before)
    damped = quadratic.matrix + 1e-6 * np.diag(quadratic.matrix).mean() * np.eye(size)
    variance = (slopes * np.linalg.solve(damped, slopes.T).T).sum(axis=1)
    return 0.5 * bend**2 / variance
