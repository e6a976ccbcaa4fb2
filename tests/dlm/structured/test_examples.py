import numpy as np
import pytest

from datasets.specification import Sample
from dlm.structured.classes import Schedules
from dlm.structured.examples import Example
from dlm.tasks import TaskBatch
from expert.problems.contact import FREE

SCHEDULES = Schedules()


@pytest.fixture(params=range(4))
def sample(request: pytest.FixtureRequest, tasks: TaskBatch) -> Sample:
    return tasks.samples[request.param]


def test_mirrored_and_split_examples_keep_their_optimum(sample: Sample) -> None:
    example = Example.of(sample)
    again = example.mirrored().mirrored()
    np.testing.assert_allclose(again.vertices, example.vertices, atol=1e-12)
    assert (again.modes == example.modes).all()
    rng = np.random.default_rng(0)
    margin = sample.task.fingers.facet_margin
    for variant in (example.mirrored(), example.split(rng, 9), example.mirrored().split(rng, 12)):
        own = variant.contact_class(SCHEDULES)
        assert own is not None
        facet = np.maximum(variant.modes, 0)
        a, b = variant.vertices[facet], np.roll(variant.vertices, -1, axis=0)[facet]
        places = a + variant.rho[..., None] * (b - a)
        original = Example.of(sample)
        c, d = (
            original.vertices[np.maximum(original.modes, 0)],
            np.roll(original.vertices, -1, axis=0)[np.maximum(original.modes, 0)],
        )
        expected = c + original.rho[..., None] * (d - c)
        flip = np.sign(variant.poses[0, 0] * original.poses[0, 0]) if original.poses[0, 0] else 1.0
        touching = variant.modes != FREE
        np.testing.assert_allclose(places[touching], (expected * [flip, 1.0])[touching], atol=1e-9)
    assert 0 < margin < 0.5
