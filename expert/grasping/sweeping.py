"""Execution of a grasp without friction: where do finger paths push the object?  (Thesis 5.2.5, simulated experiments.)

Quasi-static motion on a support is a sweeping process (Moreau): the object moves as little as it can, in the metric of
its support, while the fingers do not enter it.  Each step moves the fingers, then the pose to the nearest free one:

    min |q' - q|_B   subject to   max or min over nearby facets f of  g_nf(q') = n_f . y_n(q') - d_f  >= 0

with y_n the finger in the body frame: all facets that meet at a reflex corner, one of those that meet at a convex one.
Lengths are over the object's diameter, poses relative to the goal.  Where no free pose is near, the object is jammed.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from expert.caging.problem import Shape
from expert.errors import InvalidProblem
from expert.geometry.polygon import facet_frames, facets, mass_properties, reflex_vertices
from expert.geometry.pose import Array, rotation
from expert.types import readonly, require

STEP = 3e-4
"""Largest finger motion of a step, over the object's diameter."""
REACH = 4e-3
"""Facets this near to a finger take part in a step; no step moves object and finger nearer by more."""
QUICK, SHORT = 5.0, 0.1
"""A step is taken if the object moves at most QUICK times as far as the fingers, or by at most SHORT * STEP."""
STALL = 1e-10
"""Finger motion below which no further step is tried: the object cannot move, or only at a rate beyond 3e5."""
ACCURACY = 1e-12
"""Depth to which fingers may be inside after a step."""
SAMPLES = 40
"""Recorded poses per knot interval."""
CONTACTS, ITERATIONS = 8, 12


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """M executions, recorded at S path parameters.

    s (S,) in [0, K - 1].  poses (M, S, 3) [m, rad], world; after a stall the last one stays.  stalled (M,): path parameter
    at which the object jammed, nan where it did not.  starts_inside (M,): the start was not free and nothing was executed.
    """

    s: Array
    poses: Array
    stalled: Array

    @property
    def ends(self) -> Array:
        """Last poses (M, 3)."""
        return self.poses[:, -1]


def sweep(
    shape: Shape,
    path: Array,
    starts: Array,
    *,
    goal: Array | None = None,
    metric: Array | None = None,
    step: float = STEP,
    samples: int = SAMPLES,
) -> Sweep:
    """Execute finger paths (K, N, 2) [m], straight between the knots, from start poses (M, 3).

    goal (3,): the pose about which lengths are small (by default 0).  metric (3, 3): positive definite form of body twists
    (vx, vy [over the diameter], omega) about the centroid that the support resists, by default that of a uniform disc of
    the polygon's radius of gyration.  Raises InvalidProblem for starts with a finger inside the object.
    """
    path = readonly(path, (None, None, 2), "path")
    starts = readonly(starts, (None, 3), "starts")
    goal = np.zeros(3) if goal is None else readonly(goal, (3,), "goal")
    require(len(path) >= 2, "path", "at least 2 knots", len(path))
    require(0 < step <= REACH / 4, "step", f"a length over the diameter of at most {REACH / 4:g}", step)
    frame = _Frame(shape, goal)
    rows = frame.facet_rows()
    half = frame.metric_root(metric)
    times = np.linspace(0, len(path) - 1, (len(path) - 1) * samples + 1)
    poses, stalled = _sweep_all(
        rows, frame.points(path), frame.poses(starts), times, half, frame.radius, step
    )
    if (inside := np.flatnonzero(stalled < 0)).size:
        raise InvalidProblem(
            f"starts[{inside[0]}]", expected="a pose that no finger enters", got="one with a finger inside"
        )
    return Sweep(s=times, poses=frame.world(poses), stalled=stalled)


class _Frame:
    """Lengths over the diameter; origin at the centroid of the object in its goal pose, whose angle counts as 0."""

    def __init__(self, shape: Shape, goal: Array) -> None:
        self.size, self.goal = shape.size, goal
        plate = mass_properties(shape.vertices)
        self.centroid = plate.centroid
        self.vertices = (shape.vertices - plate.centroid) / self.size
        self.gyration = np.sqrt(plate.second_moment / plate.area) / self.size
        self.radius = float(np.linalg.norm(self.vertices, axis=1).max())
        self.turn = rotation(goal[2])
        self.origin = goal[:2] + self.turn @ plate.centroid

    def points(self, points: Array) -> Array:
        return np.ascontiguousarray((points - self.origin) @ self.turn / self.size)

    def poses(self, poses: Array) -> Array:
        centres = poses[:, :2] + (rotation(poses[:, 2]) @ self.centroid)
        return np.column_stack([self.points(centres), poses[:, 2] - self.goal[2]])

    def world(self, poses: Array) -> Array:
        angle = poses[..., 2] + self.goal[2]
        centres = self.origin + self.size * poses[..., :2] @ self.turn.T
        return np.concatenate([centres - rotation(angle) @ self.centroid, angle[..., None]], axis=-1)

    def facet_rows(self) -> Array:
        """(V, 8): start, outward normal, tangent, length, 1 where the start vertex is reflex."""
        a, b = facets(self.vertices)
        inward, tangent = facet_frames(self.vertices)
        length = np.linalg.norm(b - a, axis=1)
        return np.column_stack([a, -inward, tangent, length, reflex_vertices(self.vertices)])

    def metric_root(self, metric: Array | None) -> Array:
        """Inverse transposed root W of the metric B = U^T U: a gradient a becomes W a where twists become U xi."""
        B = np.diag([1.0, 1.0, self.gyration**2]) if metric is None else readonly(metric, (3, 3), "metric")
        definite = bool(np.allclose(B, B.T) and np.linalg.eigvalsh(B).min() > 0)
        require(definite, "metric", "a symmetric positive definite matrix", B.tolist())
        return np.ascontiguousarray(np.linalg.inv(np.linalg.cholesky(B)))


@njit(cache=True, error_model="numpy")
def _sweep_all(
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
    poses, stalled = np.empty((M, S, 3)), np.full(M, np.nan)
    for i in range(M):
        stalled[i] = _sweep_one(facets, path, starts[i], times, W, radius, step, poses[i])
    return poses, stalled


@njit(cache=True, error_model="numpy")
def _sweep_one(
    facets: np.ndarray,
    path: np.ndarray,
    start: np.ndarray,
    times: np.ndarray,
    W: np.ndarray,
    radius: float,
    step: float,
    poses: np.ndarray,
) -> float:
    """Record one execution and return the time of its stall."""
    fingers = path[0].copy()
    A, g, which = np.empty((CONTACTS, 3)), np.empty(CONTACTS), np.empty((CONTACTS, 2), np.int64)
    q, trial, u = start.copy(), np.empty(3), np.empty(3)
    poses[:] = q
    if _depth(facets, fingers, q) > 1e-9:
        return -1.0
    s, stride = 0.0, step
    for k in range(1, len(times)):
        while s < times[k]:
            segment = min(int(s), len(path) - 2)
            speed = _speed(path, segment)
            wanted = stride / speed if speed > 0 else np.inf
            after = min(s + wanted, times[k])
            motion = (after - s) * speed
            for n in range(len(fingers)):
                for d in range(2):
                    share = after - segment
                    fingers[n, d] = (1 - share) * path[segment, n, d] + share * path[segment + 1, n, d]
            trial[:] = q
            ok = _project(facets, fingers, trial, W, A, g, which, u)
            moved = np.hypot(trial[0] - q[0], trial[1] - q[1]) + radius * abs(trial[2] - q[2])
            if ok and moved <= max(QUICK * motion, SHORT * step):
                q[:] = trial
                s = after
                stride = min(step, 1.6 * stride)
                continue
            stride = 0.5 * motion
            if stride < STALL:
                poses[k:] = q
                return s
        poses[k] = q
    return np.nan


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
            gap = _gap(facets, f, bx, by)
            if not np.isfinite(gap):
                continue
            before, after = (f - 1) % V, (f + 1) % V
            # At a convex corner it is enough to be outside of one facet: keep the one that is farther.
            if facets[f, 7] == 0 and _gap_or(facets, before, bx, by) >= gap:
                continue
            if facets[after, 7] == 0 and _gap_or(facets, after, bx, by) > gap:
                continue
            if count < CONTACTS:
                which[count, 0], which[count, 1] = n, f
                count += 1
    return count


@njit(cache=True, error_model="numpy", inline="always")
def _gap(facets: np.ndarray, f: int, x: float, y: float) -> float:
    """Signed distance of a body point from the line of a facet; infinite where the facet is out of reach."""
    dx, dy = x - facets[f, 0], y - facets[f, 1]
    gap = dx * facets[f, 2] + dy * facets[f, 3]
    along = dx * facets[f, 4] + dy * facets[f, 5]
    near = abs(gap) <= REACH and -REACH <= along <= facets[f, 6] + REACH
    return gap if near else np.inf


@njit(cache=True, error_model="numpy", inline="always")
def _gap_or(facets: np.ndarray, f: int, x: float, y: float) -> float:
    """As `_gap`, but minus infinity out of reach."""
    gap = _gap(facets, f, x, y)
    return gap if np.isfinite(gap) else -np.inf


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
        n, f = which[k]
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


@njit(cache=True, error_model="numpy")
def least_norm(A: np.ndarray, b: np.ndarray, count: int, u: np.ndarray) -> bool:
    """The shortest u (3,) with A u >= b for the first `count` rows (rows of unit order); False where there is none.

    It is a combination with weights >= 0 of at most three rows that hold with equality: all triples, pairs and single
    rows are tried, and the candidate that breaks the others least is taken.
    """
    best, tolerance = np.inf, 1e-13
    w = np.empty(3)
    u[:] = 0
    best = _violation(A, b, count, u)
    if best <= tolerance:
        return True
    for i in range(count):
        if b[i] > 0 and _on_rows(A, b, i, -1, -1, w):
            best = _keep(A, b, count, w, u, best)
    if best <= tolerance:
        return True
    for i in range(count):
        for j in range(i):
            if _on_rows(A, b, i, j, -1, w):
                best = _keep(A, b, count, w, u, best)
    if best <= tolerance:
        return True
    for i in range(count):
        for j in range(i):
            for k in range(j):
                if _on_rows(A, b, i, j, k, w):
                    best = _keep(A, b, count, w, u, best)
    return best <= 0.1 * ACCURACY


@njit(cache=True, error_model="numpy")
def _keep(A: np.ndarray, b: np.ndarray, count: int, w: np.ndarray, u: np.ndarray, best: float) -> float:
    """Take w for u if it breaks the rows less than `best`; return the least violation."""
    violation = _violation(A, b, count, w)
    if violation < best:
        u[:] = w
        return violation
    return best


@njit(cache=True, error_model="numpy")
def _violation(A: np.ndarray, b: np.ndarray, count: int, u: np.ndarray) -> float:
    worst = 0.0
    for k in range(count):
        worst = max(worst, b[k] - A[k, 0] * u[0] - A[k, 1] * u[1] - A[k, 2] * u[2])
    return worst


@njit(cache=True, error_model="numpy")
def _on_rows(A: np.ndarray, b: np.ndarray, i: int, j: int, k: int, w: np.ndarray) -> bool:
    """The shortest w on rows i, j, k (-1: no row) with equality; False where a weight is negative or rows depend."""
    p = A[i, 0] * A[i, 0] + A[i, 1] * A[i, 1] + A[i, 2] * A[i, 2]
    if j < 0:
        l = b[i] / p
        w[0], w[1], w[2] = l * A[i, 0], l * A[i, 1], l * A[i, 2]
        return l >= 0
    r = A[j, 0] * A[j, 0] + A[j, 1] * A[j, 1] + A[j, 2] * A[j, 2]
    o = A[i, 0] * A[j, 0] + A[i, 1] * A[j, 1] + A[i, 2] * A[j, 2]
    if k < 0:
        det = p * r - o * o
        if det <= 1e-14 * p * r:
            return False
        l, m = (r * b[i] - o * b[j]) / det, (p * b[j] - o * b[i]) / det
        for d in range(3):
            w[d] = l * A[i, d] + m * A[j, d]
        return l >= 0 and m >= 0
    # Cramer's rule for the point; its weights by the dual basis.
    c0 = A[j, 1] * A[k, 2] - A[j, 2] * A[k, 1]
    c1 = A[j, 2] * A[k, 0] - A[j, 0] * A[k, 2]
    c2 = A[j, 0] * A[k, 1] - A[j, 1] * A[k, 0]
    d0 = A[k, 1] * A[i, 2] - A[k, 2] * A[i, 1]
    d1 = A[k, 2] * A[i, 0] - A[k, 0] * A[i, 2]
    d2 = A[k, 0] * A[i, 1] - A[k, 1] * A[i, 0]
    e0 = A[i, 1] * A[j, 2] - A[i, 2] * A[j, 1]
    e1 = A[i, 2] * A[j, 0] - A[i, 0] * A[j, 2]
    e2 = A[i, 0] * A[j, 1] - A[i, 1] * A[j, 0]
    det = A[i, 0] * c0 + A[i, 1] * c1 + A[i, 2] * c2
    size = A[k, 0] * A[k, 0] + A[k, 1] * A[k, 1] + A[k, 2] * A[k, 2]
    if det * det <= 1e-18 * p * r * size:
        return False
    w[0] = (b[i] * c0 + b[j] * d0 + b[k] * e0) / det
    w[1] = (b[i] * c1 + b[j] * d1 + b[k] * e1) / det
    w[2] = (b[i] * c2 + b[j] * d2 + b[k] * e2) / det
    floor = -1e-12 * (abs(w[0]) + abs(w[1]) + abs(w[2]))
    l = (w[0] * c0 + w[1] * c1 + w[2] * c2) / det
    m = (w[0] * d0 + w[1] * d1 + w[2] * d2) / det
    n = (w[0] * e0 + w[1] * e1 + w[2] * e2) / det
    return l >= floor and m >= floor and n >= floor
