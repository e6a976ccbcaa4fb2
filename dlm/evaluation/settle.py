"""Batch norm's statistics, taken anew after training.

Its running averages lag behind weights that still move, and were taken while dropout widened what each layer saw.  In
evaluation nothing is dropped, so that on small data sets a network in evaluation can differ much from the one that was trained.
"""

import torch
from torch import nn

from dlm.policy import Policy
from dlm.tasks import TaskBatch

ENOUGH = 2000
"""Tasks over which statistics are taken, of larger data sets the first so many."""


def settle(policy: Policy, tasks: TaskBatch) -> None:
    """Replace running averages by the statistics over one pass of (ENOUGH of) the tasks that the policy learned from, without dropout."""
    norms = [m for m in policy.modules() if isinstance(m, nn.BatchNorm1d)]
    if not norms:
        return
    for norm in norms:
        norm.reset_running_stats()
        norm.momentum = None  # plain averages, of one batch here
    policy.train()
    for module in policy.modules():
        if isinstance(module, nn.Dropout):
            module.eval()
    with torch.no_grad():
        policy(tasks.video[:ENOUGH])
    policy.eval()
