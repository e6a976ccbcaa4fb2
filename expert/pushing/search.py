"""Beam search over sequences of pushes from a table, scored in time: travel, push, and an estimate of the rest.

Nothing is rolled out here: a push's outcome is the same in the body frame wherever the object is, so that a node costs one
composition of poses.  Plans are compared that end at the goal, or have full depth; a shorter plan that misses would win by
its estimate alone.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from expert.geometry.pose import Array, to_world
from expert.pushing.roads import Roads, distances
from expert.pushing.room import Room, depth_in_walls, finger_fits, fits, way_round
from expert.pushing.table import Table, straight
from expert.world.values import IntArray

Nodes = np.ndarray[tuple[int], np.dtype[np.void]]


class Moves(NamedTuple):
    """A table for compiled code: see `Table`; leads (K, 2) are the farthest commands, in the frame before the push.

    middles (K, 2): the area's centroid after a push, in the frame before it; turns (K, 2): cosine and sine of its turn.
    shorter (K,): first of the pushes, in a row, that this one begins with.
    """

    ways: Roads
    first: IntArray
    shifts: Array
    fingers: Array
    leads: Array
    steps: Array
    middles: Array
    turns: Array
    shorter: IntArray


class Task(NamedTuple):
    """Goals (G, 3), the centroid (2,) of the body's area and its spread, and where object and finger may be."""

    goals: Array
    centroid: Array
    spread: float
    room: Room


class Prices(NamedTuple):
    """Time for a miss, and for each length of the error; for start and stop; way per time; error worth mending.

    Times are control steps, or seconds, as the table has it.
    """

    miss: float
    error: float
    travel: float
    pace: float
    capture: float


NODE = np.dtype(
    [(name, "f8") for name in ("score", "time", "error", "x", "y", "angle", "finger_x", "finger_y")]
    + [(name, "i8") for name in ("parent", "entry")]
)
"""A partial plan: its last push is `entry` of the table; parent is its row among the nodes, -1 for the root."""


def moves_of(table: Table, centroid: Array) -> Moves:
    """A table for compiled code; centroid (2,): of the object's area, in the moving frame."""
    starts, directions, lengths = straight(table.curve, table.parameters)
    begins = np.any(np.diff(table.parameters[:, :2], axis=0) != 0, axis=1)
    turn = table.shifts[:, 2]
    return Moves(
        table.ways,
        table.first,
        table.shifts,
        table.fingers,
        starts + table.model.leads(lengths)[:, None] * directions,
        table.steps.astype(float),
        middles=to_world(table.shifts, centroid[None])[:, 0],
        turns=np.stack([np.cos(turn), np.sin(turn)], -1),
        shorter=np.concatenate([[0], np.flatnonzero(begins) + 1])[np.cumsum([0, *begins])],
    )


def poses_of(nodes: Nodes) -> Array:
    """Poses (n, 3) of nodes (n,)."""
    return np.stack([nodes[name] for name in ("x", "y", "angle")], -1)


@njit(cache=True, error_model="numpy")
def goals_from(task: Task, x: float, y: float, angle: float) -> Array:
    """Goals (G, 4) in the frame of a pose: the area's centroid, cosine and sine of the turn."""
    seen = np.empty((len(task.goals), 4))
    c, s = np.cos(angle), np.sin(angle)
    for g in range(len(task.goals)):
        gx, gy, turn = task.goals[g]
        cg, sg = np.cos(turn), np.sin(turn)
        dx = gx + cg * task.centroid[0] - sg * task.centroid[1] - x
        dy = gy + sg * task.centroid[0] + cg * task.centroid[1] - y
        seen[g, 0], seen[g, 1] = c * dx + s * dy, c * dy - s * dx
        seen[g, 2], seen[g, 3] = cg * c + sg * s, sg * c - cg * s
    return seen


@njit(cache=True, error_model="numpy")
def error_after(goals: Array, spread: float, mx: float, my: float, c: float, s: float) -> float:
    """Root-mean-square displacement from the nearest goal after a push; goals (G, 4) as seen from before it.

    (mx, my): the centroid after the push, in the same frame; c, s: cosine and sine of its turn.
    """
    least = np.inf
    for g in range(len(goals)):
        dx, dy = mx - goals[g, 0], my - goals[g, 1]
        apart = 1 - c * goals[g, 2] - s * goals[g, 3]
        least = min(least, dx * dx + dy * dy + 2 * spread * apart)
    return np.sqrt(max(least, 0.0))


@njit(cache=True, error_model="numpy")
def beam_search(
    moves: Moves, task: Task, prices: Prices, pose: Array, finger: Array, depth: int, width: int, endings: int
) -> tuple[Nodes, Nodes]:
    """Nodes of the beam, level after level, and the best `endings`: pushes that end within the capture radius.

    Both sorted by score within their level; unfilled rows have score inf.
    """
    nodes, ends = unfilled(depth * width), unfilled(endings)
    slack = depth_in_walls(task.room, pose) + 1e-9
    grow(moves, task, prices, root_of(pose, finger), -1, nodes[:width], ends, slack)
    for level in range(1, depth):
        above, beam = nodes[(level - 1) * width : level * width], nodes[level * width : (level + 1) * width]
        grow(moves, task, prices, above, (level - 1) * width, beam, ends, slack)
    return nodes, ends


@njit(cache=True, error_model="numpy")
def root_of(pose: Array, finger: Array) -> Nodes:
    """The plan without a push (1,), from a pose (3,) and with the finger (2,) in its frame."""
    root = unfilled(1)
    root[0].x, root[0].y, root[0].angle = pose
    root[0].finger_x, root[0].finger_y = finger
    root[0].score = 0.0
    return root


@njit(cache=True, error_model="numpy")
def grow(
    moves: Moves, task: Task, prices: Prices, nodes: Nodes, first: int, beam: Nodes, ends: Nodes, slack: float
) -> None:
    """Put the children of nodes (n,), whose rows begin at `first`, into the beam and among the endings."""
    for k in range(len(nodes)):
        if nodes[k].score < np.inf:
            row = first + k if first >= 0 else -1
            _expand(moves, task, prices, nodes[k : k + 1], row, beam, ends, slack)


@njit(cache=True, error_model="numpy")
def unfilled(count: int) -> Nodes:
    """Nodes (count,) of score inf."""
    nodes = np.zeros(count, NODE)
    for k in range(count):
        nodes[k].score, nodes[k].parent, nodes[k].entry = np.inf, -1, -1
    return nodes


@njit(cache=True, error_model="numpy")
def _expand(
    moves: Moves, task: Task, prices: Prices, at: Nodes, row: int, beam: Nodes, ends: Nodes, slack: float
) -> None:
    """Children of one node, from all stations that the finger can reach."""
    node = at[0]
    c, s = np.cos(node.angle), np.sin(node.angle)
    stations = len(moves.first) - 1
    ways, corner = np.empty(stations), np.empty(stations, np.int64)
    distances(moves.ways, node.finger_x, node.finger_y, ways, corner)
    goals = goals_from(task, node.x, node.y, node.angle)
    for station in range(stations):
        sx, sy = moves.ways.stations[station]
        x, y = node.x + c * sx - s * sy, node.y + s * sx + c * sy
        if ways[station] < np.inf and finger_fits(task.room, x, y):
            start = node.time + prices.travel + ways[station] / prices.pace
            _push(moves, task, prices, at, row, goals, station, start, beam, ends, slack)


@njit(cache=True, error_model="numpy")
def _push(
    moves: Moves,
    task: Task,
    prices: Prices,
    at: Nodes,
    row: int,
    goals: Array,
    station: int,
    start: float,
    beam: Nodes,
    ends: Nodes,
    slack: float,
) -> None:
    """Put the best push from a station into the beam, and what ends near the goal among the endings."""
    node, child, best = at[0], unfilled(1), unfilled(1)
    best[0].score = beam[-1].score
    for entry in range(moves.first[station], moves.first[station + 1]):
        time = start + moves.steps[entry]
        if time + prices.miss >= best[0].score and time >= ends[-1].score:
            continue
        (mx, my), (ct, st) = moves.middles[entry], moves.turns[entry]
        error = error_after(goals, task.spread, mx, my, ct, st)
        soon = time + prices.error * error
        good, ending = soon + prices.miss < best[0].score, error <= prices.capture and soon < ends[-1].score
        if (good or ending) and _is_free(moves, task.room, at, entry, slack):
            new = child[0]
            _carry_out(moves, node, entry, new)
            new.time, new.error, new.parent, new.entry = time, error, row, entry
            if ending:
                new.score = soon
                _insert(ends, child)
            new.score = soon + prices.miss + prices.error * _detour(task, new, error)
            if new.score < best[0].score:
                best[0] = child[0]
    if best[0].entry >= 0:
        _insert(beam, best)


@njit(cache=True, error_model="numpy")
def _carry_out(moves: Moves, node: Any, entry: int, new: Any) -> None:
    """Pose and finger after a push."""
    c, s = np.cos(node.angle), np.sin(node.angle)
    dx, dy, turn = moves.shifts[entry]
    new.x, new.y, new.angle = node.x + c * dx - s * dy, node.y + s * dx + c * dy, node.angle + turn
    new.finger_x, new.finger_y = moves.fingers[entry]


@njit(cache=True, error_model="numpy")
def _is_free(moves: Moves, room: Room, at: Nodes, entry: int, slack: float) -> bool:
    """Whether a push ends where object and finger may be; among obstacles, whether the pushes that it begins with do so, too."""
    node = at[0]
    c, s = np.cos(node.angle), np.sin(node.angle)
    lead_x, lead_y = moves.leads[entry]
    if not finger_fits(room, node.x + c * lead_x - s * lead_y, node.y + s * lead_x + c * lead_y):
        return False
    alone = len(room.obstacles.first) == 1
    for k in range(entry if alone else moves.shorter[entry], entry + 1):
        dx, dy, turn = moves.shifts[k]
        if not fits(room, node.x + c * dx - s * dy, node.y + s * dx + c * dy, node.angle + turn, slack):
            return False
    return True


@njit(cache=True, error_model="numpy")
def _detour(task: Task, node: Any, error: float) -> float:
    """By how much the way round the obstacles is longer than the error."""
    c, s = np.cos(node.angle), np.sin(node.angle)
    x, y = (
        node.x + c * task.centroid[0] - s * task.centroid[1],
        node.y + s * task.centroid[0] + c * task.centroid[1],
    )
    return max(0.0, way_round(task.room.field, x, y) - error)


@njit(cache=True, error_model="numpy")
def _insert(rows: Nodes, new: Nodes) -> None:
    """Keep the rows sorted by score; the last one falls out."""
    k = len(rows) - 1
    if new[0].score >= rows[k].score:
        return
    while k > 0 and rows[k - 1].score > new[0].score:
        rows[k] = rows[k - 1]
        k -= 1
    rows[k] = new[0]
