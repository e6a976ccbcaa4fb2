import numpy as np
import torch

from dlm.structured.examples import Example
from dlm.structured.scorer import stack
from dlm.tasks import TaskBatch
from tests.support.structured import SMALL


def test_logits_follow_the_facets_wherever_the_outline_begins(tasks: TaskBatch) -> None:
    scorer = SMALL.proposer().scorer
    vertices, poses = tasks.samples[0].task.body.vertices, tasks.samples[0].task.trajectory.poses
    count = len(vertices)
    logits = scorer(stack([(vertices, poses)]))[0]
    rolled = scorer(stack([(np.roll(vertices, -1, axis=0), poses)]))[0]
    turned = np.roll(np.arange(count), -1)
    asymmetric = torch.from_numpy(~scorer.schedules.symmetric & ~scorer.schedules.single)
    torch.testing.assert_close(
        rolled[asymmetric], logits[asymmetric][:, turned][:, :, turned], atol=1e-4, rtol=1e-4
    )
    moved = scorer(stack([(vertices, poses + [0.3, 0.0, 0.0])]))[0]
    torch.testing.assert_close(moved, logits, atol=1e-4, rtol=1e-4)


def test_padding_changes_no_logit(tasks: TaskBatch) -> None:
    scorer = SMALL.proposer().scorer
    both = [(s.task.body.vertices, s.task.trajectory.poses) for s in tasks.samples]
    wide = Example.of(tasks.samples[0]).split(np.random.default_rng(0), 12)
    batch = scorer(stack([*both, (wide.vertices, wide.poses)]))
    for k, one in enumerate(both):
        alone = scorer(stack([one]))[0]
        torch.testing.assert_close(batch[k][:, : len(one[0]), : len(one[0])], alone, atol=1e-4, rtol=1e-4)
