"""Command line: `python -m dlm.control world=pusht observation=pixels episodes=500`; configs/control.yaml lists all options.

Prints a table, writes results.json and videos.  Exit codes: 0 done; 2 bad input; 130 interrupted: the same command goes on.
"""

from pathlib import Path

from omegaconf import DictConfig
from rich.console import Console
from rich.progress import track
from rich.table import Table

from datasets.entry import entry_point
from dlm.control.episodes import Trial, run_episodes
from dlm.control.results import Results, summary
from expert.world.values import require


@entry_point("control")
def main(cfg: DictConfig) -> None:
    """Run the episodes that are missing, and say how all went."""
    require(cfg.world == "pusht", "world", "pusht", cfg.world)
    for name, least in (("episodes", 1), ("jobs", 1), ("seed", 0), ("videos", 0)):
        ok = isinstance(cfg[name], int) and cfg[name] >= least
        require(ok, name, f"a whole number >= {least}", cfg[name])
    trial = Trial(observation=cfg.observation, light=cfg.light, noise=cfg.noise, jpeg=cfg.jpeg, stop=cfg.stop)
    folder = Path(cfg.out or Path("outputs") / "control" / f"{cfg.world}_{cfg.observation}")
    require(not folder.exists() or folder.is_dir(), "out", "a folder", f"{folder}, a file")
    results = Results(folder, trial)
    folder.mkdir(parents=True, exist_ok=True)
    wanted = range(cfg.seed, cfg.seed + cfg.episodes)
    missing = [seed for seed in wanted if seed not in results.episodes]
    films = {seed: folder / f"episode_{seed}.mp4" for seed in wanted[: cfg.videos]}
    console = Console(stderr=True)
    ended = run_episodes(trial, missing, cfg.jobs, films)
    for episode in track(ended, "episodes", total=len(missing), console=console):
        results.add(episode)
    tell(results, wanted, folder)


def tell(results: Results, wanted: range, folder: Path) -> None:
    """The table of the wanted episodes."""
    episodes = [results.episodes[seed] for seed in wanted]
    found = summary(episodes)
    table = Table(
        "episodes", "success", "steps: median", "90 %", "mean", "ms per step", "first step", "most later"
    )
    table.add_row(
        f"{found['episodes']}",
        f"{found['successes']} ({found['successes'] / found['episodes']:.1%})",
        f"{found['steps_median']:g}",
        f"{found['steps_p90']:g}",
        f"{found['steps_mean']:.1f}",
        f"{found['mean_ms']:.1f}",
        f"{found['first_ms']:.0f}, at most {found['first_most_ms']:.0f}",
        f"{found['later_most_ms']:.0f}",
    )
    Console(width=120).print(table)
    failed = [episode.seed for episode in episodes if not episode.success]
    print(f"failed seeds: {failed}" if failed else "no failures")
    print(f"results: {folder / 'results.json'}")


if __name__ == "__main__":
    main()
