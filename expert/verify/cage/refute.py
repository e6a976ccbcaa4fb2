"""Random search for escapes: a test oracle that shares nothing with the cage verifier but the exact move check.

A rapidly exploring random tree over poses.  Each extension is a translation followed by a turn about the object's
reference point, or the other way round; whatever part of it is collision-free is kept.  Failing to escape proves nothing.
"""

import numba
import numpy as np
import shapely

from expert.geometry.pose import Array, to_world
from expert.problems.cage import START_TOLERANCE, Arrangement
from expert.verify.cage.escape import core_edges, escape_fault, move_collides


def random_escape(arrangement: Arrangement, rng: np.random.Generator, *, nodes: int = 2000) -> Array | None:
    """Body poses (K, 3) of an escape that passes the exact check, or None if a tree of `nodes` poses found none."""
    shape = arrangement.shape
    core = shapely.Polygon(shape.vertices).buffer(-START_TOLERANCE * shape.size, join_style="mitre")
    centre = np.array(shapely.MultiPoint(shape.vertices).convex_hull.centroid.coords[0])
    radius = float(np.linalg.norm(shape.vertices - centre, axis=1).max())
    start = np.append(to_world(arrangement.pose, centre[None])[0], arrangement.pose[2])
    obstacles = np.concatenate([arrangement.fingers, arrangement.wall_ends.reshape(-1, 2)])
    middle = obstacles.mean(axis=0)
    reach = radius * 1.001 + float(np.linalg.norm(obstacles - middle, axis=1).max())
    draws = rng.random((6 * nodes, 7))
    edges = core_edges(core) - centre
    walls = arrangement.wall_ends
    tree, parents, count = _grow(
        start, edges, np.array(arrangement.fingers), walls, middle, reach, radius, nodes, draws
    )
    if np.linalg.norm(tree[count - 1, :2] - middle) <= reach:
        return None
    path = body_poses(_trace(tree, parents, count - 1), centre)
    path[0] = arrangement.pose
    return path if escape_fault(arrangement, path) is None else None


def body_poses(reference_poses: Array, centre: Array) -> Array:
    """Poses of the body frame where (x, y, theta) are those of a parallel frame at `centre` of it."""
    return np.array([np.append(to_world(q, -centre[None])[0], q[2]) for q in reference_poses])


def _trace(tree: Array, parents: Array, k: int) -> Array:
    chain = [k]
    while parents[chain[-1]] >= 0:
        chain.append(int(parents[chain[-1]]))
    return tree[chain[::-1]]


@numba.njit(cache=True)
def _grow(
    start: Array,
    edges: Array,
    fingers: Array,
    walls: Array,
    middle: Array,
    reach: float,
    radius: float,
    nodes: int,
    draws: Array,
) -> tuple[Array, Array, int]:
    """Tree of reference poses (nodes, 3), parents and the node count; the last node is outside `reach` on success."""
    tree, parents = np.empty((nodes, 3)), np.full(nodes, -1)
    tree[0], count = start, 1
    for draw in draws:
        if count + 2 > nodes:
            break
        target = np.empty(3)
        target[0] = middle[0] + 1.5 * reach * (2 * draw[0] - 1)
        target[1] = middle[1] + 1.5 * reach * (2 * draw[1] - 1)
        target[2] = start[2] + 2 * np.pi * (draw[2] - 0.5)
        explore = draw[3] < 0.3  # around what is already there
        near = int(draw[4] * count) if explore else _nearest(tree, count, target, radius)
        stretch = 10.0 ** (-2.5 * draw[5])
        here = tree[near].copy()
        gap = target - here
        length = np.sqrt(gap[0] ** 2 + gap[1] ** 2)
        move = gap * min(1.0, stretch * radius / max(length, 1e-12))
        move[2] = min(max(gap[2], -stretch), stretch)
        parent = near
        turn_first = draw[6] < 0.5
        for phase in range(2):
            there = here.copy()
            if (phase == 0) == turn_first:
                there[2] += move[2]
            else:
                there[:2] += move[:2]
            for _halving in range(4):
                if not move_collides(here, there, edges, fingers, walls):
                    tree[count], parents[count] = there, parent
                    here, parent, count = there, count, count + 1
                    break
                there = 0.5 * (here + there)
        dx, dy = here[0] - middle[0], here[1] - middle[1]
        if dx * dx + dy * dy > reach * reach:
            break
    return tree, parents, count


@numba.njit(cache=True)
def _nearest(tree: Array, count: int, target: Array, radius: float) -> int:
    best, least = 0, np.inf
    for k in range(count):
        dx, dy = tree[k, 0] - target[0], tree[k, 1] - target[1]
        turn = radius * (tree[k, 2] - target[2])
        d = dx * dx + dy * dy + turn * turn
        if d < least:
            best, least = k, d
    return best
