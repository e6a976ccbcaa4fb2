"""Finger paths of a grasp, executed by the contact simulator or in MuJoCo on a support plane with friction.

An outside check of the sweeping process, which knows neither mass, nor springs, nor speed.  Finger friction, which the
certificates exclude, can be added here to see what it does.
"""

from dataclasses import dataclass

import numpy as np

from dlm.simulator.mujoco import MujocoReplay, command_model, replay_model
from dlm.simulator.replay import follow
from dlm.simulator.rollout import run_for
from dlm.simulator.scene import Scene, SceneBatch
from dlm.simulator.settings import SimulatorSettings
from dlm.simulator.world import world_of
from expert.geometry.pose import Array, moved_origin
from expert.problems.grasp import GraspProblem
from expert.world.environment import Environment
from expert.world.motion import Trajectory
from expert.world.shape import Body
from expert.world.values import readonly

MASS, SUPPORT_FRICTION = 0.1, 0.3
STIFFNESS_PER_MASS = 1e6
"""Finger stiffness over the object's mass [N/m per kg]: pushing the object deflects a finger by micrometres."""


@dataclass(frozen=True, kw_only=True)
class Slow:
    """How slowly fingers move: seconds and time steps per knot interval, and the radius of the fingers [m]."""

    seconds: float = 4.0
    substeps: int = 400
    radius: float = 1e-6

    @property
    def settings(self) -> SimulatorSettings:
        """For the simulators."""
        return SimulatorSettings(substeps=self.substeps, finger_radius=self.radius)


def replay_grasp(
    problem: GraspProblem, path: Array, starts: Array, *, friction: float = 0.0, slow: Slow | None = None
) -> Array:
    """Object poses (M, K, 3) at the knots of finger paths (K, N, 2) [m], from start poses (M, 3).

    friction: at the fingers.  The last pose is held where numbers overflow.  Raises SolverFailed where rounding made a
    contact problem unsolvable.
    """
    slow = slow or Slow()
    scene, centroid = _scene(problem, len(path), friction, slow)
    commands = _commands(readonly(path, (None, None, 2), "path"), slow.substeps)
    batch = SceneBatch.of([scene])
    world = world_of(batch.arrays, 0, slow.settings.numbers)
    run = run_for(batch.arrays, len(commands), path.shape[1])
    motion = run.motion
    motion.commands[:] = commands
    poses = np.empty((len(starts), len(path), 3))
    for m, start in enumerate(moved_origin(readonly(starts, (None, 3), "starts"), centroid)):
        motion.poses[0], motion.fingers[0], motion.velocities[0] = start, commands[0], 0
        follow(world, run)
        poses[m] = motion.poses[:: slow.substeps]
    return moved_origin(poses, -centroid)


def replay_grasp_in_mujoco(
    problem: GraspProblem, path: Array, start: Array, *, friction: float = 0.0, slow: Slow | None = None
) -> Array:
    """Object poses (K, 3) at the knots, in MuJoCo.  Raises MujocoMissing without the package."""
    slow = slow or Slow(seconds=1.0, substeps=100, radius=1e-4)
    scene, centroid = _scene(problem, len(path), friction, slow)
    commands = _commands(readonly(path, (None, None, 2), "path"), slow.substeps)
    text = command_model(
        scene, commands, commands[0], slow.settings, start=moved_origin(np.asarray(start), centroid)
    )
    record: MujocoReplay = replay_model(text)
    return moved_origin(record.poses, -centroid)


def _scene(problem: GraspProblem, knots: int, friction: float, slow: Slow) -> tuple[Scene, Array]:
    """The object on its support plane, and the centre of mass in the body frame of the problem."""
    body, centroid = Body.uniform(problem.shape.vertices, MASS)
    goal = moved_origin(problem.pose, centroid)
    scene = Scene(
        body=body,
        environment=Environment(plane="transverse", support_friction=SUPPORT_FRICTION),
        trajectory=Trajectory.of(np.repeat(goal[None], knots, axis=0), slow.seconds, "rest"),
        friction=friction,
        stiffness=STIFFNESS_PER_MASS * MASS,
    )
    return scene, centroid


def _commands(path: Array, substeps: int) -> Array:
    """Straight lines between the knots, (S + 1, N, 2)."""
    s = np.linspace(0, len(path) - 1, (len(path) - 1) * substeps + 1)
    k = np.minimum(s.astype(int), len(path) - 2)
    share = (s - k)[:, None, None]
    return np.ascontiguousarray((1 - share) * path[k] + share * path[k + 1])
