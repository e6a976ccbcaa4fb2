"""What is measured and drawn while a stage learns."""

from collections.abc import Mapping

from matplotlib.figure import Figure

from dlm.evaluation.outcomes import act, execute
from dlm.evaluation.picture import derendered, task_figure
from dlm.policy import Policy
from dlm.simulator import SimulatorSettings
from dlm.tasks import TaskBatch, first
from dlm.training.loop import Row, Watch

MOST = 40
"""Tasks of each data set that curves are measured on."""


def watch(tasks: Mapping[str, TaskBatch], simulator: SimulatorSettings) -> Watch:
    """Finger- and object-trajectory losses on every data set (the curves of Fig. 4-6), and a picture of one test task."""
    few = first(tasks, MOST)

    def measure(policy: Policy) -> Row:
        row: Row = {}
        for name, batch in few.items():
            outcome = execute(act(policy, batch), batch, simulator)
            row[f"object/{name}"] = float(outcome.object_loss.mean())
            row[f"finger/{name}"] = float(outcome.finger_loss.mean())
        return row

    def picture(policy: Policy) -> Figure:
        batch = tasks["family"]
        outcome = execute(act(policy, batch), batch, simulator)
        return task_figure(batch, 0, {"action": outcome}, {"action": derendered(policy, batch)})

    return Watch(measure=measure, picture=picture)
