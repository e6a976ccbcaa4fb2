"""The free component in three dimensions."""

import numpy as np
import shapely

from expert.drawing.cage_component import draw_component, linked_slices
from expert.drawing.canvas import new_figure
from expert.problems.cage import Arrangement
from expert.verify.cage.check import verify_cage
from expert.world.named import named_shape
from expert.world.shape import Shape


def arrangement(name: str, fingers: list) -> Arrangement:
    return Arrangement(shape=Shape(vertices=named_shape(name)), pose=np.zeros(3), fingers=np.array(fingers))


def test_linked_slices_leave_out_what_the_start_cannot_reach() -> None:
    a = arrangement("I", [[-0.02, 0], [0.02, 0]])
    angles = np.radians(np.linspace(-20, 20, 9))
    reached = linked_slices(a, angles)
    assert all(len(parts) == 1 for parts in reached)
    assert reached[4][0].covers(shapely.Point(0, 0))


def test_the_axes_enclose_what_the_object_can_reach_and_the_start() -> None:
    a = arrangement("I", [[-0.02, 0], [0.02, 0]])
    axes = new_figure(4, 4).add_subplot(projection="3d")
    report = verify_cage(a)
    draw_component(axes, a, report)
    low, high = np.degrees(report.rotation_range or (0, 0))
    bottom, top = axes.get_zlim()
    assert low - 1 < bottom < 0 < top < high + 1
    assert axes.get_xlim()[0] < 0 < axes.get_xlim()[1]
    assert axes.get_title() == "all that the object can reach"
    assert [axis.get_label_text() for axis in (axes.xaxis, axes.yaxis, axes.zaxis)] == [
        "Δx [mm]",
        "Δy [mm]",
        "Δθ [deg]",
    ]


def test_a_way_out_is_a_line_from_the_start() -> None:
    a = arrangement("I", [[-0.02, 0], [0.08, 0]])
    axes = new_figure(4, 4).add_subplot(projection="3d")
    report = verify_cage(a)
    draw_component(axes, a, report)
    (line,) = axes.lines
    x, y, turned = line.get_data_3d()
    np.testing.assert_allclose([x[0], y[0], turned[0]], 0, atol=1e-9)
    np.testing.assert_allclose([x[-1], y[-1]], 1e3 * report.path[-1, :2])
