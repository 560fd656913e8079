"""Measuring windows along creases (sharp convex edges), where dents cover only a narrow band."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.coverage.field.surface_points import ball_fits
from chamberopt.geometry.triangles import count_up

if TYPE_CHECKING:
    from chamberopt.coverage.field.smooth_faces import Creases, Places
    from chamberopt.coverage.field.surface_points import Rooms
    from chamberopt.coverage.field.windows import Windows

# Length of a window along a crease, in radii of a window. A dent takes a larger share of a line
# than of an area, so windows along creases are longer to hold as many dents.
CREASE_LENGTH = 3.0
PIECES_PER_WINDOW = 32  # pieces that measure the length of a crease in a window


class CreasePieces(NamedTuple):
    """Short pieces of creases (sharp edges) that a ball can touch: middle [m], index of the edge,
    and length [m] of each piece.
    """

    place: np.ndarray
    edge: np.ndarray
    length: np.ndarray


def crease_pieces(creases: Creases, mesh: Rooms, ball_radius: float, radius: float) -> CreasePieces:
    """Divide creases into short pieces, and return the pieces that a ball can touch.

    Args:
        mesh: surface of the chamber.
        ball_radius: radius of the ball [m].
        radius: radius of the measuring windows, from which the length of pieces follows [m].
    """
    start, end = creases.ends[:, 0], creases.ends[:, 1]
    length = np.linalg.norm(end - start, axis=1)
    count = np.maximum(
        1, np.ceil(length / (2.0 * CREASE_LENGTH * radius) * PIECES_PER_WINDOW)
    ).astype(int)
    edge = np.repeat(np.arange(len(count)), count)
    number = count_up(count)
    place = start[edge] + ((number + 0.5) / count[edge])[:, None] * (end - start)[edge]
    fits = ball_fits(mesh, place, creases.outward[edge], ball_radius)
    edge, place = edge[fits], place[fits]
    return CreasePieces(place, edge, (length / count)[edge])


def on_lines(creases: Creases, place: np.ndarray, edge: np.ndarray) -> tuple[Places, np.ndarray]:
    """Return contact points on crease edges as points on crease lines, which are chains of edges.

    An edge may belong to a different line in each division of the part into faces. A point
    therefore comes once for each division in which its edge is a crease.

    Args:
        place: contact points [m], (k, 3).
        edge: crease edge under each contact point, (k,).
    Returns:
        The points on lines, and the row in `place` of each.
    """
    from chamberopt.coverage.field.smooth_faces import Places

    division, row = np.nonzero(creases.line[:, edge] >= 0)
    line = creases.line[division, edge[row]]
    return Places(place[row], np.zeros((len(row), 3)), line), row


class CreaseBand(NamedTuple):
    """Windows near creases: a row for each pair of a window's middle and a crease line near it.

    The foot of a middle is the point of the crease line nearest to it.

    Attributes:
        point: index of the window's middle, shape (b,).
        height: distance of the middle from the crease [m], shape (b,).
        length: length of the crease in the window round the foot [m], shape (b,).
        windows: windows round the feet, along the crease lines.
    """

    point: np.ndarray
    height: np.ndarray
    length: np.ndarray
    windows: Windows


def find_band(
    windows: Windows, creases: Creases, pieces: CreasePieces, dent_radius: float
) -> CreaseBand | None:
    """Return the windows whose middles dents on creases can cover, or None if there are none.

    Args:
        dent_radius: largest radius of a dent [m].
    """
    from scipy.spatial import cKDTree

    from chamberopt.coverage.field.smooth_faces import Places
    from chamberopt.coverage.field.windows import Windows

    points = windows.points
    if not len(pieces.edge) or not len(points.place):
        return None
    far = dent_radius + 0.5 * float(pieces.length.max())
    near = cKDTree(points.place).sparse_distance_matrix(
        cKDTree(pieces.place), far, output_type="ndarray"
    )
    point, edge = near["i"], pieces.edge[near["j"]]
    division = windows.division[point]
    own, sides = points.face[point][:, None], creases.faces[edge]
    if windows.faces is not None:
        own, sides = (windows.faces[division[:, None], faces] for faces in (own, sides))
    beside = (sides == own).any(axis=1) & (creases.line[division, edge] >= 0)
    point, edge = np.unique(np.column_stack([point, edge])[beside], axis=0).T
    start, end = creases.ends[edge, 0], creases.ends[edge, 1]
    along = end - start
    share = ((points.place[point] - start) * along).sum(axis=1) / (along**2).sum(axis=1)
    foot = start + np.clip(share, 0.0, 1.0)[:, None] * along
    height = np.linalg.norm(points.place[point] - foot, axis=1)
    # The nearest edge of each line counts.
    line = creases.line[windows.division[point], edge]
    order = np.lexsort([height, line, point])
    key = np.column_stack([point, line])[order]
    first = np.ones(len(key), dtype=bool)
    first[1:] = (key[1:] != key[:-1]).any(axis=1)
    rows = order[first]
    rows = rows[height[rows] < dent_radius]
    if not len(rows):
        return None
    feet = Places(foot[rows], np.zeros((len(rows), 3)), line[rows])
    round_feet = Windows(feet, CREASE_LENGTH * windows.radius)
    on, row = on_lines(creases, pieces.place, pieces.edge)
    length = round_feet.sums(on, pieces.length[row])
    return CreaseBand(
        point[rows].astype(np.int32), height[rows], np.maximum(length, dent_radius), round_feet
    )
