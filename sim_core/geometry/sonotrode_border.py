"""Where still surfaces rise gently from a vibrating one: both go on beyond their common edge, and meet all the same.

A ball against a steep wall never comes near the edge, however the vibrating face moves. On a gentle slope it does: it
could come onto a raised face from the side, already below it, or past the end of the slope onto a lowered one.

             ball's centre meets     ....... raised face, carried on under the slope
             one or the other  ....--''
        --------------------''~~~ slope, carried on under the lowered face
"""

from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError
from sim_core.geometry.flat_faces import LONE, Flats, edge_partners
from sim_core.geometry.mesh import TriangleMesh

SAME_LINE = 1e-9  # [-] and m: a face's border that runs along the edge, but for rounding


class Rim(NamedTuple):
    """``overhang`` [m]: how far the vibrating faces go on. Of each gentle edge: ``slopes`` (k,), the still triangle
    beside it; ``lines`` (k, 4), the slope's inward border normal and offset [m]; ``beyond`` (k,), how far it goes on
    [m].
    """

    overhang: float
    slopes: np.ndarray
    lines: np.ndarray
    beyond: np.ndarray


def find_rim(
    triangles: np.ndarray,
    corners: np.ndarray,
    normals: np.ndarray,
    radius: float,
    waving: np.ndarray,
    swing: float | np.ndarray,
) -> Rim:
    """The gentle edges of the triangles marked ``waving`` (m,), which vibrate by ``swing`` [m] zero-to-peak, or each by
    its own (m,).

    Raises SceneError where a surface rises so gently that the raised face would come out far from its edge.
    """
    two = edge_partners(triangles)
    still = two[np.repeat(waving, 3) & ~waving[two // 3]]
    face, slope = two[still] // 3, still // 3
    own = np.broadcast_to(swing, waving.shape)[face]
    rise = np.linalg.norm(np.cross(normals[face], normals[slope]), axis=1)
    run = np.einsum("ij,ij->i", normals[face], normals[slope])
    gentle = np.flatnonzero((run > 0.0) & (radius * (1.0 - run) < own))
    still, slope, rise, run, own = (
        still[gentle],
        slope[gentle],
        rise[gentle],
        run[gentle],
        own[gentle],
    )
    flat = np.flatnonzero(own * run > radius * rise)
    if len(flat):
        raise SceneError(
            f"beside the vibrating triangle {face[gentle[flat[0]]]} the surface of triangle {slope[flat[0]]} lies flat "
            f"or rises by only {np.degrees(np.arctan2(rise, run)[flat[0]]):.3g} degrees: a moving edge is not "
            "supported yet; let the sonotrode fill the chamber's floor from wall to wall, flat, and walls rise from it "
            f"by {np.ceil(np.degrees(np.arctan2(own[flat[0]], radius))):.0f} degrees or more"
        )
    start = corners[slope, still % 3]
    inward = np.cross(corners[slope, (still % 3 + 1) % 3] - start, normals[slope])
    inward /= np.linalg.norm(inward, axis=1)[:, None]
    lines = np.column_stack([inward, np.einsum("ij,ij->i", inward, start)])
    return Rim(float((own * run / rise).max(initial=0.0)), slope, lines, own / rise)


def require_room_at_joints(
    mesh: TriangleMesh, normals: np.ndarray, radius: float, waving: np.ndarray, swing: np.ndarray
) -> None:
    """Raises SceneError where two sonotrodes meet in an edge so blunt that one could come out beside the other.

    A ball that touches both has its centre radius (1 - cos) / sin from the ends of their moved faces; swings take at
    most their sum from the numerator.
    """
    two = edge_partners(mesh.triangles)
    one = np.flatnonzero(np.arange(len(two)) < two)
    face, other = one // 3, two[one] // 3
    room = (
        radius * (1.0 - np.einsum("ij,ij->i", normals[face], normals[other]))
        - swing[face]
        - swing[other]
    )
    apart = waving[face] & waving[other] & (mesh.tags[face] != mesh.tags[other])
    tight = np.flatnonzero(apart & (room < 0.0))
    if len(tight):
        a, b = face[tight[0]], other[tight[0]]
        raise SceneError(
            f"the vibrating triangles {a} and {b}, of tags {mesh.tags[a]} and {mesh.tags[b]}, meet in an edge so blunt "
            "that a ball could touch the edge of one beside the other: a moving edge is not supported yet; let a steep "
            "wall part them"
        )


def carry_on(
    numbers: np.ndarray, triangle: np.ndarray, waving: np.ndarray, flats: Flats, rim: Rim
) -> np.ndarray:
    """Moves the borders of faces out over gentle edges; returns how far (k,) [m] each face goes on at most.

    ``numbers`` (k, 20): faces as obstacles hold them, changed in place; ``triangle`` (k,): which each is booked on;
    ``waving`` (k,).
    """
    farther = np.where(waving, rim.overhang, 0.0)[:, None].repeat(4, axis=1)
    for slope, line, beyond in zip(rim.slopes, rim.lines, rim.beyond, strict=True):
        flat = flats.flat[slope]
        rows = np.flatnonzero(flats.flat[triangle] == flat if flat != LONE else triangle == slope)
        for k in range(4):
            along = (np.abs(numbers[rows, 4 + 4 * k : 8 + 4 * k] - line) <= SAME_LINE).all(axis=1)
            farther[rows[along], k] = np.maximum(farther[rows[along], k], beyond)
    numbers[:, 7:20:4] -= farther
    return np.asarray(farther.max(axis=1))
