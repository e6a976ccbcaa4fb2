"""Every solution of a contact problem, by trying all modes; shares nothing with the solver."""

import itertools
from dataclasses import dataclass

import numpy as np

from expert.geometry.pose import Array

OPEN, STICK, PLUS, MINUS = "open", "stick", "+", "-"


@dataclass(frozen=True)
class ContactProblem:
    """Impulses P (n, 2), normal and tangential, against velocities y = A P + c at n contacts with friction mu (n,).

    A (n, 2, n, 2), c (n, 2): y_n >= 0, P_n >= 0, y_n P_n = 0; |P_t| <= mu P_n, and P_t opposes y_t with its whole limit.
    """

    A: Array
    c: Array
    mu: Array

    def velocity(self, P: Array) -> Array:
        return np.tensordot(self.A, P, axes=([2, 3], [0, 1])) + self.c

    def violation(self, P: Array) -> float:
        """Of signs, cones and complementarity, over the size of the problem's impulses and velocities."""
        y = self.velocity(P)
        speed = np.abs(self.c).max() + np.abs(y).max() + 1e-300
        impulse = np.abs(P).max() + speed / np.abs(self.A).max()
        P, y = P / impulse, y / speed
        limit = self.mu * P[:, 0]
        resisted = np.minimum(limit - P[:, 1], np.maximum(-y[:, 1], 0)) + np.minimum(
            limit + P[:, 1], np.maximum(y[:, 1], 0)
        )
        scale = 1 + self.mu
        parts = [
            -P[:, 0],
            -y[:, 0],
            np.minimum(P[:, 0], y[:, 0]),
            (np.abs(P[:, 1]) - limit) / scale,
            resisted / scale,
        ]
        return max(float(np.max(p, initial=0)) for p in parts)

    def solutions(self, tolerance: float = 1e-9) -> list[Array]:
        """All isolated solutions: for each of the 4^n modes the impulses of its linear equations, where they keep the laws."""
        found: list[Array] = []
        for mode in itertools.product((OPEN, STICK, PLUS, MINUS), repeat=len(self.mu)):
            P = self._of_mode(mode)
            if P is None or self.violation(P) > tolerance:
                continue
            size = max(np.abs(P).max(), 1e-300)
            if all(np.abs(P - Q).max() > 1e-6 * size for Q in found):
                found.append(P)
        return found

    def _of_mode(self, mode: tuple[str, ...]) -> Array | None:
        """Open: P = 0; stick: y = 0; + or -: y_n = 0 and P_t = +-mu P_n.  None for singular equations."""
        n = len(mode)
        system, right = np.zeros((n, 2, n, 2)), np.zeros((n, 2))
        for i, state in enumerate(mode):
            if state == OPEN:
                system[i, 0, i, 0] = system[i, 1, i, 1] = 1
                continue
            system[i, 0], right[i, 0] = self.A[i, 0], -self.c[i, 0]
            if state == STICK:
                system[i, 1], right[i, 1] = self.A[i, 1], -self.c[i, 1]
            else:
                system[i, 1, i, 1] = 1
                system[i, 1, i, 0] = -self.mu[i] if state == PLUS else self.mu[i]
        try:
            return np.linalg.solve(system.reshape(2 * n, 2 * n), right.ravel()).reshape(n, 2)
        except np.linalg.LinAlgError:
            return None
