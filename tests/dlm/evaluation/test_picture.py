from dlm.evaluation.outcomes import execute
from dlm.evaluation.picture import derendered, task_figure, window
from dlm.execution import expert_action
from dlm.inverse_dynamics.layer import InverseDynamics
from dlm.inverse_dynamics.parameters import Layout
from dlm.tasks import TaskBatch
from dlm.thesis.derender import NetworkSizes
from dlm.thesis.policies import ThesisArchitecture
from expert.geometry.pose import to_world
from tests.support.outcomes import RIGID

SMALL = NetworkSizes(channels=(2, 3, 4), latent=8, recurrent_layers=1, hidden_layers=1)


def test_a_strip_shows_input_derendered_parameters_and_outcome(tasks: TaskBatch) -> None:
    expert = execute(expert_action(tasks), tasks, RIGID)
    figure = task_figure(tasks, 0, {"MDR": expert}, {"MDR": tasks.parameters})
    frames, parameters, outcome = (figure.axes[5 * k : 5 * k + 5] for k in range(3))
    assert [len(ax.images) for ax in frames] == [1] * 5
    assert [len(ax.patches) for ax in outcome] == [3] * 5  # floor, object, goal
    assert all(len(ax.lines) >= 3 for ax in parameters)  # position, a facet for each finger
    without = task_figure(tasks, 0, {"NN": expert}, {"NN": None})
    assert len(without.axes) == 2 * 5


def test_the_window_holds_the_whole_motion(tasks: TaskBatch) -> None:
    for k, sample in enumerate(tasks.samples):
        (left, right), (low, high) = window(tasks, k)
        corners = to_world(sample.task.trajectory.poses, sample.task.body.vertices)
        assert corners[..., 0].min() > left
        assert corners[..., 0].max() < right
        assert low < 0
        assert corners[..., 1].max() < high


def test_only_policies_that_learn_to_derender_show_parameters(tasks: TaskBatch) -> None:
    model = ThesisArchitecture(sizes=SMALL, layout=Layout())
    assert derendered(model.build("perceptron", InverseDynamics(), seed=0), tasks) is None
    shown = derendered(model.build("program", InverseDynamics(), seed=0), tasks)
    assert shown is not None
    assert shown.facets.shape == tasks.parameters.facets.shape
    assert not shown.facets.requires_grad
