"""Files of `problem: contact_trajectory`: mapping -> ContactTask, Plan <-> mapping.

The file's body frame may have any origin and list its vertices either way round.  Inside the package the origin is the
centre of mass and the order counter-clockwise; both are converted here, once, and indices back again on writing.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from expert.errors import InvalidProblem
from expert.files.fields import SMALLEST, Section, shorten
from expert.geometry.polygon import mass_properties, signed_area, simple_polygon
from expert.geometry.pose import Array, to_world
from expert.types import (
    FREE,
    SUPPORT,
    Body,
    ContactForce,
    ContactTask,
    Cost,
    Environment,
    Fingers,
    HalfPlane,
    IntArray,
    Plan,
    Robustness,
    Status,
    Trajectory,
)

if TYPE_CHECKING:
    from expert.files import Problem

METHODS = ("exact", "thesis", "scip")
STATUSES: tuple[Status, ...] = ("optimal", "feasible", "infeasible", "time_limit")


def read(data: dict[str, Any]) -> tuple[ContactTask, dict[str, Any]]:
    """The task that a file describes and keyword options for the solver.  Raises InvalidProblem."""
    file = Section(
        data,
        "",
        (
            "schema",
            "problem",
            "description",
            "object",
            "environment",
            "trajectory",
            "fingers",
            "cost",
            "robustness",
            "options",
        ),
    )
    file.text("description", "")
    body, com = _read_body(file.section("object", ("vertices", "mass", "com", "inertia")))
    environment = _read_environment(
        file.section("environment", ("plane", "gravity", "walls", "support_friction"))
    )
    trajectory = _read_trajectory(file.section("trajectory", ("dt", "poses", "ends", "before", "after")), com)
    task = ContactTask(
        body=body,
        environment=environment,
        trajectory=trajectory,
        fingers=_read_fingers(file, 10 * body.mass * environment.gravity),
        cost=_read_cost(file),
        robustness=_read_robustness(file),
    )
    return task, _read_options(file)


def _read_body(section: Section) -> tuple[Body, Array]:
    """Body about its centre of mass, and the centre of mass in the file's body frame."""
    listed = section.array("vertices", (None, 2))
    field = section.path("vertices")
    if len(listed) and np.ptp(listed, axis=0).max() < SMALLEST:
        raise InvalidProblem(field, expected=f"an object larger than {SMALLEST:g} m", got="a smaller one")
    vertices = simple_polygon(listed, field=field)
    mass = section.number("mass", positive=True)
    plate = mass_properties(vertices)
    com = section.array("com", (2,)) if "com" in section else plate.centroid
    if not shapely.MultiPoint(vertices).convex_hull.buffer(SMALLEST).covers(shapely.Point(com)):
        raise InvalidProblem(
            section.path("com"), expected="a point inside the object's hull", got=shorten(com.tolist())
        )
    offset = com - plate.centroid
    uniform = mass * (plate.second_moment / plate.area + float(offset @ offset))
    inertia = section.number("inertia", positive=False) if "inertia" in section else uniform
    return Body(vertices=vertices - com, mass=mass, inertia=inertia), com


def _read_environment(section: Section) -> Environment:
    walls = section.sections("walls", ("point", "normal", "friction"))
    return Environment(
        plane=section.choice("plane", ("sagittal", "transverse"), "sagittal"),  # type: ignore[arg-type]
        gravity=section.number("gravity", 9.81, positive=True),
        walls=tuple(_read_wall(wall) for wall in walls),
        support_friction=section.number("support_friction", 0.3),
    )


def _read_wall(section: Section) -> HalfPlane:
    normal = section.array("normal", (2,))
    length = float(np.linalg.norm(normal))
    if length < SMALLEST:
        raise InvalidProblem(
            section.path("normal"), expected="a direction into free space", got="a zero vector"
        )
    return HalfPlane(
        point=section.array("point", (2,)),
        normal=normal / length,
        friction=section.number("friction", 0.0),
        name=section.name,
    )


def _read_trajectory(section: Section, com: Array) -> Trajectory:
    """Poses of the centre of mass; the end rule applies to its motion."""
    poses = _moved_origin(section.array("poses", (None, 3)), com)
    if len(poses) < 2:
        raise InvalidProblem(section.path("poses"), expected="at least 2 poses", got=f"{len(poses)}")
    ends = section.choice("ends", ("steady", "rest"), "steady")
    by_rule = Trajectory.of(poses.tolist(), section.number("dt", positive=True), ends)
    outside = {
        key: _moved_origin(section.array(key, (3,)), com) if key in section else getattr(by_rule, key)
        for key in ("before", "after")
    }
    return Trajectory(dt=by_rule.dt, poses=by_rule.poses, **outside)


def _moved_origin(poses: Array, com: Array) -> Array:
    """Poses (..., 3) of the file's body frame as poses of the parallel frame at the centre of mass."""
    return np.concatenate([to_world(poses, com[None])[..., 0, :], poses[..., 2:]], axis=-1)


def _read_fingers(file: Section, default_force: float) -> Fingers:
    section = file.section("fingers", ("count", "friction", "max_force", "facet_margin", "clearance"))
    return Fingers(
        count=section.integer("count", least=1),
        friction=section.number("friction"),
        max_force=section.number("max_force", default_force),
        facet_margin=section.number("facet_margin", 0.05),
        clearance=section.number("clearance", 0.002),
    )


def _read_cost(file: Section) -> Cost:
    section = file.section("cost", ("force", "acceleration", "margin"), optional=True)
    return Cost(
        force=section.number("force", 1.0),
        acceleration=section.number("acceleration", 1.0),
        margin=section.number("margin", 0.0),
    )


def _read_robustness(file: Section) -> Robustness:
    keys = ("cone_fraction", "support_inset", "min_normal_force", "min_interval", "free_clearance")
    section = file.section("robustness", keys, optional=True)
    return Robustness(
        cone_fraction=section.number("cone_fraction", 1.0),
        support_inset=section.number("support_inset", 0.0),
        min_normal_force=section.number("min_normal_force", 0.0),
        min_interval=section.integer("min_interval", 1, least=1),
        free_clearance=section.number("free_clearance", 0.0),
    )


def _read_options(file: Section) -> dict[str, Any]:
    section = file.section("options", ("gap", "time_limit", "method", "node_limit"), optional=True)
    gap, time_limit = section.number("gap", 1e-3), section.number("time_limit", 60.0, positive=True)
    if not 0 <= gap < 1:
        raise InvalidProblem(section.path("gap"), expected="a fraction in [0, 1)", got=f"{gap:g}")
    options = {"gap": gap, "time_limit": time_limit, "method": section.choice("method", METHODS, "exact")}
    return options | (
        {"node_limit": section.integer("node_limit", least=1)} if "node_limit" in section else {}
    )


def answer_fields(problem: "Problem", plan: Plan) -> dict[str, Any]:
    """The plan as plain JSON values, facets and vertices numbered as in the problem file; null where there is none."""
    numbering = _Numbering(problem)
    summary = {
        "status": plan.status,
        "objective": _number(plan.objective),
        "bound": _number(plan.bound),
        "gap": _number(plan.gap),
        "seconds": plan.seconds,
        "nodes": plan.nodes,
    }
    if not plan.found:
        return {**summary, "reason": plan.reason}
    return {
        **summary,
        "modes": [[None if f == FREE else f for f in row] for row in numbering.facets(plan.modes).tolist()],
        "finger_positions": plan.positions.tolist(),
        "finger_forces": plan.forces.tolist(),
        "contact_forces": [
            {
                "step": c.step,
                "vertex": numbering.vertex(c.vertex),
                "wall": None if c.wall == SUPPORT else c.wall,
                "point": c.point.tolist(),
                "force": c.force.tolist(),
            }
            for c in plan.contact_forces
        ],
        "residual": _number(plan.residual),
        "reason": plan.reason,
    }


def read_answer(problem: "Problem", data: dict[str, Any]) -> Plan:
    """The plan of a solution file, checked for form (its truth is what `expert.verify` checks).  Raises InvalidProblem."""
    keys = (
        "status",
        "objective",
        "bound",
        "gap",
        "seconds",
        "nodes",
        "modes",
        "finger_positions",
        "finger_forces",
    )
    file = Section(data, "", (*keys, "contact_forces", "residual", "reason"))
    status: Any = file.choice("status", STATUSES)
    summary = {
        "status": status,
        "objective": file.number("objective", np.inf),
        "bound": file.number("bound", -np.inf),
        "seconds": file.number("seconds", 0.0),
        "nodes": file.integer("nodes", 0),
        "residual": file.number("residual", np.nan),
        "reason": file.text("reason", ""),
    }
    if status not in ("optimal", "feasible"):
        return Plan(**summary)
    numbering, task = _Numbering(problem), problem.task
    shape = (task.steps, task.fingers.count, 2)
    return Plan(
        **summary,
        modes=numbering.facets(_read_modes(file, shape[:2], len(task.body.vertices))),
        positions=file.array("finger_positions", shape),
        forces=file.array("finger_forces", shape),
        contact_forces=tuple(
            _read_contact(section, task, numbering)
            for section in file.sections("contact_forces", ("step", "vertex", "wall", "point", "force"))
        ),
    )


class _Numbering:
    """Facets and vertices of a file that lists them clockwise, to and from the package's counter-clockwise ones."""

    def __init__(self, problem: "Problem") -> None:
        listed = np.array(problem.data["object"]["vertices"], dtype=float)
        self.count, self.clockwise = len(listed), signed_area(listed) < 0

    def vertex(self, index: int) -> int:
        """Either way: the conversion is its own inverse."""
        return -index % self.count if self.clockwise else index

    def facets(self, modes: IntArray) -> IntArray:
        """Either way, FREE kept."""
        return np.where(modes == FREE, FREE, self.count - 1 - modes) if self.clockwise else modes


def _read_modes(file: Section, shape: tuple[int, int], facets: int) -> IntArray:
    field, rows = file.path("modes"), file.take("modes", "facets by step and finger")
    if not isinstance(rows, list) or len(rows) != shape[0]:
        raise InvalidProblem(field, expected=f"a list of {shape[0]} lists", got=shorten(rows))
    for t, row in enumerate(rows):
        valid = isinstance(row, list) and len(row) == shape[1]
        if not valid or not all(f is None or (type(f) is int and 0 <= f < facets) for f in row):
            what = f"{shape[1]} facets from 0 to {facets - 1}, or null"
            raise InvalidProblem(f"{field}[{t}]", expected=what, got=shorten(row))
    return np.array([[FREE if f is None else f for f in row] for row in rows], dtype=np.int64)


def _read_contact(section: Section, task: ContactTask, numbering: _Numbering) -> ContactForce:
    """One environment force; where no point is given it acts at the vertex."""
    step = _index(section, "step", task.steps)
    vertex = numbering.vertex(_index(section, "vertex", len(task.body.vertices)))
    wall = _index(section, "wall", len(task.environment.walls)) if "wall" in section else SUPPORT
    at_vertex = to_world(task.trajectory.poses[step], task.body.vertices)[vertex]
    point = section.array("point", (2,)) if "point" in section else at_vertex
    return ContactForce(step=step, vertex=vertex, wall=wall, point=point, force=section.array("force", (2,)))


def _index(section: Section, key: str, count: int) -> int:
    index = section.integer(key)
    if index >= count:
        raise InvalidProblem(section.path(key), expected=f"an index from 0 to {count - 1}", got=f"{index}")
    return index


def _number(value: float) -> float | None:
    """JSON knows neither infinity nor nan."""
    return float(value) if np.isfinite(value) else None
