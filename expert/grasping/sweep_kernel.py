"""The sweeping process of one object and its fingers, compiled: see `expert.grasping.sweeping` for the law."""

from typing import NamedTuple

import numpy as np
from numba import njit

from expert.numeric.least_norm import least_norm

NEARBY = 4e-3
"""Facets this near to a finger, over the object's diameter, take part in a step; none moves the two nearer by more."""
QUICK, SHORT = 5.0, 0.1
"""A step is taken if the object moves at most QUICK times as far as the fingers, or by at most SHORT * STEP."""
STALL = 1e-10
"""Finger motion below which no further step is tried: the object cannot move, or only at a rate beyond 3e5."""
FREE = 1e-9
"""Depth to which fingers may be inside at the start."""
ACCURACY = 1e-12
"""Depth to which fingers may be inside after a step."""
ITERATIONS = 12


FACET = np.dtype(
    [(name, np.float64) for name in ("x", "y", "nx", "ny", "tx", "ty", "length")] + [("reflex", np.bool_)]
)
"""A facet of the object: where it starts, outward normal, tangent, length, and whether it starts at a reflex corner."""


class Law(NamedTuple):
    """What moves whom: finger path (K, N, 2), the object's facets (V,), its metric's root W (3, 3) and radius, and the longest step."""

    path: np.ndarray
    facets: np.ndarray
    W: np.ndarray
    radius: float
    step: float


class Step(NamedTuple):
    """Room for one step: fingers (N, 2), contacts `which` (C, 2) of finger and facet, their gaps g (C,) and gradients A (C, 3),
    the pose tried q (3,), and the twist u (3,) that leads there, A u >= b.
    """

    fingers: np.ndarray
    which: np.ndarray
    g: np.ndarray
    A: np.ndarray
    b: np.ndarray
    u: np.ndarray
    q: np.ndarray


@njit(cache=True, error_model="numpy")
def sweep_all(law: Law, starts: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Poses (M, S, 3) at the given times, and times of stalls (M,): nan for none, -1 for a start that is not free."""
    M, S = len(starts), len(times)
    poses, stalled = np.empty((M, S, 3)), np.empty(M)
    for i in range(M):
        stalled[i] = _sweep_one(law, starts[i].copy(), times, poses[i])
    return poses, stalled


@njit(cache=True, error_model="numpy")
def _sweep_one(law: Law, q: np.ndarray, times: np.ndarray, poses: np.ndarray) -> float:
    """Record one execution from pose q, which is carried along, and return the time of its stall."""
    N = law.path.shape[1]
    most = N * len(law.facets)
    g, A, b = np.empty(most), np.empty((most, 3)), np.empty(most)
    room = Step(np.empty((N, 2)), np.empty((most, 2), np.int64), g, A, b, np.empty(3), np.empty(3))
    _place(law.path, 0.0, 0, room.fingers)
    poses[:] = q
    if _depth(law.facets, room.fingers, q) > FREE:
        return -1.0
    s, stride = 0.0, law.step
    for k in range(1, len(times)):
        while s < times[k]:
            segment = min(int(s), len(law.path) - 2)
            speed = _speed(law.path, segment)
            after = min(s + stride / speed, times[k]) if speed > 0 else times[k]
            motion = (after - s) * speed
            _place(law.path, after, segment, room.fingers)
            if _moves_on(law, room, q, motion):
                s, stride = after, min(law.step, 1.6 * stride)
                continue
            stride = 0.5 * motion
            if stride < STALL:
                poses[k:] = q
                return s
        poses[k:] = q
    return np.nan


@njit(cache=True, error_model="numpy")
def _moves_on(law: Law, room: Step, q: np.ndarray, motion: float) -> bool:
    """Move q to the nearest free pose, if there is one that fingers which moved by so much can push the object to."""
    trial = room.q
    trial[:] = q
    if not _project(law, room):
        return False
    moved = np.hypot(trial[0] - q[0], trial[1] - q[1]) + law.radius * abs(trial[2] - q[2])
    if moved > max(QUICK * motion, SHORT * law.step):
        return False
    q[:] = trial
    return True


@njit(cache=True, error_model="numpy")
def _place(path: np.ndarray, s: float, segment: int, fingers: np.ndarray) -> None:
    """Fingers (N, 2) at path parameter s of a segment."""
    share = s - segment
    for n in range(len(fingers)):
        for d in range(2):
            fingers[n, d] = (1 - share) * path[segment, n, d] + share * path[segment + 1, n, d]


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
def _project(law: Law, room: Step) -> bool:
    """Move room.q to the nearest free pose, by successive linearisation; False where there is none nearby.

    u: body twist times the metric's root.  After a few rounds facets stay chosen, which ends a flutter at a convex corner.
    """
    W, A, b, u, q = law.W, room.A, room.b, room.u, room.q
    x, y, angle = q[0], q[1], q[2]
    cs, sn = np.cos(angle), np.sin(angle)
    u[:] = 0
    change, count = 0.0, 0
    for iteration in range(ITERATIONS):
        if iteration < ITERATIONS // 2:
            count = _choose(law.facets, room)
        worst = _linearise(law, room, angle, count)
        if worst >= -ACCURACY and change <= 1e-8:
            return True
        for k in range(count):
            b[k] = A[k, 0] * u[0] + A[k, 1] * u[1] + A[k, 2] * u[2] - room.g[k]
        before0, before1, before2 = u[0], u[1], u[2]
        if not least_norm(A, b, count, u):
            return False
        change = abs(u[0] - before0) + abs(u[1] - before1) + abs(u[2] - before2)
        v0 = W[0, 0] * u[0] + W[1, 0] * u[1] + W[2, 0] * u[2]
        v1 = W[0, 1] * u[0] + W[1, 1] * u[1] + W[2, 1] * u[2]
        turn = W[0, 2] * u[0] + W[1, 2] * u[1] + W[2, 2] * u[2]
        if abs(v0) + abs(v1) + abs(turn) > 0.5 * NEARBY:
            return False
        q[0], q[1], q[2] = x + cs * v0 - sn * v1, y + sn * v0 + cs * v1, angle + turn
    return False


@njit(cache=True, error_model="numpy")
def _choose(facets: np.ndarray, room: Step) -> int:
    """Fill room.which with (finger, facet) whose half-planes bound the free poses nearby; return their number."""
    q = room.q
    cs, sn = np.cos(q[2]), np.sin(q[2])
    V, count = len(facets), 0
    for n in range(len(room.fingers)):
        dx, dy = room.fingers[n, 0] - q[0], room.fingers[n, 1] - q[1]
        x, y = cs * dx + sn * dy, cs * dy - sn * dx
        for f in range(V):
            gap, along = _height(facets, f, x, y), _along(facets, f, x, y)
            if abs(gap) > NEARBY or along < -NEARBY or along > facets[f].length + NEARBY:
                continue
            before, after = (f - 1) % V, (f + 1) % V
            # At a convex corner it is enough to be outside of one facet: keep the one that is farther.
            if not facets[f].reflex and _height(facets, before, x, y) >= gap:
                continue
            if not facets[after].reflex and _height(facets, after, x, y) > gap:
                continue
            room.which[count, 0], room.which[count, 1] = n, f
            count += 1
    return count


@njit(cache=True, error_model="numpy")
def _height(facets: np.ndarray, f: int, x: float, y: float) -> float:
    """Signed distance of a body point from the line of a facet."""
    return (x - facets[f].x) * facets[f].nx + (y - facets[f].y) * facets[f].ny


@njit(cache=True, error_model="numpy")
def _along(facets: np.ndarray, f: int, x: float, y: float) -> float:
    """Distance of a body point from the start of a facet, along it."""
    return (x - facets[f].x) * facets[f].tx + (y - facets[f].y) * facets[f].ty


@njit(cache=True, error_model="numpy")
def _linearise(law: Law, room: Step, angle: float, count: int) -> float:
    """Fill gaps g and their gradients A by u, about room.q; twists are in a frame at `angle`.  Returns the smallest gap."""
    q = room.q
    c, s, cs, sn = np.cos(q[2]), np.sin(q[2]), np.cos(angle), np.sin(angle)
    worst = np.inf
    for k in range(count):
        n, f = room.which[k, 0], room.which[k, 1]
        dx, dy = room.fingers[n, 0] - q[0], room.fingers[n, 1] - q[1]
        x, y = c * dx + s * dy, c * dy - s * dx
        nx, ny = law.facets[f].nx, law.facets[f].ny
        room.g[k] = _height(law.facets, f, x, y)
        worst = min(worst, room.g[k])
        wx, wy = c * nx - s * ny, s * nx + c * ny
        a0, a1, a2 = -(cs * wx + sn * wy), -(cs * wy - sn * wx), y * nx - x * ny
        for d in range(3):
            room.A[k, d] = law.W[d, 0] * a0 + law.W[d, 1] * a1 + law.W[d, 2] * a2
    return worst


@njit(cache=True, error_model="numpy")
def _depth(facets: np.ndarray, fingers: np.ndarray, q: np.ndarray) -> float:
    """How deep the deepest finger is inside; 0 where none is."""
    cs, sn = np.cos(q[2]), np.sin(q[2])
    deepest, V = 0.0, len(facets)
    for n in range(len(fingers)):
        dx, dy = fingers[n, 0] - q[0], fingers[n, 1] - q[1]
        x, y = cs * dx + sn * dy, cs * dy - sn * dx
        inside, nearest = False, np.inf
        for f in range(V):
            a, b = facets[f], facets[(f + 1) % V]
            if (a.y > y) != (b.y > y) and x < a.x + (y - a.y) * (b.x - a.x) / (b.y - a.y):
                inside = not inside
            along = min(max(_along(facets, f, x, y), 0.0), a.length)
            foot_x, foot_y = a.x + along * a.tx, a.y + along * a.ty
            nearest = min(nearest, np.hypot(x - foot_x, y - foot_y))
        if inside:
            deepest = max(deepest, nearest)
    return deepest
