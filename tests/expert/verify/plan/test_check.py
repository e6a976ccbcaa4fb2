"""The plan checker accepts plans that are right by hand and names what is wrong with tampered ones."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from expert.errors import InvalidProblem
from expert.problems.contact import FREE, SUPPORT, ContactForce, ContactTask, Cost, Plan, Robustness
from expert.verify.plan.check import check_plan, verify
from expert.world.walls import HalfPlane
from tests.support.hand_plans import TOP, WEIGHT, A, lifted_block, pushed_block, sliding_block

Made = Callable[[], tuple[ContactTask, Plan]]


def changed(values: np.ndarray, index: Any, value: Any) -> np.ndarray:
    copy = values.copy()
    copy[index] = value
    return copy


def with_contact(plan: Plan, k: int, **changes: Any) -> Plan:
    contacts = list(plan.contact_forces)
    contacts[k] = replace(contacts[k], **changes)
    return replace(plan, contact_forces=tuple(contacts))


@pytest.mark.parametrize("made", [sliding_block, lifted_block, pushed_block])
def test_a_plan_that_is_right_by_hand_is_sound(made: Made) -> None:
    report = check_plan(*made())
    assert report.verdict == "sound", str(report)
    assert report.violations == ()
    assert report.check("newton_euler").value < 1e-14


TAMPERED = {
    "harder push": (sliding_block, "newton_euler", lambda p: replace(p, forces=1.001 * p.forces)),
    "push out of the cone": (
        sliding_block,
        "finger_cone",
        lambda p: replace(p, forces=p.forces + [0.0, 0.11 * p.forces[0, 0, 0]]),
    ),
    "pull": (sliding_block, "finger_cone", lambda p: replace(p, forces=-p.forces)),
    "not a number": (
        sliding_block,
        "newton_euler",
        lambda p: replace(p, forces=changed(p.forces, (2, 0, 0), np.nan)),
    ),
    "finger off its facet": (
        sliding_block,
        "on_facet",
        lambda p: replace(p, positions=p.positions - [1e-3, 0.0]),
    ),
    "finger in the facet's margin": (
        sliding_block,
        "on_facet",
        lambda p: replace(p, positions=p.positions + [0.0, 0.98 * A]),
    ),
    "finger inside the block": (
        sliding_block,
        "penetration",
        lambda p: replace(p, positions=p.positions + [1e-4, 0.0]),
    ),
    "another facet claimed": (sliding_block, "on_facet", lambda p: replace(p, modes=np.full((5, 1), TOP))),
    "free finger pushes": (
        sliding_block,
        "complementarity",
        lambda p: replace(p, modes=np.full((5, 1), FREE)),
    ),
    "finger slides on its facet": (
        sliding_block,
        "sticking",
        lambda p: replace(p, positions=changed(p.positions, (3, 0, 1), A + 1e-3)),
    ),
    "facet to facet without release": (
        sliding_block,
        "alternation",
        lambda p: replace(p, modes=changed(p.modes, slice(3, 5), TOP)),
    ),
    "force at the release": (
        pushed_block,
        "release",
        lambda p: replace(p, modes=changed(p.modes, (4, 0), FREE)),
    ),
    "floor pulls": (
        sliding_block,
        "environment_cone",
        lambda p: with_contact(p, 0, force=-p.contact_forces[0].force),
    ),
    "floor without friction": (
        sliding_block,
        "environment_cone",
        lambda p: with_contact(p, 0, force=p.contact_forces[0].force * [0.0, 1.0]),
    ),
    "friction that drives": (
        sliding_block,
        "environment_cone",
        lambda p: with_contact(p, 0, force=p.contact_forces[0].force * [-1.0, 1.0]),
    ),
    "floor acts beside the block": (
        sliding_block,
        "environment_contact",
        lambda p: with_contact(p, 0, point=p.contact_forces[0].point - [A, 0.0]),
    ),
    "floor acts above itself": (
        sliding_block,
        "environment_contact",
        lambda p: with_contact(p, 0, point=p.contact_forces[0].point + [0.0, A]),
    ),
    "floor holds a block that leaves": (
        lifted_block,
        "environment_contact",
        lambda p: replace(
            p,
            contact_forces=(
                ContactForce(
                    step=0, vertex=0, wall=0, point=np.array([-A, 0.0]), force=np.array([0.0, 1e-3])
                ),
            ),
        ),
    ),
    "free finger inside the block": (
        pushed_block,
        "penetration",
        lambda p: replace(p, positions=changed(p.positions, (2, 1), [0.02, A - 1e-3])),
    ),
    "support drags forward": (
        pushed_block,
        "support_friction",
        lambda p: with_contact(p, 7, force=-p.contact_forces[7].force),
    ),
    "support drag left out": (
        pushed_block,
        "support_friction",
        lambda p: replace(p, contact_forces=p.contact_forces[1:]),
    ),
    "support drags elsewhere": (
        pushed_block,
        "support_contact",
        lambda p: with_contact(p, 7, point=np.zeros(2)),
    ),
    "support in the sagittal plane": (
        lifted_block,
        "support_friction",
        lambda p: replace(
            p,
            contact_forces=(
                ContactForce(
                    step=2, vertex=0, wall=SUPPORT, point=np.array([-A, 0.04]), force=np.array([0.0, 1e-3])
                ),
            ),
        ),
    ),
    "cost understated": (lifted_block, "objective", lambda p: replace(p, objective=0.99 * p.objective)),
    "bound above the cost": (lifted_block, "bound", lambda p: replace(p, bound=1.01 * p.objective)),
    "optimal without a bound": (lifted_block, "bound", lambda p: replace(p, bound=-np.inf)),
    "facet that does not exist": (
        lifted_block,
        "shape",
        lambda p: replace(p, modes=changed(p.modes, (0, 0), 9)),
    ),
    "step missing": (lifted_block, "shape", lambda p: replace(p, forces=p.forces[1:])),
}


@pytest.mark.parametrize(("made", "name", "tamper"), TAMPERED.values(), ids=TAMPERED)
def test_tampering_is_refuted_by_its_law(made: Made, name: str, tamper: Callable[[Plan], Plan]) -> None:
    task, plan = made()
    report = check_plan(task, tamper(plan))
    assert report.verdict == "refuted"
    assert name in [violation.name for violation in report.violations], str(report)


STRICTER = {
    "smaller force limit": (
        lifted_block,
        "force_limit",
        lambda t: replace(t, fingers=replace(t.fingers, max_force=4 * WEIGHT)),
    ),
    "less finger friction": (
        lifted_block,
        "finger_cone",
        lambda t: replace(t, fingers=replace(t.fingers, friction=0.09)),
    ),
    "share of the cone": (
        lifted_block,
        "finger_cone",
        lambda t: replace(t, robustness=Robustness(cone_fraction=0.9)),
    ),
    "least force": (
        sliding_block,
        "min_normal_force",
        lambda t: replace(t, robustness=Robustness(min_normal_force=0.2 * WEIGHT)),
    ),
    "inset supports": (
        sliding_block,
        "environment_contact",
        lambda t: replace(t, robustness=Robustness(support_inset=0.3)),
    ),
    "clearance from walls": (
        sliding_block,
        "wall_clearance",
        lambda t: replace(t, fingers=replace(t.fingers, clearance=1.1 * A)),
    ),
    "clearance from the block": (
        pushed_block,
        "clearance",
        lambda t: replace(t, robustness=Robustness(free_clearance=0.16)),
    ),
    "dearer force": (sliding_block, "objective", lambda t: replace(t, cost=Cost(force=2.0))),
    "reward for the cone's middle": (sliding_block, "objective", lambda t: replace(t, cost=Cost(margin=1.0))),
    "a wall in the way": (
        pushed_block,
        "wall_clearance",
        lambda t: replace(
            t,
            environment=replace(
                t.environment, walls=(HalfPlane(point=np.array([0.0, 0.15]), normal=np.array([0.0, -1.0])),)
            ),
        ),
    ),
}


@pytest.mark.parametrize(("made", "name", "tighten"), STRICTER.values(), ids=STRICTER)
def test_a_stricter_task_refutes_the_same_plan(
    made: Made, name: str, tighten: Callable[[ContactTask], ContactTask]
) -> None:
    task, plan = made()
    report = check_plan(tighten(task), plan)
    assert report.verdict == "refuted"
    assert name in [violation.name for violation in report.violations], str(report)


def test_contacts_of_one_step_are_refuted_where_two_are_asked_for() -> None:
    task, plan = pushed_block()
    plan = replace(plan, modes=changed(plan.modes, (slice(1, 5), 0), FREE))
    brief = check_plan(replace(task, robustness=Robustness(min_interval=2)), plan)
    assert not brief.check("min_interval").ok
    assert check_plan(task, plan).check("min_interval").ok


def test_violations_are_sized_and_placed() -> None:
    task, plan = sliding_block()
    report = check_plan(task, replace(plan, positions=changed(plan.positions, (3, 0, 0), 0.03 - A - 1e-3)))
    off = report.check("on_facet")
    assert off.value == pytest.approx(1e-3 / np.hypot(2 * A, 2 * A))
    assert off.where == "step 3, finger 0"


def test_the_cone_margin_is_the_distance_from_the_edge() -> None:
    """Force (N, 0) in a cone of friction mu keeps mu N / sqrt(1 + mu^2) from either edge."""
    task, plan = sliding_block()
    push = plan.forces[0, 0, 0]
    rewarded = 5 * push**2 - 5 * 2.0 * 0.1 * push / np.sqrt(1.01)
    task = replace(task, cost=Cost(margin=2.0))
    report = check_plan(task, replace(plan, objective=rewarded, bound=rewarded))
    assert report.verdict == "sound", str(report)


def test_acceleration_cost_counts_backward_differences_from_the_third_step() -> None:
    task, plan = pushed_block()
    plan = replace(plan, positions=changed(plan.positions, (4, 1), [0.0, 0.21]))
    cost = plan.objective + (0.01 / 0.1**2) ** 2
    assert check_plan(task, replace(plan, objective=cost, bound=cost)).verdict == "sound"


def test_an_answer_without_a_plan_is_unknown_and_a_bare_problem_refused() -> None:
    task, plan = sliding_block()
    assert verify(task, replace(plan, status="time_limit")).verdict == "unknown"
    with pytest.raises(InvalidProblem, match="solve it first"):
        verify(task, None)


def test_the_checker_never_loads_a_solver() -> None:
    code = (
        "import sys, expert.verify.plan.check; "
        "print([m for m in sys.modules if m.startswith(('expert.contact', 'expert.mip', 'pyscipopt', 'daqp', 'cvxpy'))])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_report_turns_into_plain_json_values() -> None:
    task, plan = sliding_block()
    fields = check_plan(task, replace(plan, forces=np.full_like(plan.forces, np.nan))).as_dict()
    assert fields["verdict"] == "refuted"
    assert {c["check"]: c["violation"] for c in fields["checks"]}["newton_euler"] is None
