"""Outlines of objects from drawings (SVG, DXF), maps (GeoJSON) and pictures: one simple polygon without holes, or one line why not."""

import json
import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry import shape

from certmanip.installation import explained
from expert.errors import InvalidProblem
from expert.geometry.polygon import diameter
from expert.geometry.pose import Array
from expert.world.values import require

CURVE = 64
"""Points that stand for one curve of a drawing before needless ones are left out."""
SPECK = 1e-3
"""Regions of a picture below this share of the largest are dirt."""
JOINED = 1e-6
"""Ends of lines that are nearer than this share of a drawing's extent meet."""
Drawing = tuple[list[shapely.Polygon], float | None]
"""Polygons in the file's units, y up, and metres per unit where the file says them."""


def outline(
    path: str | os.PathLike[str],
    *,
    size: float | None = None,
    scale: float | None = None,
    detail: float = 0.005,
) -> Array:
    """Vertices (V, 2) [m] of the one closed outline in a file, counter-clockwise about its centroid, y up.

    .svg, .dxf, .geojson or .json, or a picture of one object before a plain ground (or with transparency).
    size: greatest extent of the object [m]; or scale: metres per unit of the file, or per pixel; a DXF file may say its units.
    detail: share of the extent by which curves, stairs of pixels and needless corners may be off.
    Raises InvalidProblem, and IncompleteInstallation without the extra `outlines` (pictures: `learn`).
    """
    file = Path(path)
    require(file.is_file(), "outline", "a file", f"{file}, which is none")
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        raise InvalidProblem("outline", expected="a file named " + ", ".join(READERS), got=str(file))
    require(0 <= detail < 0.2, "detail", "a fraction from 0 to 0.2", detail)
    for name, value in (("size", size), ("scale", scale)):
        require(value is None or 0 < value < np.inf, name, "a positive number of metres", value)
    polygons, unit = reader(file)
    polygon = _only(polygons)
    extent = diameter(np.array(polygon.exterior.coords))
    polygon = shapely.orient_polygons(polygon.simplify(detail * extent))
    vertices = np.array(polygon.exterior.coords)[:-1]
    return _scale(vertices, size, scale, unit) * (vertices - np.array(polygon.centroid.coords[0]))


def _scale(vertices: Array, size: float | None, scale: float | None, unit: float | None) -> float:
    """Metres per unit of the file."""
    known = (size is not None) + (scale is not None)
    if known == 0 and unit is not None:
        return unit
    what = "size (greatest extent in metres) or scale (metres per unit of the file)"
    require(known == 1, "size", what, "both" if known else "neither", "give one of them")
    return size / diameter(vertices) if size is not None else float(scale or 0.0)


def _only(polygons: list[shapely.Polygon]) -> shapely.Polygon:
    """The one polygon of a drawing, if it is simple."""
    what = "one closed outline without holes"
    remedy = "keep one in the file" if polygons else "close its lines"
    require(len(polygons) == 1, "outline", what, len(polygons) or "none", remedy)
    (polygon,) = polygons
    holes = len(polygon.interiors)
    require(holes == 0, "outline", what, f"{holes} hole(s) in it", "fill them")
    fault = shapely.is_valid_reason(polygon)
    require(bool(polygon.is_valid), "outline", "a simple polygon", fault, "lines must not cross")
    require(polygon.area > 0, "outline", "a polygon", "one without area")
    return polygon


def _polygons(rings: Iterable[Array]) -> list[shapely.Polygon]:
    return [shapely.Polygon(ring) for ring in rings if len(np.unique(ring, axis=0)) >= 3]


def _read_svg(file: Path) -> Drawing:
    """Closed paths and basic shapes, transforms applied; y points down in the file.  Open lines bound nothing."""
    with explained():
        from svgpathtools import Document, Line
    from xml.etree.ElementTree import ParseError

    try:
        paths = Document(str(file)).paths()
        parts = [part for path in paths for part in path.continuous_subpaths() if part.isclosed()]
    except (ParseError, ValueError, AssertionError) as error:
        raise InvalidProblem("outline", expected="an SVG drawing", got=f"{file}: {error}") from error
    along = np.linspace(0, 1, CURVE, endpoint=False)
    rings = []
    for part in parts:
        corners = [
            [piece.start] if isinstance(piece, Line) else [piece.point(t) for t in along] for piece in part
        ]
        ring = np.concatenate(corners)
        rings.append(np.column_stack([ring.real, -ring.imag]))
    return _polygons(rings), None


def _read_dxf(file: Path) -> Drawing:
    """Whatever lines, arcs, polylines, circles, ellipses and splines of the model space enclose."""
    with explained():
        import ezdxf
        from ezdxf import path as dxf
        from ezdxf import units
        from ezdxf.enums import InsertUnits

    try:
        drawing = ezdxf.readfile(file)
    except (ezdxf.DXFError, OSError, UnicodeDecodeError) as error:
        raise InvalidProblem("outline", expected="a DXF drawing", got=f"{file}: {error}") from error
    kinds = "LINE ARC LWPOLYLINE POLYLINE CIRCLE ELLIPSE SPLINE"
    paths = [dxf.make_path(entity) for entity in drawing.modelspace().query(kinds)]
    if not paths:
        return [], None
    box = dxf.bbox(paths)
    extent = max(box.size.x, box.size.y)
    lines = [
        np.array([(p.x, p.y) for p in path.flattening(1e-3 * extent, segments=CURVE // 4)])
        for path in paths
        if len(path)
    ]
    unit = drawing.units if drawing.units in set(InsertUnits) else 0
    known = units.conversion_factor(InsertUnits(unit), InsertUnits.Meters) if unit else None
    return _enclosed(lines, JOINED * extent), known


def _enclosed(lines: list[Array], near: float) -> list[shapely.Polygon]:
    """Faces of the plane that lines (k, 2) cut out, ends joined that are nearer than `near`."""
    snapped = shapely.set_precision([shapely.LineString(line) for line in lines], near)
    faces = shapely.polygonize(list(shapely.get_parts(shapely.node(shapely.union_all(snapped)))))
    return list(shapely.get_parts(faces))


def _read_geojson(file: Path) -> Drawing:
    """Polygons of any geometry, feature or collection, their coordinates taken as those of a plane."""
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
        features = data["features"] if data.get("type") == "FeatureCollection" else [data]
        found = [shape(feature.get("geometry", feature)) for feature in features]
    except (OSError, ValueError, TypeError, AttributeError, KeyError, shapely.errors.ShapelyError) as error:
        fault = error if isinstance(error, OSError | ValueError) else "no geometry in it"
        raise InvalidProblem("outline", expected="GeoJSON", got=f"{file}: {fault}"[:200]) from error
    parts = [part for geometry in found for part in shapely.get_parts(shapely.force_2d(geometry))]
    return [part for part in parts if isinstance(part, shapely.Polygon)], None


def _read_picture(file: Path) -> Drawing:
    """The region that differs from the ground: by transparency, or by grey level (Otsu) from what most of the border is."""
    with explained():
        import cv2

    image, grey = (cv2.imread(str(file), way) for way in (cv2.IMREAD_UNCHANGED, cv2.IMREAD_GRAYSCALE))
    if image is None or grey is None:
        raise InvalidProblem("outline", expected="a picture that OpenCV can read", got=str(file))
    if image.ndim == 3 and image.shape[2] == 4 and np.ptp(image[..., 3]):
        mask = image[..., 3] > 127
    else:
        _, white = cv2.threshold(grey, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
        mask = np.asarray(white) > 0
        border = np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]])
        mask ^= border.mean() > 0.5
    contours, family = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    areas = [cv2.contourArea(contour) for contour in contours]
    large = [k for k, area in enumerate(areas) if area > SPECK * max(areas)]
    outer = [k for k in large if family[0, k, 3] < 0]
    holes = [contours[k][:, 0, :] * [1.0, -1.0] for k in large if family[0, k, 3] >= 0]
    whole = [shapely.Polygon(contours[k][:, 0, :] * [1.0, -1.0]) for k in outer]
    # A contour goes through the middles of the outermost pixels.
    grown = [
        shapely.difference(p.buffer(0.5, join_style="mitre"), shapely.union_all(_polygons(holes)))
        for p in whole
    ]
    return [polygon.simplify(1.0) for polygon in grown], None


READERS = {
    ".svg": _read_svg,
    ".dxf": _read_dxf,
    ".geojson": _read_geojson,
    ".json": _read_geojson,
    **dict.fromkeys((".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp"), _read_picture),
}
"""By the ending of a file's name."""
