"""The comparison of all trained architectures with doing nothing and with the oracle."""

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dlm.checkpoint import About, versions
from dlm.evaluation.animation import animate, input_film
from dlm.evaluation.curves import curves_figure
from dlm.evaluation.outcomes import Outcome, act, execute
from dlm.evaluation.picture import derendered, task_figure
from dlm.evaluation.report import Example, html_report
from dlm.evaluation.table import Cell, Line, Table
from dlm.evaluation.timing import backward_seconds, expert_seconds, forward_seconds
from dlm.execution import expert_action, idle_action
from dlm.models import Policy
from dlm.simulator import SimulatorSettings
from dlm.tasks import TaskBatch
from dlm.training import Stage

Seconds = tuple[float | None, float | None]
"""Forward and backward, per task."""

IDLE, ORACLE = "no action", "MIQP (oracle)"


@dataclass(frozen=True, kw_only=True)
class Trained:
    """One architecture, trained: its stage, and policy and record of every seed."""

    stage: Stage
    policies: Sequence[Policy]
    abouts: Sequence[About]

    @property
    def title(self) -> str:
        """As in the table."""
        return self.stage.name.upper()


@dataclass(frozen=True, kw_only=True)
class Study:
    """Trained architectures, data sets by name, and the simulator that judges."""

    trained: Sequence[Trained]
    tasks: Mapping[str, TaskBatch]
    simulator: SimulatorSettings

    def outcomes(self) -> dict[str, dict[str, list[Outcome]]]:
        """Of every architecture on every data set, one per seed."""
        fixed = {IDLE: idle_action, ORACLE: expert_action}
        rows: dict[str, dict[str, list[Outcome]]] = {IDLE: {}}
        for one in self.trained:
            rows[one.title] = {
                name: [execute(act(policy, batch), batch, self.simulator) for policy in one.policies]
                for name, batch in self.tasks.items()
            }
        for title, action in fixed.items():
            rows[title] = {n: [execute(action(b), b, self.simulator)] for n, b in self.tasks.items()}
        return rows

    def table(self, outcomes: Mapping[str, Mapping[str, list[Outcome]]], origin: dict[str, object]) -> Table:
        """Table 4.1 with times, and how it came about."""
        seconds: dict[str, Seconds] = {one.title: self._seconds(one) for one in self.trained}
        seconds[ORACLE] = expert_seconds(self.tasks["test"]), None
        lines = [
            Line(
                model=title,
                cells={name: Cell.of(row[name], outcomes[IDLE][name][0]) for name in self.tasks},
                forward=seconds.get(title, (None, None))[0],
                backward=seconds.get(title, (None, None))[1],
            )
            for title, row in outcomes.items()
        ]
        machine = f"{platform.machine()}, {platform.system()}"
        return Table(lines=lines, origin={**origin, "machine": machine, "versions": versions()})

    def _seconds(self, one: Trained) -> Seconds:
        policy = one.policies[0]
        tasks = self.tasks[one.stage.dataset]
        return forward_seconds(policy, self.tasks["test"]), backward_seconds(policy, one.stage.loss, tasks)

    def report(self, outcomes: Mapping[str, Mapping[str, list[Outcome]]], table: Table, examples: int) -> str:
        """The HTML page; `examples` tasks each of the family and test sets."""
        histories = {one.stage.name: [a.history for a in one.abouts] for one in self.trained}
        no_action = float(outcomes[IDLE]["test"][0].object_loss.mean())
        chosen = [(d, k) for d in ("family", "test") for k in range(min(examples, len(self.tasks[d])))]
        return html_report(
            table, curves_figure(histories, no_action), [self._example(outcomes, d, k) for d, k in chosen]
        )

    def _example(self, outcomes: Mapping[str, Mapping[str, list[Outcome]]], dataset: str, k: int) -> Example:
        tasks = self.tasks[dataset]
        shown = {title: row[dataset][0] for title, row in outcomes.items() if title != IDLE}
        parameters = {one.title: derendered(one.policies[0], tasks) for one in self.trained}
        films = {title: animate(tasks, k, one.action, self.simulator) for title, one in shown.items()}
        return Example(
            title=f"{dataset} {k}: {tasks.samples[k].family.replace('_', ' ')}",
            strip=task_figure(tasks, k, shown, parameters),
            films={"input": input_film(tasks, k), **films},
        )
