"""What multipliers of the master program prove, right or wrong as they may be."""

import numpy as np
import pytest

from expert.contact.box import Box
from expert.contact.master import safe_bound
from expert.contact.plan_at import forces_at
from expert.contact.ranges import narrow
from expert.contact.relaxation import force_bound, open_master
from expert.contact.scaled import ScaledTask
from expert.contact.sequence import sequence_of
from tests.support.random_tasks import floor_task


@pytest.mark.parametrize("seed", [1, 3])
def test_any_multipliers_bound_every_plan_from_below(seed: int) -> None:
    rng, compared = np.random.default_rng(seed), 0
    scaled = ScaledTask.of(floor_task(rng))
    for on in [(f, g) for f in range(scaled.facets) for g in range(f)]:
        sequence = sequence_of(scaled, np.tile(on, (scaled.steps, 1)))
        box = Box(sequence, sequence.lo.copy(), sequence.hi.copy(), np.full_like(sequence.modes, -1))
        if not narrow(scaled, sequence, box.lo, box.hi)[0]:
            continue
        master = open_master(scaled, box, 5)
        force_bound(scaled, box, master)
        costs = [forces_at(scaled, sequence, rng.uniform(box.lo, box.hi)).cost for _ in range(5)]
        for _ in range(5):
            rows = int(master.filled[0])
            z = sequence.reference + 0.1 * rng.standard_normal(sequence.reference.size)
            bound = safe_bound(scaled, box, master, z, rng.exponential(size=rows))
            compared += np.isfinite(bound) and np.isfinite(min(costs))
            assert bound <= min(costs) + 1e-9 * (1 + abs(min(costs)))
    assert compared > 0
