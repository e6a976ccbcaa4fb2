"""Outlines from files: the same L from four forms, in metres about its centroid, or one line why there is none."""

import json
from pathlib import Path

import cv2
import ezdxf
import numpy as np
import pytest
from ezdxf import units

from certmanip.outlines import outline
from expert.errors import InvalidProblem
from expert.geometry.polygon import diameter, mass_properties, signed_area

L = np.array([[0, 0], [80, 0], [80, 30], [30, 30], [30, 60], [0, 60]], dtype=float)
"""y up."""
SVG = '<svg xmlns="http://www.w3.org/2000/svg">{}</svg>'


def svg(path: Path, content: str) -> Path:
    path.write_text(SVG.format(content))
    return path


def dxf(path: Path, corners: np.ndarray = L, unit: int = units.MM) -> Path:
    """Single lines, in no order and either way round."""
    drawing = ezdxf.new(units=unit)
    ends = list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
    for k in np.random.default_rng(0).permutation(len(ends)):
        drawing.modelspace().add_line(*ends[k][:: -1 if k % 2 else 1])
    drawing.saveas(path)
    return path


def geojson(path: Path, *rings: np.ndarray) -> Path:
    closed = [np.concatenate([ring, ring[:1]]).tolist() for ring in rings]
    feature = {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": closed}}
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    return path


def picture(path: Path, *, ground: int = 255, paint: tuple[int, ...] = (30, 60, 200)) -> Path:
    """The L as 80 x 60 pixels."""
    image = np.full((100, 120, 3), ground, dtype=np.uint8)
    image[20:50, 20:50] = paint
    image[50:80, 20:100] = paint
    cv2.imwrite(str(path), image)
    return path


def assert_is_the_l(found: np.ndarray, tolerance: float) -> None:
    wanted = 1e-3 * (L - mass_properties(L).centroid)
    assert signed_area(found) > 0
    assert len(found) == len(L)
    for corner in wanted:
        assert np.hypot(*(found - corner).T).min() < tolerance


def test_svg_with_transforms(tmp_path: Path) -> None:
    path = "M0 0 H15 V15 H40 V30 H0 Z"
    file = svg(tmp_path / "l.svg", f'<g transform="translate(7,9) scale(2)"><path d="{path}"/></g>')
    assert_is_the_l(outline(file, scale=1e-3), 1e-12)
    assert_is_the_l(outline(file, size=1e-3 * diameter(L)), 1e-12)


def test_svg_shapes_and_curves(tmp_path: Path) -> None:
    corners = " ".join(f"{x},{-y}" for x, y in L)
    assert_is_the_l(outline(svg(tmp_path / "p.svg", f'<polygon points="{corners}"/>'), scale=1e-3), 1e-12)
    disc = outline(svg(tmp_path / "c.svg", '<circle cx="3" cy="4" r="50"/>'), scale=1e-3)
    assert 8 < len(disc) < 64
    assert np.abs(np.hypot(*disc.T) - 0.05).max() < 0.005 * 0.1
    fine = outline(tmp_path / "c.svg", scale=1e-3, detail=0.0)
    assert len(fine) > len(disc)


def test_dxf_lines_join_and_units_are_known(tmp_path: Path) -> None:
    assert_is_the_l(outline(dxf(tmp_path / "l.dxf")), 1e-7)
    assert_is_the_l(outline(dxf(tmp_path / "cm.dxf", 0.1 * L, units.CM)), 1e-7)
    unknown = dxf(tmp_path / "none.dxf", L, 0)
    with pytest.raises(InvalidProblem, match="got neither"):
        outline(unknown)
    assert_is_the_l(outline(unknown, scale=1e-3), 1e-7)


def test_dxf_arcs(tmp_path: Path) -> None:
    drawing = ezdxf.new(units=units.MM)
    space = drawing.modelspace()
    space.add_lwpolyline([(0, 20), (40, 20), (40, 0), (0, 0)])
    space.add_arc((0, 10), 10, 90, 270)
    drawing.saveas(tmp_path / "d.dxf")
    found = outline(tmp_path / "d.dxf")
    np.testing.assert_allclose(np.ptp(found, axis=0), [0.05, 0.02], rtol=0.01)
    assert signed_area(found) == pytest.approx(8e-4 + 0.5e-4 * np.pi, rel=0.01)


def test_geojson(tmp_path: Path) -> None:
    assert_is_the_l(outline(geojson(tmp_path / "l.geojson", L[::-1]), scale=1e-3), 1e-12)


@pytest.mark.parametrize(("ground", "paint"), [(255, (30, 60, 200)), (0, (90, 200, 90))])
def test_pictures(tmp_path: Path, ground: int, paint: tuple[int, ...]) -> None:
    file = picture(tmp_path / "l.png", ground=ground, paint=paint)
    assert_is_the_l(outline(file, scale=1e-3), 1.5e-3)
    assert np.ptp(outline(file, scale=1e-3), axis=0) == pytest.approx([0.08, 0.06], abs=1e-9)


def test_pictures_with_transparency(tmp_path: Path) -> None:
    image = np.zeros((100, 120, 4), dtype=np.uint8)
    image[20:80, 20:100, 3] = 255
    cv2.imwrite(str(tmp_path / "t.png"), image)
    assert np.ptp(outline(tmp_path / "t.png", scale=1e-3), axis=0) == pytest.approx([0.08, 0.06])


HOLE = np.array([[10, 10], [20, 10], [20, 20]], dtype=float)
BAD = {
    "two": (lambda p: svg(p / "a.svg", '<rect width="2" height="1"/><rect x="5" width="2" height="1"/>'), "got 2; keep one"),
    "open": (lambda p: svg(p / "a.svg", '<path d="M0 0 H10 V10"/>'), "got none; close its lines"),
    "crossing": (lambda p: geojson(p / "a.geojson", L[[0, 2, 1, 4]]), "Self-intersection"),
    "hole": (lambda p: geojson(p / "a.geojson", L, HOLE), r"1 hole\(s\) in it; fill them"),
    "no drawing": (lambda p: svg(p / "a.svg", "<g>"), "expected an SVG drawing"),
    "no dxf": (lambda p: svg(p / "a.dxf", ""), "expected a DXF drawing"),
    "gap": (lambda p: dxf(p / "a.dxf", np.array([[0.0, 0.0], [1.0, 0.0]])), "got none"),
    "no json": (lambda p: svg(p / "a.geojson", ""), "expected GeoJSON"),
    "no picture": (lambda p: svg(p / "a.png", ""), "a picture that OpenCV can read"),
    "empty picture": (lambda p: picture(p / "a.png", paint=(255, 255, 255)), "got none"),
    "another ending": (lambda p: svg(p / "a.txt", ""), r"a file named \.svg"),
    "missing": (lambda p: p / "nothing.svg", "expected a file"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_simple_polygon_gets_one_line(name: str, tmp_path: Path) -> None:
    make, words = BAD[name]
    file = make(tmp_path)
    with pytest.raises(InvalidProblem, match=words) as refusal:
        outline(file, size=0.1)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("wrong", [{}, {"size": 1.0, "scale": 1.0}, {"size": -1.0}, {"scale": np.nan}, {"size": 1, "detail": 2}])  # fmt: skip
def test_a_wrong_measure_is_refused(wrong: dict[str, float], tmp_path: Path) -> None:
    with pytest.raises(InvalidProblem, match=r"size|scale|detail"):
        outline(geojson(tmp_path / "l.geojson", L), **wrong)
