"""Video to polygon and poses: unmix colours, find the object, start, fit everything together, remove needless corners."""

import numpy as np

from datasets.render import Camera, Frames
from dlm.perception.appearance import Appearance, separate
from dlm.perception.contacts import snap_contacts
from dlm.perception.fit import Observation, Scene, calibrated, fit, without_outliers
from dlm.perception.prune import boundary_variance, prune
from dlm.perception.segment import Windows, segment
from dlm.perception.start import clearest_frames, first_scene
from dlm.perception.types import Perceived, PerceptionSettings
from expert.errors import InvalidProblem
from expert.geometry.polygon import mass_properties
from expert.geometry.pose import Array, to_body

MARGIN = 4
"""Pixels around the object that are looked at; more where the image is blurred."""
BLURRED_PASSES = 4
"""Fits with the object's colour corrected in between."""
STARTS = 3
POOR = 9.0
"""Mean square of the errors over that of the noise beyond which another start is tried."""


def perceive(
    video: Frames, camera: Camera | None = None, settings: PerceptionSettings | None = None
) -> Perceived:
    """Fit one moving polygon to a video (T >= 2, camera.size, camera.size, 3), uint8 RGB.

    Raises InvalidProblem (field `video`) for anything but one object that stays in view.
    """
    camera, settings = camera or Camera(), settings or PerceptionSettings()
    check_video(video, camera)
    look = separate(video, camera, settings.floor, settings.blur)
    windows = segment(look, MARGIN + int(np.ceil(3 * settings.blur)))
    seen = _observation(look, windows, settings)
    scene, seen = _best_start(seen, settings)
    scene, _ = prune(scene, seen)
    if settings.floor:
        scene = snap_contacts(scene, seen, camera.below / camera.scale, settings.snap)
    return _answer(scene, seen, camera, look)


def _best_start(seen: Observation, settings: PerceptionSettings) -> tuple[Scene, Observation]:
    """Fitted from the clearest frame's outline, or from another where that explains the video much better."""
    best, least = None, np.inf
    for reference in clearest_frames(seen)[:STARTS]:
        scene = first_scene(seen, int(reference), settings.most_vertices)
        trusted = without_outliers(scene, seen)
        for _ in range(BLURRED_PASSES if settings.blur > 0 else 1):
            trusted = calibrated(scene, trusted)
            scene, _ = fit(scene, trusted)
        _, error = boundary_variance(scene, seen)
        if error < least:
            best, least = (scene, trusted), error
        if error < POOR:
            break
    if best is None:
        raise RuntimeError("no start was tried")
    return best


def check_video(video: Frames, camera: Camera) -> None:
    """Raises InvalidProblem unless this is a video for that camera."""
    if not isinstance(video, np.ndarray) or video.ndim != 4 or video.shape[-1] != 3:
        got = f"shape {video.shape}" if isinstance(video, np.ndarray) else type(video).__name__
        raise InvalidProblem(
            "video", expected="an array (T, height, width, 3)", got=got, remedy="give RGB frames"
        )
    if video.dtype != np.uint8:
        bad = np.issubdtype(video.dtype, np.floating) and not np.isfinite(video).all()
        raise InvalidProblem(
            "video",
            expected="uint8 grey levels from 0 to 255",
            got=f"{video.dtype}" + (" with nan or inf" if bad else ""),
            remedy="round to whole numbers and convert",
        )
    if len(video) < 2:
        raise InvalidProblem(
            "video", expected="at least 2 frames", got=f"{len(video)}", remedy="give a longer clip"
        )
    if video.shape[1:3] != (camera.size, camera.size):
        raise InvalidProblem(
            "video",
            expected=f"frames of {camera.size} x {camera.size} pixels as the camera's",
            got=f"{video.shape[2]} x {video.shape[1]}",
            remedy="resize the frames or give their camera",
        )


def _observation(look: Appearance, windows: Windows, settings: PerceptionSettings) -> Observation:
    weight = np.where(look.foreign, 0.0, look.precision)
    return Observation(
        windows.cut(look.share), windows.cut(weight), windows.origins.astype(float), settings.blur
    )


def _answer(scene: Scene, seen: Observation, camera: Camera, look: Appearance) -> Perceived:
    """In metres, about the centroid, the lowest vertex first."""
    outline = to_metres(scene.placed(), camera)
    low = np.flatnonzero(outline[0, :, 1] < outline[0, :, 1].min() + 0.1 * camera.scale)
    first = int(low[outline[0, low, 0].argmin()])
    outline = np.roll(outline, -first, axis=1)
    centres = np.array([mass_properties(corners).centroid for corners in outline])
    poses = np.column_stack([centres, scene.motion[:, 2]])
    _, variance = boundary_variance(scene, seen)
    residual = look.noise * np.sqrt(variance)
    return Perceived(vertices=to_body(poses[0], outline[0]), poses=poses, residual=residual, noise=look.noise)


def to_metres(points: Array, camera: Camera) -> Array:
    """Pixel coordinates (X, Y upwards) as world points [m]."""
    return camera.to_world(points * [1, -1] + [0, camera.size])
