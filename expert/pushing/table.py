"""What pushes do to an object, in its own frame: rolled out once, composed ever after."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from expert.geometry.pose import Array, perpendicular
from expert.pushing.contour import Contour, contour, turned
from expert.pushing.roads import Roads, roads
from expert.world.shape import Shape
from expert.world.values import IntArray, require


class PushModel(Protocol):
    """How an object answers to straight pushes by a disc of `radius`; frame: the shape's, moved to `origin`."""

    @property
    def shape(self) -> Shape: ...
    @property
    def origin(self) -> Array: ...
    @property
    def radius(self) -> float: ...
    def steps(self, lengths: Array) -> Array | IntArray:
        """How long pushes of lengths (N,) take: control steps, or seconds."""

    def leads(self, lengths: Array) -> Array:
        """How far the commands of such pushes reach beyond their starts (N,)."""

    def outcomes(self, starts: Array, directions: Array, lengths: Array) -> tuple[Array, Array]:
        """Pose changes (N, 3), and the finger's end in the new frame (N, 2), of pushes along unit directions (N, 2)."""


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Which pushes a table holds: stations on the stand-off curve, angles to its normal [rad], lengths; gap of the curve.

    least: pushes that move the object less are left out.  wobble: how well the finger's place beside the object is known;
    pushes whose ends differ by more than `spread` wobbles where they start a wobble aside are left out, too.
    """

    stations: int = 60
    angles: tuple[float, ...] = tuple(np.deg2rad([-45, -30, -15, 0, 15, 30, 45]))
    lengths: tuple[float, ...] = (16, 22, 28, 36, 44, 54, 66, 80, 96, 112, 130, 150, 170, 190)
    gap: float = 6.0
    least: float = 1.0
    wobble: float = 0.0
    spread: float = 6.0

    def __post_init__(self) -> None:
        require(self.stations >= 3, "grid.stations", "at least 3", self.stations)
        require(len(self.angles) > 0 and len(self.lengths) > 0, "grid", "angles and lengths", "none")
        require(min(self.lengths) > 0 and self.gap >= 0, "grid", "positive lengths", min(self.lengths))


@dataclass(frozen=True)
class Table:
    """Pushes K, sorted by station: parameters (K, 3) = (arc length, angle, length), pose changes (K, 3), fingers (K, 2), steps (K,).

    Pushes of station s are those from first[s] to first[s + 1]; ways: the finger's, round the object to the stations.
    """

    model: PushModel
    curve: Contour
    grid: Grid
    parameters: Array
    shifts: Array
    fingers: Array
    steps: Array | IntArray
    first: IntArray
    ways: Roads

    @cached_property
    def stations(self) -> Array:
        """Arc lengths (S,) of the stations."""
        count = len(self.first) - 1
        return np.arange(count) * self.curve.length / count

    def outcomes(self, parameters: Array) -> tuple[Array, Array]:
        """Pose changes (N, 3) and fingers (N, 2) of any pushes (N, 3), in the table or between its entries."""
        return self.model.outcomes(*straight(self.curve, parameters))


def straight(curve: Contour, parameters: Array) -> tuple[Array, Array, Array]:
    """Starts (N, 2), unit directions (N, 2) and lengths (N,) of pushes (arc length, angle, length)."""
    starts, normals = curve.at(parameters[:, 0])
    return starts, turned(normals, parameters[:, 1]), parameters[:, 2]


def span(model: PushModel, a: Array, b: Array) -> Array:
    """How far pose changes (N, 3) are apart (N,): position, and angle at half the object's size."""
    difference = a - b
    return np.hypot(np.hypot(difference[:, 0], difference[:, 1]), model.shape.size / 2 * difference[:, 2])


def steadiness(model: PushModel, curve: Contour, parameters: Array, shifts: Array, wobble: float) -> Array:
    """How far pushes (N, 3) end at most from their `shifts` (N, 3) where they start a wobble to either side (N,)."""
    if wobble == 0:
        return np.zeros(len(parameters))
    starts, directions, lengths = straight(curve, parameters)
    aside = wobble * perpendicular(directions)
    ends = (model.outcomes(starts + side, directions, lengths)[0] for side in (aside, -aside))
    return np.max([span(model, end, shifts) for end in ends], axis=0)


def push_table(model: PushModel, grid: Grid) -> Table:
    """Roll out all pushes of a grid; those that move the object by less than grid.least are left out, and unsteady ones."""
    curve = contour(model.shape, model.origin, model.radius + grid.gap)
    stations = np.arange(grid.stations) * curve.length / grid.stations
    axes = np.meshgrid(stations, grid.angles, grid.lengths, indexing="ij")
    parameters = np.stack([axis.ravel() for axis in axes], -1)
    station = np.repeat(np.arange(grid.stations), len(grid.angles) * len(grid.lengths))
    ways = roads(model.shape, model.origin, model.radius, grid.gap, curve.at(stations)[0])
    rolled = _rolled_out(model, curve, grid, parameters, station, ways)
    unsteady = steadiness(model, curve, rolled.parameters, rolled.shifts, grid.wobble)
    return _part(rolled, unsteady <= grid.spread * grid.wobble)


def again(model: PushModel, table: Table) -> Table:
    """The pushes of a table under another model of the same outline, as far as they move the object."""
    station = np.repeat(np.arange(len(table.first) - 1), np.diff(table.first))
    return _rolled_out(model, table.curve, table.grid, table.parameters, station, table.ways)


def _rolled_out(
    model: PushModel, curve: Contour, grid: Grid, parameters: Array, station: IntArray, ways: Roads
) -> Table:
    """The table of pushes (N, 3) from stations (N,), without those that move the object too little."""
    shifts, fingers = model.outcomes(*straight(curve, parameters))
    first = np.searchsorted(station, np.arange(grid.stations + 1))
    steps = model.steps(parameters[:, 2])
    whole = Table(model, curve, grid, parameters, shifts, fingers, steps, first, ways)
    return _part(whole, span(model, shifts, 0 * shifts) >= grid.least)


def _part(table: Table, kept: np.ndarray) -> Table:
    """The pushes of a mask (K,)."""
    before = np.concatenate([[0], np.cumsum(kept)])
    names = ("parameters", "shifts", "fingers", "steps")
    rows = {name: getattr(table, name)[kept] for name in names}
    return replace(table, **rows, first=before[table.first])
