"""The certificate of a search: multipliers from which a checker proves the bound again without a solver (docs/theory/contact-certificate.md)."""

import base64
from typing import Any

import numpy as np

from expert.budget import Budget
from expert.contact.search import Planted, Search
from expert.contact.smoothing import least_smoothing
from expert.contact.tree import AtRho, Node
from expert.geometry.pose import Array
from expert.world.values import IntArray


def certificate_of(search: Search, bound: float, budget: Budget) -> dict[str, Any] | None:
    """Why no plan costs less than `bound` [`cost_unit`] (inf: why there is none), as plain JSON values.

    steps: multipliers of every step and multiset of active facets.  paths: the least smoothing cost of one finger's modes.
    sequences: boxes of complete mode sequences.  None where the budget is spent before all is written down.
    """
    paths, sequences = [], []
    for modes, cost in search.smoothing.items():
        if cost > 0 and not budget.over:
            paths.append({"modes": [int(f) for f in modes], **_path(search, modes)})
    for planted in search.planted:
        if not budget.over:
            sequences.append(_sequence(search, planted, bound))
    return None if budget.over else {"steps": packed(search.phi.y), "paths": paths, "sequences": sequences}


def packed(values: Array) -> str:
    """Numbers, little-endian float64, in base64."""
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f8").tobytes()).decode("ascii")


def _path(search: Search, modes: tuple[int, ...]) -> dict[str, Any]:
    column = np.array(modes)[:, None]
    return _outside(search, column, np.full_like(column, -1), search.smoothing[modes])


def _outside(search: Search, column: IntArray, assigned: IntArray, bound: float) -> dict[str, Any]:
    """Accelerations that prove the bound, or one part for each region that the finger may be in at a step."""
    cost, step, slopes = least_smoothing(search.scaled, column, assigned)
    if step < 0 or cost >= bound:
        return {"accelerations": packed(slopes)}
    parts = []
    for region in range(search.scaled.regions):
        assigned[step, 0] = region
        parts.append(_outside(search, column, assigned, bound))
    assigned[step, 0] = -1
    return {"step": step, "parts": parts}


def _sequence(search: Search, planted: Planted, bound: float) -> dict[str, Any]:
    """What was cut off from a sequence's box, piece by piece, and the node of what is left, if anything is."""
    pieces, used = planted.removed, int(planted.removed.filled[0])
    removed = {
        **{name: getattr(pieces, name)[:used].tolist() for name in ("step", "interval", "part")},
        "at": packed(pieces.at[:used]),
        "multipliers": packed(pieces.y[:used]),
    }
    rest = {} if planted.rest is None else _node(search, planted.rest, bound)
    return {"modes": planted.sequence.modes.tolist(), "removed": removed, **rest}


def _node(search: Search, node: Node, bound: float) -> dict[str, Any]:
    """The proof of a box, or the parts it was split into."""
    if node.split is not None and not (node.proof is not None and node.proof.bound >= bound):
        parts = [_node(search, part, bound) for part in node.parts]
        if isinstance(node.split, AtRho):
            return {"interval": node.split.interval, "at": node.split.at, "parts": parts}
        return {"step": node.split.step, "finger": node.split.finger, "parts": parts}
    proof = node.proof or search.proof_apart(node.box)
    return {"multipliers": packed(proof.y), "accelerations": packed(proof.accelerations)}
