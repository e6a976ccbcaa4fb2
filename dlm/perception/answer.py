"""The fitted scene as the labels of a data set describe one, and whether it explains the video."""

from dataclasses import dataclass
from typing import cast

import numpy as np
import shapely
from scipy.ndimage import uniform_filter

from datasets.render import Camera
from dlm.perception.appearance import Appearance
from dlm.perception.fit import MovingPolygon, Observation, modelled
from dlm.perception.raster import is_simple
from dlm.perception.types import Perceived, PerceptionSettings, Status
from expert.geometry.polygon import mass_properties, signed_area
from expert.geometry.pose import Array, to_body

UNEXPLAINED = 4.0
"""Rms difference that even a noiseless video may have [grey levels]."""
MOST_HIDDEN = 0.4
"""Share of the outline, over all frames, that may be hidden."""
ODD = 0.15
"""Error of coverage, mean over 3 x 3 pixels, that even a noiseless video may have."""
LOW = 0.1
"""Vertices as low as the lowest, when the first one is chosen [pixels]."""


@dataclass(frozen=True)
class Evidence:
    """What the fit is held against: pixels that were trusted in the end, all that show object or background, and colours."""

    trusted: Observation
    everything: Observation
    look: Appearance


def answer(
    scene: MovingPolygon, evidence: Evidence, camera: Camera, settings: PerceptionSettings
) -> Perceived:
    """In metres, about the centroid, the lowest vertex first."""
    look = evidence.look
    residual, hidden = explained(scene, evidence.trusted, look)
    status, reason = _verdict(scene, evidence, residual, hidden, settings)
    placed = scene.placed() if is_simple(scene.vertices) else _hull(scene)
    outline = camera.to_world(placed * [1, -1] + [0, camera.size])
    low = np.flatnonzero(outline[0, :, 1] < outline[0, :, 1].min() + LOW * camera.scale)
    first = int(low[outline[0, low, 0].argmin()])
    outline = np.roll(outline, -first, axis=1)
    centres = np.array([mass_properties(corners).centroid for corners in outline])
    # The fit may end whole turns away; from step to step the object takes the shorter way.
    poses = np.column_stack([centres, np.unwrap(scene.motion[:, 2])])
    return Perceived(
        vertices=to_body(poses[0], outline[0]),
        poses=poses,
        residual=residual,
        noise=look.noise,
        status=status,
        reason=reason,
    )


def explained(scene: MovingPolygon, seen: Observation, look: Appearance) -> tuple[float, float]:
    """Rms error of the pixels that the outline crosses [grey levels], and the share of these that are hidden."""
    share, gradient = modelled(scene, seen)
    edge = np.abs(gradient).sum(axis=(-1, -2)) > 1e-3
    visible = edge & (seen.weight > 0)
    hidden = 1 - float(visible.sum()) / max(int(edge.sum()), 1)
    squares = (share - seen.share)[visible] ** 2
    return float(np.median(look.contrast) * np.sqrt(squares.mean())) if visible.any() else np.inf, hidden


def odd_spot(scene: MovingPolygon, seen: Observation) -> float:
    """Largest error of coverage, mean over 3 x 3 pixels, next to the object: noise is small there, a finger in the object's
    colour is not."""
    share, _ = modelled(scene, seen)
    error = np.where(seen.weight > 0, share - seen.share, 0.0)
    return float(np.abs(uniform_filter(error, size=(1, 3, 3))).max())


def _verdict(
    scene: MovingPolygon, evidence: Evidence, residual: float, hidden: float, settings: PerceptionSettings
) -> tuple[Status, str]:
    noise = evidence.look.noise
    allowed = settings.tolerance * noise + UNEXPLAINED
    if not is_simple(scene.vertices):
        return "poor_fit", "the outline crosses itself; its convex hull is given"
    if residual > allowed:
        return (
            "poor_fit",
            f"video and model differ by {residual:.1f} grey levels along the outline, more than {allowed:.1f}",
        )
    spot = odd_spot(scene, evidence.everything)
    if spot > ODD + noise / float(np.median(evidence.look.contrast)):
        return (
            "poor_fit",
            f"next to the object {100 * spot:.0f} % of a few pixels change with it but are no part of its outline",
        )
    if hidden > MOST_HIDDEN:
        return (
            "poor_fit",
            f"{100 * hidden:.0f} % of the outline is hidden, more than {100 * MOST_HIDDEN:.0f} %",
        )
    return "ok", ""


def _hull(scene: MovingPolygon) -> Array:
    """The scene with the convex hull of its vertices."""
    hull = np.array(cast(shapely.Polygon, shapely.MultiPoint(scene.vertices).convex_hull).exterior.coords)[
        :-1
    ]
    hull = hull if signed_area(hull) > 0 else hull[::-1]
    return MovingPolygon(hull, scene.motion, scene.centre).placed()
