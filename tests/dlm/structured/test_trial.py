from dataclasses import replace

import numpy as np

from dlm.structured.trial import Trial
from dlm.tasks import TaskBatch


def test_a_trial_tells_a_sound_plan_from_one_that_drops_the_object(tasks: TaskBatch) -> None:
    k = next(i for i, s in enumerate(tasks.samples) if "lift" in s.family)
    sample, trial = tasks.samples[k], Trial()
    assert trial.risk(sample.task, sample.plan) < trial.good
    centres = sample.task.trajectory.poses[:, None, :2]
    wide = replace(sample.plan, positions=centres + 1.2 * (sample.plan.positions - centres))
    assert trial.risk(sample.task, wide) > 0.1
    broken = replace(sample.plan, forces=sample.plan.forces * np.nan)
    assert not trial.risk(sample.task, broken) <= trial.good
