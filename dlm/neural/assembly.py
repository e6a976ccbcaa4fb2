"""Mechanical parameters from polygon, poses and contact class, differentiable in polygon, poses and margins.

What `datasets.parameters` states of an expert's plan, without the plan: b task, t step, f facet, c finger.  The free regions
are those in front of the finger's facet, and the references are left to the program (`solve`).
"""

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from datasets.motions import TaskSettings
from datasets.parameters import EXTERNAL_CONTACTS, NO_ROW, REGION_ROWS
from dlm.inverse_dynamics.layer import Action, InverseDynamics
from dlm.inverse_dynamics.parameters import ParameterBatch
from dlm.structured.classes import Schedules
from dlm.structured.features import TOUCHES, Geometry, gyration, open_range, turned
from expert.problems.contact import FREE
from expert.world.values import IntArray


@dataclass(frozen=True, kw_only=True)
class Margins:
    """What planning keeps free, as tensors that may be learned: facet_margin, cone_fraction, and least_push over m g."""

    facet: Tensor
    cone: Tensor
    push: Tensor

    @classmethod
    def of(cls, tasks: TaskSettings) -> "Margins":
        """Those of the settings."""
        values = (tasks.facet_margin, tasks.cone_fraction, tasks.least_push)
        return cls(
            **dict(zip(("facet", "cone", "push"), torch.tensor(values, dtype=torch.float64), strict=True))
        )


def assemble(
    g: Geometry, classes: IntArray, schedules: Schedules, tasks: TaskSettings, margins: Margins
) -> ParameterBatch:
    """P(t) of each task with its class, classes (b, 3); vertices count from the centre of mass.

    References: the middle of what is open of a facet, and no force.
    """
    modes = torch.from_numpy(schedules.modes(classes))  # (b, t, c)
    facet = torch.from_numpy(classes[:, None, 1:]).expand(-1, modes.shape[1], -1)
    touching = modes != FREE
    open_, normal = _facets(g, facet, touching, tasks, margins)
    regions = _regions(g, facet, touching, normal, tasks)
    weight = tasks.mass * tasks.gravity
    most = torch.full_like(margins.push, tasks.force_limit)
    limits = weight * torch.stack([margins.push, most]).to(g.poses)
    ground = _ground(g, tasks)
    return ParameterBatch(
        poses=g.poses,
        wrench=_wrench(g, tasks),
        facets=open_,
        cones=_cones(normal, margins.cone * tasks.friction),
        contact=touching.to(g.poses),
        stick=_sticking(touching).to(g.poses),
        force_limits=limits.expand(*touching.shape, 2),
        region_normals=regions[0],
        region_offsets=regions[1],
        external_contact=ground[0],
        external_points=ground[1],
        external_cones=ground[2],
        reference_positions=open_.mean(-2),
        reference_forces=torch.zeros_like(normal),
    )


def solve(program: InverseDynamics, parameters: ParameterBatch, *, passes: int) -> Action:
    """The program's answer where its torque is linearised at its own answer before, so many times over.

    At the fixed point the torque is exact, and the plan a stationary point of the expert's program with these modes.
    """
    action = program(parameters)
    for _ in range(passes - 1):
        parameters = replace(parameters, reference_positions=action.positions, reference_forces=action.forces)
        action = program(parameters)
    return action


def _wrench(g: Geometry, tasks: TaskSettings) -> Tensor:
    """M r_ddot + G of a uniform plate, at rest before and after, (b, t, 3)."""
    q = torch.cat([g.poses[:, :1], g.poses, g.poses[:, -1:]], 1)
    acceleration = (q[:, 2:] - 2 * q[:, 1:-1] + q[:, :-2]) / tasks.dt**2
    force = acceleration[..., :2] + acceleration.new_tensor([0.0, tasks.gravity])
    torque = gyration(g)[:, None] * acceleration[..., 2]
    return tasks.mass * torch.cat([force, torque[..., None]], -1)


def _facets(
    g: Geometry, facet: Tensor, touching: Tensor, tasks: TaskSettings, margins: Margins
) -> tuple[Tensor, Tensor]:
    """Segments (b, t, c, 2, 2) open to the fingers, the same shares of a facet while it is touched; inward normals (b, t, c, 2)."""
    at = facet[..., None].expand(-1, -1, -1, 2)
    a, b = (
        (turned(x, g.poses) + g.poses[:, :, None, :2]).gather(2, at) for x in (g.vertices, g.ends)
    )  # (b, t, c, 2)
    along = b - a
    normal = torch.stack([-along[..., 1], along[..., 0]], -1) / along.norm(dim=-1, keepdim=True)
    low, high = open_range(torch.stack([a[..., 1], b[..., 1]], -1), replace(tasks, facet_margin=0.0))
    low, high = torch.maximum(low, margins.facet), torch.minimum(high, 1 - margins.facet)
    low = torch.where(touching, torch.where(touching, low, -torch.inf).amax(1, keepdim=True), margins.facet)
    high = torch.where(
        touching, torch.where(touching, high, torch.inf).amin(1, keepdim=True), 1 - margins.facet
    )
    return torch.stack([a + rho[..., None] * along for rho in (low, high)], -2), normal


def _cones(normal: Tensor, friction: Tensor) -> Tensor:
    """Both edges of the cones about inward normals (..., 2), unit normal component, (..., 2, 2)."""
    tangent = torch.stack([normal[..., 1], -normal[..., 0]], -1)
    return torch.stack([normal + friction * tangent, normal - friction * tangent], -2)


def _sticking(touching: Tensor) -> Tensor:
    """Whether a finger touches at the next step too; the last step counts as held."""
    later = torch.cat([touching[:, 1:], torch.ones_like(touching[:, :1])], 1)
    return touching & later


def _regions(
    g: Geometry, facet: Tensor, touching: Tensor, normal: Tensor, tasks: TaskSettings
) -> tuple[Tensor, Tensor]:
    """Half-planes of free fingers (b, t, c, h, 2), (b, t, c, h): in front of the facet, over the floor; the rest stays empty."""
    at = facet[..., None].expand(-1, -1, -1, 2)
    corner = (turned(g.vertices, g.poses) + g.poses[:, :, None, :2]).gather(2, at)
    front = (normal * corner).sum(-1) - tasks.clearance
    down = torch.zeros_like(normal) - normal.new_tensor([0.0, 1.0])
    free, shape = ~touching, (*touching.shape, REGION_ROWS)
    normals = normal.new_zeros(*shape, 2)
    offsets = normal.new_full(shape, NO_ROW)
    rows = ((normal, front), (down, torch.full_like(front, -tasks.clearance)))
    for h, (direction, bound) in enumerate(rows):
        normals[..., h, :] = torch.where(free[..., None], direction, 0.0)
        offsets[..., h] = torch.where(free, bound, NO_ROW)
    return normals, offsets


def _ground(g: Geometry, tasks: TaskSettings) -> tuple[Tensor, Tensor, Tensor]:
    """Flags (b, t, e), points (b, t, e, 2) and rays (b, t, e, 2, 2): the outermost of the vertices that the floor touches
    to the next step, drawn in by support_inset; one ray where it slides."""
    later = torch.cat([g.poses[:, 1:], g.poses[:, -1:]], 1)
    now, then = (turned(g.vertices, q) + q[:, :, None, :2] for q in (g.poses, later))
    touching = (now[..., 1] <= TOUCHES) & (then[..., 1] <= TOUCHES) & g.present[:, None]
    first = torch.where(touching, now[..., 0], torch.inf).argmin(-1)
    last = torch.where(touching, now[..., 0], -torch.inf).argmax(-1)
    ends = torch.stack([first, last], -1)[..., None].expand(-1, -1, -1, 2)
    corner, moved = now.gather(2, ends), then.gather(2, ends)
    apart = tasks.support_inset * (corner[:, :, 1] - corner[:, :, 0])
    points = corner + torch.stack([apart, -apart], 2)
    any_ = touching.any(-1)
    flags = torch.stack([any_, any_ & (first != last)], -1)
    rays = _floor_rays((moved - corner)[..., 0], tasks)
    centre = g.poses[:, :, None, :2].expand(-1, -1, EXTERNAL_CONTACTS, -1)
    mask = flags[..., None]
    return flags.to(g.poses), torch.where(mask, points, centre), torch.where(mask[..., None], rays, 0.0)


def _floor_rays(slip: Tensor, tasks: TaskSettings) -> Tensor:
    """Rays (..., 2, 2) of floor contacts that slip so far [m] to the next step: a tightened cone, or the edge that opposes it."""
    up = slip.new_tensor([0.0, 1.0]).expand(*slip.shape, 2)
    staying = _cones(up, slip.new_tensor(tasks.cone_fraction * tasks.friction))
    edge = up - slip.sign()[..., None] * slip.new_tensor([tasks.friction, 0.0])
    sliding = torch.stack([edge, edge], -2)
    return torch.where((slip.abs() > TOUCHES)[..., None, None], sliding, staying)
