"""Files of `problem: contact_trajectory`: mapping -> ContactTask, and by `contact_plan` Plan <-> mapping.

The file's body frame may have any origin and list its vertices either way round.  Inside the package the origin is the
centre of mass and the order counter-clockwise: converted here, once.
"""

from typing import Any

import numpy as np
import shapely

from expert.errors import InvalidProblem
from expert.files.contact_plan import answer_fields, read_answer
from expert.files.fields import SMALLEST, Section, shorten
from expert.geometry.polygon import mass_properties, simple_polygon
from expert.geometry.pose import Array, moved_origin
from expert.problems.contact import ContactTask, Cost, Robustness
from expert.world.environment import Environment
from expert.world.fingers import Fingers
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.walls import HalfPlane

__all__ = ["answer_fields", "read", "read_answer"]

METHODS = ("exact", "thesis", "scip")


def read(data: dict[str, Any]) -> tuple[ContactTask, dict[str, Any]]:
    """The task that a file describes and keyword options for the solver.  Raises InvalidProblem."""
    sections = ("object", "environment", "trajectory", "fingers", "cost", "robustness", "options")
    file = Section(data, "", ("schema", "problem", "description", *sections))
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
    poses = moved_origin(section.array("poses", (None, 3)), com)
    if len(poses) < 2:
        raise InvalidProblem(section.path("poses"), expected="at least 2 poses", got=f"{len(poses)}")
    ends = section.choice("ends", ("steady", "rest"), "steady")
    by_rule = Trajectory.of(poses.tolist(), section.number("dt", positive=True), ends)
    outside = {
        key: moved_origin(section.array(key, (3,)), com) if key in section else getattr(by_rule, key)
        for key in ("before", "after")
    }
    return Trajectory(dt=by_rule.dt, poses=by_rule.poses, **outside)


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
