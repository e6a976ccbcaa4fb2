"""MIP1's blocks, 5-CT1 to 5-CT11, in thesis letters with its errata mended.  Relative lengths, q = (0, 0, 0); indices as in
`SlicedObject`, n finger, k half of the loop's way through a piece.

The obstacle of piece i of finger n is p_n - R(theta) P_i.  What is mended, and why, stands at each block.
"""

from dataclasses import dataclass

import cvxpy as cp
import numpy as np

from expert.caging.thesis_geometry import SlicedObject
from expert.geometry.pose import Array, rotation
from expert.mip.block import Block, implies

FARTHEST = 2.0
"""Fingers stay within this distance of q, per coordinate: neighbours' obstacles, of radius 1, must meet."""
BELOW_LEFTWARD, BELOW_RIGHTWARD, ABOVE, LEFT, RIGHT, UNUSED = range(6)
"""Where q is, seen from a segment of the loop; below it, the ray up from q crosses it leftward or rightward."""


@dataclass(frozen=True)
class Variables:
    """Table 5.2.  p (n, d) fingers; Theta (s,): 1 at and beyond the limit orientations; H (n, i, j): the loop passes from piece
    i of n to piece j of n + 1; G (n, i, j): from i to j within n; R (s, n, r) regions; F (n, i, k, 6): where q is, seen from
    half k of the loop's way through piece i; T (s, n, f) contacts at the limits; x (s - 1, n, d): a point in both pieces
    between slices s and s + 1, in the frame of finger n + 1.

    way (n, i, 3, d): entry, bend and exit of the loop in a piece; rho (s, n, f) where on a facet; z (s, c) limit contacts:
    continuous, yet 0 or 1 wherever T is.
    """

    p: cp.Variable
    Theta: cp.Variable
    H: cp.Variable
    G: cp.Variable
    R: cp.Variable
    F: cp.Variable
    T: cp.Variable
    x: cp.Variable
    way: cp.Variable
    rho: cp.Variable
    z: cp.Variable

    @classmethod
    def of(cls, o: SlicedObject, count: int) -> "Variables":
        """Variables with their boxes: the workspace, the object's radius 1, and sums of both."""
        (S, M, R, L), N = o.shape, count
        return cls(
            p=cp.Variable((N, 2), bounds=[-FARTHEST, FARTHEST], name="p"),
            Theta=cp.Variable(S, boolean=True, name="Theta"),
            H=cp.Variable((N, M, M), boolean=True, name="H"),
            G=cp.Variable((N, M, M), boolean=True, name="G"),
            R=cp.Variable((S, N, R), boolean=True, name="R"),
            F=cp.Variable((N, M, 2, 6), boolean=True, name="F"),
            T=cp.Variable((S, N, L), boolean=True, name="T"),
            x=cp.Variable((S - 1, N, 2), bounds=[-1, 1], name="x"),
            way=cp.Variable((N, M, 3, 2), bounds=[-FARTHEST - 1, FARTHEST + 1], name="way"),
            rho=cp.Variable((S, N, L), bounds=[0, 1], name="rho"),
            z=cp.Variable((S, len(o.contacts)), bounds=[0, 1], name="z"),
        )

    def entered(self) -> cp.Expression:
        """(n, j): 1 where the loop comes to piece j of n from another finger."""
        return _behind(cp.sum(self.H, axis=1))

    def used(self) -> cp.Expression:
        """(n, j): 1 where the loop passes through piece j of n."""
        return self.entered() + cp.sum(self.G, axis=1)

    def inner(self, o: SlicedObject) -> cp.Expression:
        """(s,): 0 at slices between the limits and at the limits themselves, 1 beyond: Theta of the neighbour towards q."""
        return cp.hstack([self.Theta[1 : o.start + 1], np.zeros(1), self.Theta[o.start : -1]])


def _behind(each: cp.Expression) -> cp.Expression:
    """Entry n of the result is entry n - 1 of `each`, cyclically."""
    return cp.concatenate([each[-1:], each[:-1]])


def _ahead(each: cp.Expression) -> cp.Expression:
    """Entry n of the result is entry n + 1 of `each`, cyclically."""
    return cp.concatenate([each[1:], each[:1]])


def intersections(x: Variables, o: SlicedObject) -> Block:
    """5-CT1: H_n(i, j) = 1 => exists r in P_i,n and P_j,n+1: where the loop leaves the one and enters the other, at q's slice.

    Other slices: 5-CT9 to 5-CT11 give such a point between each two of them.
    """
    N, M = x.p.shape[0], x.G.shape[1]
    body = cp.reshape(x.p, (N, 1, 1, 2), order="C") - x.way
    inside = cp.einsum("ied,nikd->nike", o.piece_A, body) <= o.piece_b[:, None]
    r, r_next = x.way[:, :, None, 2], _ahead(x.way[:, :, 0])[:, None]
    shape = (N, M, M, 2)
    same = cp.broadcast_to(r, shape) == cp.broadcast_to(r_next, shape)
    return Block.of("5-CT1", implies(x.used(), inside), implies(x.H, same))


def one_intersection(x: Variables) -> Block:
    """5-CT2: sum_ij H_n(i, j) = 1."""
    return Block.of("5-CT2", cp.sum(x.H, axis=(1, 2)) == 1)


def loop_closure(x: Variables, o: SlicedObject) -> Block:
    """5-CT3, 5-CT4: wherever the loop comes to a piece it goes on, within the finger or to the next, once.

    G says which meetings inside a finger the loop uses, and only pieces that meet may: a point of both joins them.
    With 5-CT1 and 5-CT2 the obstacles then hold an enclosing loop (5.1 Definition 2).
    """
    entered, used = x.entered(), x.used()
    leaves = cp.sum(x.H, axis=2) + cp.sum(x.G, axis=2)
    N, M = entered.shape
    allowed = np.broadcast_to(o.meeting & ~np.eye(M, dtype=bool), (N, M, M))
    shape = (N, M, M, 2)
    r, r_next = x.way[:, :, None, 2], x.way[:, None, :, 0]
    same = cp.broadcast_to(r, shape) == cp.broadcast_to(r_next, shape)
    return Block.of("5-CT3, 5-CT4", leaves == used, used <= 1, x.G - allowed <= 0, implies(x.G, same))


def object_enclosing(x: Variables, o: SlicedObject) -> Block:
    """5-CT5: q is below, above, left or right of each segment of the loop, and the ray up from q crosses it once, leftward, more
    often than rightward: winding number one.

    What lies inside is caged under translations (5.1 Remark 1).  Mended: of an odd count (5.1 Remark 2, 5.1 Lemma 1) the
    printed truth table makes an even one; and boxes about straight segments between two meetings leave out every cage of
    a convex object by three fingers, so that the way through a piece may bend once.
    """
    a, b = x.way[:, :, :2], x.way[:, :, 1:]
    used = cp.broadcast_to(x.used()[..., None], (*x.F.shape[:3],))
    eps = o.clearance
    ends = cp.stack([a, b], axis=4)  # (n, i, k, d, 2)
    across, up = ends[:, :, :, 0], ends[:, :, :, 1]
    turns = cp.sum(x.F[..., BELOW_LEFTWARD]) - cp.sum(x.F[..., BELOW_RIGHTWARD])
    return Block.of(
        "5-CT5",
        cp.sum(x.F, axis=3) == 1,
        x.F[..., UNUSED] == 1 - used,
        implies(x.F[..., BELOW_LEFTWARD] + x.F[..., BELOW_RIGHTWARD], up >= eps),
        implies(x.F[..., BELOW_LEFTWARD], cp.multiply(across, np.array([1.0, -1.0])) >= eps),
        implies(x.F[..., BELOW_RIGHTWARD], cp.multiply(across, np.array([-1.0, 1.0])) >= eps),
        implies(x.F[..., ABOVE], up <= -eps),
        implies(x.F[..., LEFT], across >= eps),
        implies(x.F[..., RIGHT], across <= -eps),
        turns == 1,
    )


def non_penetration(x: Variables, o: SlicedObject) -> Block:
    """5-CT6: R_rn(s) = 1 => A_r R(theta_s)^T p_n <= b_r."""
    body = cp.einsum("nd,sde->sne", x.p, rotation(o.angles))
    place = cp.einsum("sne,rhe->snrh", body, o.region_A)
    return Block.of("5-CT6", implies(x.R, place <= o.region_b[:, None]))


def limits(x: Variables, o: SlicedObject) -> Block:
    """5-CT7: between the limits, and at them, each finger is in a region and the loop exists; beyond, nothing is asked.

    The limits are those of 5.1 Definition 1.  Mended: as printed, Theta = 1 switches the loop off at the limit slices
    themselves.  sum_ij H = 1 is 5-CT2: one topology for all slices, which 5.1 Theorem 1 needs and 5-CT11 does not give.
    """
    up, down = x.Theta[o.start :], x.Theta[o.start :: -1]
    N = x.p.shape[0]
    inner = cp.broadcast_to(x.inner(o)[:, None], (o.shape[0], N))
    return Block.of(
        "5-CT7",
        *(side for way in (up, down) for side in (way[0] == 0, way[:-1] <= way[1:], way[-1] == 1)),
        cp.sum(x.R, axis=2) == 1 - inner,
    )


def limit_contacts(x: Variables, o: SlicedObject) -> Block:
    """5-CT8: T_s in L_O at both limits: three contacts hold the object at q, and turning further would press on them.

    Mended: the contacts belong to one position of the object (q itself), not to "some configuration of the slice"; their
    facets turn with it; and the sign of the moment tells a limit from an orientation where free space begins.
    """
    S, N, L = x.T.shape
    is_limit = x.Theta - x.inner(o)
    member = o.contacts > 0
    R = rotation(o.angles)
    a, along = o.ends[:, 0], o.ends[:, 1] - o.ends[:, 0]
    on_facet = np.einsum("sde,fe->sfd", R, a)[:, None] + cp.einsum(
        "snf,sfd->snfd", x.rho, np.einsum("sde,fe->sfd", R, along)
    )
    beyond = np.sign(o.angles)[:, None]
    turning = cp.einsum("sknd,nd->sk", o.turning(R) * beyond[..., None, None], x.p)
    fingers = cp.broadcast_to(cp.reshape(x.p, (1, N, 1, 2), order="C"), (S, N, L, 2))
    return Block.of(
        "5-CT8",
        cp.sum(x.z, axis=1) == is_limit,
        cp.sum(x.T, axis=(1, 2)) == x.z @ member.sum(axis=(1, 2)),
        cp.einsum("sc,cnf->snf", x.z, member.astype(float)) <= x.T,
        implies(x.T, fingers == on_facet),
        implies(x.T, x.rho >= o.along[:, 0]),
        implies(x.T, x.rho <= o.along[:, 1]),
        implies(x.z, turning <= -o.clearance),
    )


def continuous_boundary(x: Variables, o: SlicedObject) -> Block:
    """5-CT9, 5-CT10, 5-CT11: between neighbouring slices a point x fixed in P_j,n+1 stays in P_i,n: its arc there lies in the
    triangle of its ends and of x_v, where their tangents meet.

    So the loop encloses between the slices too: 5.1 Theorem 1, whose proof is 5.1 Lemma 2, 5.1 Lemma 3 and 5.1 Lemma 4.
    """
    Delta = x.p - _ahead(x.p)
    half = np.diff(o.angles) / 2
    middle = o.angles[:-1] + half
    seen = np.stack(
        [
            rotation(-o.angles[:-1]),
            rotation(-o.angles[1:]),
            rotation(-middle) / np.cos(half)[:, None, None],  # x_v
        ]
    )
    S, N = len(half), x.p.shape[0]
    x_i = cp.broadcast_to(cp.reshape(x.x, (1, S, N, 2), order="C"), (3, S, N, 2)) + cp.einsum(
        "vsde,ne->vsnd", seen, Delta
    )
    inner = x.inner(o)
    beyond = cp.hstack([inner[: o.start], inner[o.start + 1 :]])  # of the interval's outer slice
    active = (S, N, o.shape[1])
    off = cp.broadcast_to(beyond[:, None, None], active)
    entered = cp.broadcast_to(_ahead(x.entered())[None], active) - off
    left = cp.broadcast_to(cp.sum(x.H, axis=2)[None], active) - off
    in_P_j = cp.einsum("snd,jed->snje", x.x, o.piece_A) <= o.piece_b
    in_P_i = cp.einsum("vsnd,ied->snive", x_i, o.piece_A) <= o.piece_b[:, None]
    return Block.of("5-CT9, 5-CT10, 5-CT11", implies(entered, in_P_j), implies(left, in_P_i))


def leftmost_first(x: Variables) -> Block:
    """Renaming the fingers along the loop changes nothing: finger 0 is the leftmost."""
    return Block.of("symmetry", x.p[0, 0] <= x.p[1:, 0])


def not_again(found: list[tuple[cp.Expression, Array]]) -> Block:
    """Cuts off a choice of binaries: at least one of those that are 1 must not be."""
    ones = [cp.sum(cp.multiply(np.round(value), variable)) for variable, value in found]
    return Block.of("cut", sum(ones) <= sum(np.round(value).sum() for _, value in found) - 1)
