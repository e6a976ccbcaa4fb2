from dlm.evaluation.curves import curves_figure


def test_curves_have_a_line_for_every_logged_loss() -> None:
    rows = [
        {
            f"{k}/{d}": 1.0 / (i + 1)
            for k in ("finger", "object")
            for d in ("train", "finetune", "test", "family")
        }
        | {"iteration": float(i)}
        for i in range(3)
    ]
    figure = curves_figure(
        {stage: [rows, rows] for stage in ("nn", "nnm", "mdr", "cvx", "dlm")}, {"test": 1.0}, {"test": 0.01}
    )
    assert [len(ax.get_lines()) for ax in figure.axes] == [9, 11, 8]
    levels = [ax.get_lines()[-1].get_ydata()[0] for ax in figure.axes[1:]]
    assert levels == [0.01, 0.01]  # the oracle's
    assert [len(ax.collections) for ax in figure.axes] == [9, 9, 6]  # bands over the seeds
