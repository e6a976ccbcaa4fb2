"""Check a plan of pushes: what the object does under them by the law of contact, and what both sweep.

A push is carried out from where the one before it really left the object, so that deviations add up as they would on a table.
"""

import time
from dataclasses import dataclass

import numpy as np
import shapely

from expert.errors import InvalidProblem
from expert.geometry.pose import Array, wrapped
from expert.problems.push import PushPlan, PushProblem, duration
from expert.verify.plan.report import Check
from expert.verify.push.law import support
from expert.verify.push.motion import Course, centroids, course
from expert.verify.push.report import PushReport

STEP = 0.01
"""Longest step of the integration, over the object's size; it is repeated with steps twice as long."""
ACCURATE = ("goal, position", "claimed positions")
"""Checks that hang on the integration's error."""
CLAIMED = ("nodes", "seconds", "reason")
"""Fields of an answer that nothing here depends on."""
PRESS = 2e-3
"""A finger on its way may enter the object's outline by this fraction of its size."""


@dataclass
class Sweep:
    """One push as it is carried out: the object's pose before it, its course, and the same with longer steps."""

    before: Array
    course: Course
    coarse: Course


def verify(problem: PushProblem, plan: PushPlan | None) -> PushReport:
    """Judge a plan.  An answer without a plan is `unknown`: that there is none is not proved.  Raises InvalidProblem without answer."""
    began = time.process_time()
    if plan is None:
        raise InvalidProblem(
            "solution", expected="a solution file", got="a problem file", remedy="solve it first"
        )
    claim = f"{len(plan.pushes)} pushes bring the object to its goal"
    if not plan.found:
        reason = "there is no plan to check, and nothing is proved without one"
        return PushReport(verdict="unknown", claim=plan.status, reason=reason, claimed=CLAIMED)
    sweeps = _carried_out(problem, plan)
    if any(s.course.several or s.coarse.several for s in sweeps):
        reason = f"push {len(sweeps) - 1} touches the object at two places, which this checker does not judge"
        return PushReport(verdict="unknown", claim=claim, reason=reason, seconds=time.process_time() - began)
    uncertain = max((_apart(problem, s.course.poses[-1], s.coarse.poses[-1])[0] for s in sweeps), default=0.0)
    checks = _checks(problem, plan, sweeps)
    modes = [mode for s in sweeps for mode in s.course.modes]
    close = [c for c in checks if c.name in ACCURATE and abs(c.value - c.limit) <= uncertain]
    reason = "; ".join(f"{c.name} is within the integration's error" for c in close)
    refuted = any(not c.ok for c in checks if c not in close)
    return PushReport(
        verdict="refuted" if refuted else "unknown" if close else "sound",
        claim=claim,
        reason="" if refuted else reason,
        checks=checks,
        ends=tuple(tuple(map(float, s.course.poses[-1])) for s in sweeps),
        uncertain=uncertain,
        sliding=modes.count("sliding") / max(len(modes), 1),
        claimed=CLAIMED,
        seconds=time.process_time() - began,
    )


def _carried_out(problem: PushProblem, plan: PushPlan) -> list[Sweep]:
    """All pushes, one after the other; the last one of them may be unfinished."""
    under = support(problem.limit_surface, problem.shape, problem.centroid)
    pose, coarse, sweeps = problem.start, problem.start, []
    step = STEP * problem.shape.size
    for push in plan.pushes:
        fine, rough = (
            course(problem, under, at, push.way[-1], push.end, h)
            for at, h in ((pose, step), (coarse, 2 * step))
        )
        sweeps.append(Sweep(pose, fine, rough))
        if fine.several or rough.several:
            break
        pose, coarse = fine.poses[-1], rough.poses[-1]
    return sweeps


def _checks(problem: PushProblem, plan: PushPlan, sweeps: list[Sweep]) -> tuple[Check, ...]:
    """Every law."""
    allowed, size = problem.tolerance, problem.shape.size
    end = sweeps[-1].course.poses[-1] if sweeps else problem.start
    short, turned = _apart(problem, end, problem.goal)
    off = [_apart(problem, s.course.poses[-1], p.pose) for s, p in zip(sweeps, plan.pushes, strict=True)]
    votes = [_against_the_vote(s, p.pose) for s, p in zip(sweeps, plan.pushes, strict=True)]
    seconds = abs(duration(problem.finger, plan.pushes) - plan.objective)
    return (
        Check(name="goal, position", value=short, limit=allowed.position, unit="m"),
        Check(name="goal, angle", value=turned, limit=allowed.angle, unit="rad"),
        Check.largest("claimed positions", [d for d, _ in off], allowed.position, "m", ["push"]),
        Check.largest("claimed angles", [a for _, a in off], allowed.angle, "rad", ["push"]),
        Check.largest("voting theorem", votes, allowed.angle, "rad", ["push"]),
        Check.largest("object in obstacles", [_in_obstacles(problem, s) for s in sweeps], 0.0, "m", ["push"]),
        Check.largest("object off workspace", [_off(problem, s) for s in sweeps], 1e-6 * size, "m", ["push"]),
        Check.largest("finger in object", _in_object(problem, plan, sweeps), PRESS * size, "m", ["push"]),
        Check.largest("finger in obstacles", _finger_out(problem, plan), 1e-6 * size, "m", ["push"]),
        Check(name="objective", value=seconds, limit=1e-6 * max(1.0, plan.objective), unit="s"),
    )


def _apart(problem: PushProblem, a: Array, b: Array) -> tuple[float, float]:
    """Distance of the centroids [m] and of the angles [rad] of two poses."""
    distance = np.linalg.norm(centroids(problem, a) - centroids(problem, b))
    return float(distance), float(abs(wrapped(a[2] - b[2])))


def _against_the_vote(sweep: Sweep, claimed: Array) -> float:
    """How far the object is claimed to turn against a vote that is the same all the way [rad]."""
    votes = set(sweep.course.votes)
    turn = float(wrapped(claimed[2] - sweep.before[2]))
    return max(0.0, -turn * votes.pop()) if len(votes) == 1 else 0.0


def _in_obstacles(problem: PushProblem, sweep: Sweep) -> float:
    """Between two poses no point of the object strays from both by more than half of the largest way of a vertex [m]."""
    if not problem.obstacles:
        return 0.0
    outlines = problem.outline(np.array(sweep.course.poses))
    strays = np.linalg.norm(np.diff(outlines, axis=0), axis=-1).max(initial=0.0) / 2
    solid = shapely.union_all([shapely.Polygon(o.vertices) for o in problem.obstacles])
    return float(strays - shapely.distance(shapely.polygons(outlines), solid).min())


def _off(problem: PushProblem, sweep: Sweep) -> float:
    """How far the object leaves the workspace [m]."""
    corners = problem.outline(np.array(sweep.course.poses)).reshape(-1, 2)
    return float((problem.walls[:, 2] - corners @ problem.walls[:, :2].T).max())


def _in_object(problem: PushProblem, plan: PushPlan, sweeps: list[Sweep]) -> list[float]:
    """How deep the disc enters the object, at rest, on its way to each push [m]."""
    depths, at = [], problem.finger.start
    for push, sweep in zip(plan.pushes, sweeps, strict=True):
        way = _line(np.concatenate([at[None], push.way]))
        body = shapely.Polygon(problem.outline(sweep.before))
        depths.append(problem.radius - float(way.distance(body)))
        at = push.end
    return depths


def _finger_out(problem: PushProblem, plan: PushPlan) -> list[float]:
    """How deep the disc enters obstacles or leaves the workspace, on ways and pushes [m]."""
    depths, at = [], problem.finger.start
    solid = shapely.union_all([shapely.Polygon(o.vertices) for o in problem.obstacles])
    for push in plan.pushes:
        points = np.concatenate([at[None], push.way, push.end[None]])
        off = float((problem.walls[:, 2] + problem.radius - points @ problem.walls[:, :2].T).max())
        inside = problem.radius - float(_line(points).distance(solid)) if problem.obstacles else -np.inf
        depths.append(max(off, inside))
        at = push.end
    return depths


def _line(points: Array) -> shapely.Geometry:
    """A polyline, or the point that all of them are."""
    return shapely.LineString(points) if np.ptp(points, axis=0).max() > 0 else shapely.Point(points[0])
