"""The same scene in MuJoCo: a model file that carries the plan, and its replay, to check our physics from outside.

The object has two slides and a hinge; its convex pieces meet the fingers, a bead at every vertex meets the walls.
Fingers are balls on slides, driven by forces: springs with dampers towards the commands of the execution layer.
In the transverse plane every vertex stands on a foot of its own, loaded with its share of the weight.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np

from dlm.simulator.replay import planned_commands
from dlm.simulator.scene import Scene
from dlm.simulator.settings import SimulatorSettings
from expert.errors import ExpertError
from expert.geometry.convex import convex_pieces
from expert.geometry.pose import Array
from expert.problems.contact import ContactTask

BEAD = 1e-4
"""Radius of the beads at the vertices [m]; walls are set back by it."""
THICKNESS = 0.02
"""Of the object, out of the plane [m]; it has no effect."""
FINGER_MASS_SHARE = 0.1
"""Mass of a finger over the object's."""
FOOT_MASS_SHARE = 1e-3
FINGERS, WALLS, FLOOR = "1", "2", "4"
"""Collision bits: fingers meet the object's pieces, beads meet walls, feet meet the support plane."""
FOOT_DEPTH = 0.05
"""Depth of the support plane under the plane of motion [m]."""


class MujocoMissing(ExpertError):
    """The package mujoco is not installed."""


@dataclass(frozen=True, kw_only=True)
class MujocoReplay:
    """Object poses (T, 3) at the knots and at the substeps (S + 1, 3); fingers (S + 1, C, 2)."""

    poses: Array
    substep_poses: Array
    fingers: Array


def plan_model(
    task: ContactTask | Scene,
    positions: Array,
    forces: Array,
    settings: SimulatorSettings | None = None,
    *,
    contact: np.ndarray | None = None,
    start: Array | None = None,
    timestep: float = 2.5e-4,
) -> str:
    """MJCF text of the scene, with the commands of a plan (T, C, 2) as custom numbers `commands` and `interval`."""
    scene = Scene.of(task) if isinstance(task, ContactTask) else task
    settings = settings or SimulatorSettings()
    commands, fingers = planned_commands(scene, positions, forces, settings, contact=contact)
    pose = scene.trajectory.poses[0] if start is None else np.asarray(start, dtype=float)
    return command_model(scene, commands, fingers, settings, start=pose, timestep=timestep)


def command_model(
    scene: Scene,
    commands: Array,
    fingers: Array,
    settings: SimulatorSettings,
    *,
    start: Array,
    timestep: float = 2.5e-4,
) -> str:
    """MJCF text of the scene with commands (S + 1, C, 2) for fingers (C, 2), which begin there, and the first pose (3,)."""
    root = _model(scene, fingers, settings, timestep)
    custom = xml.SubElement(root, "custom")
    interval = scene.trajectory.dt / settings.substeps
    _add(custom, "numeric", name="interval", data=[interval])
    _add(custom, "numeric", name="substeps", data=[settings.substeps])
    _add(custom, "numeric", name="commands", data=commands.ravel())
    feet = len(scene.body.vertices) if scene.environment.plane == "transverse" else 0
    rest = np.concatenate([start, np.zeros(feet), fingers.ravel()])
    _add(
        xml.SubElement(root, "keyframe"),
        "key",
        name="start",
        qpos=rest,
        ctrl=np.zeros(4 * len(fingers) + feet),
    )
    xml.indent(root)
    return xml.tostring(root, encoding="unicode")


def export_plan(path: str | Path, *args: object, **options: object) -> None:
    """Write `plan_model` to a file that MuJoCo's own tools open."""
    Path(path).write_text(plan_model(*args, **options) + "\n", encoding="utf-8")  # type: ignore[arg-type]


def replay_in_mujoco(
    task: ContactTask | Scene,
    positions: Array,
    forces: Array,
    settings: SimulatorSettings | None = None,
    *,
    contact: np.ndarray | None = None,
    start: Array | None = None,
    timestep: float = 2.5e-4,
) -> MujocoReplay:
    """Execute a plan, as `replay` does, in MuJoCo.  Raises MujocoMissing without the package."""
    return replay_model(
        plan_model(task, positions, forces, settings, contact=contact, start=start, timestep=timestep)
    )


def replay_model(text: str) -> MujocoReplay:
    """Run a model made by `plan_model`: every spring follows its command, linear between substeps."""
    try:
        import mujoco
    except ImportError as missing:
        raise MujocoMissing(
            "mujoco is not installed: pip install 'certified-manipulation[mujoco]'"
        ) from missing
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    interval, substeps = float(model.numeric("interval").data[0]), int(model.numeric("substeps").data[0])
    C = len([a for a in range(model.nu) if model.actuator(a).name.startswith("spring")]) // 2
    commands = np.array(model.numeric("commands").data).reshape(-1, C, 2)
    S, inner = len(commands) - 1, round(interval / model.opt.timestep)
    springs = [model.actuator(f"spring{c}{axis}").id for c in range(C) for axis in "xy"]
    dampers = [model.actuator(f"damper{c}{axis}").id for c in range(C) for axis in "xy"]
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[[a for a in range(model.nu) if model.actuator(a).name.startswith("foot")]] = 1.0
    mujoco.mj_forward(model, data)
    poses, fingers = [_pose(data)], [_fingers(data, C)]
    for i in range(S):
        step = (commands[i + 1] - commands[i]).ravel()
        data.ctrl[dampers] = step / interval
        for k in range(inner):
            data.ctrl[springs] = commands[i].ravel() + step * (k + 1) / inner
            mujoco.mj_step(model, data)
        poses.append(_pose(data))
        fingers.append(_fingers(data, C))
    record = np.array(poses)
    return MujocoReplay(poses=record[::substeps], substep_poses=record, fingers=np.array(fingers))


def _pose(data: Any) -> Array:
    return np.array([data.joint(name).qpos[0] for name in ("x", "y", "theta")])


def _fingers(data: Any, count: int) -> Array:
    return np.array([[data.joint(f"finger{c}{axis}").qpos[0] for axis in "xy"] for c in range(count)])


def _model(scene: Scene, fingers: Array, settings: SimulatorSettings, timestep: float) -> xml.Element:
    root = xml.Element("mujoco", model="plan")
    sagittal = scene.environment.plane == "sagittal"
    gravity = [0, -scene.environment.gravity, 0] if sagittal else [0, 0, 0]
    _add(root, "compiler", angle="radian")
    option = {"integrator": "implicitfast", "cone": "elliptic", "impratio": [100]}
    _add(
        root,
        "option",
        timestep=[timestep],
        gravity=gravity,
        tolerance=[1e-12],
        ccd_tolerance=[1e-9],
        **option,
    )
    hard = xml.SubElement(root, "default")
    _add(hard, "geom", solref=[8 * timestep, 1], solimp=[0.99, 0.999, 1e-4], contype="0", conaffinity="0")
    asset, world, actuator = (xml.SubElement(root, tag) for tag in ("asset", "worldbody", "actuator"))
    body = _object(scene, asset, world)
    for k, wall in enumerate(scene.environment.walls):
        mu = 0.0 if settings.frictionless else wall.friction
        back = wall.point - BEAD * wall.normal
        _plane(world, f"wall{k}", [*back, 0], [*wall.normal, 0], mu, WALLS)
    if not sagittal:
        _feet(scene, body, world, actuator)
    for c in range(len(fingers)):
        _finger(scene, c, world, actuator, settings)
    return root


def _object(scene: Scene, asset: xml.Element, world: xml.Element) -> xml.Element:
    """Two slides and a hinge, so that its coordinates are the pose."""
    body = _add(world, "body", name="object")
    m, i = scene.body.mass, scene.body.inertia
    _add(body, "inertial", pos=[0, 0, 0], mass=[m], diaginertia=[i, i, i])
    _add(body, "joint", name="x", type="slide", axis=[1, 0, 0])
    _add(body, "joint", name="y", type="slide", axis=[0, 1, 0])
    _add(body, "joint", name="theta", type="hinge", axis=[0, 0, 1])
    for k, piece in enumerate(convex_pieces(scene.body.vertices)):
        prism = np.vstack([np.column_stack([piece, np.full(len(piece), z)]) for z in (-0.5, 0.5)])
        _add(asset, "mesh", name=f"piece{k}", vertex=(prism * [1, 1, THICKNESS]).ravel())
        _add(body, "geom", type="mesh", mesh=f"piece{k}", friction=[0, 0, 0], conaffinity=FINGERS)
    for x, y in scene.body.vertices:
        _add(body, "geom", type="sphere", size=[BEAD], pos=[x, y, 0], friction=[0, 0, 0], contype=WALLS)
    return body


def _feet(scene: Scene, body: xml.Element, world: xml.Element, actuator: xml.Element) -> None:
    """A foot under every vertex, pressed on the support plane by its share of the weight and by nothing else."""
    mass, load = scene.body.mass, scene.body.mass * scene.environment.gravity / len(scene.body.vertices)
    for k, (x, y) in enumerate(scene.body.vertices):
        foot = _add(body, "body", pos=[x, y, -FOOT_DEPTH])
        m = FOOT_MASS_SHARE * mass
        _add(foot, "inertial", pos=[0, 0, 0], mass=[m], diaginertia=[m * BEAD**2] * 3)
        _add(foot, "joint", name=f"foot{k}", type="slide", axis=[0, 0, 1])
        _add(foot, "geom", type="sphere", size=[BEAD], friction=[0, 0, 0], contype=FLOOR)
        _add(actuator, "motor", name=f"foot{k}", joint=f"foot{k}", gear=[-load])
    _plane(world, "support", [0, 0, -FOOT_DEPTH - BEAD], [0, 0, 1], scene.environment.support_friction, FLOOR)


def _plane(world: xml.Element, name: str, at: list, normal: list, friction: float, meets: str) -> None:
    shape = {"type": "plane", "size": [0, 0, 1], "pos": at, "zaxis": normal}
    _add(world, "geom", name=name, friction=[friction, 0, 0], conaffinity=meets, **shape)


def _finger(
    scene: Scene, c: int, world: xml.Element, actuator: xml.Element, settings: SimulatorSettings
) -> None:
    """A ball on two slides, each with a spring towards the command and a critical damper towards its velocity."""
    mass = FINGER_MASS_SHARE * scene.body.mass
    damping = 2 * np.sqrt(scene.stiffness * mass)
    finger = _add(world, "body", name=f"finger{c}")
    radius, mu = settings.finger_radius, 0.0 if settings.frictionless else scene.friction
    _add(finger, "inertial", pos=[0, 0, 0], mass=[mass], diaginertia=[mass * radius**2] * 3)
    _add(finger, "geom", type="sphere", size=[radius], friction=[mu, 0, 0], contype=FINGERS)
    for axis, direction in (("x", [1, 0, 0]), ("y", [0, 1, 0])):
        joint = f"finger{c}{axis}"
        _add(finger, "joint", name=joint, type="slide", axis=direction)
        _add(actuator, "position", name=f"spring{c}{axis}", joint=joint, kp=[scene.stiffness])
        _add(actuator, "velocity", name=f"damper{c}{axis}", joint=joint, kv=[damping])
    finger.set("gravcomp", "1")


def _add(parent: xml.Element, tag: str, **attributes: Any) -> xml.Element:
    """Child element; numbers are written with all their digits."""
    text = {
        key: value if isinstance(value, str) else " ".join(format(float(v), ".17g") for v in value)
        for key, value in attributes.items()
    }
    return xml.SubElement(parent, tag, text)
