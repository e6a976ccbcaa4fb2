"""Random search for escapes: an oracle that shares nothing with the cage verifier but the exact move check.

A rapidly exploring random tree over poses.  Each extension is a translation followed by a turn about the object's
reference point, or the other way round; whatever part of it is collision-free is kept.  Failing to escape proves nothing.
"""

from typing import NamedTuple

import numba
import numpy as np
import shapely

from expert.geometry.pose import Array, to_world
from expert.problems.cage import START_TOLERANCE, Arrangement
from expert.verify.cage.escape import core_edges, escape_fault, move_collides


class Search(NamedTuple):
    """Edges of the object (E, 2, 2) about its reference point, obstacles, and the circle that it must leave."""

    edges: Array
    fingers: Array
    walls: Array
    radius: float
    middle: Array
    reach: float


def random_escape(arrangement: Arrangement, rng: np.random.Generator, *, nodes: int = 2000) -> Array | None:
    """Body poses (K, 3) of an escape that passes the exact check, or None if a tree of `nodes` poses found none."""
    shape = arrangement.shape
    core = shapely.Polygon(shape.vertices).buffer(-START_TOLERANCE * shape.size, join_style="mitre")
    centre = np.array(shapely.MultiPoint(shape.vertices).convex_hull.centroid.coords[0])
    radius = float(np.linalg.norm(shape.vertices - centre, axis=1).max())
    obstacles = np.concatenate([arrangement.fingers, arrangement.wall_ends.reshape(-1, 2)])
    middle = obstacles.mean(axis=0)
    search = Search(
        core_edges(core) - centre, np.array(arrangement.fingers), arrangement.wall_ends, radius, middle,
        radius * 1.001 + float(np.linalg.norm(obstacles - middle, axis=1).max()),
    )  # fmt: skip
    start = np.append(to_world(arrangement.pose, centre[None])[0], arrangement.pose[2])
    tree, parents = _grow(search, start, nodes, rng.random((6 * nodes, 7)))
    if np.linalg.norm(tree[-1, :2] - middle) <= search.reach:
        return None
    path = _body_poses(_trace(tree, parents), centre)
    path[0] = arrangement.pose
    return path if escape_fault(arrangement, path) is None else None


def _body_poses(reference_poses: Array, centre: Array) -> Array:
    """Poses of the body frame where (x, y, theta) are those of a parallel frame at `centre` of it."""
    return np.array([np.append(to_world(q, -centre[None])[0], q[2]) for q in reference_poses])


def _trace(tree: Array, parents: Array) -> Array:
    """From the root to the last node."""
    chain = [len(tree) - 1]
    while parents[chain[-1]] >= 0:
        chain.append(int(parents[chain[-1]]))
    return tree[chain[::-1]]


@numba.njit(cache=True)
def _grow(search: Search, start: Array, nodes: int, draws: Array) -> tuple[Array, Array]:
    """Tree of at most so many reference poses (n, 3), and parents (n,); the last one is outside on success."""
    tree, parents = np.empty((nodes, 3)), np.full(nodes, -1)
    tree[0], count = start, 1
    for draw in draws:
        if count + 2 > nodes:
            break
        parent, move = _extension(search, tree[:count], draw)
        here = tree[parent].copy()
        turn_first = draw[6] < 0.5
        for phase in range(2):
            step = np.zeros(3)
            if (phase == 0) == turn_first:
                step[2] = move[2]
            else:
                step[:2] = move[:2]
            there, moved = _as_far_as_possible(search, here, here + step)
            if moved:
                tree[count], parents[count] = there, parent
                here, parent, count = there, count, count + 1
        if np.sqrt(((here[:2] - search.middle) ** 2).sum()) > search.reach:
            break
    return tree[:count], parents[:count]


@numba.njit(cache=True)
def _extension(search: Search, tree: Array, draw: Array) -> tuple[int, Array]:
    """A node to extend and a move (3,) towards a random pose: at times around what is there, else from the nearest node."""
    target = np.empty(3)
    target[:2] = search.middle + 1.5 * search.reach * (2 * draw[:2] - 1)
    target[2] = tree[0, 2] + 2 * np.pi * (draw[2] - 0.5)
    node = int(draw[4] * len(tree)) if draw[3] < 0.3 else _nearest(tree, target, search.radius)
    stretch = 10.0 ** (-2.5 * draw[5])
    gap = target - tree[node]
    length = np.sqrt(gap[0] ** 2 + gap[1] ** 2)
    move = gap * min(1.0, stretch * search.radius / max(length, 1e-12))
    move[2] = min(max(gap[2], -stretch), stretch)
    return node, move


@numba.njit(cache=True)
def _as_far_as_possible(search: Search, here: Array, there: Array) -> tuple[Array, bool]:
    """The whole move, or its half, or its half ... that does not collide, and whether there is one."""
    for _halving in range(4):
        if not move_collides(here, there, search.edges, search.fingers, search.walls):
            return there, True
        there = 0.5 * (here + there)
    return here, False


@numba.njit(cache=True)
def _nearest(tree: Array, target: Array, radius: float) -> int:
    best, least = 0, np.inf
    for k in range(len(tree)):
        dx, dy = tree[k, 0] - target[0], tree[k, 1] - target[1]
        turn = radius * (tree[k, 2] - target[2])
        d = dx * dx + dy * dy + turn * turn
        if d < least:
            best, least = k, d
    return best
