"""The finger's way to its next push, among obstacles and round the object at rest: a visibility graph in the world."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import shortest_path

from expert.geometry.pose import Array
from expert.problems.push import PushProblem

CUT = 0.999
"""Ways along the edge of what they avoid are clear: that much of the clearance is asked for."""
OFF = 1.2
"""A finger that touches the object first leaves it, to this multiple of the clearance."""


@dataclass(frozen=True)
class Detours:
    """Ways of the finger of a problem."""

    problem: PushProblem

    @cached_property
    def room(self) -> shapely.Geometry:
        """Where the finger's centre may be, but for the object."""
        return self.problem.finger_room(clearance=CUT * self.problem.clearance)

    @cached_property
    def corners(self) -> Array:
        """Of the obstacles, as far off as the finger keeps (n, 2)."""
        grown = [self._grown(obstacle.vertices) for obstacle in self.problem.obstacles]
        return np.concatenate([np.zeros((0, 2)), *grown])

    def way(self, pose: Array, start: Array, end: Array) -> Array | None:
        """Shortest way (n, 2) from start (2,) to end (2,), without the start, beside the object at a pose (3,); None: none.

        From within the clearance the finger first goes straight off the object.
        """
        outline = self.problem.outline(pose)
        body = shapely.Polygon(outline)
        away = self._off(body, start)
        if away is None:
            return None
        free = self.room - body.buffer(self.problem.radius + CUT * self.problem.clearance)
        shapely.prepare(free)
        nodes = np.concatenate([away[-1:], end[None], self._grown(outline), self.corners])
        nodes = nodes[shapely.covers(free, shapely.points(nodes))]
        if len(nodes) < 2 or (nodes[0] != away[-1]).any() or (nodes[1] != end).any():
            return None
        chain = _shortest(free, nodes)
        return None if chain is None else np.concatenate([away[1:], nodes[chain[1:]]])

    def _grown(self, outline: Array) -> Array:
        """Corners of an outline as far off as the finger keeps."""
        kept = self.problem.radius + self.problem.clearance
        grown = shapely.buffer(shapely.Polygon(outline), kept, join_style="mitre", mitre_limit=2.0)
        return np.array(grown.exterior.coords)[:-1]

    def _off(self, body: shapely.Polygon, start: Array) -> Array | None:
        """From the start (2,) to where the clearance is kept (1 or 2, 2); None: it is not kept there either."""
        p = shapely.Point(start)
        gap = body.distance(p) - self.problem.radius
        if gap >= self.problem.clearance:
            return start[None]
        near = shapely.get_coordinates(shapely.shortest_line(p, body))[1]
        if (reach := float(np.linalg.norm(start - near))) == 0:
            return None
        out = near + (start - near) * (self.problem.radius + OFF * self.problem.clearance) / reach
        line = shapely.LineString([start, out])
        clear = body.distance(shapely.Point(out)) >= self.problem.radius + self.problem.clearance
        return np.stack([start, out]) if clear and self.room.covers(line) else None


def _shortest(free: shapely.Geometry, nodes: Array) -> list[int] | None:
    """Rows of the nodes (N, 2) on the shortest way from the first to the second."""
    i, j = np.triu_indices(len(nodes), 1)
    seen = shapely.covers(free, shapely.linestrings(np.stack([nodes[i], nodes[j]], axis=1)))
    i, j = i[seen], j[seen]
    lengths = np.maximum(np.linalg.norm(nodes[i] - nodes[j], axis=1), 1e-12)
    graph = csr_matrix((lengths, (i, j)), shape=(len(nodes), len(nodes)))
    total, before = shortest_path(graph, directed=False, indices=0, return_predecessors=True)
    if not np.isfinite(total[1]):
        return None
    chain = [1]
    while chain[0] != 0:
        chain.insert(0, int(before[chain[0]]))
    return chain


def lengths_to(problem: PushProblem, goal: Array, nodes: int) -> tuple[Array, Array, float]:
    """Lengths (R, C) of the ways of the object's centroid to the goal (2,) on a grid of about `nodes` a side; first node; cell.

    A disc about the centroid that lies in the object keeps clear of obstacles on them: no way of the object is shorter.
    """
    low, high = problem.bounds[:2], problem.bounds[2:]
    cell = float((high - low).max()) / nodes
    x, y = (np.arange(a, b + cell / 2, cell) for a, b in zip(low, high, strict=True))
    points = np.stack(np.meshgrid(x, y), -1)
    body, solid = (
        shapely.Polygon(problem.shape.vertices),
        [shapely.Polygon(o.vertices) for o in problem.obstacles],
    )
    centre = shapely.Point(problem.centroid)
    core = float(body.exterior.distance(centre)) if body.covers(centre) else 0.0
    # A way between two nodes that are free may graze what lies between them: half a cell's diagonal is let through.
    free = shapely.distance(shapely.points(points), shapely.union_all(solid)) >= core - 0.71 * cell
    rows, columns = free.shape
    index = np.arange(rows * columns).reshape(rows, columns)
    links = []
    for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = index[: rows - dr, max(0, -dc) : columns - max(0, dc)]
        b = index[dr:, max(0, dc) : columns + min(0, dc)]
        both = free.ravel()[a] & free.ravel()[b]
        links.append(np.stack([a[both], b[both], np.full(both.sum(), cell * np.hypot(dr, dc))]))
    i, j, length = np.concatenate(links, axis=1)
    graph = csr_matrix((length, (i.astype(int), j.astype(int))), shape=(index.size, index.size))
    at = np.rint((goal - low) / cell).astype(int)
    found = shortest_path(graph, directed=False, indices=index[at[1], at[0]])
    return found.reshape(rows, columns), low, cell
