"""Checks of a shape's surface before a part is taken out of it."""

from pathlib import Path

import numpy as np

from chamberopt.design.shapes.construction.surface import TAG_SONOTRODE, TAG_WALL, ShapeSurface
from chamberopt.geometry.mesh_io.self_intersection import refuse_self_intersection
from chamberopt.geometry.mesh_io.surface_error import SurfaceError, format_point
from chamberopt.geometry.triangles import area_vectors, find_shells

MAX_WIDTH = 10.0  # m: shipped shapes are smaller; a chamber with mm taken for m is larger


def find_fault(cavity: object) -> str | None:
    """What is wrong with a surface, to follow the words "the surface"; None if it can be used."""
    if not isinstance(cavity, ShapeSurface):
        given = type(cavity).__name__
        return f"gives {given}; it must give a chamberopt.design.shapes.ShapeSurface"
    try:
        vertices = np.asarray(cavity.vertices, dtype=np.float64)
        triangles, tags = np.asarray(cavity.triangles), np.asarray(cavity.tags)
    except (TypeError, ValueError):
        return "has vertices, triangles or tags that are not arrays of numbers"
    if any(array.ndim != 2 or array.shape[1] != 3 for array in (vertices, triangles)):
        shapes = f"vertices {vertices.shape} and triangles {triangles.shape}"
        return f"has {shapes}; their shapes must be (n, 3) and (m, 3)"
    if triangles.dtype.kind not in "iu" or len(triangles) < 4:
        return "has triangles that are not at least four rows of vertex numbers"
    if triangles.min() < 0 or triangles.max() >= len(vertices) or not np.isfinite(vertices).all():
        return "has triangles whose vertices do not exist or are not finite numbers"
    if tags.shape != triangles.shape[:1] or not np.isin(tags, (TAG_SONOTRODE, TAG_WALL)).all():
        return "must tag each triangle as TAG_SONOTRODE or TAG_WALL"
    width = float(np.ptp(vertices, axis=0).max())
    if width > MAX_WIDTH:
        limit = f"at most {MAX_WIDTH:g} m is allowed"
        return f"is {width:.4g} m wide; {limit}; its vertices are in metres, not mm"
    fault = _closure_fault(vertices, triangles) or _floor_fault(vertices, triangles, tags)
    return fault or _crossing_fault(vertices, triangles)


def with_array_types(cavity: ShapeSurface) -> ShapeSurface:
    """A surface without a fault, with the array types that a ShapeSurface promises and no part."""
    arrays = (cavity.vertices, np.float64), (cavity.triangles, np.int32), (cavity.tags, np.uint8)
    return ShapeSurface(*(np.asarray(array, dtype=kind) for array, kind in arrays))


def _closure_fault(vertices: np.ndarray, triangles: np.ndarray) -> str | None:
    count = len(vertices)
    a, b = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).T.astype(np.int64)
    there, back = np.sort(a * count + b), np.sort(b * count + a)
    if (there[1:] == there[:-1]).any() or not np.array_equal(there, back):
        lone = np.setdiff1d(there, back)
        near = np.round(1e3 * vertices[lone[0] // count], 3).tolist() if lone.size else None
        place = "" if near is None else f", near {near} mm"
        rule = "each side of a triangle must meet one other, run the other way"
        return f"is not closed: {rule}{place}"
    _, volumes = find_shells(vertices, triangles)
    if len(volumes) > 1:
        return f"is in {len(volumes)} pieces; it must be one closed surface"
    return "is inside out: normals must point out of the cavity" if volumes[0] <= 0.0 else None


def _floor_fault(vertices: np.ndarray, triangles: np.ndarray, tags: np.ndarray) -> str | None:
    floor = triangles[tags == TAG_SONOTRODE]
    if not len(floor):
        return "has no triangle tagged TAG_SONOTRODE"
    if vertices[floor][..., 2].any() or (area_vectors(vertices, floor)[:, 2] > 0.0).any():
        return "has a sonotrode that is not the floor at z = 0, facing down"
    low = vertices[triangles][..., 2].min()
    return f"goes below the sonotrode, to z = {1e3 * low:.4g} mm" if low < 0.0 else None


def _crossing_fault(vertices: np.ndarray, triangles: np.ndarray) -> str | None:
    try:
        refuse_self_intersection(Path(), vertices, triangles)
    except SurfaceError as error:
        return f"crosses itself, near {format_point(error.edges.reshape(-1, 3).mean(axis=0))}"
    return None
