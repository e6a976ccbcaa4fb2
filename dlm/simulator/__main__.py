"""Command line: python -m dlm.simulator solution.json [-o motion.gif] [--mujoco] [--mjcf plan.xml] [--json FILE]

Executes the plan of a contact-trajectory solution file and says where the object ends.  Exit codes: 0 within 2 mm and
2 deg of the goal; 1 not, or a missing package; 2 bad input.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dlm.metrics import rotation_error, translation_error
from dlm.simulator.draw import draw
from dlm.simulator.mujoco import export_plan, replay_in_mujoco
from dlm.simulator.replay import replay
from dlm.simulator.settings import SimulatorSettings
from expert.errors import ExpertError, InvalidProblem
from expert.files import read_solution
from expert.problems.contact import ContactTask, Plan
from expert.world.values import require

MM, DEG = 2.0, 2.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; whatever is wrong with the input becomes one line on stderr."""
    options = _parser().parse_args(arguments)
    try:
        return _run(options)
    except InvalidProblem as error:
        print(f"error: {options.file}: {error}", file=sys.stderr)
        return 2
    except ExpertError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m dlm.simulator", description="Execute a plan in simulation."
    )
    parser.add_argument("file", type=Path, help="solution file of a contact-trajectory problem, JSON")
    parser.add_argument(
        "-o", "--output", type=Path, help="film strip (.png, .svg, .pdf) or animation (.gif, .mp4)"
    )
    parser.add_argument("--mujoco", action="store_true", help="execute it in MuJoCo too")
    parser.add_argument("--mjcf", type=Path, help="write scene and plan as a MuJoCo model file")
    parser.add_argument("--json", type=Path, help="write poses and errors")
    parser.add_argument("--substeps", type=int, default=SimulatorSettings.substeps, help="per knot interval")
    parser.add_argument("--frictionless", action="store_true", help="fingers and walls without friction")
    return parser


def _run(options: argparse.Namespace) -> int:
    solution = read_solution(options.file)
    task, plan = solution.problem.task, solution.answer
    require(isinstance(task, ContactTask), "solution", "contact-trajectory", solution.problem.kind)
    require(
        isinstance(plan, Plan) and plan.found, "status", "a plan to execute", getattr(plan, "status", None)
    )
    settings = SimulatorSettings(substeps=options.substeps, frictionless=options.frictionless)
    record = replay(task, plan.positions, plan.forces, settings)
    result: dict[str, Any] = {
        "simulator": _summary(record.poses, task),
        "loss_cm2": record.loss,
        "steps_with_several_solutions": record.several,
    }
    if options.mujoco:
        other = replay_in_mujoco(task, plan.positions, plan.forces, settings)
        result["mujoco"] = _summary(other.poses, task)
    for name in ("simulator", "mujoco"):
        if name in result:
            mm, deg = result[name]["final_mm"], result[name]["final_deg"]
            print(f"{name}: ends {mm:.3f} mm and {deg:.3f} deg from the goal")
    if options.mjcf:
        export_plan(options.mjcf, task, plan.positions, plan.forces, settings)
    if options.json:
        options.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    if options.output:
        draw(task, record, options.output)
    return 0 if record.final_error[0] <= MM and record.final_error[1] <= DEG else 1


def _summary(poses: np.ndarray, task: ContactTask) -> dict:
    goal = task.trajectory.poses[-1]
    return {
        "poses": poses.tolist(),
        "final_mm": float(translation_error(poses[-1], goal)),
        "final_deg": float(rotation_error(poses[-1], goal)),
    }


if __name__ == "__main__":
    sys.exit(main())
