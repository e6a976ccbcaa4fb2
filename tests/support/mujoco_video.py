"""Videos from another engine: MuJoCo's OpenGL renderer, which knows nothing of pixel coverage.

A lamp stands at one side, edges are smoothed by multisampling, and the camera is orthographic or a lens at 1.5 m.
OpenGL without a screen needs its own process: the first import of mujoco decides the backend.

    python -m tests.support.mujoco_video IN.npz OUT.npz
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from datasets.render import Camera, Frames
from expert.geometry.convex import convex_pieces
from expert.geometry.pose import Array

THICKNESS = 0.002
DISTANCE = 1.5
FINER = 4
"""The camera has so many times more pixels per side; their means are stored."""

SCENE = """
<mujoco>
  <visual>
    <quality offsamples="8"/>
    <global offwidth="{width}" offheight="{width}"/>
    <headlight ambient="0.55 0.55 0.55" diffuse="0.15 0.15 0.15" specular="0 0 0"/>
    <map znear="0.01"/>
  </visual>
  <asset>{meshes}</asset>
  <worldbody>
    <light pos="-0.3 -0.5 0.4" dir="0.4 1 -0.4" cutoff="85" exponent="1" diffuse="0.35 0.35 0.35" specular="0 0 0" castshadow="false"/>
    <camera name="camera" pos="{x} -{distance} {z}" xyaxes="1 0 0 0 0 1" {projection}/>
    <geom type="box" pos="0 {behind} 0" size="2 0.001 2" rgba="0.85 0.85 0.8 1"/>
    <geom type="box" pos="0 0 -0.5" size="2 {half} 0.5" rgba="0.25 0.35 0.45 1"/>
    <body><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 -1 0"/>{pieces}</body>
  </worldbody>
</mujoco>
"""


def mujoco_videos(
    scenes: list[tuple[Array, Array]], camera: Camera, *, perspective: bool = False
) -> list[Frames] | None:
    """Videos of polygons (V, 2) [m] at poses (T, 3); None where OpenGL cannot be used without a screen."""
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder) / "in.npz", Path(folder) / "out.npz"
        arrays = {
            f"{kind}{k}": a for k, scene in enumerate(scenes) for kind, a in zip("vp", scene, strict=True)
        }
        about = np.array([camera.size, camera.scale, camera.centre, camera.below, perspective], dtype=float)
        np.savez(given, about=about, **arrays)
        command = [sys.executable, "-m", "tests.support.mujoco_video", str(given), str(made)]
        done = subprocess.run(command, env={"MUJOCO_GL": "egl", **os.environ}, capture_output=True, text=True)
        if done.returncode:
            return None
        with np.load(made) as videos:
            return [videos[f"v{k}"] for k in range(len(scenes))]


def _model(vertices: Array, camera: Camera, perspective: bool) -> str:
    meshes, pieces = [], []
    for k, piece in enumerate(convex_pieces(vertices)):
        corners = [f"{x} {side * THICKNESS / 2} {y}" for side in (-1, 1) for x, y in piece]
        meshes.append(f'<mesh name="m{k}" vertex="{" ".join(corners)}"/>')
        pieces.append(f'<geom type="mesh" mesh="m{k}" rgba="0.8 0.3 0.2 1"/>')
    height = camera.size * camera.scale
    # The lens stands in front of the near face, which is what it sees.
    angle = 2 * np.degrees(np.arctan(height / 2 / (DISTANCE - THICKNESS / 2)))
    projection = f'fovy="{angle}"' if perspective else f'projection="orthographic" fovy="{height}"'
    return SCENE.format(
        width=camera.size * FINER,
        meshes="".join(meshes),
        pieces="".join(pieces),
        x=camera.centre,
        z=height / 2 - camera.below,
        distance=DISTANCE,
        projection=projection,
        behind=THICKNESS,
        half=THICKNESS / 2,
    )


def _render(vertices: Array, poses: Array, camera: Camera, perspective: bool) -> Frames:
    import mujoco

    model = mujoco.MjModel.from_xml_string(_model(vertices, camera, perspective))
    # Meshes are stored about their own centres; the body frame stays ours.
    data = mujoco.MjData(model)
    width = camera.size * FINER
    frames = []
    with mujoco.Renderer(model, width, width) as renderer:
        for pose in poses:
            data.qpos[:] = pose
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, "camera")
            fine = renderer.render().astype(float)
            blocks = fine.reshape(camera.size, FINER, camera.size, FINER, 3)
            frames.append(np.rint(blocks.mean(axis=(1, 3))))
    return np.array(frames, dtype=np.uint8)


def main() -> int:
    given, made = sys.argv[1:3]
    with np.load(given) as arrays:
        size, scale, centre, below, perspective = arrays["about"]
        camera = Camera(size=int(size), scale=scale, centre=centre, below=below)
        count = (len(arrays.files) - 1) // 2
        videos = {
            f"v{k}": _render(arrays[f"v{k}"], arrays[f"p{k}"], camera, bool(perspective))
            for k in range(count)
        }
    np.savez(made, **videos)
    return 0


if __name__ == "__main__":
    sys.exit(main())
