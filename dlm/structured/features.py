"""What the scorer sees: one token per facet, one per step, from vertices and poses alone; without dimensions, float32.

b task, f facet, t step.  Positions count from the centre of mass, lengths over LENGTH; the floor is y = 0.  Steps are told
relative to the first pose, so that tokens do not depend on where the floor's x = 0 is.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from datasets.motions import TaskSettings

LENGTH = 0.05
SHORT = 0.01
"""Scale of displacements [m]."""
TOUCHES = 2e-5
"""Gaps and slips below this count as zero [m]."""
FACET_NUMBERS, STEP_NUMBERS = 10, 13
"""Numbers per step in a facet's token (and its length), numbers in a step's token."""


@dataclass(frozen=True, kw_only=True)
class Geometry:
    """vertices (b, f, 2) body frame, padded with zeros; count (b,) of those that count; poses (b, t, 3).  SI, float64."""

    vertices: Tensor
    count: Tensor
    poses: Tensor

    def __getitem__(self, rows: Tensor) -> "Geometry":
        """Some of the tasks, by number."""
        return Geometry(vertices=self.vertices[rows], count=self.count[rows], poses=self.poses[rows])

    @property
    def present(self) -> Tensor:
        """Mask (b, f) of the facets that count."""
        return torch.arange(self.vertices.shape[1]) < self.count[:, None]

    @property
    def ends(self) -> Tensor:
        """Body frame: end point of each facet, (b, f, 2); the last one closes the polygon."""
        last = (self.count - 1)[:, None]
        following = torch.arange(1, self.vertices.shape[1] + 1).expand(len(last), -1)
        index = torch.where(following > last, 0, following)
        return self.vertices.gather(1, index[..., None].expand(-1, -1, 2))


def facet_tokens(g: Geometry, tasks: TaskSettings) -> Tensor:
    """(b, f, t * FACET_NUMBERS + 1): end points, normal, heights and the range of rho open to a finger, by step; length."""
    a, b = turned(g.vertices, g.poses), turned(g.ends, g.poses)  # (b, t, f, 2)
    along = b - a
    length = along.norm(dim=-1, keepdim=True).clamp(min=1e-9)
    normal = torch.stack([-along[..., 1], along[..., 0]], -1) / length
    heights = torch.stack([x[..., 1] + g.poses[..., 1, None] for x in (a, b)], -1)
    low, high = open_range(heights, tasks)
    numbers = [a / LENGTH, b / LENGTH, normal, heights / LENGTH, low[..., None], high[..., None]]
    by_step = torch.cat(numbers, -1).transpose(1, 2).flatten(2)
    return torch.cat([by_step, length[:, 0] / LENGTH], -1).float()


def open_range(heights: Tensor, tasks: TaskSettings) -> tuple[Tensor, Tensor]:
    """Least and greatest rho that the facet margin and the floor's clearance leave, of facets with end points this high."""
    start = heights[..., 0] - tasks.clearance
    slope = heights[..., 1] - heights[..., 0]
    root = -start / torch.where(slope.abs() < 1e-9, torch.full_like(slope, 1e-9), slope)
    low = torch.where(slope > 0, root, -torch.ones_like(root))
    high = torch.where(slope < 0, root, torch.full_like(root, 2.0))
    closed = (slope.abs() < 1e-9) & (start < 0)
    margin = tasks.facet_margin
    return low.clamp(margin, 2.0), torch.where(closed, -1.0, high.clamp(-1.0, 1 - margin))


def step_tokens(g: Geometry, tasks: TaskSettings) -> Tensor:
    """(b, t, STEP_NUMBERS): pose since the start and to the next step, wrench to be exerted, contact with the floor."""
    later = torch.cat([g.poses[:, 1:], g.poses[:, -1:]], 1)
    earlier = torch.cat([g.poses[:, :1], g.poses[:, :-1]], 1)
    scale = g.poses.new_tensor([SHORT, SHORT, 0.1])
    numbers = [
        (g.poses - g.poses[:, :1]) / scale,
        (later - g.poses) / scale,
        _wrench(g, (later - 2 * g.poses + earlier) / tasks.dt**2, tasks),
        _floor(g, later),
    ]
    return torch.cat(numbers, -1).float()


def _wrench(g: Geometry, acceleration: Tensor, tasks: TaskSettings) -> Tensor:
    """Over m g and m g LENGTH, of a uniform plate."""
    linear = acceleration[..., :2] / tasks.gravity + acceleration.new_tensor([0.0, 1.0])
    torque = gyration(g)[:, None] * acceleration[..., 2] / (tasks.gravity * LENGTH)
    return torch.cat([linear, 10 * torque[..., None]], -1)


def gyration(g: Geometry) -> Tensor:
    """Inertia over mass about the origin of the body frame, (b,) [m^2]."""
    v, w = g.vertices, g.ends
    c = (v[..., 0] * w[..., 1] - v[..., 1] * w[..., 0]) * g.present
    second = ((v * v + v * w + w * w).sum(-1) * c).sum(-1) / 12
    return second / (0.5 * c.sum(-1)).clamp(min=1e-12)


def _floor(g: Geometry, later: Tensor) -> Tensor:
    """(b, t, 4): whether something stays on the floor to the next step, from where to where (x), and how far it slides."""
    now, then = (turned(g.vertices, q) + q[:, :, None, :2] for q in (g.poses, later))
    touching = (now[..., 1] <= TOUCHES) & (then[..., 1] <= TOUCHES) & g.present[:, None]
    x = now[..., 0] - g.poses[..., 0, None]
    far = x.new_tensor(torch.inf)
    left, right = torch.where(touching, x, far).amin(-1), torch.where(touching, x, -far).amax(-1)
    slip = torch.where(touching, then[..., 0] - now[..., 0], 0.0)
    slip = slip.gather(-1, slip.abs().argmax(-1, keepdim=True))[..., 0]
    flag = touching.any(-1)
    ends = [torch.where(flag, edge / LENGTH, 0.0) for edge in (left, right)]
    sliding = torch.where(slip.abs() > TOUCHES, slip.sign() + slip / SHORT, 0.0)
    return torch.stack([flag.to(x), *ends, sliding], -1)


def turned(points: Tensor, poses: Tensor) -> Tensor:
    """Body points (b, n, 2) at poses (b, t, 3) from the centre of mass, (b, t, n, 2)."""
    c, s = poses[..., 2].cos()[..., None], poses[..., 2].sin()[..., None]
    x, y = points[:, None, :, 0], points[:, None, :, 1]
    return torch.stack([c * x - s * y, s * x + c * y], -1)
