"""What can be reached: floods that know where pockets of dead ends are, and what pockets are."""

import numpy as np
import pytest

from expert.budget import Budget
from expert.grasping.proposals import RelativeProblem, goal_cells
from expert.problems.grasp import GraspProblem
from expert.verify.grasp.check import verify_grasp
from expert.verify.grasp.dead_ends import dead_end_events
from expert.verify.grasp.finger_path import FingerPath
from expert.verify.grasp.pockets import Pockets
from expert.verify.grasp.reach_tube import COARSEST, reach_tube
from expert.world.shape import Shape
from tests.support.experiments import closing_path
from tests.support.polygons import irregular_polygon

HALF_RANGES = np.radians([30, 24, 16, 8, 4])


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 5])
def test_pockets_are_free_and_lead_to_their_dead_end(seed: int) -> None:
    shape, knots, _ = closing_path(seed)
    path = FingerPath(shape, np.zeros(3), knots)
    events = dead_end_events(path)
    assert events
    for event in events:
        pockets = Pockets.before(path, [event])
        assert np.abs(pockets.configurations[0] - event.configurations(3)[1]).max() < 0.05
        assert 0 <= event.s - pockets.until[0] < 0.1
        assert (np.diff(pockets.since) <= 0).all()
        for configuration, *span in zip(pockets.configurations, pockets.since, pockets.until, strict=True):
            for s in np.linspace(*span, 5):
                assert path.gap(configuration[None], s)[0] >= -1e-6


def test_a_flood_that_knows_the_pockets_keeps_out_of_them_with_cells_as_wide() -> None:
    shape = Shape(vertices=irregular_polygon(np.random.default_rng(0), 4))
    problem = GraspProblem(shape=shape, pose=np.zeros(3), half_ranges=HALF_RANGES)
    search = RelativeProblem(problem, Budget(np.inf))
    path = FingerPath(shape, np.zeros(3), search.frame.world(next(goal_cells(search)).path))
    assert verify_grasp(problem, path.knots_w, time_limit=np.inf).verdict == "certified"
    events = [e for e in dead_end_events(path) if abs(e.first[2]) < HALF_RANGES[0]]
    limits = HALF_RANGES[:-1] + np.radians(2)
    blind = reach_tube(path, limits, COARSEST, Budget(np.inf))
    aware = reach_tube(path, limits, COARSEST, Budget(np.inf), Pockets.before(path, events))
    assert blind.closed
    assert aware.closed
    assert any(blind.meets(e.s, e.first, e.last) for e in events)
    assert not any(aware.meets(e.s, e.first, e.last) for e in events)
