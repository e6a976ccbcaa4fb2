"""Simulating needs no torch; only its derivatives as a torch function do."""

import pkgutil
import subprocess
import sys

import dlm.simulator

NEEDS_TORCH = {"gradient"}

SCRIPT = """
import importlib, sys
sys.modules["torch"] = None  # any import of it raises
for name in sys.argv[1:]:
    importlib.import_module(f"dlm.simulator.{name}")
from dlm.metrics import object_trajectory_loss
from dlm.simulator import SimulatorSettings
import numpy as np
assert object_trajectory_loss(np.full((5, 3), 0.01), np.zeros((5, 3))) > 0
"""


def modules() -> set[str]:
    return {m.name for m in pkgutil.iter_modules(dlm.simulator.__path__)}


def in_a_process_without_torch(names: set[str]) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", SCRIPT, *sorted(names)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_every_module_but_the_gradient_is_imported_without_torch():
    assert modules() > NEEDS_TORCH
    done = in_a_process_without_torch(modules() - NEEDS_TORCH)
    assert done.returncode == 0, done.stderr


def test_the_gradient_says_that_torch_is_missing():
    done = in_a_process_without_torch(NEEDS_TORCH)
    assert done.returncode != 0
    assert "torch" in done.stderr
