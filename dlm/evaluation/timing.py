"""Processor seconds per task: from video to action, from loss to gradients, and the expert's own time.

Processor time, not time on the clock: other programs on the machine do not change it.
"""

import time
from statistics import median

import torch

from dlm.policy import Loss, Policy
from dlm.tasks import TaskBatch
from expert.contact import solve

REPEATS = 10


def forward_seconds(policy: Policy, tasks: TaskBatch) -> float:
    """Video to action, one video at a time: median over a few tasks."""
    policy.eval()
    seconds = []
    with torch.no_grad():
        policy(tasks.video[:1])  # the first call builds caches
        for k in range(min(REPEATS, len(tasks))):
            start = time.process_time()
            policy(tasks.video[k : k + 1])
            seconds.append(time.process_time() - start)
    return median(seconds)


def backward_seconds(policy: Policy, loss: Loss, tasks: TaskBatch) -> float:
    """Loss to gradients of all weights, of a training batch, divided by its size: median of three."""
    policy.train()
    seconds = []
    with torch.random.fork_rng():
        for _ in range(3):
            policy.zero_grad()
            value = loss(policy, tasks)
            start = time.process_time()
            value.backward()
            seconds.append((time.process_time() - start) / len(tasks))
    policy.zero_grad()
    policy.eval()
    return median(seconds)


def expert_seconds(tasks: TaskBatch) -> float:
    """The expert's time to plan, with all true parameters: median over a few tasks."""
    seconds = []
    for sample in tasks.samples[:REPEATS]:
        start = time.process_time()
        solve(sample.task)
        seconds.append(time.process_time() - start)
    return median(seconds)
