"""Contact certificates read as docs/theory/contact-certificate.md describes them, in plain numpy: the bound that they prove."""

import base64
import itertools
from typing import Any

import numpy as np
import shapely

from expert.contact.scaled import ScaledTask
from expert.geometry.pose import Array

FAR = 10.0


class Reading:
    """proves(target): whether every mode sequence is shown to cost at least `target` [(m g)^2], or to have no plan (inf)."""

    def __init__(self, s: ScaledTask, fingers: int, certificate: dict[str, Any]) -> None:
        self.s, self.fingers = s, fingers
        sets = list(itertools.combinations_with_replacement(range(s.facets + 1), fingers))
        y = numbers(certificate["steps"], (s.steps, len(sets), 3))
        self.phi = [{m: self.step_bound(t, m, y[t, k]) for k, m in enumerate(sets)} for t in range(s.steps)]
        self.paths = {tuple(p["modes"]): self.path(tuple(p["modes"]), p, {}) for p in certificate["paths"]}
        self.sequences = {tuple(map(tuple, q["modes"])): q for q in certificate["sequences"]}
        self.to_go: dict = {}
        self.met = 0

    # One step

    def step_bound(self, t: int, facets: tuple[int, ...], y: Array) -> float:
        """facets: 1 + facet, or 0 for a finger that does not push."""
        ends = [(f - 1, self.s.low[t, f - 1], self.s.high[t, f - 1]) for f in facets if f]
        if any(low > high for _, low, high in ends):
            return np.inf
        start = self.s.required[t] @ y - self.environment(t, y)
        miss = start - sum(max(self.support(t, f, r, y, True) for r in (a, b)) for f, a, b in ends)
        if miss > 0:
            return np.inf
        return start - sum(max(self.support(t, f, r, y, False) for r in (a, b)) for f, a, b in ends)

    def environment(self, t: int, y: Array) -> float:
        return sum(
            self.s.limit[t, g] * max(0.0, (self.s.rays[t, self.s.group[t] == g] @ y).max(initial=0.0))
            for g in range(self.s.limit.shape[1])
        )

    def support(self, t: int, f: int, rho: float, y: Array, proof: bool) -> float:
        """Largest y.wrench over the friction cone at rho, less the cost of the force unless for a `proof`."""
        s = self.s
        arm = s.arm[t, f] + rho * s.edge[t, f]
        z = y[:2] + y[2] * np.array([-arm[1], arm[0]])
        along, across = z @ s.normal[t, f], abs(z @ s.tangent[t, f])
        if proof:
            slope = along + s.friction * across
            return slope * (s.max_force if slope > 0 else s.min_force)
        along, across = along + s.margin_weight * s.true_friction, max(across - s.margin_weight, 0.0)
        best = -np.inf
        inner = along / (2 * s.force_weight)
        edge = (along + s.friction * across) / (2 * s.force_weight * (1 + s.friction**2))
        for n in np.clip([inner, edge], s.min_force, s.max_force):
            tau = np.clip(across / (2 * s.force_weight), 0, s.friction * n)
            best = max(best, along * n + across * tau - s.force_weight * (n * n + tau * tau))
        return float(best)

    # One finger's path

    def path(self, modes: tuple[int, ...], node: dict[str, Any], regions: dict[int, int]) -> float:
        if "parts" in node:
            t = node["step"]
            return min(self.path(modes, p, {**regions, t: r}) for r, p in enumerate(node["parts"]))
        a = numbers(node["accelerations"], (max(len(modes) - 2, 0), 2))
        total = -self.s.acceleration_weight * float((a**2).sum())
        pull = self.pull(a, len(modes))
        ranges = self.intervals(modes)
        for steps, f, low, high in ranges:
            if low > high:
                return np.inf
            total += min(sum(pull[t] @ self.place(t, f, r) for t in steps) for r in (low, high))
        if not ranges:  # it waits where nothing is in its way
            return 0.0
        return total + sum(self.free(t, pull[t], regions.get(t)) for t, f in enumerate(modes) if f < 0)

    def pull(self, a: Array, steps: int) -> Array:
        """Coefficient (steps, 2) of each position in sum 2 w a.(p - 2 p + p)."""
        pull = np.zeros((steps, 2))
        for t in range(len(a)):
            for k, c in enumerate((1, -2, 1)):
                pull[t + k] += 2 * self.s.acceleration_weight * c * a[t]
        return pull

    def place(self, t: int, f: int, rho: float) -> Array:
        return self.s.centre[t] + self.s.arm[t, f] + rho * self.s.edge[t, f]

    def intervals(self, modes: tuple[int, ...]) -> list[tuple[range, int, float, float]]:
        found, start = [], 0
        for f, run in itertools.groupby(modes):
            steps = range(start, start := start + len(list(run)))
            if f >= 0:
                found.append((steps, f, self.s.low[steps, f].max(), self.s.high[steps, f].min()))
        return found

    def free(self, t: int, pull: Array, region: int | None) -> float:
        """Least pull.p over where a free finger may be at t; inf: nowhere."""
        low, high = self.s.workspace[0] - FAR, self.s.workspace[1] + FAR
        rows = [(-x, -y, -d) for x, y, d in self.s.walls]
        if region is not None:
            rows += [tuple(row) for row in self.s.region[t, region] if row[:2].any()]
        place = shapely.box(*low, *high)
        for x, y, b in rows:
            place = clipped(place, np.array([x, y]), b)
        corners = shapely.get_coordinates(place)
        return float((corners @ pull).min()) if len(corners) else np.inf

    # Complete sequences

    def box(
        self, modes: Array, node: dict[str, Any], lo: list[float], hi: list[float], regions: dict
    ) -> float:
        if "interval" in node:
            k, at = node["interval"], node["at"]
            assert lo[k] <= at <= hi[k]
            below, above = [*hi], [*lo]
            below[k] = above[k] = at
            return min(
                self.box(modes, node["parts"][0], lo, below, regions),
                self.box(modes, node["parts"][1], above, hi, regions),
            )
        if "step" in node:
            key = node["step"], node["finger"]
            assert modes[key] < 0
            assert len(node["parts"]) == self.s.regions
            return min(self.box(modes, p, lo, hi, {**regions, key: r}) for r, p in enumerate(node["parts"]))
        T, C = modes.shape
        y = numbers(node["multipliers"], (T, 3))
        a = numbers(node["accelerations"], (max(T - 2, 0), C, 2))
        if self.leaf(modes, y, 0 * a, lo, hi, regions, True) > 0:
            return np.inf
        return self.leaf(modes, y, a, lo, hi, regions, False)

    def leaf(
        self, modes: Array, y: Array, a: Array, lo: list[float], hi: list[float], regions: dict, proof: bool
    ) -> float:
        T, C = modes.shape
        total = sum(self.s.required[t] @ y[t] - self.environment(t, y[t]) for t in range(T))
        total -= self.s.acceleration_weight * float((a**2).sum())
        k = 0
        for c in range(C):
            pull, column = self.pull(a[:, c], T), tuple(modes[:, c].tolist())
            for steps, f, _, _ in self.intervals(column):
                pushing = [t for t in steps if t == T - 1 or t + 1 in steps]
                total += min(
                    sum(pull[t] @ self.place(t, f, r) for t in steps)
                    - sum(self.support(t, f, r, y[t], proof) for t in pushing)
                    for r in (lo[k], hi[k])
                )
                k += 1
            if max(column) >= 0:
                total += sum(self.free(t, pull[t], regions.get((t, c))) for t in range(T) if column[t] < 0)
        return total

    # All sequences

    def proves(self, target: float) -> bool:
        self.target = target - 1e-9 * abs(target) if np.isfinite(target) else target
        C = self.fingers
        return all(self.from_here([()] * C, modes, 0.0) for modes in self.steps_from([None] * C))

    def steps_from(self, states: list) -> list[tuple[int, ...]]:
        after = []
        for modes in states:
            f = modes[-1] if modes else -1
            alone = self.s.min_interval > 1 and modes and f >= 0 and (len(modes) < 2 or modes[-2] != f)
            after.append(range(-1, self.s.facets) if f < 0 else [f] if alone else [f, -1])
        return list(itertools.product(*after))

    def from_here(self, before: list, now: tuple[int, ...], forces: float) -> bool:
        """Whether all sequences that begin with `before` and go on with `now` are proved; forces: until the step before."""
        prefix = [(*b, n) for b, n in zip(before, now, strict=True)]
        if any(a > b for a, b in itertools.pairwise(prefix)):
            return True  # another order of the fingers
        t = len(prefix[0]) - 1
        smooth = sum(self.smooth(p) for p in prefix)
        if forces + smooth + self.rest(t, tuple(map(self.state, prefix))) >= self.target:
            return True
        if t == self.s.steps - 1:
            return self.sequence(np.array(prefix).T)
        for after in self.steps_from(prefix):
            active = tuple(sorted(n + 1 if n == a else 0 for n, a in zip(now, after, strict=True)))
            if not self.from_here(prefix, after, forces + self.phi[t][active]):
                return False
        return True

    def sequence(self, modes: Array) -> bool:
        self.met += 1
        node = self.sequences.get(tuple(map(tuple, modes.tolist())))
        ranges = [r for c in range(self.fingers) for r in self.intervals(tuple(modes[:, c].tolist()))]
        lo, hi = [r[2] for r in ranges], [r[3] for r in ranges]
        if node is None:
            return False
        removed = node["removed"]
        count = len(removed["step"])
        at, multipliers = numbers(removed["at"], (count,)), numbers(removed["multipliers"], (count, 3))
        for i in range(count):
            k, part = removed["interval"][i], removed["part"][i]
            y = np.zeros((self.s.steps, 3))
            y[removed["step"][i]] = multipliers[i]
            ends = ([*lo], [*hi])
            if part != 2:
                assert lo[k] <= at[i] <= hi[k]
                ends[1 - part][k] = (lo, hi)[part][k] = at[i]
            none = np.zeros((max(self.s.steps - 2, 0), self.fingers, 2))
            if not self.leaf(modes, y, none, *ends, {}, True) > 0:
                return False
            if part == 2:
                return True
        return len(node) > 2 and self.box(modes, node, lo, hi, {}) >= self.target

    def smooth(self, prefix: tuple[int, ...]) -> float:
        """The better of what the certificate says of this path, and of the path so far with one more step."""
        if len(prefix) < 3:
            return self.paths.get(prefix, 0.0)
        window = self.window(len(prefix) - 1, prefix[-1]) if len({*prefix[-3:]}) == 1 else 0.0
        return max(self.paths.get(prefix, 0.0), self.smooth(prefix[:-1]) + window)

    def window(self, t: int, f: int) -> float:
        """Least |p(t) - 2 p(t - 1) + p(t - 2)|^2 of a finger that sat on f since t - 2."""
        if f < 0:
            return 0.0
        s, steps = self.s, [t - 2, t - 1, t]
        low, high = s.low[steps, f].max(), s.high[steps, f].min()
        if low > high:
            return np.inf
        p0 = sum(c * self.place(u, f, 0.0) for c, u in zip((1, -2, 1), steps, strict=True))
        p1 = sum(c * s.edge[u, f] for c, u in zip((1, -2, 1), steps, strict=True))
        rho = np.clip(-(p0 @ p1) / max(p1 @ p1, 1e-300), low, high)
        return s.acceleration_weight * float(((p0 + rho * p1) ** 2).sum())

    def state(self, prefix: tuple[int, ...]) -> tuple[int, int]:
        """Mode, and for how many steps it has been there, up to three."""
        run = next(len(list(g)) for _, g in itertools.groupby(reversed(prefix)))
        return prefix[-1], min(run, 3) if prefix[-1] >= 0 else 0

    def rest(self, t: int, states: tuple) -> float:
        """Least force cost from t on and smoothing cost after t."""
        key = t, states
        if key in self.to_go:
            return self.to_go[key]
        now = [f for f, _ in states]
        if t == self.s.steps - 1:
            short = self.s.min_interval > 1 and any(f >= 0 and age == 1 for f, age in states)
            value = np.inf if short else self.phi[t][tuple(sorted(f + 1 for f in now))]
        else:
            value = np.inf
            for after in self.steps_from([(f,) * max(age, 1) for f, age in states]):
                active = tuple(sorted(n + 1 if n == a else 0 for n, a in zip(now, after, strict=True)))
                grown = tuple(
                    (a, min(age + 1, 3) if a == f else 1) if a >= 0 else (a, 0)
                    for (f, age), a in zip(states, after, strict=True)
                )
                windows = sum(self.window(t + 1, a) for a, age in grown if age == 3)
                value = min(value, self.phi[t][active] + windows + self.rest(t + 1, grown))
        self.to_go[key] = value
        return value


def clipped(place: Any, normal: Array, b: float) -> Any:
    """The part of a polygon where normal.x <= b."""
    corners = shapely.get_coordinates(place)[:-1]
    if not len(corners):
        return place
    side, kept = corners @ normal - b, []
    for i in range(len(corners)):
        j = (i + 1) % len(corners)
        if side[i] <= 0:
            kept.append(corners[i])
        if side[i] * side[j] < 0:
            kept.append(corners[i] + side[i] / (side[i] - side[j]) * (corners[j] - corners[i]))
    return shapely.Polygon(kept) if len(kept) > 2 else shapely.Polygon()


def numbers(text: str, shape: tuple[int, ...]) -> Array:
    """Packed float64."""
    return np.frombuffer(base64.b64decode(text), dtype="<f8").reshape(shape)
