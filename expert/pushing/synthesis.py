"""Plans of pushes for a problem with friction and obstacles: a beam search over a table, the best plans worked out in full.

A push from the table moves the object in the same way wherever it is; the finger's ways are found as the beam grows.  Plans
that come near the goal get their last push made exact, by a finer model, and the checker has the last word.
"""

import itertools
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from expert.budget import Budget
from expert.geometry.pose import Array, to_world
from expert.problems.push import Push, PushOptions, PushPlan, PushProblem, duration
from expert.pushing.detours import Detours
from expert.pushing.refine import composed, refine_plan
from expert.pushing.room import depth_in_walls, way_round
from expert.pushing.search import Nodes, grow, poses_of, root_of, unfilled
from expert.pushing.setting import Pushing
from expert.pushing.table import straight
from expert.verify.push.check import verify

ENDINGS, TRIED = 200, 40
"""Plans near the goal that are kept, and that are worked out in full."""
ENOUGH = 6
"""So many plans are compared before the checker is asked."""
SPARE = 2
"""The beam is grown to this multiple of its width before the finger's ways are looked for."""
ROUNDS, UNIT, EXACT = 8, 0.01, 0.05
"""Of making pushes exact; a unit of their steps, over the object's size; the fraction of the tolerance that is exact enough."""


def solve(problem: PushProblem, **options: Any) -> PushPlan:
    """The plan of least duration among the first that hold.  Options: those of PushOptions."""
    chosen = PushOptions(**options)
    budget = Budget(chosen.time_limit)
    pushing = Pushing(problem)
    if pushing.goal.error(pushing.start()[0]) <= pushing.tolerance:
        return PushPlan(status="solved", objective=0.0, seconds=budget.spent)
    nodes, ends = _searched(pushing, chosen, budget)
    best, why = _worked_out(pushing, nodes, ends, budget)
    if best:
        return replace(best, seconds=budget.spent, nodes=len(nodes))
    reason = _reason(pushing, nodes, ends, why, chosen)
    out_of_time = budget.over
    return PushPlan(
        status="time_limit" if out_of_time else "no_plan",
        seconds=budget.spent,
        nodes=len(nodes),
        reason=reason,
    )


def _searched(pushing: Pushing, options: PushOptions, budget: Budget) -> tuple[Nodes, Nodes]:
    """Partial plans, each with a way of the finger to its last push, and what comes near the goal from them."""
    pose, finger = pushing.start()
    nodes, ends, above, first = unfilled(0), unfilled(ENDINGS), root_of(pose, finger), -1
    slack, parts = (
        depth_in_walls(pushing.task.room, pose) + 1e-9,
        (pushing.moves, pushing.task, pushing.prices),
    )
    for _ in range(options.depth):
        beam = unfilled(SPARE * options.width)
        grow(*parts, above, first, beam, ends, slack)
        above = _with_ways(pushing, beam, above, first)[: options.width]
        first, nodes = len(nodes), np.concatenate([nodes, above])
        if budget.over or not len(above) or above["time"].min() > ends[ENOUGH]["score"]:
            break
    return nodes, ends


def _with_ways(pushing: Pushing, beam: Nodes, above: Nodes, first: int) -> Nodes:
    """The nodes whose last push the finger can reach, timed by its true way; soonest first."""
    detours, kept = Detours(pushing.problem), []
    for node in beam[np.isfinite(beam["score"])]:
        before = above[node["parent"] - first if first >= 0 else 0]
        pose = poses_of(before)
        (start,), _, _ = straight(pushing.table.curve, pushing.table.parameters[node["entry"]][None])
        finger = np.array([before["finger_x"], before["finger_y"]])
        finger, begin = to_world(pose, np.stack([finger, start]))
        way = detours.way(pushing.frame(pose), finger, begin)
        if way is not None:
            late = _length(finger, way) / pushing.prices.pace - _assumed(pushing, before, node)
            for name in ("time", "score"):
                node[name] += late
            kept.append(node)
    found = np.array(kept, dtype=beam.dtype)
    return found[np.argsort(found["score"], kind="stable")]


def _length(start: Array, way: Array) -> float:
    return float(np.linalg.norm(np.diff(np.concatenate([start[None], way]), axis=0), axis=1).sum())


def _assumed(pushing: Pushing, before: Nodes, node: Nodes) -> float:
    """Time of the way as the search reckoned it."""
    return float(node["time"] - before["time"] - pushing.table.steps[node["entry"]])


def _worked_out(
    pushing: Pushing, nodes: Nodes, ends: Nodes, budget: Budget
) -> tuple[PushPlan | None, list[str]]:
    """The plan of least duration among the first that hold, if the checker agrees; and why others are none."""
    chains = itertools.islice(_chains(pushing, nodes, ends), TRIED)
    why: list[str] = []
    while not budget.over and (few := _next_plans(pushing, chains, why, budget)):
        for plan in sorted(few, key=lambda plan: plan.objective):
            report = verify(pushing.problem, plan)
            if report.verdict == "sound":
                return plan, why
            names = ", ".join(check.name for check in report.violations)
            why.append(f"the checker refuses ({names or report.reason})")
    return None, why


def _next_plans(pushing: Pushing, chains: Iterator[Array], why: list[str], budget: Budget) -> list[PushPlan]:
    """Up to ENOUGH plans worked out from the next chains; why others are none is noted."""
    found: list[PushPlan] = []
    while len(found) < ENOUGH and not budget.over and (chain := next(chains, None)) is not None:
        pushes = _in_full(pushing, chain)
        if isinstance(pushes, str):
            why.append(pushes)
        else:
            seconds = duration(pushing.problem.finger, pushes)
            found.append(PushPlan(status="solved", pushes=pushes, objective=seconds))
    return found


def _chains(pushing: Pushing, nodes: Nodes, ends: Nodes) -> Iterator[Array]:
    """Pushes (n, 3) of the plans that end near the goal; soonest first."""
    parameters = pushing.table.parameters
    for end in ends[np.isfinite(ends["score"])]:
        rows, row = [parameters[end["entry"]]], int(end["parent"])
        while row >= 0:
            rows.insert(0, parameters[nodes["entry"][row]])
            row = int(nodes["parent"][row])
        yield np.array(rows)


def _in_full(pushing: Pushing, chain: Array) -> tuple[Push, ...] | str:
    """The pushes of a plan, made exact, with the finger's ways, under the finer model; or why it is none."""
    problem, table, allowed = pushing.problem, pushing.fine, pushing.tolerance
    pose, _ = pushing.start()
    for model in (pushing.table, table):
        chain, error = refine_plan(
            model, pushing.goal, pose, chain, ROUNDS, UNIT * problem.shape.size, EXACT * allowed
        )
        if not error <= allowed:
            return "its pushes cannot be made exact"
    finger, pushes, detours = problem.finger.start, [], Detours(problem)
    for push in chain:
        (start,), (direction,), (length,) = straight(table.curve, push[None])
        begin, end = to_world(pose, np.stack([start, start + length * direction]))
        way = detours.way(pushing.frame(pose), finger, begin)
        if way is None:
            return "the finger finds no way to a push"
        course = composed(pose, pushing.path(start, direction, length))
        if not pushing.is_free(course, end):
            return "a push comes too near to obstacles or walls"
        pose, finger = course[-1], end
        pushes.append(Push(way=way, end=end, pose=pushing.frame(pose)))
    return tuple(pushes)


def _reason(pushing: Pushing, nodes: Nodes, ends: Nodes, why: list[str], options: PushOptions) -> str:
    """What stands in the way of a plan, as far as the search can tell."""
    what = f"no plan of at most {options.depth} pushes at this resolution ({len(pushing.table.steps)} pushes in the table)"
    if why:
        causes = {cause: why.count(cause) for cause in dict.fromkeys(why)}
        told = "; ".join(f"{cause} ({count} times)" for cause, count in causes.items())
        return f"{what}: of {len(why)} plans that end near the goal none holds: {told}"
    if not len(nodes):
        return f"{what}: from the start no push is free of obstacles and walls"
    pose, _ = pushing.start()
    if not np.isfinite(way_round(pushing.task.room.field, pose[0], pose[1])):
        return f"{what}: obstacles part the start from the goal"
    if np.isfinite(ends["score"]).any():
        return f"{what}: plans come near the goal, but no last push ends within the tolerance"
    reached = nodes["error"].min()
    return f"{what}: the nearest that the object comes to its goal is {reached:.3g} m"
