import torch

from dlm.evaluation.outcomes import act, execute
from dlm.evaluation.watch import watch
from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.inverse_dynamics.parameters import Layout
from dlm.tasks import TaskBatch
from dlm.thesis.derender import NetworkSizes
from dlm.thesis.policies import ThesisArchitecture
from tests.support.outcomes import RIGID

SMALL = NetworkSizes(channels=(2, 3, 4), latent=8, recurrent_layers=1, hidden_layers=1)


def test_curves_are_the_mean_losses_on_every_data_set(tasks: TaskBatch) -> None:
    policy = ThesisArchitecture(sizes=SMALL, layout=Layout()).build("perceptron", InverseDynamics(), seed=0)
    policy.fit_centre(tasks)
    sets = {"test": tasks[torch.arange(2)], "family": tasks}
    looked = watch(sets, RIGID)
    row = looked.measure(policy)
    assert set(row) == {"object/test", "object/family", "finger/test", "finger/family"}
    for name, batch in sets.items():
        outcome = execute(act(policy, batch), batch, RIGID)
        assert row[f"object/{name}"] == outcome.object_loss.mean()
        assert row[f"finger/{name}"] == outcome.finger_loss.mean()
    assert len(looked.picture(policy).axes) == 2 * 5  # frames, and what comes of the action
