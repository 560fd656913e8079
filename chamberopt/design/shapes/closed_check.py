"""What a cavity's surface must be before a part can be taken out of it."""

from pathlib import Path

import numpy as np

from chamberopt.design.shapes.construction.surface import TAG_SONOTRODE, TAG_WALL, ShapeSurface
from chamberopt.geometry.mesh_io import SurfaceError, format_point
from chamberopt.geometry.mesh_io.self_intersection import refuse_self_intersection
from chamberopt.geometry.triangles import area_vectors, find_shells

MOST_ACROSS = (
    10.0  # m: more than the shipped shapes can be, less than a chamber whose mm are taken for m
)


def fault(cavity: object) -> str | None:
    """What is wrong with it, to follow the words "the surface"; None for a sound one."""
    if not isinstance(cavity, ShapeSurface):
        return f"gives {type(cavity).__name__}; a chamberopt.design.shapes.ShapeSurface is wanted"
    try:
        vertices = np.asarray(cavity.vertices, dtype=np.float64)
        triangles, tags = np.asarray(cavity.triangles), np.asarray(cavity.tags)
    except (TypeError, ValueError):
        return "holds what is no array of numbers"
    if (
        vertices.ndim != 2
        or vertices.shape[1:] != (3,)
        or triangles.ndim != 2
        or triangles.shape[1:] != (3,)
    ):
        return f"has vertices {vertices.shape} and triangles {triangles.shape}; (n, 3) and (m, 3) are wanted"
    if triangles.dtype.kind not in "iu" or len(triangles) < 4:
        return "has triangles that are not at least four rows of vertex numbers"
    if triangles.min() < 0 or triangles.max() >= len(vertices) or not np.isfinite(vertices).all():
        return "has triangles whose vertices do not exist, or are no finite numbers"
    if tags.shape != triangles.shape[:1] or not np.isin(tags, (TAG_SONOTRODE, TAG_WALL)).all():
        return "must tag each triangle as TAG_SONOTRODE or TAG_WALL"
    across = float(np.ptp(vertices, axis=0).max())
    if across > MOST_ACROSS:
        return f"is {across:.4g} m wide, where {MOST_ACROSS:g} is the most; its vertices are in metres, not mm"
    return (
        _open_or_turned(vertices, triangles)
        or _no_floor(vertices, triangles, tags)
        or _crossed(vertices, triangles)
    )


def in_arrays(cavity: ShapeSurface) -> ShapeSurface:
    """One without a fault as the arrays that a ShapeSurface is said to hold; of a part it knows nothing."""
    return ShapeSurface(
        np.asarray(cavity.vertices, dtype=np.float64),
        np.asarray(cavity.triangles, dtype=np.int32),
        np.asarray(cavity.tags, dtype=np.uint8),
    )


def _open_or_turned(vertices: np.ndarray, triangles: np.ndarray) -> str | None:
    count = len(vertices)
    a, b = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).T.astype(np.int64)
    there, back = np.sort(a * count + b), np.sort(b * count + a)
    if (there[1:] == there[:-1]).any() or not np.array_equal(there, back):
        lone = np.setdiff1d(there, back)
        place = (
            f", near {np.round(1e3 * vertices[lone[0] // count], 3).tolist()} mm"
            if lone.size
            else ""
        )
        return (
            f"is not closed: each side of a triangle must meet one other, run the other way{place}"
        )
    _, volumes = find_shells(vertices, triangles)
    if len(volumes) > 1:
        return f"is in {len(volumes)} pieces; one closed surface is wanted"
    return "is inside out: normals must point out of the cavity" if volumes[0] <= 0.0 else None


def _crossed(vertices: np.ndarray, triangles: np.ndarray) -> str | None:
    try:
        refuse_self_intersection(Path(), vertices, triangles)
    except SurfaceError as error:
        places = format_point(error.edges.reshape(-1, 3).mean(axis=0))
        return f"crosses itself, near {places}"
    return None


def _no_floor(vertices: np.ndarray, triangles: np.ndarray, tags: np.ndarray) -> str | None:
    floor = tags == TAG_SONOTRODE
    if not floor.any():
        return "has no triangle tagged TAG_SONOTRODE"
    if (vertices[triangles[floor]][..., 2] != 0.0).any() or (
        area_vectors(vertices, triangles[floor])[:, 2] > 0.0
    ).any():
        return "has a sonotrode that is not the floor at z = 0, facing down"
    low = vertices[triangles][..., 2].min()
    return f"goes below the sonotrode, to z = {1e3 * low:.4g} mm" if low < 0.0 else None
