"""Video to polygon and poses: unmix colours, find the object, start, fit everything together, remove needless corners."""

import numpy as np

from datasets.render import Camera, Frames
from dlm.perception.answer import Evidence, answer
from dlm.perception.appearance import Appearance, separate
from dlm.perception.contacts import snap_contacts
from dlm.perception.fit import MovingPolygon, Observation, calibrated, fit, without_outliers
from dlm.perception.prune import boundary_variance, prune
from dlm.perception.segment import MARGIN, Windows, segment
from dlm.perception.start import clearest_frames, first_scene
from dlm.perception.types import Perceived, PerceptionSettings
from dlm.perception.video import check_video

BLURRED_PASSES = 4
"""Fits with the object's colour corrected in between."""
FINER = 2
"""A finer outline has so many times more corners."""
POOR = 12.0
"""Mean square of the errors over that of the noise beyond which another start is tried."""


def perceive(
    video: Frames, camera: Camera | None = None, settings: PerceptionSettings | None = None
) -> Perceived:
    """Fit one moving polygon to a video (T >= 2, camera.size, camera.size, 3), uint8 RGB.

    Raises InvalidProblem (field `video`) for anything but one object that stays in view.
    """
    camera, settings = camera or Camera(), settings or PerceptionSettings()
    check_video(video, camera)
    look = separate(video, camera, settings.floor, settings.blur, settings.codec)
    windows = segment(look, MARGIN + int(np.ceil(3 * settings.blur)))
    seen = _observation(look, windows, settings)
    everything = seen
    scene, seen = _best_start(seen, settings)
    scene, _ = prune(scene, seen)
    if settings.floor:
        scene = snap_contacts(scene, seen, camera.below / camera.scale, settings.snap)
    return answer(scene, Evidence(seen, everything, look), camera, settings)


def _best_start(seen: Observation, settings: PerceptionSettings) -> tuple[MovingPolygon, Observation]:
    """Fitted from the clearest frame's outline; where that explains little, from a finer one, then from another frame."""
    first, second = (int(t) for t in clearest_frames(seen)[:2])
    fine = FINER * settings.most_vertices
    best, least = _started(seen, first, settings.most_vertices, settings)
    for reference in (first, second):
        if least < POOR:
            break
        other, error = _started(seen, reference, fine, settings)
        if error < least:
            best, least = other, error
    return best


def _started(
    seen: Observation, reference: int, most_vertices: int, settings: PerceptionSettings
) -> tuple[tuple[MovingPolygon, Observation], float]:
    """MovingPolygon fitted from one frame's outline, the observation without what hides it, and the error over the noise's."""
    scene = first_scene(seen, reference, most_vertices)
    trusted = without_outliers(scene, seen)
    for _ in range(BLURRED_PASSES if settings.blur > 0 else 1):
        trusted = calibrated(scene, trusted)
        scene, _ = fit(scene, trusted)
    return (scene, trusted), boundary_variance(scene, seen)[1]


def _observation(look: Appearance, windows: Windows, settings: PerceptionSettings) -> Observation:
    weight = np.where(look.foreign, 0.0, look.precision)
    return Observation(
        windows.cut(look.share), windows.cut(weight), windows.origins.astype(float), settings.blur
    )
