"""Pushing: how exactly is the world predicted, how long do table and plan take, and how do Push-T's episodes go?

    python -m tests.benchmarks.pushing [--quick] [--episodes 200] [--only NAME ...] [--json FILE]

`state`, `pixels`: gym-pusht as it is.  `worse camera`: noise of 25 of 255, JPEG of quality 60, a fifth less light, all at
once.  `other blocks`: centre of gravity up to 30 pixels off, inertia times 0.5 to 2, velocity kept per substep 0, 0.5, 0.9
or 0.97, nothing told, from pixels.  `own stop`: the policy ends the episode by its own test, and the world says whether it
was right.  Times are processor time of one core.  Exits 1 where a stated bar is missed.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from dlm.control import PushPolicy, pusht
from dlm.control.episodes import Episode, Stop, run_episode
from dlm.control.results import summary
from dlm.control.worlds import PushT, Spoiler
from expert.pushing.impulses import ANGLE, X, run
from expert.pushing.table import again

SEEDS = {"state": 0, "pixels": 10_000, "worse camera": 20_000, "other blocks": 30_000, "own stop": 40_000}
Bar = tuple[str, str, float]
BARS: dict[str, list[Bar]] = {
    "model": [("worst_px", "<=", 1e-4)],
    "times": [("plan_ms", "<=", 50.0)],
    "state": [
        ("success", ">=", 1.0),
        ("steps_median", "<=", 24),
        ("steps_p90", "<=", 34),
        ("mean_ms", "<=", 8),
    ],
    "pixels": [
        *[
            ("success", ">=", 0.999),
            ("steps_median", "<=", 24),
            ("steps_p90", "<=", 34),
            ("mean_ms", "<=", 8),
        ],
        *[("first_most_ms", "<=", 120.0), ("later_most_ms", "<=", 50.0)],
    ],
    "worse camera": [("success", ">=", 0.98)],
    "other blocks": [("success", ">=", 0.97)],
    "own stop": [("success", ">=", 0.99)],
}
PROGRESS = Console(stderr=True)


def model(episodes: int) -> dict[str, float]:
    """Random commands in the middle of the world: greatest deviation of block and agent, over all steps without a wall."""
    world, law, rng = (
        PushT("state"),
        pusht.block().law(pusht.pusht_planner(60.0).model.drive),
        np.random.default_rng(0),
    )
    bare, worst, steps = world.environment.unwrapped, 0.0, 0
    for seed in range(episodes):
        world.environment.reset(
            seed=seed, options={"reset_to_state": [256, 480, 256, 256, rng.uniform(-3, 3)]}
        )
        state = np.zeros(13)
        state[:2], state[X : ANGLE + 1] = bare.agent.position, _centre(bare)
        for _ in range(30):
            command = rng.uniform(150, 360, 2)
            bare.step(command)
            run(law, state, command[None], 10)
            if np.abs(_centre(bare)[:2] - 256).max() > 126:
                break
            off = np.concatenate([state[:2] - bare.agent.position, state[X : ANGLE + 1] - _centre(bare)])
            worst, steps = max(worst, float(np.abs(off).max())), steps + 1
    return {"steps": steps, "worst_px": worst}


def _centre(bare: Any) -> np.ndarray:
    return pusht.about_centre(np.array([*bare.block.position, bare.block.angle]))


def times(episodes: int) -> dict[str, float]:
    """A table of pushes, and a plan from random places."""
    planner = pusht.pusht_planner(pusht.STATE.speed)
    rng = np.random.default_rng(1)
    places = [
        (np.array([*rng.uniform(150, 360, 2), rng.uniform(-3, 3)]), rng.uniform(40, 470, 2))
        for _ in range(episodes)
    ]
    still = np.zeros(2)
    planner.plan(*places[0], still, 1.5)
    began = time.process_time()
    table = again(planner.model, planner.table)
    built = time.process_time()
    for place in places:
        planner.plan(*place, still, 1.5)
    ended = time.process_time()
    plan_ms = 1e3 * (ended - built) / len(places)
    return {"pushes": len(table.steps), "table_ms": 1e3 * (built - began), "plan_ms": plan_ms}


def played(
    name: str, count: int, world: Callable[[int], PushT], kind: str, stop: Stop = "world"
) -> dict[str, float]:
    """Episodes of one section."""
    policy, found = PushPolicy.for_pusht(observation=kind), []
    run_episode(world(0), policy, 1)  # compiles
    for seed in track(
        range(SEEDS[name], SEEDS[name] + count), name, console=PROGRESS, disable=not PROGRESS.is_terminal
    ):
        found.append(run_episode(world(seed), policy, seed, stop))
    return {**summary(found), "success": share(found)}


def share(episodes: Sequence[Episode]) -> float:
    """Of successes."""
    return float(np.mean([episode.success for episode in episodes]))


def other_block(seed: int) -> PushT:
    """gym-pusht with a block of another kind."""
    rng = np.random.default_rng(seed)
    angle, offset = rng.uniform(0, 2 * np.pi), rng.uniform(0, 30)
    centre = pusht.CENTRE_OF_GRAVITY + offset * np.array([np.cos(angle), np.sin(angle)])
    kept, moment = rng.choice([0.0, 0.5, 0.9, 0.97]), pusht.GYRATION * 2 ** rng.uniform(-1, 1)
    world = PushT("pixels", damping=float(kept) ** 100, block_cog=(float(centre[0]), float(centre[1])))
    bare: Any = world.environment.unwrapped
    set_up = bare._setup

    def with_moment() -> None:
        set_up()
        bare.block.moment = moment

    bare._setup = with_moment
    return world


def sections(episodes: int) -> dict[str, Callable[[], dict[str, float]]]:
    """What can be measured, by name."""
    plain, pixels = PushT("state"), PushT("pixels")
    worse = PushT("pixels", Spoiler(light=0.8, noise=25, jpeg=60))
    return {
        "model": lambda: model(episodes),
        "times": lambda: times(episodes),
        "state": lambda: played("state", episodes, lambda _: plain, "state"),
        "pixels": lambda: played("pixels", episodes, lambda _: pixels, "pixels"),
        "worse camera": lambda: played("worse camera", episodes, lambda _: worse, "pixels"),
        "other blocks": lambda: played("other blocks", episodes, other_block, "pixels"),
        "own stop": lambda: played("own stop", episodes, lambda _: pixels, "pixels", "own"),
    }


def missed(found: dict[str, dict[str, float]]) -> list[str]:
    """Bars that do not hold."""
    return [
        f"{name}: {key} = {found[name][key]:.4g}, bar {relation} {limit:g}"
        for name in found
        for key, relation, limit in BARS[name]
        if not (found[name][key] <= limit if relation == "<=" else found[name][key] >= limit)
    ]


def main() -> int:
    """Measure, print, and say which bars are missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="8 episodes each, within a minute")
    parser.add_argument("--episodes", type=int, default=200)
    parser.add_argument("--only", nargs="+", choices=list(BARS))
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    found: dict[str, dict[str, float]] = {}
    for name, measure in sections(8 if options.quick else options.episodes).items():
        if not options.only or name in options.only:
            found[name] = measure()
            table = Table(name, *found[name])
            table.add_row("", *(f"{value:.4g}" for value in found[name].values()))
            Console(width=150).print(table)
    complaints = missed(found)
    print("\n".join(complaints) or "all bars hold")
    if options.json:
        options.json.write_text(json.dumps({"sections": found, "missed": complaints}, indent=1) + "\n")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
