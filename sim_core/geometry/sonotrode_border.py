"""Gently rising surfaces beside a vibrating one: both are extended past their common edge.

A ball against a steep wall never comes near the edge, however the vibrating face moves. On a gentle
slope it does: it could come onto a raised face from the side, already below it, or past the end of
the slope onto a lowered one. Extended, the two faces still meet.

             ball's centre meets     ....... raised face, extended under the slope
             one or the other  ....--''
        --------------------''~~~ slope, extended under the lowered face
"""

from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError
from sim_core.geometry.flat_faces import LONE, FlatFaces, SurfaceTriangles
from sim_core.geometry.mesh import edge_partners

SAME_LINE = 1e-9  # [-] and m: a face's border that runs along the edge, up to rounding


class SonotrodeBorder(NamedTuple):
    """The k gentle edges between vibrating faces and still ones."""

    overhang: float  # how far the vibrating faces are extended [m]
    slopes: np.ndarray  # the still triangle beside each edge, shape (k,)
    lines: np.ndarray  # inward border normal and offset [m] of that triangle, shape (k, 4)
    beyond: np.ndarray  # how far that triangle is extended [m], shape (k,)


def find_border(surface: SurfaceTriangles, radius: float) -> SonotrodeBorder:
    """The gentle edges for balls of one radius [m].

    Raises:
        SceneError: where a surface rises so gently that the raised face would come out far from its
            edge.
    """
    corners, normals, vibrating = surface.corners, surface.normals, surface.vibrating
    two = edge_partners(surface.mesh.triangles)
    still = two[np.repeat(vibrating, 3) & ~vibrating[two // 3]]
    face, slope = two[still] // 3, still // 3
    rise = np.linalg.norm(np.cross(normals[face], normals[slope]), axis=1)
    run = np.einsum("ij,ij->i", normals[face], normals[slope])
    gentle = (run > 0.0) & (radius * (1.0 - run) < surface.amplitude[face])
    still, face, slope, rise, run = (x[gentle] for x in (still, face, slope, rise, run))
    amplitude = surface.amplitude[face]
    flat = np.flatnonzero(amplitude * run > radius * rise)
    if len(flat):
        k = flat[0]
        angle, enough = np.degrees(np.arctan2([rise[k], amplitude[k]], [run[k], radius]))
        raise SceneError(
            f"beside the vibrating triangle {face[k]} the surface of triangle {slope[k]} lies flat "
            f"or rises by only {angle:.3g} degrees: a moving edge is not supported yet; let the "
            "sonotrode fill the chamber's floor from wall to wall, flat, and walls rise from it "
            f"by {np.ceil(enough):.0f} degrees or more"
        )
    start = corners[slope, still % 3]
    inward = np.cross(corners[slope, (still % 3 + 1) % 3] - start, normals[slope])
    inward /= np.linalg.norm(inward, axis=1)[:, None]
    lines = np.column_stack([inward, np.einsum("ij,ij->i", inward, start)])
    overhang = float((amplitude * run / rise).max(initial=0.0))
    return SonotrodeBorder(overhang, slope, lines, amplitude / rise)


def require_room_at_joints(surface: SurfaceTriangles, radius: float) -> None:
    """Raise SceneError where two sonotrodes meet in an edge so blunt that one emerges at the other.

    A ball of this radius [m] that touches both has its centre radius (1 - cos) / sin from the ends
    of their moved faces; the vibrations take at most the sum of their amplitudes off the numerator.
    """
    normals, amplitude, tags = surface.normals, surface.amplitude, surface.mesh.tags
    two = edge_partners(surface.mesh.triangles)
    one = np.flatnonzero(np.arange(len(two)) < two)
    face, other = one // 3, two[one] // 3
    cosine = np.einsum("ij,ij->i", normals[face], normals[other])
    room = radius * (1.0 - cosine) - amplitude[face] - amplitude[other]
    joint = surface.vibrating[face] & surface.vibrating[other] & (tags[face] != tags[other])
    tight = np.flatnonzero(joint & (room < 0.0))
    if len(tight):
        a, b = face[tight[0]], other[tight[0]]
        raise SceneError(
            f"the vibrating triangles {a} and {b}, of tags {tags[a]} and {tags[b]}, meet in an "
            "edge so blunt that a ball could touch the edge of one beside the other: a moving edge "
            "is not supported yet; let a steep wall part them"
        )


def extend_faces(
    numbers: np.ndarray,
    triangle: np.ndarray,
    vibrating: np.ndarray,
    flat_faces: FlatFaces,
    border: SonotrodeBorder,
) -> np.ndarray:
    """Move the borders of faces out over gentle edges.

    Args:
        numbers: faces as obstacles hold them, shape (k, 20), changed in place.
        triangle: the triangle on which impacts on each face are recorded, shape (k,).
        vibrating: whether each face vibrates, shape (k,) bool.
        flat_faces: the flat faces of the mesh.
        border: the gentle edges.

    Returns:
        How far each face is extended at most [m], shape (k,).
    """
    farther = np.where(vibrating, border.overhang, 0.0)[:, None].repeat(4, axis=1)
    of_triangle = flat_faces.of_triangle
    for slope, line, beyond in zip(border.slopes, border.lines, border.beyond, strict=True):
        flat = of_triangle[slope]
        rows = np.flatnonzero(of_triangle[triangle] == flat if flat != LONE else triangle == slope)
        for k in range(4):
            same = (np.abs(numbers[rows, 4 + 4 * k : 8 + 4 * k] - line) <= SAME_LINE).all(axis=1)
            farther[rows[same], k] = np.maximum(farther[rows[same], k], beyond)
    numbers[:, 7:20:4] -= farther
    return np.asarray(farther.max(axis=1))
