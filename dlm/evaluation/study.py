"""The comparison of all trained architectures with doing nothing and with the oracle."""

import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from dlm.evaluation.animation import animate, input_film
from dlm.evaluation.curves import curves_figure
from dlm.evaluation.extras import Extra
from dlm.evaluation.outcomes import Outcome, act, execute
from dlm.evaluation.picture import derendered, task_figure
from dlm.evaluation.qualitative import qualitative_figure
from dlm.evaluation.report import Example, Report
from dlm.evaluation.significance import Comparison, compare_all
from dlm.evaluation.table import Cell, Line, Table
from dlm.evaluation.timing import backward_seconds, expert_seconds, forward_seconds
from dlm.evaluation.trained import Trained, title_of
from dlm.execution import expert_action, idle_action
from dlm.inverse_dynamics.layer import Action
from dlm.simulator import SimulatorSettings
from dlm.tasks import TaskBatch, first
from dlm.training.checkpoint import versions

Seconds = tuple[float | None, float | None]
"""Forward and backward, per task."""

IDLE, ORACLE = "no action", "MIQP (oracle)"
CROSSWISE = (("NN", "MDR"), ("NNM", "DLM"), ("CVX longer", "DLM"))
"""Compared beside every stage and the one that it starts from: networks alone and with the program, labels and simulation."""

TIMED = 20
"""Tasks of the batch on which backward passes are timed, as many as the thesis trains on."""

Outcomes = Mapping[str, Mapping[str, list[Outcome]]]
"""Of every row on every data set, one per seed."""


@dataclass(frozen=True, kw_only=True)
class Study:
    """Trained architectures, data sets by name, and the simulator that judges.

    baselines: further rows by title, from tasks to actions, which nobody trained.
    """

    trained: Sequence[Trained]
    tasks: Mapping[str, TaskBatch]
    simulator: SimulatorSettings
    baselines: Mapping[str, Callable[[TaskBatch], Action]] = field(default_factory=dict)

    def outcomes(self) -> dict[str, dict[str, list[Outcome]]]:
        """Of every architecture on every data set, one per seed, between doing nothing and the oracle."""
        rows = self._fixed({IDLE: idle_action})
        for one in self.trained:
            rows[one.title] = {
                name: [execute(act(policy, batch), batch, self.simulator) for policy in one.policies]
                for name, batch in self.tasks.items()
            }
        return rows | self._fixed({**self.baselines, ORACLE: expert_action})

    def _fixed(
        self, actions: Mapping[str, Callable[[TaskBatch], Action]]
    ) -> dict[str, dict[str, list[Outcome]]]:
        return {
            title: {name: [execute(action(b), b, self.simulator)] for name, b in self.tasks.items()}
            for title, action in actions.items()
        }

    def table(self, outcomes: Outcomes, origin: dict[str, object]) -> Table:
        """Table 4.1 with times and tests, and how it came about."""
        seconds: dict[str, Seconds] = {one.title: self._seconds(one) for one in self.trained}
        seconds[ORACLE] = expert_seconds(self.tasks["test"]), None
        lines = [
            Line(
                model=title,
                cells={name: Cell.of(row[name], outcomes[IDLE][name][0]) for name in self.tasks},
                forward=seconds.get(title, (None, None))[0],
                backward=seconds.get(title, (None, None))[1],
                judged=title not in (IDLE, ORACLE),
            )
            for title, row in outcomes.items()
        ]
        costs = {one.title: f"{sum(a.seconds for a in one.abouts) / 60:.1f}" for one in self.trained}
        return Table(
            lines=lines,
            origin={
                **origin,
                "training, processor minutes": costs,
                "machine": f"{platform.machine()}, {platform.system()}",
                "versions": versions(),
            },
            comparisons=self._comparisons(outcomes),
        )

    def _seconds(self, one: Trained) -> Seconds:
        policy = one.policies[0]
        tasks = first(self.tasks, TIMED)[one.stage.dataset]
        return forward_seconds(policy, self.tasks["test"]), backward_seconds(policy, one.stage.loss, tasks)

    def _comparisons(self, outcomes: Outcomes) -> list[Comparison]:
        losses = {
            title: {name: np.mean([o.object_loss for o in seeds], axis=0) for name, seeds in row.items()}
            for title, row in outcomes.items()
        }
        stages = [(one.stage.warm_start, one.stage.name) for one in self.trained if one.stage.warm_start]
        pairs = [
            *((title_of(before), title_of(after)) for before, after in stages),
            *CROSSWISE,
            *((IDLE, title) for title in outcomes if title not in (IDLE, ORACLE)),
        ]
        known = [(a, b) for a, b in dict.fromkeys(pairs) if a in losses and b in losses]
        return compare_all(losses, known, rng=np.random.default_rng(0))

    def report(
        self, outcomes: Outcomes, table: Table, *, examples: int, extras: Sequence[Extra] = ()
    ) -> Report:
        """What the page shows; `examples` animated tasks each of the family and test sets."""
        histories = {one.stage.name: [a.history for a in one.abouts] for one in self.trained}
        idle, oracle = (
            {name: float(row[0].object_loss.mean()) for name, row in outcomes[title].items()}
            for title in (IDLE, ORACLE)
        )
        return Report(
            table=table,
            curves=curves_figure(histories, idle, oracle),
            qualitative=qualitative_figure(
                [
                    (d, self.tasks[d], k, {t: row[d][0] for t, row in outcomes.items() if t != IDLE})
                    for d, k in self._spread(2)
                ]
            ),
            examples=[self._example(outcomes, d, k) for d, k in self._spread(examples)],
            extras=extras,
        )

    def _spread(self, count: int) -> list[tuple[str, int]]:
        """Task numbers, fixed before any result: the first ones of the family and test sets, each of another kind of motion."""
        return [(d, k) for d in ("family", "test") for k in range(min(count, len(self.tasks[d])))]

    def _example(self, outcomes: Outcomes, dataset: str, k: int) -> Example:
        tasks = self.tasks[dataset]
        shown = {title: row[dataset][0] for title, row in outcomes.items() if title != IDLE}
        parameters = {one.title: derendered(one.policies[0], tasks) for one in self.trained}
        films = {title: animate(tasks, k, one.action, self.simulator) for title, one in shown.items()}
        return Example(
            title=f"{dataset} {k}: {tasks.samples[k].family.replace('_', ' ')}",
            strip=task_figure(tasks, k, shown, parameters),
            films={"input": input_film(tasks, k), **films},
        )
