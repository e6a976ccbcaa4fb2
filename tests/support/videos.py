"""Rendered tasks, and how far what is perceived is from the truth."""

import numpy as np
import shapely

from datasets.motions import NoRoom, sample_task
from datasets.render import Frames, render
from datasets.shapes import ShapeFamily
from dlm.perception import Perceived
from expert.geometry.polygon import mass_properties
from expert.geometry.pose import Array
from expert.problems.contact import ContactTask

LEANING = np.array([[-0.03, -0.02], [0.03, -0.02], [0.04, 0.01], [-0.01, 0.035]])


LEANING = LEANING - mass_properties(LEANING).centroid


PATH = np.array(
    [[-0.02, 0.06, 0.0], [-0.01, 0.08, 0.1], [0.0, 0.09, 0.2], [0.01, 0.08, 0.3], [0.02, 0.07, 0.35]]
)


def task_of(family: str, shapes: ShapeFamily | None = None, seed: int = 0) -> ContactTask:
    for attempt in range(20):
        try:
            return sample_task(np.random.default_rng([seed, attempt]), family, shapes)
        except NoRoom:
            continue
    raise AssertionError(f"20 shapes in a row without a motion of the family {family}")


def video_of(task: ContactTask) -> Frames:
    return render(task.body.vertices, task.trajectory.poses)


def errors(seen: Perceived, vertices: Array, poses: Array) -> tuple[float, float, float]:
    """Degrees, and millimetres of the centre and the outline."""
    off = np.abs(seen.poses - poses).max(axis=0)
    outlines = [shapely.Polygon(v).exterior for v in (vertices, seen.vertices)]
    return np.degrees(off[2]), 1e3 * off[:2].max(), 1e3 * outlines[0].hausdorff_distance(outlines[1])
