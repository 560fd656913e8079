"""Windows on a surface: which contacts lie in the window round a point, and products over them.

Notation
    p, q      point and contact [m]
    n_p, n_q  unit normals of the surface there
    theta     angle between the normals
    a, b      (p - q).n_q and (q - p).n_p [m]

A contact is in a window if it is on the same smooth face and nearer than the window's radius along
the surface. On two planes that meet in an edge that distance is

    distance² = |p - q|² + 2 a b / (1 + cos theta),

exact for the straight way over the edge. With h and y the distances of p and q from the edge and s
along it, a = -h sin theta and b = -y sin theta (both + in a hollow), |p - q|² = h² + y² + 2 h y cos
theta + s², and unfolded the distance² is (h + y)² + s². The far side of a thin blade faces the
other way, cos theta = -1, and is infinitely far.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from sim_core import jit

MAX_CELLS = 4e6  # of the grid in which the points near a contact are found
PAIRS_AT_ONCE = 2_000_000  # bounds memory


class Places(NamedTuple):
    """Places on a surface.

    Attributes:
        place: [m], shape (p, 3).
        normal: unit vectors out of the part, shape (p, 3); zero on lines.
        face: smooth face, or line, that each is on, shape (p,).
    """

    place: np.ndarray
    normal: np.ndarray
    face: np.ndarray

    def select(self, rows: np.ndarray | slice) -> Places:
        """The places of these rows."""
        return Places(*(column[rows] for column in self))


class Windows:
    """Windows of one radius round points on a surface.

    Args:
        points: the middles of the windows.
        radius: [m].
    """

    def __init__(self, points: Places, radius: float) -> None:
        self.points, self.radius = points, radius
        place = points.place
        self._low = place.min(axis=0) if len(place) else np.zeros(3)
        span = np.ptp(place, axis=0) if len(place) else np.zeros(3)
        # Cells twice as wide as the radius: a window then lies in two cells along each axis.
        self._edge = max(2.0 * radius, (float(np.prod(span + radius)) / MAX_CELLS) ** (1.0 / 3.0))
        self._shape = (span / self._edge).astype(np.int64) + 1
        cell = ((place - self._low) / self._edge).astype(np.int64)
        number = (cell[:, 0] * self._shape[1] + cell[:, 1]) * self._shape[2] + cell[:, 2]
        self._order = np.argsort(number, kind="stable").astype(np.int32)
        count = np.bincount(number, minlength=int(np.prod(self._shape)))
        self._first = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
        self._sorted = points.select(self._order)
        self._has_points = np.zeros(int(points.face.max(initial=0)) + 1, dtype=bool)
        self._has_points[points.face] = True  # by face

    def pairs(self, contacts: Places) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield indices of points and of the contacts in their windows, some pairs at a time."""
        point, contact = np.empty((2, PAIRS_AT_ONCE), dtype=np.int32)
        done = 0
        face = np.minimum(contacts.face, len(self._has_points) - 1)
        rows = np.flatnonzero(self._has_points[face] & (face == contacts.face))
        columns = [np.ascontiguousarray(column[rows]) for column in contacts]
        while done < len(rows):
            done, found = _find_pairs(
                self._low, self._edge, self._shape, self._first, self._sorted, Places(*columns),
                self.radius, done, point, contact,
            )  # fmt: skip
            yield self._order[point[:found]], rows[contact[:found]]

    def sums(self, contacts: Places, values: np.ndarray) -> np.ndarray:
        """Sums over each window of values (k,) of the contacts, shape (p,)."""
        total = np.zeros(len(self.points.place))
        for point, contact in self.pairs(contacts):
            total += np.bincount(point, values[contact], len(total))
        return total


@jit
def _find_pairs(low, edge, shape, first, points, contacts, radius, begin, point, contact):  # type: ignore[no-untyped-def]
    """Write down all pairs until the arrays are full.

    Args:
        low, edge, shape, first: of the grid of cells; points first[c] to first[c + 1] are in c.
        begin: first contact to look at.
        point, contact: written.

    Returns:
        The first contact that is not done, and the number of pairs.
    """
    found = 0
    x, n_x, face_x = points
    y, n_y, face_y = contacts
    for j in range(begin, len(y)):
        before = found
        x0 = int(np.floor((y[j, 0] - low[0]) / edge - 0.5))
        y0 = int(np.floor((y[j, 1] - low[1]) / edge - 0.5))
        z0 = int(np.floor((y[j, 2] - low[2]) / edge - 0.5))
        for ix in range(max(x0, 0), min(x0 + 2, shape[0])):
            for iy in range(max(y0, 0), min(y0 + 2, shape[1])):
                for iz in range(max(z0, 0), min(z0 + 2, shape[2])):
                    cell = (ix * shape[1] + iy) * shape[2] + iz
                    for i in range(first[cell], first[cell + 1]):
                        if face_x[i] != face_y[j]:
                            continue
                        dx = y[j, 0] - x[i, 0]
                        dy = y[j, 1] - x[i, 1]
                        dz = y[j, 2] - x[i, 2]
                        square = dx * dx + dy * dy + dz * dz
                        if square >= radius * radius:
                            continue
                        a = -(dx * n_y[j, 0] + dy * n_y[j, 1] + dz * n_y[j, 2])
                        b = dx * n_x[i, 0] + dy * n_x[i, 1] + dz * n_x[i, 2]
                        if a * b > 0.0:
                            cosine = (
                                n_x[i, 0] * n_y[j, 0] + n_x[i, 1] * n_y[j, 1]
                                + n_x[i, 2] * n_y[j, 2]
                            )  # fmt: skip
                            # not divided: the cosine may be -1
                            if 2.0 * a * b >= (radius * radius - square) * (1.0 + cosine):
                                continue
                        if found == len(point):
                            return j, before
                        point[found] = i
                        contact[found] = j
                        found += 1
    return len(y), found


@jit
def multiply_products(products, point, weight, scales):  # type: ignore[no-untyped-def]
    """Multiply products[point, k] by 1 - scales[k] weight for each pair of point and weight.

    A factor is at least 0. Negative ones would leave the mean without bias, but where one dent
    takes more than a window the product would grow beyond all bounds.
    """
    for pair in range(len(point)):
        for k in range(len(scales)):
            products[point[pair], k] *= max(0.0, 1.0 - scales[k] * weight[pair])
