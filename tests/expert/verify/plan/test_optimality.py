"""Whatever a certificate says, nothing false is proved with it; what it must say is all asked for."""

import base64
import copy
import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from expert.contact import solve
from expert.geometry.convex import free_regions
from expert.problems.contact import ContactTask, Plan
from expert.verify.plan import optimality
from expert.verify.plan.optimality import covers_the_outside, objection
from expert.world.shape import Body
from tests.support.polygons import HARD, hard_polygon
from tests.support.random_tasks import floor_task, table_task

POSES = ("poses", "before", "after")
LEAST_WRONG = 1e-6
"""Relative excess of a bound that is certainly wrong."""


def solved(seed: int) -> tuple[ContactTask, Plan, dict[str, Any]]:
    rng = np.random.default_rng(seed)
    task = floor_task(rng) if seed % 2 else table_task(rng)
    plan = solve(task)
    assert plan.found
    return task, plan, json.loads(json.dumps(plan.certificate))


def places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Every container and key of nested lists and mappings."""
    for key in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
        yield value, key
        yield from places(value[key])


def other(value: Any, rng: np.random.Generator) -> Any:
    """Something else of the same kind, or nothing of the kind."""
    if isinstance(value, str) and len(value) % 4 == 0:
        numbers = np.frombuffer(base64.b64decode(value), dtype="<f8").copy()
        if numbers.size and rng.random() < 0.8:
            i = rng.integers(numbers.size)
            numbers[i] = rng.choice([0.0, np.nan, np.inf, -1e300, 1e59, -1.0, rng.normal(numbers[i])])
        return base64.b64encode(numbers.tobytes()[: None if rng.random() < 0.9 else -8]).decode()
    if isinstance(value, int | float):
        return [value + 1, value - 1, -5, 10**9, "x", None][rng.integers(6)]
    if isinstance(value, list):
        return [value[1:], value[:-1], value[::-1], value + value, [], 3][rng.integers(6)]
    if not isinstance(value, dict):
        return 0
    return [{}, None, [], {**value, "parts": []}, {**value, "step": 0, "finger": 0}][rng.integers(5)]


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
def test_no_certificate_proves_what_is_false(seed: int) -> None:
    task, plan, certificate = solved(seed)
    assert not objection(task, certificate, plan.bound)
    false = (plan.objective * (1 + LEAST_WRONG) + 1e-12, 2 * plan.objective, np.inf)
    rng = np.random.default_rng(seed)
    for _ in range(60):
        tampered = copy.deepcopy(certificate)
        for _ in range(rng.integers(1, 4)):
            found = list(places(tampered))
            if found:
                container, key = found[rng.integers(len(found))]
                container[key] = other(container[key], rng)
        for bound in false:
            assert objection(task, tampered, bound)


@pytest.mark.parametrize("nonsense", [None, 3, [], {}, {"steps": "", "paths": [], "sequences": []}, "proof"])
def test_what_is_no_certificate_is_malformed(nonsense: Any) -> None:
    task, plan, _ = solved(3)
    assert "malformed" in objection(task, nonsense, plan.bound)


def test_parts_that_are_missing_are_asked_for() -> None:
    """Each sequence and each part of a split is needed for this bound, or else it was not written down."""
    task, plan, certificate = solved(3)
    needed = 0
    for i in range(len(certificate["sequences"])):
        rest = certificate["sequences"][:i] + certificate["sequences"][i + 1 :]
        needed += bool(objection(task, {**certificate, "sequences": rest}, plan.bound))
    assert needed > 0
    for container, key in list(places(certificate["sequences"])):
        if key == "parts":
            whole = container[key]
            container[key] = whole[:-1]
            assert "missing" in objection(task, certificate, plan.bound)
            container[key] = whole


@pytest.mark.parametrize("seed", [*range(6), 87])
def test_free_regions_cover_the_outside_and_none_may_be_missing(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    task = floor_task(np.random.default_rng([seed, 5]), facets=3 + seed % 4)
    assert covers_the_outside(task)
    monkeypatch.setattr(optimality, "free_regions", lambda *known: free_regions(*known)[1:])
    assert not covers_the_outside(task)


@pytest.mark.parametrize("family", HARD)
def test_free_regions_cover_the_outside_of_odd_shapes(family: str) -> None:
    body, _ = Body.uniform(0.1 * hard_polygon(np.random.default_rng(1), family), 0.01)
    task = floor_task(np.random.default_rng(1), facets=4)
    raised = replace(task.trajectory, **{k: getattr(task.trajectory, k) + [0, 1, 0] for k in POSES})
    assert covers_the_outside(replace(task, body=body, trajectory=raised))
