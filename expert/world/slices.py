"""Exact slices of configuration space at one orientation: obstacles and free components of the body frame's origin [m]."""

import numpy as np
import shapely

from expert.geometry.pose import Array, rotation
from expert.world.shape import Shape


def obstacles_at(shape: Shape, fingers: Array, walls: Array, angle: float) -> list[shapely.Polygon]:
    """Positions (x, y) [m] of the body frame at which a finger (N, 2) or a wall (W, 2, 2) is inside the object, one polygon each."""
    turned = shape.vertices @ rotation(angle).T
    obstacles = [shapely.Polygon(finger - turned) for finger in fingers]
    for ends in walls:
        swept = [
            shapely.MultiPoint((ends[:, None] - piece @ rotation(angle).T).reshape(-1, 2)).convex_hull
            for piece in shape.pieces
        ]
        obstacles.append(shapely.union_all(swept))
    return obstacles


def free_components(
    shape: Shape, fingers: Array, walls: Array, angle: float, *, bounded: bool = True
) -> list[shapely.Polygon]:
    """Connected parts of the free positions; `bounded`: without the one that reaches to infinity."""
    union = shapely.union_all(obstacles_at(shape, fingers, walls, angle))
    low, high = np.reshape(union.bounds, (2, 2))
    box = shapely.box(*(low - 1), *(high + 1))
    parts = shapely.get_parts(box.difference(union))
    return [p for p in parts if not (bounded and p.bounds == box.bounds)]
