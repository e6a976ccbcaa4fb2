"""Video files written by OpenCV, as a user would have them."""

from pathlib import Path

import cv2
import numpy as np

from datasets.render import Camera, Frames, Palette, render
from expert.geometry.pose import Array

SIZE, SCALE = 200, 0.001
"""Side of the pictures [pixels], metres per pixel: the data sets' view at a finer resolution."""
CAMERA = Camera(size=SIZE, scale=SCALE)


def drawn(vertices: Array, poses: Array, palette: Palette | None = None) -> Frames:
    return render(vertices, poses, CAMERA, palette)


def write_clip(path: Path, frames: Frames, rate: float = 10.0, codec: str = "mp4v") -> Path:
    height, width = frames.shape[1:3]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), rate, (width, height))
    for frame in frames:
        writer.write(np.ascontiguousarray(frame[..., ::-1]))
    writer.release()
    assert path.stat().st_size > 0
    return path
