"""Functions that borrow arrays and count no references: none returns an array, and nothing is lost or freed twice."""

import importlib
import inspect
import pkgutil
from typing import Any, get_args

import numpy as np
import pytest
import torch
from numba.core.dispatcher import Dispatcher
from numba.core.runtime import _nrt_python, rtsys

import dlm.simulator
from dlm.simulator import SimulatorSettings, replay
from dlm.simulator.gradient import rollout
from tests.support.scenes import batch_of, lift, push, random_case, transverse_push


def use_everything() -> None:
    """Rollouts, both gradients and a record, of rigid and smoothed contacts, in both planes, with steps cut into parts."""
    rng = np.random.default_rng(5)
    for cases in ([push(), lift(), random_case(rng), random_case(rng)], [transverse_push()]):
        batch, positions, forces = batch_of(cases)
        for gradient in ("implicit", "finite_difference"):
            poses = rollout(batch, positions, forces, SimulatorSettings(gradient=gradient, kappa=1250.0))
            torch.autograd.grad(poses.sum(), (positions, forces))
        rollout(batch, positions, forces)
        for case in cases:
            replay(case.scene, case.positions, case.forces)


def borrowers() -> dict[str, Dispatcher]:
    """Compiled functions of the simulator that count no references, by name."""
    found = {}
    for module in pkgutil.iter_modules(dlm.simulator.__path__):
        if module.name != "__main__":
            name = f"dlm.simulator.{module.name}"
            own = [
                (key, f)
                for key, f in vars(importlib.import_module(name)).items()
                if isinstance(f, Dispatcher) and f.py_func.__module__ == name
            ]
            found |= {f"{module.name}.{key}": f for key, f in own if not f.targetoptions["_nrt"]}
    return found


def numbers_only(kind: Any) -> bool:
    """Whether a return annotation is that of numbers, or tuples of them."""
    parts = get_args(kind) or tuple(getattr(kind, "__annotations__", {}).values())
    return kind in (None, bool, int, float) or (len(parts) > 0 and all(map(numbers_only, parts)))


def test_borrowers_return_numbers():
    returned = {name: inspect.signature(f.py_func).return_annotation for name, f in borrowers().items()}
    assert len(returned) > 50
    assert {name: kind for name, kind in returned.items() if not numbers_only(kind)} == {}


@pytest.fixture
def counted():
    """Allocations of compiled code are counted."""
    _nrt_python.memsys_enable_stats()
    yield
    _nrt_python.memsys_disable_stats()


def test_every_array_is_given_back_once(counted):
    use_everything()
    before = rtsys.get_allocation_stats()
    use_everything()
    after = rtsys.get_allocation_stats()
    made, freed = after.mi_alloc - before.mi_alloc, after.mi_free - before.mi_free
    assert made > 100
    assert made == freed
    assert after.alloc - before.alloc == after.free - before.free
