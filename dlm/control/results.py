"""Results of episodes: kept on disk as they come, and their figures."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from dlm.control.episodes import Episode, Trial
from expert.errors import InvalidProblem
from expert.files.document import save


class Results:
    """results.json of a folder: the trial and its episodes by seed."""

    def __init__(self, folder: Path, trial: Trial) -> None:
        self.file, self.trial = folder / "results.json", trial
        self.episodes: dict[int, Episode] = {}
        if self.file.exists():
            self._read()

    def _read(self) -> None:
        """Raises InvalidProblem for another trial's results, or for a file that is none."""
        try:
            stored = json.loads(self.file.read_text(encoding="utf-8"))
            found = {row["seed"]: Episode(**row) for row in stored["episodes"]}
        except (ValueError, KeyError, TypeError) as error:
            raise InvalidProblem("out", expected="a results.json of this command", got=str(error)) from error
        if stored.get("trial") != asdict(self.trial):
            raise InvalidProblem(
                "out",
                expected=f"results of {asdict(self.trial)}",
                got=f"{stored.get('trial')}",
                remedy="choose another folder",
            )
        self.episodes = found

    def add(self, episode: Episode) -> None:
        """Keep an episode, on disk too."""
        self.episodes[episode.seed] = episode
        self.write()

    def write(self) -> None:
        """All episodes, in the order of their seeds; whoever interrupts finds the old file or the new one."""
        episodes = [self.episodes[seed] for seed in sorted(self.episodes)]
        rows = [asdict(episode) for episode in episodes]
        save(self.file, {"trial": asdict(self.trial), "summary": summary(episodes), "episodes": rows})


def summary(episodes: Sequence[Episode]) -> dict[str, float]:
    """Figures of episodes; steps count those of failures too, as many as were made."""
    steps = np.array([e.steps for e in episodes])
    spent = sum(e.first_ms + (e.steps - 1) * e.mean_ms for e in episodes)
    return {
        "episodes": len(episodes),
        "successes": sum(e.success for e in episodes),
        "steps_median": float(np.median(steps)),
        "steps_p90": float(np.percentile(steps, 90)),
        "steps_mean": float(steps.mean()),
        "mean_ms": float(spent / steps.sum()),
        "first_ms": float(np.mean([e.first_ms for e in episodes])),
        "first_most_ms": max(e.first_ms for e in episodes),
        "later_most_ms": max(e.most_ms for e in episodes),
    }
