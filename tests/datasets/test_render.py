"""Frames show the polygon where it is, to a small part of a pixel."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from datasets.motions import FAMILIES, sample_task
from datasets.render import Camera, Palette, coverage, ground_coverage, render
from datasets.shapes import Shapes, sample_polygon
from expert.errors import InvalidProblem
from expert.geometry.polygon import mass_properties
from expert.geometry.pose import Array, to_world

CAMERA, PALETTE = Camera(), Palette()
seeds = st.integers(0, 2**32)


def polygon(seed: int) -> Array:
    """Somewhere in view, turned anyhow."""
    rng = np.random.default_rng(seed)
    kind = Shapes(facets=(4, 6)) if seed % 2 else Shapes(facets=(12, 12))
    return to_world(
        [rng.uniform(-0.02, 0.02), rng.uniform(0.06, 0.10), rng.uniform(0, 6)], sample_polygon(rng, kind)
    )


def exact_coverage(vertices: Array, camera: Camera) -> Array:
    """Area of the intersection with each pixel's square, by polygon clipping."""
    shape = shapely.Polygon(camera.to_pixels(vertices))
    k = np.arange(camera.size)
    columns, rows = np.meshgrid(k, k)
    return shapely.area(shapely.intersection(shape, shapely.box(columns, rows, columns + 1, rows + 1)))


@settings(max_examples=30, deadline=None)
@given(seed=seeds)
def test_coverage_is_that_of_polygon_clipping(seed: int) -> None:
    vertices = polygon(seed)
    error = coverage(vertices, CAMERA) - exact_coverage(vertices, CAMERA)
    assert np.abs(error).max() < 0.12  # at most a row of cells and a corner
    assert np.sqrt((error**2).mean()) < 0.01


@settings(max_examples=30, deadline=None)
@given(seed=seeds)
def test_area_and_centroid_of_the_pixels_are_the_polygons(seed: int) -> None:
    vertices = polygon(seed)
    share, truth = coverage(vertices, CAMERA), mass_properties(vertices)
    perimeter = shapely.Polygon(vertices).length
    assert abs(share.sum() * CAMERA.scale**2 - truth.area) < 1e-4 * perimeter  # 0.1 mm of inflation
    centres = np.stack(np.meshgrid(*[np.arange(CAMERA.size) + 0.5] * 2), axis=-1)
    centroid = CAMERA.to_world((centres * share[..., None]).sum((0, 1)) / share.sum())
    assert np.abs(centroid - truth.centroid).max() < 2e-4


def test_outlines_are_not_inflated_on_average() -> None:
    """OpenCV paints every cell that an outline crosses; uncorrected, shapes grow by 0.125 mm."""
    growth = []
    for seed in range(150):
        vertices = polygon(seed)
        excess = coverage(vertices, CAMERA).sum() * CAMERA.scale**2 - mass_properties(vertices).area
        growth.append(excess / shapely.Polygon(vertices).length)
    assert abs(np.mean(growth)) < 2e-5


@pytest.mark.parametrize("family", FAMILIES)
def test_object_and_ground_have_their_colours_in_every_frame(family: str) -> None:
    task = sample_task(np.random.default_rng(3), family)
    frames = render(task.body.vertices, task.trajectory.poses)
    assert frames.shape == (5, 50, 50, 3)
    assert frames.dtype == np.uint8
    for frame, pose in zip(frames, task.trajectory.poses, strict=True):
        inside = coverage(to_world(pose, task.body.vertices), CAMERA) == 1
        assert inside.sum() > 20
        assert (frame[inside] == PALETTE.object).all()
        assert (frame[-5:] == PALETTE.ground).all()
        assert (frame[0] == PALETTE.background).all()
        away = coverage(to_world(pose, task.body.vertices), CAMERA)[:-5] == 0
        assert (frame[:-5][away] == PALETTE.background).all()


def test_an_edge_pixel_mixes_its_colours_by_coverage() -> None:
    half = np.array([[-0.02, 0.04], [0.02, 0.04], [0.02, 0.062], [-0.02, 0.062]])  # its top lies mid-pixel
    frame = render(half - half.mean(axis=0), np.array([[*half.mean(axis=0), 0.0]]))[0].astype(float)
    row = int(CAMERA.to_pixels(np.array([0.0, 0.062]))[1])
    expected = (np.array(PALETTE.object) + np.array(PALETTE.background)) / 2
    assert np.abs(frame[row, 25] - expected).max() <= 10


def test_the_ground_surface_may_cut_through_a_pixel() -> None:
    share = ground_coverage(Camera(below=0.018))
    assert np.allclose(share[-4:], 1)
    assert np.allclose(share[-5], 0.5)
    assert np.allclose(share[:-5], 0)


@given(x=st.floats(-1, 1), y=st.floats(-1, 1), centre=st.floats(-0.1, 0.1), below=st.floats(0, 0.1))
def test_pixels_and_world_are_inverse(x: float, y: float, centre: float, below: float) -> None:
    camera = Camera(centre=centre, below=below)
    assert np.allclose(camera.to_world(camera.to_pixels(np.array([x, y]))), [x, y], atol=1e-12)


def test_up_is_up_and_a_pixel_is_four_millimetres() -> None:
    low, high = CAMERA.to_pixels(np.array([[0.0, 0.0], [0.004, 0.004]]))
    assert np.allclose(low, [25, 45])
    assert np.allclose(high - low, [1, -1])


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: Camera(size=2), "camera.size"),
        (lambda: Camera(scale=0.0), "camera.scale"),
        (lambda: Camera(below=1.0), "camera.below"),
        (lambda: Camera(centre=float("nan")), "camera.centre"),
        (lambda: Palette(object=(0, 0, 256)), "palette.object"),
    ],
)
def test_a_senseless_camera_is_refused_by_name(make, field: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^{field}: expected "):
        make()
