"""MIP1 as a method: its answers are verified, refuted ones are cut off, and both solvers agree."""

import numpy as np
import pytest

from expert.budget import Budget
from expert.caging import synthesis
from expert.caging.model import Guess
from expert.caging.synthesis import solve
from expert.caging.tally import Tally
from expert.caging.thesis import ThesisModel, slices
from expert.errors import InvalidProblem
from expert.geometry.pose import Array
from expert.mip.backends import Solver
from expert.problems.cage import CageProblem
from expert.verify.cage.check import verify
from expert.world.fingers import Gripper
from expert.world.frame import Frame
from expert.world.named import named_shape
from expert.world.shape import Shape
from expert.world.walls import Segment
from tests.support.polygons import random_polygon, regular_polygon

NARROW = ((np.radians(40), np.radians(40)),)
SMALL = ((np.radians(20), np.radians(20)),)


def problem(vertices: Array, **changes: object) -> CageProblem:
    return CageProblem(shape=Shape(vertices=vertices), pose=np.zeros(3), **{"count": 3, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", [1, 7, 8])
def test_small_polygons_are_caged_and_verified(seed: int) -> None:
    task = problem(random_polygon(np.random.default_rng(seed), 4 + seed % 7), rotation=NARROW)
    answer = solve(task, method="thesis", time_limit=60)
    assert answer.found
    assert verify(task, answer).verdict == "caged"
    assert [meeting.element for meeting in answer.topology] == [0, 1, 2]


def test_a_named_shape_at_a_pose_of_its_own() -> None:
    pose = np.array([0.3, -0.2, 2.0])
    task = CageProblem(
        shape=Shape(vertices=named_shape("T")), pose=pose, count=3, rotation=(tuple(np.radians([45, 45])),)
    )
    answer = solve(task, method="thesis", time_limit=60)
    assert answer.found
    assert verify(task, answer).verdict == "caged"


@pytest.mark.parametrize(("seed", "verdict"), [(7, "caged"), (0, "none_found")])
def test_both_solvers_agree(seed: int, verdict: str) -> None:
    task = problem(random_polygon(np.random.default_rng(seed), 4), rotation=NARROW)
    solvers: tuple[Solver, ...] = ("highs", "scip")
    answers = [solve(task, method="thesis", solver=s, time_limit=120) for s in solvers]
    assert [answer.status for answer in answers] == [verdict] * 2
    assert all(answer.found or "others may exist" in answer.reason for answer in answers)


def test_a_spent_limit_is_called_that() -> None:
    task = problem(random_polygon(np.random.default_rng(0), 4))
    assert solve(task, method="thesis", time_limit=1e-9).status == "time_limit"


@pytest.mark.parametrize(
    "extra",
    [
        {"fixed": np.array([[0.2, 0.0]])},
        {"walls": (Segment(ends=np.array([[-0.2, -0.2], [0.2, -0.2]])),)},
        {"cost": "min_separation"},
        {"grippers": (Gripper(fingers=(0, 1), opening=(0.0, 0.1)),)},
    ],
)
def test_what_mip1_does_not_know_is_refused(extra: dict[str, object]) -> None:
    with pytest.raises(InvalidProblem, match=r"options\.method: expected swept"):
        solve(problem(named_shape("T"), **extra), method="thesis")


def test_too_many_facets_for_mip1_are_refused() -> None:
    task = problem(regular_polygon(17, 0.05))
    with pytest.raises(
        InvalidProblem, match=r"options\.method: expected swept for more than 16 facets, got thesis for 17"
    ):
        solve(task, method="thesis")


class Scripted:
    """Proposes given fingers, one after the other."""

    def __init__(self, *proposals: Array) -> None:
        self.proposals = list(proposals)
        self.cuts = 0

    def propose(self, solver: Solver, seconds: float) -> Guess:
        if not self.proposals:
            return Guess(status="infeasible")
        return Guess(status="optimal", fingers=self.proposals.pop(0))

    def cut_off(self) -> None:
        self.cuts += 1


def test_no_false_cage_leaves_the_loop() -> None:
    """Fingers that let the object go, and fingers inside it, are counted and cut off; the cage behind them is found."""
    task = problem(named_shape("T"), rotation=NARROW)
    real = solve(task, time_limit=60).fingers
    frame = Frame.of(task.shape, task.pose)
    tally = Tally(task, Budget(60))
    model = Scripted(frame.relative(real + 0.3), frame.relative(0 * real), frame.relative(real))
    synthesis._search(tally, model, frame, 1.0, "highs")  # type: ignore[arg-type]
    assert (tally.refuted, model.cuts, tally.attempts) == (2, 2, 3)
    assert tally.best.found
    np.testing.assert_allclose(tally.best.fingers, real)


def test_only_refuted_answers_leave_nothing() -> None:
    task = problem(named_shape("T"), rotation=NARROW)
    frame = Frame.of(task.shape, task.pose)
    tally = Tally(task, Budget(60))
    model = Scripted(*[np.array([[2.0, 0], [2.0, 1], [2.0, -1]])] * 9)
    synthesis._search(tally, model, frame, 1.0, "highs")  # type: ignore[arg-type]
    assert tally.refuted == model.cuts == synthesis.MOST_CUTS
    assert not tally.best.found


def test_a_cut_makes_the_next_proposal_another_one() -> None:
    task = problem(random_polygon(np.random.default_rng(7), 4), rotation=SMALL)
    frame = Frame.of(task.shape, task.pose)
    clearance = task.margin * task.shape.size / frame.radius
    model = ThesisModel(frame.body(task.shape.vertices), clearance, slices(*NARROW[0], 9), 3)
    found = []
    for _ in range(2):
        assert model.propose("highs", 60).fingers is not None
        x = model.x
        found.append(
            np.concatenate(
                [np.ravel(np.asarray(v.value)).round() for v in (x.H, x.T, x.R[model.object.start])]
            ).tobytes()
        )
        model.cut_off()
    assert len(set(found)) == 2
