"""Every certified start arrives, whatever the support, in the sweeping process, in the contact simulator and in MuJoCo."""

import numpy as np
import pytest

from dlm.simulator.grasp import replay_grasp, replay_grasp_in_mujoco
from expert.files import read_problem
from expert.grasping.sweeping import sweep
from expert.grasping.synthesis import solve
from expert.problems.grasp import GraspProblem, GraspSolution
from expert.verify.grasp.check import verify_grasp
from expert.verify.grasp.finger_path import FingerPath
from expert.verify.grasp.start_set import StartSet
from expert.world.named import named_shape
from expert.world.shape import Shape
from tests.support.experiments import hard_starts
from tests.support.jams import jams
from tests.support.polygons import irregular_polygon

Certified = tuple[GraspProblem, GraspSolution, StartSet]
TOLERANCE, ANGLE = 1e-5, np.radians(0.01)


OBJECTS = {"bracket": named_shape("bracket"), "random": irregular_polygon(np.random.default_rng(3), 4)}


@pytest.fixture(scope="module", params=OBJECTS)
def certified(request: pytest.FixtureRequest) -> Certified:
    pose = np.array([0.1, -0.05, 0.4])
    problem = GraspProblem(shape=Shape(vertices=OBJECTS[request.param]), pose=pose)
    answer = solve(problem)
    assert answer.found, answer.reason
    return problem, answer, StartSet(FingerPath(problem.shape, problem.pose, answer.path))


def test_every_start_in_the_certified_set_ends_at_the_goal(certified: Certified) -> None:
    problem, answer, starts = certified
    rng = np.random.default_rng(1)
    path = FingerPath(problem.shape, problem.pose, answer.path)
    chosen = np.concatenate([starts.starts(rng, 100), hard_starts(path, starts, rng)])
    assert len(chosen) > 110
    run = sweep(problem.shape, answer.path, chosen, goal=problem.pose)
    distance, angle = run.misses(problem.pose)
    assert np.isnan(run.stalled).all()
    assert distance.max() <= TOLERANCE * problem.shape.size
    assert angle.max() <= ANGLE


def test_success_does_not_depend_on_the_support(certified: Certified) -> None:
    problem, answer, starts = certified
    chosen = starts.starts(np.random.default_rng(2), 40)
    rng = np.random.default_rng(3)
    middles = []
    for _ in range(4):
        root = rng.normal(size=(3, 3))
        metric = root @ root.T + 0.05 * np.eye(3)
        run = sweep(problem.shape, answer.path, chosen, goal=problem.pose, metric=metric)
        distance, angle = run.misses(problem.pose)
        assert distance.max() <= TOLERANCE * problem.shape.size
        assert angle.max() <= ANGLE
        middles.append(run.poses[:, len(run.s) // 2])
    assert np.abs(middles[0] - middles[1]).max() > 1e-4  # on the way it does


def test_the_contact_simulator_arrives_too(certified: Certified) -> None:
    """With masses, springs and Coulomb friction at the support, fingers without friction: within 0.1 % of size."""
    problem, answer, starts = certified
    chosen = starts.starts(np.random.default_rng(4), 8)
    ends = replay_grasp(problem, answer.path, chosen)[:, -1] - problem.pose
    assert np.linalg.norm(ends[:, :2], axis=1).max() <= 1e-3 * problem.shape.size
    assert np.abs(ends[:, 2]).max() <= np.radians(0.1)


def test_mujoco_arrives_too(certified: Certified) -> None:
    pytest.importorskip("mujoco")
    problem, answer, starts = certified
    start = starts.starts(np.random.default_rng(5), 1)[0]
    end = replay_grasp_in_mujoco(problem, answer.path, start)[-1] - problem.pose
    assert np.linalg.norm(end[:2]) <= 2e-3 * problem.shape.size
    assert abs(end[2]) <= np.radians(0.3)


def test_three_fingers_that_hold_to_second_order_bring_every_start_to_the_goal() -> None:
    problem = read_problem("configs/problem/certified_grasp/arrow_3.yaml").task
    answer = solve(problem)
    assert answer.found
    report = verify_grasp(problem, answer.path, answer.facets)
    assert report.end
    assert report.end.form_closure == 2
    assert report.start
    run = sweep(problem.shape, answer.path, report.start.starts(np.random.default_rng(6), 100))
    distance, angle = run.misses(problem.pose)
    assert not (
        run.stalled < len(answer.path) - 1 - 1e-6
    ).any()  # the object's rate has no bound at the very end
    assert distance.max() <= TOLERANCE * problem.shape.size
    assert angle.max() <= ANGLE


@pytest.mark.parametrize("name", ["I, late", "quadrangle", "I, early", "MIQP2's answer"])
def test_what_jams_in_the_sweeping_process_jams_in_the_contact_simulator(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nested cages with a form-closed end: the checker's witness is held elsewhere, though other starts do arrive.

    Fingers ten times as stiff as by default: three of the quadrangle's hold it against the support's friction up to 0.2 deg and
    0.2 % of its size from the goal, by so much as their springs give (at most 0.01 deg and 0.01 % here).
    """
    monkeypatch.setattr("dlm.simulator.grasp.STIFFNESS_PER_MASS", 1e7)
    problem, path = jams()[name]
    report = verify_grasp(problem, path)
    assert report.verdict == "refuted"
    assert report.dead_ends
    assert report.start
    starts = report.start.starts(np.random.default_rng(0), 20)
    arriving = starts[np.isnan(sweep(problem.shape, path, starts).stalled)][:3]
    assert len(arriving) == 3
    assert report.dead_ends.witness is not None
    ends = replay_grasp(problem, path, np.stack([report.dead_ends.witness, *arriving]))[:, -1] - problem.pose
    distance, angle = np.linalg.norm(ends[:, :2], axis=1) / problem.shape.size, np.abs(ends[:, 2])
    assert distance[0] > 0.01
    assert angle[0] > np.radians(2)
    assert distance[1:].max() < 1e-3
    assert angle[1:].max() < np.radians(0.1)
