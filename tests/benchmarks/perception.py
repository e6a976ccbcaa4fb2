"""Perception: how exactly are polygon and poses seen, clean and disturbed, and how long does a video take?

    python -m tests.benchmarks.perception [--quick] [--tasks 200] [--validation] [--only NAME] [--json FILE]

Thresholds were tuned with --validation; figures come from the other seeds.  Errors of a video: the largest over its frames
of angle and of position of the centre of mass, and the Hausdorff distance between true and seen outline.  `contacts` is
the share of videos whose contacts with the floor (which side, sticking or sliding, at which step) are all as in truth.
`unnoticed`: off by more than 2 mm or 2 deg, yet called ok.  Times are processor time of one core.
"""

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely
from rich.console import Console
from rich.progress import track
from rich.table import Table

from datasets.disturb import DISTURBANCES, random_palette
from datasets.motions import FAMILIES, NoRoom, sample_task
from datasets.render import Camera, Frames, Palette, ground_coverage, render
from datasets.shapes import ShapeFamily, Shapes
from datasets.shapes_omnipush import OmniPush
from datasets.specification import generator
from dlm.perception import Perceived, PerceptionSettings, perceive
from dlm.perception.raster import coverage
from expert.errors import InvalidProblem
from expert.geometry.pose import Array, to_world
from expert.mechanics import external_contacts
from expert.problems.contact import ContactTask
from expert.world.motion import Trajectory
from expert.world.shape import Body
from tests.support.mujoco_video import mujoco_videos

KINDS: dict[str, ShapeFamily] = {"4-6": Shapes(), "12": Shapes(facets=(12, 12)), "omnipush": OmniPush()}
"""Shapes by name."""
MUJOCO = {"MuJoCo": False, "MuJoCo, lens": True}
"""Videos of another engine: orthographic, or through a lens."""
EXACT = "exact coverage"
BOTH_SCALES = ("clean", "noise 3", "noise 5")
BARS = {("4-6", "clean", "angle"): 0.1, ("4-6", "clean", "position"): 0.1, ("4-6", "noise 15", "angle"): 1.0}
"""Medians that must hold: angle [deg], position [mm]."""
MOST_SECONDS = 0.08

Row = dict[str, float]


def tasks_of(kind: str, count: int, name: str) -> list[ContactTask]:
    """Random tasks of all families in turn."""
    found = []
    for index in range(count):
        family = list(FAMILIES)[index % len(FAMILIES)]
        for attempt in range(100):
            try:
                found.append(sample_task(generator(name + kind, 0, index, attempt), family, KINDS[kind]))
                break
            except NoRoom:
                continue
    return found


def contacts_of(task: ContactTask) -> list[tuple]:
    """Step, and the directions that each floor contact can push in."""
    return [(c.step, *np.sign(np.round(c.rays[:, 0], 9))) for c in external_contacts(task)]


def errors(seen: Perceived, task: ContactTask) -> Row:
    """What the table shows of one video."""
    off = np.abs(seen.poses - task.trajectory.poses).max(axis=0)
    true, found = (shapely.Polygon(v) for v in (task.body.vertices, seen.vertices))
    body, _ = Body.uniform(seen.vertices, task.body.mass)
    motion = Trajectory.of(seen.poses, task.trajectory.dt, "rest")
    same = contacts_of(replace(task, body=body, trajectory=motion)) == contacts_of(task)
    return {
        "angle": float(np.degrees(off[2])),
        "position": 1e3 * float(off[:2].max()),
        "outline": 1e3 * float(true.exterior.hausdorff_distance(found.exterior)),
        "corners": float(len(seen.vertices) == len(task.body.vertices)),
        "contacts": float(same),
        "ok": float(seen.status == "ok"),
    }


def exactly(vertices: Array, poses: Array, camera: Camera) -> Frames:
    """Rendered with exact coverage, then rounded: what is left is what perception itself gets wrong."""
    palette = Palette()
    background, thing, ground = (
        np.array(c, dtype=float) for c in (palette.background, palette.object, palette.ground)
    )
    scene = background + ground_coverage(camera)[..., None] * (ground - background)
    corners = camera.to_pixels(to_world(poses, vertices)) * [1, -1] + [0, camera.size]
    share, _ = coverage(corners, np.zeros((len(poses), 2)), camera.size, camera.size)
    return np.rint(scene + share[:, ::-1, :, None] * (thing - scene)).astype(np.uint8)


def videos_of(tasks: list[ContactTask], disturbance: str, camera: Camera) -> list[Frames] | None:
    """One video per task; None where the engine is missing."""
    scenes = [(task.body.vertices, task.trajectory.poses) for task in tasks]
    if disturbance in MUJOCO:
        return mujoco_videos(scenes, camera, perspective=MUJOCO[disturbance])
    if disturbance == EXACT:
        return [exactly(*scene, camera) for scene in scenes]
    videos = []
    for index, scene in enumerate(scenes):
        rng = np.random.default_rng([index, 17])
        palette = random_palette(rng) if disturbance == "colours" else Palette()
        change = DISTURBANCES.get(disturbance, DISTURBANCES["clean"])
        videos.append(change(render(*scene, camera, palette), rng))
    return videos


def measure(
    kind: str, disturbance: str, scale: float, tasks: list[ContactTask], console: Console
) -> dict | None:
    """Statistics over tasks of one kind under one disturbance."""
    camera = Camera(scale=scale)
    settings = PerceptionSettings(blur=1.0 if disturbance.startswith("blur") else 0.0)
    videos = videos_of(tasks, disturbance, camera)
    if videos is None:
        return None
    rows: list[Row] = []
    refused: list[str] = []
    seconds = []
    name = f"{kind} {disturbance} {1e3 * scale:.0f} mm"
    quiet = not console.is_terminal
    pairs = list(zip(tasks, videos, strict=True))
    for task, video in track(pairs, name, console=console, disable=quiet, transient=True):
        start = time.process_time()
        try:
            seen = perceive(video, camera, settings)
        except InvalidProblem as error:
            refused.append(str(error))
            continue
        seconds.append(time.process_time() - start)
        rows.append(errors(seen, task))
    columns = {key: np.array([row[key] for row in rows]) for key in rows[0]} if rows else {}
    figures = {
        key: {"median": float(np.median(v)), "p95": float(np.quantile(v, 0.95)), "max": float(v.max())}
        for key, v in columns.items()
        if key in ("angle", "position", "outline")
    }
    shares = {key: float(columns[key].mean()) for key in ("corners", "contacts", "ok") if columns}
    if columns:
        close = (columns["angle"] <= 2) & (columns["position"] <= 2)
        # What was refused was not seen; what is off and called ok would go unnoticed.
        shares["within"] = float(close.sum()) / len(tasks)
        shares["unnoticed"] = float((~close & (columns["ok"] == 1)).sum()) / len(tasks)
    return {
        "kind": kind,
        "disturbance": disturbance,
        "scale": scale,
        "tasks": len(tasks),
        **figures,
        **shares,
        "refused": refused,
        "milliseconds": 1e3 * float(np.median(seconds)) if seconds else np.nan,
        "slowest": 1e3 * float(np.max(seconds)) if seconds else np.nan,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="24 tasks per row")
    parser.add_argument("--tasks", type=int, default=200)
    parser.add_argument("--validation", action="store_true", help="the seeds that thresholds were tuned on")
    parser.add_argument("--only", help="rows whose name contains this")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    console = Console(stderr=True)
    count = 24 if options.quick else options.tasks
    seeds = "perception_validation" if options.validation else "perception"
    rows = []
    for kind in KINDS:
        tasks = tasks_of(kind, count, seeds)
        perceive(render(tasks[0].body.vertices, tasks[0].trajectory.poses))  # compiles
        for disturbance in [EXACT, *DISTURBANCES, "colours", *MUJOCO]:
            for scale in (0.004, 0.005) if disturbance in BOTH_SCALES else (0.004,):
                if (options.only or "") in f"{kind} {disturbance} {scale}":
                    row = measure(kind, disturbance, scale, tasks, console)
                    rows += [row] if row else []
    _print(rows)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return 0 if all(_holds(row) for row in rows) else 1


def _holds(row: dict) -> bool:
    key = row["kind"], row["disturbance"]
    bars = {k[2]: bar for k, bar in BARS.items() if k[:2] == key and row["scale"] == 0.004}
    # Objects of twenty facets start from a finer outline; of blurred videos every derivative is blurred: both take their time.
    slow = row["kind"] == "omnipush" or row["disturbance"].startswith("blur")
    fast = slow or row["milliseconds"] <= 1e3 * MOST_SECONDS
    return fast and all(row[name]["median"] <= bar for name, bar in bars.items())


def _print(rows: list[dict]) -> None:
    table = Table(title="angle (deg), position and outline (mm): median / 95 % / largest")
    for column in ("shapes", "disturbance", "mm/px", "angle", "position", "outline", "corners", "contacts"):
        table.add_column(column)
    for column in ("2 mm, 2 deg", "ok", "unnoticed", "refused", "ms", "slowest"):
        table.add_column(column)
    for row in rows:
        three = [
            " / ".join(f"{row[key][q]:.3g}" for q in ("median", "p95", "max")) if key in row else "-"
            for key in ("angle", "position", "outline")
        ]
        shares = [
            f"{row[key]:.3f}" if key in row else "-"
            for key in ("corners", "contacts", "within", "ok", "unnoticed")
        ]
        rest = [str(len(row["refused"])), f"{row['milliseconds']:.0f}", f"{row['slowest']:.0f}"]
        table.add_row(row["kind"], row["disturbance"], f"{1e3 * row['scale']:.0f}", *three, *shares, *rest)
    Console(width=170).print(table)


if __name__ == "__main__":
    sys.exit(main())
