"""Windows, discs of a surface round points: the contacts of balls in each, and sums over them.

Notation
    p, q      point and contact [m]
    n_p, n_q  unit normals of the surface there
    theta     angle between the normals
    a, b      (p - q).n_q and (q - p).n_p [m]

A contact is in a window if it is on the same smooth face and nearer along the surface than the
window's radius. On two planes that meet in an edge this distance is

    distance² = |p - q|² + 2 a b / (1 + cos theta),

exact for the straight way over the edge. Proof: let h and y be the distances of p and q from the
edge, and s the way along it. Then a = -h sin theta and b = -y sin theta (both + in a hollow), |p -
q|² = h² + y² + 2 h y cos theta + s², and the unfolded distance² is (h + y)² + s². The far side of a
thin blade faces the other way, cos theta = -1, and is infinitely far.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from chamberopt.coverage.field.smooth_faces import Places
from sim_core import jit

MAX_CELLS = 4e6  # cells of the grid in which the points near a contact are found
CELLS = 3  # cells across a window; 2 to 6 cells took the same time
PAIRS_AT_ONCE = 500_000  # bounds memory, and fits in the processor's cache


class Windows:
    """Measuring windows of one radius: discs of a surface round points.

    Args:
        points: the middles of the windows.
        radius: radius of the windows [m].
        faces: for each division of the part into faces, and each face of the finest division, the
            face that stands for all faces joined to it; None if no faces are joined.
        division: index of the division that each window uses, shape (p,); None for the first.
    """

    def __init__(
        self,
        points: Places,
        radius: float,
        faces: np.ndarray | None = None,
        division: np.ndarray | None = None,
    ) -> None:
        self.points, self.radius, self.faces = points, radius, faces
        self.division = np.zeros(len(points.face), dtype=int) if division is None else division
        # Faces that any division joins are searched together.
        place, face = points.place, points.face if faces is None else faces[-1][points.face]
        self._grid = grid = _grid_of_faces(place, face, radius)
        cell = ((place - grid.low[face]) / grid.edge).astype(np.int64)
        shape = grid.shape[face]
        number = (cell[:, 0] * shape[:, 1] + cell[:, 1]) * shape[:, 2] + cell[:, 2]
        number += grid.offset[face]
        self._order = np.argsort(number, kind="stable").astype(np.int32)
        count = np.bincount(number, minlength=int(grid.offset[-1]))
        self._first = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
        self._place = np.ascontiguousarray(place[self._order].T)
        self._normal = np.ascontiguousarray(points.normal[self._order].T)

    def with_radius(self, radius: float) -> Windows:
        """Return windows of another radius [m] round the same points."""
        return Windows(self.points, radius, self.faces, self.division)

    def select(self, rows: np.ndarray) -> Windows:
        return Windows(self.points.select(rows), self.radius, self.faces, self.division[rows])

    def pairs(self, contacts: Places) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield pairs of a point and a contact in its window, as two arrays of their indices.

        The pairs come in several portions, to bound memory.
        """
        for point, contact, rows in self._found(contacts):
            yield self._order[point], rows[contact]

    def shares(
        self, contacts: Places, size: np.ndarray, area: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return pairs of a window and a contact in it, as two arrays (n,): the index of the
        window's point, and the share of the window's area that the contact's `size` (k,) takes.

        Args:
            area: area of each window, (p,).
        """
        found = [
            _divide(self._order, area, size[rows], point, contact)
            for point, contact, rows in self._found(contacts)
        ]
        if len(found) == 1:
            return found[0]
        points, shares = zip(*found, strict=True) if found else ((), ())
        none = np.zeros(0, dtype=np.int32)
        return np.concatenate([none, *points]), np.concatenate([none, *shares])

    def sums(self, contacts: Places, values: np.ndarray) -> np.ndarray:
        """Return the sum of the `values` (k,) of the contacts (k,) in each window, shape (p,)."""
        total = np.zeros(len(self.points.place))
        for point, contact in self.pairs(contacts):
            total += np.bincount(point, values[contact], len(total))
        return total

    def _found(self, contacts: Places) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Yield pairs of a point and a contact in its window, in portions of three arrays.

        The first array has the positions of the points in `_order`, and the second the positions of
        the contacts in the third. The third has the indices of all contacts on faces with points.
        """
        point, contact = np.empty((2, max(PAIRS_AT_ONCE, len(self._order))), dtype=np.int32)
        done, grid = 0, self._grid
        own = contacts.face if self.faces is None else self.faces[-1][contacts.face]
        face = np.minimum(own, len(grid.shape) - 1)
        rows = np.flatnonzero((face == own) & (grid.shape[face, 0] > 0))
        columns = Places(*(np.ascontiguousarray(one[rows]) for one in (*contacts[:2], own)))
        while done < len(rows):
            done, found = _find_pairs(
                grid, self._first, self._place, self._normal, columns, self.radius, done,
                point, contact,
            )  # fmt: skip
            if self.faces is not None and len(self.faces) > 1:
                found = _keep_joined(
                    self.faces, self.division, self.points.face, self._order,
                    contacts.face, rows, point[:found], contact,
                )  # fmt: skip
            yield point[:found], contact[:found], rows


class _Grid(NamedTuple):
    """Cells in which the points near a contact are found, with a separate grid for each face.

    Attributes:
        edge: of a cell [m].
        low: lowest corner of each face's grid [m], shape (f, 3).
        shape: number of cells along each axis, shape (f, 3); 0 for a face without points.
        offset: number of the first cell of each face, then the number of all cells, (f + 1,).
    """

    edge: float
    low: np.ndarray
    shape: np.ndarray
    offset: np.ndarray


def _grid_of_faces(place: np.ndarray, face: np.ndarray, radius: float) -> _Grid:
    """Return the cells in which to find points (p, 3) [m] on faces (p,), for windows of this radius
    [m].
    """
    faces = int(face.max(initial=0)) + 1
    low, high = np.full((faces, 3), np.inf), np.full((faces, 3), -np.inf)
    np.minimum.at(low, face, place)
    np.maximum.at(high, face, place)
    some = np.isfinite(low[:, 0])
    low[~some], high[~some] = 0.0, 0.0
    # On a plane, 2 r / edge + 1 cells are searched along each axis.
    edge = 2.0 * radius / CELLS
    while True:
        shape = ((high - low) / edge).astype(np.int64) + 1
        shape[~some] = 0
        offset = np.concatenate([[0], np.cumsum(shape.prod(axis=1))])
        if offset[-1] <= MAX_CELLS + some.sum():
            return _Grid(edge, low, shape, offset)
        edge *= 1.5


@jit
def _find_pairs(grid, first, x, n_x, contacts, radius, begin, point, contact):  # type: ignore[no-untyped-def]
    """Write pairs of a point and a contact in its window into the arrays `point` and `contact`,
    until all are written or the arrays are full.

    The loop does not branch on the distance of a point, because the processor could not predict it.

    Args:
        first: points first[c] to first[c + 1] are in cell c.
        x, n_x: positions and normals of the points, shape (3, p).
        begin: first contact to look at.
        point, contact: arrays to write into.
    Returns:
        The first contact that is not done, and the number of pairs.
    """
    found, most = 0, len(point)
    y, n_y, face_y = contacts
    edge, reach = grid.edge, radius * radius
    for j in range(begin, len(y)):
        before, face = found, face_y[j]
        low, shape = grid.low[face], grid.shape[face]
        y0, y1, y2 = y[j, 0], y[j, 1], y[j, 2]
        z_low = max(int(np.floor((y2 - radius - low[2]) / edge)), 0)
        z_high = min(int(np.floor((y2 + radius - low[2]) / edge)) + 1, shape[2])
        if z_low >= z_high:
            continue
        x_low = max(int(np.floor((y0 - radius - low[0]) / edge)), 0)
        x_high = min(int(np.floor((y0 + radius - low[0]) / edge)) + 1, shape[0])
        y_low = max(int(np.floor((y1 - radius - low[1]) / edge)), 0)
        y_high = min(int(np.floor((y1 + radius - low[1]) / edge)) + 1, shape[1])
        for ix in range(x_low, x_high):
            for iy in range(y_low, y_high):
                row = grid.offset[face] + (ix * shape[1] + iy) * shape[2]
                start, end = first[row + z_low], first[row + z_high]
                if found + end - start > most:
                    return j, before
                near = found
                for i in range(start, end):
                    dx, dy, dz = y0 - x[0, i], y1 - x[1, i], y2 - x[2, i]
                    point[near] = i
                    near += dx * dx + dy * dy + dz * dz < reach
                for k in range(found, near):
                    i = point[k]
                    dx, dy, dz = y0 - x[0, i], y1 - x[1, i], y2 - x[2, i]
                    square = dx * dx + dy * dy + dz * dz
                    a = -(dx * n_y[j, 0] + dy * n_y[j, 1] + dz * n_y[j, 2])
                    b = dx * n_x[0, i] + dy * n_x[1, i] + dz * n_x[2, i]
                    cosine = n_x[0, i] * n_y[j, 0] + n_x[1, i] * n_y[j, 1] + n_x[2, i] * n_y[j, 2]
                    # multiplied out, because the cosine may be -1
                    is_far = (a * b > 0.0) & (2.0 * a * b >= (reach - square) * (1.0 + cosine))
                    point[found] = i
                    contact[found] = j
                    found += not is_far
    return len(y), found


@jit
def _keep_joined(faces, division, face, order, face_of_contact, rows, point, contact):  # type: ignore[no-untyped-def]
    """Remove pairs whose two faces are not joined in the window's division of the part into faces.

    The other pairs move to the front of `point` and `contact`. Return their number.
    """
    kept = 0
    for pair in range(len(point)):
        i, j = order[point[pair]], rows[contact[pair]]
        own = division[i]
        point[kept], contact[kept] = point[pair], contact[pair]
        kept += faces[own, face[i]] == faces[own, face_of_contact[j]]
    return kept


def _divide(
    order: np.ndarray, area: np.ndarray, size: np.ndarray, place: np.ndarray, contact: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the index of the point of each pair, and the contact's size over the window's area.

    Args:
        order, place, contact: order of the points, and pairs, as `Windows._found` yields them.
        area: area of each window, (p,).
        size: size of each contact, (k,).
    """
    point, share = np.empty(len(place), dtype=np.int32), np.empty(len(place))
    _write_shares(order, area, size, place, contact, point, share)
    return point, share


@jit
def _write_shares(order, area, size, place, contact, point, share):  # type: ignore[no-untyped-def]
    for pair in range(len(place)):
        point[pair] = order[place[pair]]
        share[pair] = size[contact[pair]] / area[point[pair]]


@jit
def add_powers(point, share, sums):  # type: ignore[no-untyped-def]
    """Add number, shares and squared shares of the dents in windows to `sums` (p, 3).

    For each pair of a window `point` and a dent's `share` of it, 1, share and share² are added to
    the window's row.
    """
    for pair in range(len(point)):
        one, w = point[pair], share[pair]
        sums[one, 0] += 1.0
        sums[one, 1] += w
        sums[one, 2] += w * w


@jit
def add_columns(point, contact, columns, sums):  # type: ignore[no-untyped-def]
    """Add the values of contacts to the sums of the windows in which they are.

    For each pair of a window `point` and a `contact` in it, the contact's row of `columns` (k, c)
    is added to the window's row of `sums` (p, c).
    """
    for pair in range(len(point)):
        for column in range(columns.shape[1]):
            sums[point[pair], column] += columns[contact[pair], column]


@jit
def add_to_levels(point, contact, size, level, histogram):  # type: ignore[no-untyped-def]
    """Add the `size` (k,) of contacts to the histograms of windows, by their `level` (k,).

    For each pair of a window `point` and a `contact` in it, the size is added to the window's row
    of `histogram` (p, levels), in the column of the contact's level.
    """
    for pair in range(len(point)):
        histogram[point[pair], level[contact[pair]]] += size[contact[pair]]


@jit
def multiply_products(products, point, weight, scales):  # type: ignore[no-untyped-def]
    """Multiply products[point, k] by 1 - scales[k] weight, for each pair of a window and a dent.

    The pair is given by the index `point` of the window and the share `weight` of it that the dent
    takes. A factor is at least 0. Negative factors would leave the mean without bias, but if a dent
    takes more than a window the product would grow beyond all bounds.
    """
    for pair in range(len(point)):
        for k in range(len(scales)):
            products[point[pair], k] *= max(0.0, 1.0 - scales[k] * weight[pair])
