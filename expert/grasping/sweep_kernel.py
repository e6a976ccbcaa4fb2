"""The sweeping process of one object and its fingers, compiled: see `expert.grasping.sweeping` for the law."""

import numpy as np
from numba import njit

from expert.numeric.least_norm import least_norm

REACH = 4e-3
"""Facets this near to a finger take part in a step; no step moves object and finger nearer by more."""
QUICK, SHORT = 5.0, 0.1
"""A step is taken if the object moves at most QUICK times as far as the fingers, or by at most SHORT * STEP."""
STALL = 1e-10
"""Finger motion below which no further step is tried: the object cannot move, or only at a rate beyond 3e5."""
FREE = 1e-9
"""Depth to which fingers may be inside at the start."""
ACCURACY = 1e-12
"""Depth to which fingers may be inside after a step."""
CONTACTS, ITERATIONS = 8, 12


@njit(cache=True, error_model="numpy")
def sweep_all(
    facets: np.ndarray,
    path: np.ndarray,
    starts: np.ndarray,
    times: np.ndarray,
    W: np.ndarray,
    radius: float,
    step: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Poses (M, S, 3) at the given times, and times of stalls (M,): nan for none, -1 for a start that is not free."""
    M, S = len(starts), len(times)
    poses, stalled, q = np.empty((M, S, 3)), np.empty(M), np.empty(3)
    for i in range(M):
        q[0], q[1], q[2] = starts[i, 0], starts[i, 1], starts[i, 2]
        stalled[i] = _sweep_one(facets, path, q, times, W, radius, step, poses[i])
    return poses, stalled


@njit(cache=True, error_model="numpy")
def _sweep_one(
    facets: np.ndarray,
    path: np.ndarray,
    q: np.ndarray,
    times: np.ndarray,
    W: np.ndarray,
    radius: float,
    step: float,
    poses: np.ndarray,
) -> float:
    """Record one execution from pose q, which is carried along, and return the time of its stall."""
    A, g, which = np.empty((CONTACTS, 3)), np.empty(CONTACTS), np.empty((CONTACTS, 2), np.int64)
    fingers, trial, u = np.empty((path.shape[1], 2)), np.empty(3), np.empty(3)
    _place(path, 0.0, 0, fingers)
    _record(poses, 0, q)
    if _depth(facets, fingers, q) > FREE:
        return -1.0
    s, stride = 0.0, step
    for k in range(1, len(times)):
        while s < times[k]:
            segment = min(int(s), len(path) - 2)
            speed = _speed(path, segment)
            after = min(s + stride / speed, times[k]) if speed > 0 else times[k]
            motion = (after - s) * speed
            _place(path, after, segment, fingers)
            for d in range(3):
                trial[d] = q[d]
            ok = _project(facets, fingers, trial, W, A, g, which, u)
            moved = np.hypot(trial[0] - q[0], trial[1] - q[1]) + radius * abs(trial[2] - q[2])
            if ok and moved <= max(QUICK * motion, SHORT * step):
                for d in range(3):
                    q[d] = trial[d]
                s = after
                stride = min(step, 1.6 * stride)
                continue
            stride = 0.5 * motion
            if stride < STALL:
                _record(poses, k, q)
                return s
        _record(poses, k, q)
    return np.nan


@njit(cache=True, error_model="numpy")
def _place(path: np.ndarray, s: float, segment: int, fingers: np.ndarray) -> None:
    """Fingers (N, 2) at path parameter s of a segment."""
    share = s - segment
    for n in range(len(fingers)):
        for d in range(2):
            fingers[n, d] = (1 - share) * path[segment, n, d] + share * path[segment + 1, n, d]


@njit(cache=True, error_model="numpy")
def _record(poses: np.ndarray, first: int, q: np.ndarray) -> None:
    """Pose q from sample `first` on."""
    for k in range(first, len(poses)):
        for d in range(3):
            poses[k, d] = q[d]


@njit(cache=True, error_model="numpy")
def _speed(path: np.ndarray, segment: int) -> float:
    """Length of the longest finger motion in a segment."""
    longest = 0.0
    for n in range(path.shape[1]):
        d0 = path[segment + 1, n, 0] - path[segment, n, 0]
        d1 = path[segment + 1, n, 1] - path[segment, n, 1]
        longest = max(longest, np.hypot(d0, d1))
    return longest


@njit(cache=True, error_model="numpy")
def _project(
    facets: np.ndarray,
    fingers: np.ndarray,
    q: np.ndarray,
    W: np.ndarray,
    A: np.ndarray,
    g: np.ndarray,
    which: np.ndarray,
    u: np.ndarray,
) -> bool:
    """Move q to the nearest free pose, by successive linearisation; False where there is none nearby.

    u: body twist times the metric's root.  After a few rounds facets stay chosen, which ends a flutter at a convex corner.
    """
    cs, sn = np.cos(q[2]), np.sin(q[2])
    x, y, angle = q[0], q[1], q[2]
    u[:] = 0
    b = np.empty(CONTACTS)
    change, count = 0.0, 0
    for iteration in range(ITERATIONS):
        if iteration < ITERATIONS // 2:
            count = _choose(facets, fingers, q, which)
        worst = _linearise(facets, fingers, q, cs, sn, W, which, count, A, g)
        if worst >= -ACCURACY and change <= 1e-8:
            return True
        for k in range(count):
            b[k] = A[k, 0] * u[0] + A[k, 1] * u[1] + A[k, 2] * u[2] - g[k]
        before0, before1, before2 = u[0], u[1], u[2]
        if not least_norm(A, b, count, u):
            return False
        change = abs(u[0] - before0) + abs(u[1] - before1) + abs(u[2] - before2)
        v0 = W[0, 0] * u[0] + W[1, 0] * u[1] + W[2, 0] * u[2]
        v1 = W[0, 1] * u[0] + W[1, 1] * u[1] + W[2, 1] * u[2]
        turn = W[0, 2] * u[0] + W[1, 2] * u[1] + W[2, 2] * u[2]
        if abs(v0) + abs(v1) + abs(turn) > 0.5 * REACH:
            return False
        q[0], q[1], q[2] = x + cs * v0 - sn * v1, y + sn * v0 + cs * v1, angle + turn
    return False


@njit(cache=True, error_model="numpy")
def _choose(facets: np.ndarray, fingers: np.ndarray, q: np.ndarray, which: np.ndarray) -> int:
    """Fill which (CONTACTS, 2) with (finger, facet) whose half-planes bound the free poses nearby; return their number."""
    cs, sn = np.cos(q[2]), np.sin(q[2])
    V, count = len(facets), 0
    for n in range(len(fingers)):
        dx, dy = fingers[n, 0] - q[0], fingers[n, 1] - q[1]
        bx, by = cs * dx + sn * dy, cs * dy - sn * dx
        for f in range(V):
            gap = _height(facets, f, bx, by)
            along = (bx - facets[f, 0]) * facets[f, 4] + (by - facets[f, 1]) * facets[f, 5]
            if abs(gap) > REACH or along < -REACH or along > facets[f, 6] + REACH:
                continue
            before, after = (f - 1) % V, (f + 1) % V
            # At a convex corner it is enough to be outside of one facet: keep the one that is farther.
            if facets[f, 7] == 0 and _height(facets, before, bx, by) >= gap:
                continue
            if facets[after, 7] == 0 and _height(facets, after, bx, by) > gap:
                continue
            if count < CONTACTS:
                which[count, 0], which[count, 1] = n, f
                count += 1
    return count


@njit(cache=True, error_model="numpy")
def _height(facets: np.ndarray, f: int, x: float, y: float) -> float:
    """Signed distance of a body point from the line of a facet."""
    return (x - facets[f, 0]) * facets[f, 2] + (y - facets[f, 1]) * facets[f, 3]


@njit(cache=True, error_model="numpy")
def _linearise(
    facets: np.ndarray,
    fingers: np.ndarray,
    q: np.ndarray,
    cs: float,
    sn: float,
    W: np.ndarray,
    which: np.ndarray,
    count: int,
    A: np.ndarray,
    g: np.ndarray,
) -> float:
    """Gaps g and their gradients A by u, about pose q; (cs, sn) is the body frame of twists.  Returns the smallest gap."""
    c, s = np.cos(q[2]), np.sin(q[2])
    worst = np.inf
    for k in range(count):
        n, f = which[k, 0], which[k, 1]
        dx, dy = fingers[n, 0] - q[0], fingers[n, 1] - q[1]
        bx, by = c * dx + s * dy, c * dy - s * dx
        nx, ny = facets[f, 2], facets[f, 3]
        g[k] = (bx - facets[f, 0]) * nx + (by - facets[f, 1]) * ny
        worst = min(worst, g[k])
        wx, wy = c * nx - s * ny, s * nx + c * ny
        a0, a1, a2 = -(cs * wx + sn * wy), -(cs * wy - sn * wx), by * nx - bx * ny
        for d in range(3):
            A[k, d] = W[d, 0] * a0 + W[d, 1] * a1 + W[d, 2] * a2
    return worst


@njit(cache=True, error_model="numpy")
def _depth(facets: np.ndarray, fingers: np.ndarray, q: np.ndarray) -> float:
    """How deep the deepest finger is inside; 0 where none is."""
    cs, sn = np.cos(q[2]), np.sin(q[2])
    deepest = 0.0
    for n in range(len(fingers)):
        dx, dy = fingers[n, 0] - q[0], fingers[n, 1] - q[1]
        x, y = cs * dx + sn * dy, cs * dy - sn * dx
        inside, nearest = False, np.inf
        for f in range(len(facets)):
            ax, ay = facets[f, 0], facets[f, 1]
            bx, by = facets[(f + 1) % len(facets), 0], facets[(f + 1) % len(facets), 1]
            if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                inside = not inside
            along = min(max((x - ax) * facets[f, 4] + (y - ay) * facets[f, 5], 0.0), facets[f, 6])
            off = np.hypot(x - ax - along * facets[f, 4], y - ay - along * facets[f, 5])
            nearest = min(nearest, off)
        if inside:
            deepest = max(deepest, nearest)
    return deepest
