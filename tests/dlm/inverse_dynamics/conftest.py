"""Parameters at and near the truth."""

import pytest
import torch
from torch import Tensor

from datasets.parameters import parameters_of
from dlm.inverse_dynamics.parameters import FLAGS, ParameterBatch
from tests.support.labelled import labels
from tests.support.programs import LAYOUT


@pytest.fixture(scope="session")
def everyone() -> list:
    return [*labels(6, (4, 6)), *labels(6, (12, 12))]


@pytest.fixture(scope="session")
def truth(everyone: list) -> ParameterBatch:
    return ParameterBatch.stack([parameters_of(one.task, one.plan) for one in everyone])


@pytest.fixture(scope="session")
def generic(truth: ParameterBatch) -> Tensor:
    """Rows (b, t, width) near the truth where the optimum is smooth: at the truth itself it can have corners."""
    rows = LAYOUT.split(LAYOUT.flatten(truth))
    noise = torch.Generator().manual_seed(0)
    moved = {
        n: 0.05 + 0.9 * x if n in FLAGS else x + 0.03 * torch.randn(x.shape, generator=noise, dtype=x.dtype)
        for n, x in rows.items()
    }
    return torch.cat([x.flatten(2) for x in moved.values()], dim=-1)
