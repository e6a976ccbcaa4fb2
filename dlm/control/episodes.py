"""Episodes of a policy in a world, one after the other or in several processes."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
from joblib import Parallel, delayed

from dlm.control.policy import PushPolicy
from dlm.control.worlds import Image, PushT, Spoiler, World
from expert.drawing.canvas import save_frames
from expert.world.values import require

LIMIT = 300
"""Steps of an episode, as the benchmark has it."""
RATE = 10
"""Of films, as of the control steps [1/s]."""
Stop = Literal["world", "own"]


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What is tried: observations, camera, and who ends an episode: the world at success, or the policy by its own test."""

    observation: str = "pixels"
    light: float = 1.0
    noise: float = 0.0
    jpeg: int | None = None
    stop: Stop = "world"

    def __post_init__(self) -> None:
        require(self.observation in ("pixels", "state"), "observation", "pixels or state", self.observation)
        require(self.stop in ("world", "own"), "stop", "world or own", self.stop)
        Spoiler(light=self.light, noise=self.noise, jpeg=self.jpeg)

    def make(self) -> tuple[World, PushPolicy]:
        """The world and a policy for it."""
        spoiler = Spoiler(light=self.light, noise=self.noise, jpeg=self.jpeg)
        return PushT(self.observation, spoiler), PushPolicy.for_pusht(self.observation)


@dataclass(frozen=True, kw_only=True)
class Episode:
    """How one episode went; first_ms, mean_ms, most_ms: processor time of the policy's first step and of all others."""

    seed: int
    success: bool
    steps: int
    coverage: float
    stopped: bool
    first_ms: float
    mean_ms: float
    most_ms: float


def run_episode(
    world: World, policy: PushPolicy, seed: int, stop: Stop = "world", film: list[Image] | None = None
) -> Episode:
    """One episode of at most LIMIT steps; success is the world's word at its end.  Pictures go into `film`."""
    observation, success, coverage = world.reset(seed), False, 0.0
    policy.reset()
    times: list[float] = []
    while len(times) < LIMIT:
        if film is not None:
            film.append(world.picture())
        began = time.process_time()
        command = policy.select_action(observation)
        times.append(1e3 * (time.process_time() - began))
        if stop == "own" and policy.arrived:
            break
        observation, success, coverage = world.step(command)
        if stop == "world" and success:
            break
    if film is not None:
        film.append(world.picture())
    later = times[1:] or times
    return Episode(
        seed=seed,
        success=success,
        steps=len(times),
        coverage=coverage,
        stopped=policy.arrived,
        first_ms=times[0],
        mean_ms=float(np.mean(later)),
        most_ms=max(later),
    )


@lru_cache
def _made(trial: Trial) -> tuple[World, PushPolicy]:
    """Once in each process; the first look compiles, which is no part of an episode."""
    world, policy = trial.make()
    run_episode(world, policy, 0)
    return world, policy


def _episode(trial: Trial, seed: int, film: Path | None) -> Episode:
    world, policy = _made(trial)
    frames: list[Image] | None = None if film is None else []
    episode = run_episode(world, policy, seed, trial.stop, frames)
    if film is not None and frames is not None:
        save_frames(frames, film, rate=RATE)
    return episode


def run_episodes(trial: Trial, seeds: list[int], jobs: int, films: dict[int, Path]) -> Iterator[Episode]:
    """Episodes of all seeds, as they end."""
    if jobs == 1:
        for seed in seeds:
            yield _episode(trial, seed, films.get(seed))
        return
    work = (delayed(_episode)(trial, seed, films.get(seed)) for seed in seeds)
    yield from Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)(work)
