import numpy as np
import torch

from dlm.neural import NeuralArchitecture
from dlm.neural.pointer import Pointer
from dlm.structured.examples import Example
from dlm.structured.losses import class_distance
from dlm.structured.scorer import stack
from dlm.tasks import TaskBatch

SMALL = NeuralArchitecture(width=16, layers=1, heads=2)


def pointer() -> Pointer:
    ranker = SMALL.build("proposals", seed=3).scorer
    assert isinstance(ranker, Pointer)
    return ranker


def test_shares_follow_the_facets_wherever_the_outline_begins(tasks: TaskBatch) -> None:
    ranker = pointer()
    vertices, poses = tasks.samples[0].task.body.vertices, tasks.samples[0].task.trajectory.poses
    logits = ranker(stack([(vertices, poses)]))[0]
    rolled = ranker(stack([(np.roll(vertices, -1, axis=0), poses)]))[0]
    turned = np.roll(np.arange(len(vertices)), -1)
    asymmetric = torch.from_numpy(~ranker.schedules.symmetric & ~ranker.schedules.single)
    torch.testing.assert_close(
        rolled[asymmetric], logits[asymmetric][:, turned][:, :, turned], atol=1e-4, rtol=1e-4
    )


def test_facets_that_are_not_there_get_nothing(tasks: TaskBatch) -> None:
    ranker = pointer()
    one = tasks.samples[0].task
    wide = Example.of(tasks.samples[1]).split(np.random.default_rng(0), 12)
    both = ranker(stack([(one.body.vertices, one.trajectory.poses), (wide.vertices, wide.poses)]))
    alone = ranker(stack([(one.body.vertices, one.trajectory.poses)]))[0]
    count = len(one.body.vertices)
    torch.testing.assert_close(both[0][:, :count, :count], alone, atol=1e-4, rtol=1e-4)
    assert (both[0][:, count:] == -torch.inf).all()


def test_a_schedule_and_two_facets_are_chosen_one_after_the_other(tasks: TaskBatch) -> None:
    """Shares of schedules and of the first facet are what is left when the later choices are summed over."""
    ranker = pointer()
    g = stack([(s.task.body.vertices, s.task.trajectory.poses) for s in tasks.samples])
    facets, steps = ranker.encoder(g, ranker.tasks)
    joint = ranker.pairs(facets, steps.mean(1), g.present).exp()
    torch.testing.assert_close(joint.sum((1, 2, 3)), torch.ones(len(tasks)))
    schedules = ranker.schedule(steps.mean(1)).softmax(-1)
    torch.testing.assert_close(joint.sum((2, 3)), schedules)


def test_gradients_of_the_class_loss_agree_with_differences(tasks: TaskBatch) -> None:
    examples = [Example.of(s) for s in tasks.samples]
    ranker = pointer()
    for weight, entry in ((ranker.schedule.bias, (3,)), (ranker.plan, (0, 2))):
        (gradient,) = torch.autograd.grad(class_distance(ranker, examples), weight)
        ends = []
        for sign in (1, -1):
            with torch.no_grad():
                weight[entry] += sign * 1e-2
                ends.append(float(class_distance(ranker, examples)))
                weight[entry] -= sign * 1e-2
        assert abs((ends[0] - ends[1]) / 2e-2 - float(gradient[entry])) < 1e-3
