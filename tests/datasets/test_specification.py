from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from datasets.specification import Specification, draw, generator
from expert.errors import SolverFailed


def test_data_sets_of_one_seed_share_no_task(smoke: Specification) -> None:
    first, second = (generator(name, 0, 0, 0).random(4) for name in ("train", "finetune"))
    assert not np.allclose(first, second)
    (a, _), (b, _) = (draw(replace(smoke, name=name), 0, 0) for name in ("train", "finetune"))
    assert not np.array_equal(a.video, b.video)


def test_a_task_that_no_draw_can_label_stops_the_job(smoke: Specification) -> None:
    one_finger = replace(smoke, tasks=replace(smoke.tasks, fingers=1))
    with pytest.raises(SolverFailed, match=r"^task 2 \(lift\): no label in 100 draws; the last: infeasible"):
        draw(one_finger, 0, 2)


def test_every_data_set_has_its_stated_size(configured: Callable[[str], Specification]) -> None:
    sizes = {
        name: (s.count, s.shapes.facets)
        for name in ("train", "finetune", "test", "family", "smoke")
        for s in [configured(name)]
    }
    assert sizes == {
        "train": (20, (4, 6)),
        "finetune": (20, (4, 6)),
        "test": (40, (12, 12)),
        "family": (40, (4, 6)),
        "smoke": (4, (4, 6)),
    }
