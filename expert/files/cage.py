"""Files of `problem: cage`: mapping -> CageProblem, or Arrangement where finger positions are given; CageSolution <-> mapping."""

from typing import TYPE_CHECKING, Any

import numpy as np

from expert.errors import InvalidProblem
from expert.files.fields import SMALLEST, Section, checked_array, shorten
from expert.geometry.pose import Array
from expert.problems.cage import Arrangement, CageProblem, CageSolution, CageStatus, HalfRanges, Meeting
from expert.world.fingers import Gripper
from expert.world.shape import Shape
from expert.world.walls import Segment

if TYPE_CHECKING:
    from expert.files import Problem

METHODS = ("swept", "model", "thesis")
SOLVERS = ("highs", "scip")
COSTS = ("none", "min_separation", "max_opening")
STATUSES: tuple[CageStatus, ...] = ("caged", "none_found", "time_limit")
_MEETING = ("element", "piece", "next_element", "next_piece")


def read(data: dict[str, Any]) -> tuple[CageProblem | Arrangement, dict[str, Any]]:
    """The task that a file describes and keyword options for the solver.  Raises InvalidProblem."""
    keys = ("schema", "problem", "description", "object", "pose", "fingers", "walls", "cost", "options")
    file = Section(data, "", keys)
    file.text("description", "")
    shape = _read_shape(file.section("object", ("vertices", "pieces")))
    pose = file.array("pose", (3,)) if "pose" in file else np.zeros(3)
    walls = tuple(
        Segment(ends=np.stack([wall.array("from", (2,)), wall.array("to", (2,))]), name=wall.name)
        for wall in file.sections("walls", ("from", "to"))
    )
    fingers = file.section(
        "fingers", ("count", "fewest", "positions", "fixed", "grippers", "parallel", "direction")
    )
    fixed = fingers.array("fixed", (None, 2)) if "fixed" in fingers else np.empty((0, 2))
    options = file.section("options", ("margin", "rotation", "time_limit", "method", "solver"), optional=True)
    common: dict[str, Any] = {"shape": shape, "pose": pose, "walls": walls}
    if "positions" in fingers:
        return _read_arrangement(file, fingers, fixed, common), {}
    problem = CageProblem(
        **common,
        count=fingers.integer("count"),
        fewest=read_flag(fingers, "fewest"),
        fixed=fixed,
        grippers=read_grippers(fingers),
        parallel=read_flag(fingers, "parallel"),
        direction=float(np.radians(fingers.number("direction"))) if "direction" in fingers else None,
        cost=file.choice("cost", COSTS, "none"),  # type: ignore[arg-type]
        margin=options.number("margin", 0.002),
        rotation=_read_rotation(options),
    )
    return problem, {
        "time_limit": options.number("time_limit", 60.0, positive=True),
        "method": options.choice("method", METHODS, "swept"),
        "solver": options.choice("solver", SOLVERS, "highs"),
    }


def _read_shape(section: Section) -> Shape:
    if "pieces" not in section:
        vertices = section.array("vertices", (None, 2))
        require_size(section.path("vertices"), vertices)
        return Shape(vertices=vertices)
    listed = section.take("pieces", "a list of convex polygons")
    if not isinstance(listed, list):
        raise InvalidProblem(
            section.path("pieces"), expected="a list of convex polygons", got=shorten(listed)
        )
    pieces = tuple(
        checked_array(piece, (None, 2), f"{section.path('pieces')}[{k}]") for k, piece in enumerate(listed)
    )
    for k, piece in enumerate(pieces):
        require_size(f"{section.path('pieces')}[{k}]", piece)
    if "vertices" in section:
        return Shape(vertices=section.array("vertices", (None, 2)), given_pieces=pieces)
    return Shape.of_pieces(pieces)


def require_size(field: str, points: Array) -> None:
    """Raise InvalidProblem for points that almost coincide."""
    if len(points) and np.ptp(points, axis=0).max() < SMALLEST:
        raise InvalidProblem(field, expected=f"a polygon larger than {SMALLEST:g} m", got="a smaller one")


def _read_arrangement(file: Section, fingers: Section, fixed: Array, common: dict[str, Any]) -> Arrangement:
    for key in ("count", "fewest", "grippers", "parallel", "direction"):
        if key in fingers:
            raise InvalidProblem(
                fingers.path(key), expected="nothing beside positions", got="both", remedy="remove one"
            )
    if "cost" in file or "options" in file:
        raise InvalidProblem("cost, options", expected="nothing where positions are given", got="both")
    return Arrangement(
        **common, fingers=np.concatenate([fingers.array("positions", (None, 2)), fixed.reshape(-1, 2)])
    )


def read_grippers(fingers: Section) -> tuple[Gripper, ...]:
    """The list of grippers in a section of fingers.  Raises InvalidProblem."""
    grippers = []
    for gripper in fingers.sections("grippers", ("fingers", "opening")):
        i, j = gripper.array("fingers", (2,))
        if i != int(i) or j != int(j):
            raise InvalidProblem(gripper.path("fingers"), expected="two indices", got=f"[{i:g}, {j:g}]")
        least, most = gripper.array("opening", (2,))
        grippers.append(Gripper(fingers=(int(i), int(j)), opening=(float(least), float(most))))
    return tuple(grippers)


def read_flag(section: Section, key: str) -> bool:
    """An optional true or false; missing means false.  Raises InvalidProblem."""
    value = section.data.get(key, False)
    if not isinstance(value, bool):
        raise InvalidProblem(section.path(key), expected="true or false", got=shorten(value))
    return value


def _read_rotation(options: Section) -> HalfRanges:
    """Half-ranges [deg] in a list, each a number for both sides or a pair [below, above]; `auto`: the default ladder."""
    value = options.data.get("rotation", "auto")
    if value in ("auto", None):
        return ()
    field = options.path("rotation")
    if not isinstance(value, list) or not value:
        raise InvalidProblem(field, expected="auto or a list of half-ranges in degrees", got=shorten(value))
    pairs = [
        checked_array(item if isinstance(item, list) else [item, item], (2,), f"{field}[{k}]")
        for k, item in enumerate(value)
    ]
    return tuple((float(np.radians(below)), float(np.radians(above))) for below, above in pairs)


def answer_fields(problem: "Problem", answer: CageSolution) -> dict[str, Any]:
    """The answer as plain JSON values; rotation_range null where the object may turn freely."""
    limits = answer.rotation_range
    limited = limits is not None and bool(np.isfinite(limits).all())
    return {
        "status": answer.status,
        "fingers": answer.fingers.tolist(),
        "rotation_range": list(limits) if limits is not None and limited else None,
        "topology": [{key: getattr(meeting, key) for key in _MEETING} for meeting in answer.topology],
        "objective": float(answer.objective) if np.isfinite(answer.objective) else None,
        "seconds": answer.seconds,
        "attempts": answer.attempts,
        "refuted": answer.refuted,
        "unconfirmed": answer.unconfirmed,
        "reason": answer.reason,
    }


def read_answer(problem: "Problem", data: dict[str, Any]) -> CageSolution:
    """The answer of a solution file, checked for form (its truth is what `expert.verify.cage.check` checks)."""
    keys = ("status", "fingers", "rotation_range", "topology", "objective", "seconds", "attempts")
    file = Section(data, "", (*keys, "refuted", "unconfirmed", "reason"))
    status: Any = file.choice("status", STATUSES)
    if isinstance(problem.task, Arrangement):
        raise InvalidProblem("problem.fingers", expected="count", got="positions: nothing to solve")
    limits = file.array("rotation_range", (2,)) if "rotation_range" in file else None
    return CageSolution(
        status=status,
        fingers=_read_fingers(file, problem.task) if status == "caged" else np.empty((0, 2)),
        rotation_range=(float(limits[0]), float(limits[1])) if limits is not None else None,
        topology=tuple(
            Meeting(**{key: meeting.integer(key) for key in _MEETING})
            for meeting in file.sections("topology", _MEETING)
        ),
        objective=file.number("objective", np.nan),
        seconds=file.number("seconds", 0.0),
        attempts=file.integer("attempts", 0),
        refuted=file.integer("refuted", 0),
        unconfirmed=file.integer("unconfirmed", 0),
        reason=file.text("reason", ""),
    )


def _read_fingers(file: Section, task: CageProblem) -> Array:
    """As many as the problem searched for, or at most so many where it asked for the fewest."""
    if not task.fewest:
        return file.array("fingers", (task.count, 2))
    fingers = file.array("fingers", (None, 2))
    if len(fingers) > task.count:
        raise InvalidProblem(
            file.path("fingers"), expected=f"at most {task.count} fingers", got=str(len(fingers))
        )
    return fingers
