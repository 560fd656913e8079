"""Remesh the target, the part's surface to be peened, with triangles of a given size.

The surface itself does not change. Sides longer than 4/3 of the size are halved. Sides shorter than
0.6 of the size are collapsed: their ends become a single point. Edges are turned (replaced by the
other diagonal of their two triangles) until they are Delaunay. Points move towards the mean of
their neighbours. Each change is made only where the surface stays the same: within a flat face, or
along a straight edge between two flat faces. A curved surface made of flat faces smaller than the
size keeps these faces.

Notation: a triangle's side k runs from its corner k to the next. Side 3 t + k is side k of triangle
t. A crease is an edge between two flat faces.

Source: M. Botsch and L. Kobbelt, Symposium on Geometry Processing 2004, 185.
"""

from __future__ import annotations

import numpy as np

from chamberopt.geometry.triangles import (
    area_vectors,
    areas,
    connected_pieces,
    count_up,
    edge_keys,
    side_pairs,
    sides_of,
    unit_vectors,
)

# Shares of the size. A halved side is 2/3 of it, so that no side is split and collapsed in turn.
LONG, SHORT = 4.0 / 3.0, 0.6
FLAT = 1e-6  # share of the bounding box's diagonal: rounding of a text format with 6 digits
STRAIGHT = 1e-3  # rad: turns a ball's path by less than roughness does
ROUNDS = 5
MAX_PASSES = 50  # passes of turning edges; MAX_CHANGES counts passes of collapsing and of smoothing
MAX_CHANGES = 20


def remesh(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray, kinds: np.ndarray, size: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Remesh part of a closed surface with triangles whose sides are about `size` [m] long.

    Args:
        target: marks the triangles to remesh, (m,) bool.
        kinds: number of the kind of each triangle, (m,). No new triangle covers two kinds.
    Returns:
        Vertices, triangles (k, 3), and for each new triangle a given triangle of the same flat face
        and kind, (k,).
    """
    mesh = _TargetMesh(vertices, triangles, target, _flat_faces(vertices, triangles, kinds), size)
    for _ in range(ROUNDS):
        if not (mesh.split() | mesh.collapse()):
            break
        mesh.smooth()
    mesh.split()  # sides that turning and smoothing made longer
    used, numbers = np.unique(mesh.triangles, return_inverse=True)
    return mesh.vertices[used], numbers.reshape(-1, 3), mesh.source


def triangle_quality(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the shape quality of each triangle, (m,): 1 if equilateral, 0 without area.

    It is 4 √3 times the area, over the sum of the squared sides.
    """
    corners = vertices[triangles]
    squares = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=(1, 2))
    top = 4.0 * np.sqrt(3.0) * areas(vertices, triangles)
    return np.asarray(np.divide(top, squares, out=np.zeros_like(top), where=squares > 0.0))


def _flat_faces(vertices: np.ndarray, triangles: np.ndarray, kinds: np.ndarray) -> np.ndarray:
    """Return the number of the flat face to which each triangle belongs, (m,).

    A flat face consists of connected triangles of one kind in one plane.
    """
    tolerance = FLAT * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    vectors = area_vectors(vertices, triangles)
    normal = unit_vectors(vectors)
    a, b = (side_pairs(triangles) // 3).T
    cosine = np.einsum("ij,ij->i", normal[a], normal[b])
    level = (kinds[a] == kinds[b]) & (cosine > np.cos(STRAIGHT))
    count, face = connected_pieces(a[level], b[level], len(triangles))
    area = np.zeros((count, 3))
    np.add.at(area, face, vectors)
    first = np.zeros(count, dtype=np.int64)
    first[face[::-1]] = triangles[::-1, 0]
    offset = vertices[triangles] - vertices[first[face]][:, None]
    distance = np.einsum("mkj,mj->mk", offset, unit_vectors(area)[face])
    bent = np.zeros(count, dtype=bool)  # many small steps add up to a curve
    bent[face[np.abs(distance).max(axis=1) > tolerance]] = True
    return np.where(bent[face], count + np.arange(len(face)), face)


class _TargetMesh:
    """Closed surface while part of it, the target, is remeshed.

    Each split, turn or collapse is made at many edges at once, chosen so that no two of the changes
    touch the same triangle.

    Attributes:
        target: marks the target's triangles, (m,).
        face: flat face of each triangle, (m,).
        source: given triangle from which each triangle stems, (m,).
        touched: marks the triangles that may change, (m,): the target's triangles, and triangles
            beside the target that were split because their common edge was.
        edge_order: sorted numbers that identify all edges, from the last call of `_edges`.
    """

    def __init__(
        self,
        vertices: np.ndarray,
        triangles: np.ndarray,
        target: np.ndarray,
        face: np.ndarray,
        size: float,
    ) -> None:
        self.vertices, self.triangles, self.size = vertices, triangles.astype(np.int64), size
        self.target, self.face, self.source = target, face, np.arange(len(triangles))
        self.touched = target.copy()
        self.edge_order = np.zeros(0, dtype=np.int64)
        self.rng = np.random.default_rng(0)

    def split(self) -> bool:
        """Halve sides of the target until none is too long. Return True if any was halved."""
        any_long = False
        while self._split_once():
            # turned now, because the halves of a thin triangle would otherwise be halved as they
            # are
            self.turn()
            any_long = True
        return any_long

    def _split_once(self) -> bool:
        """Halve sides that are too long, at most one in each triangle.

        Returns True if any was halved.
        """
        edges, sides, _ = self._edges()
        length = self._lengths(edges)
        beside = self.target[sides // 3].any(axis=1)
        # Random order within a class of lengths. Ranked by length, a row of equal strips would be
        # split strip by strip.
        rank = self.rng.random(len(length)) - np.floor(4.0 * np.log2(length))
        edge, wanted = np.repeat(np.arange(len(sides)), 2), (length > LONG * self.size) & beside
        chosen = self._independent(sides.ravel() // 3, edge, rank, wanted)
        middle = len(self.vertices) + np.arange(len(chosen))
        self.vertices = np.concatenate([self.vertices, self.vertices[edges[chosen]].mean(axis=1)])
        old, halves = sides[chosen].T.ravel() // 3, []
        for side in sides[chosen].T:
            t, k = side // 3, side % 3
            a, b, c = (self.triangles[t, (k + j) % 3] for j in range(3))
            halves.append(np.stack([middle, b, c], axis=1))
            self.triangles[t] = np.stack([a, middle, c], axis=1)
        self.touched[old] = True
        self.triangles = np.concatenate([self.triangles, *halves])
        for name in ("target", "face", "source", "touched"):
            column = getattr(self, name)
            setattr(self, name, np.concatenate([column, column[old]]))
        return len(chosen) > 0

    def turn(self) -> None:
        """Turn edges within flat faces until they are Delaunay.

        The two angles opposite each edge then sum to at most 180°. To turn an edge is to replace it
        by the other diagonal of its two triangles.
        """
        for _ in range(MAX_PASSES):
            sides = self._edges()[1]
            (t, u), (k, j) = (sides // 3).T, (sides % 3).T
            inner = (self.face[t] == self.face[u]) & self.touched[t] & self.touched[u]
            t, u, k, j = (column[inner] for column in (t, u, k, j))
            excess = self._angle(t, k) + self._angle(u, j) - np.pi
            over = excess > 1e-6
            t, u, k, j, excess = (column[over] for column in (t, u, k, j, excess))
            a, b = self.triangles[t, k], self.triangles[t, (k + 1) % 3]
            c, d = self.triangles[t, (k + 2) % 3], self.triangles[u, (j + 2) % 3]
            one, two = np.stack([c, a, d], axis=1), np.stack([d, b, c], axis=1)
            normal = self._area_vectors(self.triangles[t]) + self._area_vectors(self.triangles[u])
            wanted = (c != d) & ~self._are_linked(c, d)
            for new in (one, two):  # otherwise the two are not a convex quadrilateral
                wanted &= np.einsum("ij,ij->i", self._area_vectors(new), normal) > 0.0
            edge = np.tile(np.arange(len(t)), 2)
            chosen = self._independent(np.r_[t, u], edge, -excess, wanted)
            # Two edges turned at once could become the same edge. Only the first edge is turned.
            new_edges = np.sort(np.stack([c, d], axis=1)[chosen], axis=1)
            chosen = chosen[np.unique(new_edges, axis=0, return_index=True)[1]]
            if not len(chosen):
                return
            self.triangles[t[chosen]], self.triangles[u[chosen]] = one[chosen], two[chosen]

    def collapse(self) -> bool:
        """Merge points into near neighbours where this does not change the surface.

        Returns True if any point was merged.
        """
        changed = False
        for _ in range(MAX_CHANGES):
            edges, sides, crease = self._edges()
            free, along = self._movable(edges, crease)
            length = self._lengths(edges)
            touched = self.touched[sides // 3].all(axis=1)
            short = np.flatnonzero((length < SHORT * self.size) & touched)
            moved, kept = edges[short].T
            swap = ~free[moved] & ~(crease[short] & along[moved])
            moved, kept = np.where(swap, kept, moved), np.where(swap, moved, kept)
            usable = free[moved] | (crease[short] & along[moved])
            moved, kept, length = moved[usable], kept[usable], length[short][usable]
            if not len(moved):
                return changed
            rings = [self._rings(end) for end in (moved, kept)]
            ring, point = (np.concatenate(column) for column in zip(*rings, strict=True))
            chosen = self._independent(ring, point, length, self._collapses_well(moved, kept))
            if not len(chosen):
                return changed
            changed = True
            onto = np.arange(len(self.vertices))
            onto[moved[chosen]] = kept[chosen]
            self.triangles = onto[self.triangles]
            whole = (self.triangles != np.roll(self.triangles, 1, axis=1)).all(axis=1)
            for name in ("triangles", "target", "face", "source", "touched"):
                setattr(self, name, getattr(self, name)[whole])
            self.turn()
        return changed

    def smooth(self) -> None:
        """Move points inside flat faces half way to the mean of their neighbours.

        A point stays where it is if a triangle at it would get a worse shape.
        """
        edges, _, crease = self._edges()
        free, _ = self._movable(edges, crease)
        ends, others = np.r_[edges[:, 0], edges[:, 1]], np.r_[edges[:, 1], edges[:, 0]]
        sums = np.zeros_like(self.vertices)
        np.add.at(sums, ends, self.vertices[others])
        count = np.maximum(np.bincount(ends, minlength=len(self.vertices)), 1)[:, None]
        moved = np.where(free[:, None], 0.5 * (self.vertices + sums / count), self.vertices)
        before = triangle_quality(self.vertices, self.triangles)
        old = self._area_vectors(self.triangles)
        worst = np.full(len(self.vertices), np.inf)
        np.minimum.at(worst, self.triangles, before[:, None])
        for _ in range(MAX_CHANGES):
            turned = np.einsum("ij,ij->i", area_vectors(moved, self.triangles), old) <= 0.0
            least = worst[self.triangles].min(axis=1)
            spoiled = turned | (triangle_quality(moved, self.triangles) < least * (1.0 - 1e-9))
            back = np.unique(self.triangles[spoiled])
            if (moved[back] == self.vertices[back]).all():
                break
            moved[back] = self.vertices[back]
        else:
            return
        self.vertices = moved
        self.turn()

    def _edges(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the edges (e, 2) as pairs of points, their two sides (e, 2), and marks of creases.

        Side k of triangle t has the number 3 t + k. The marks (e,) are True at creases.
        """
        keys = edge_keys(self.triangles)
        sides = np.argsort(keys, kind="stable").reshape(-1, 2)
        self.edge_order = keys[sides[:, 0]]
        face = self.face[sides // 3]
        return sides_of(self.triangles)[sides[:, 0]], sides, face[:, 0] != face[:, 1]

    def _are_linked(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Return True where points a and b (e,) are the ends of an edge.

        The edges are those that the last call of `_edges` found.
        """
        keys = np.minimum(a, b) * (int(self.triangles.max()) + 1) + np.maximum(a, b)
        at = np.minimum(np.searchsorted(self.edge_order, keys), len(self.edge_order) - 1)
        return np.asarray(self.edge_order[at] == keys)

    def _lengths(self, edges: np.ndarray) -> np.ndarray:
        a, b = self.vertices[edges].transpose(1, 0, 2)
        return np.asarray(np.linalg.norm(b - a, axis=1))

    def _area_vectors(self, triangles: np.ndarray) -> np.ndarray:
        return area_vectors(self.vertices, triangles)

    def _angle(self, t: np.ndarray, k: np.ndarray) -> np.ndarray:
        """Return the angle [rad] in each triangle t (e,) opposite to its side of number k (e,)."""
        a, b, apex = (self.vertices[self.triangles[t, (k + j) % 3]] for j in range(3))
        to_a, to_b = a - apex, b - apex
        sine = np.linalg.norm(np.cross(to_a, to_b), axis=1)
        return np.asarray(np.arctan2(sine, np.einsum("ij,ij->i", to_a, to_b)))

    def _independent(
        self, triangle: np.ndarray, change: np.ndarray, rank: np.ndarray, wanted: np.ndarray
    ) -> np.ndarray:
        """Return the indices of wanted changes of the mesh of which no two touch the same triangle.

        Of the changes that touch a triangle, only the change of lowest rank may be made.

        Args:
            triangle, change: pairs of a triangle and a change that touches it, (k,) each.
            rank, wanted: rank of each change, and mark of the changes to make, (c,) each.
        """
        at = np.flatnonzero(wanted)
        place = np.full(len(rank), len(at))
        place[at[np.argsort(rank[at], kind="stable")]] = np.arange(len(at))
        best = np.full(len(self.triangles), len(at))
        np.minimum.at(best, triangle, place[change])
        beaten = best[triangle] < place[change]
        return at[~np.isin(at, change[beaten])]

    def _movable(self, edges: np.ndarray, crease: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return marks (n,) of points that may move in a flat face, and of points that may move
        along a straight crease.

        All triangles around such a point must be free to change.
        """
        n = len(self.vertices)
        inside = np.ones(n, dtype=bool)
        inside[self.triangles[~self.touched]] = False
        ends = edges[crease]
        count = np.bincount(ends.ravel(), minlength=n)
        directions = np.zeros((n, 3))
        unit = unit_vectors(self.vertices[ends[:, 1]] - self.vertices[ends[:, 0]])
        np.add.at(directions, ends[:, 0], unit)
        np.add.at(directions, ends[:, 1], -unit)
        straight = np.linalg.norm(directions, axis=1) < STRAIGHT * 1e-2
        return inside & (count == 0), inside & (count == 2) & straight

    def _rings(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the triangles around points (p,), and for each triangle the index of its point."""
        corner = np.argsort(self.triangles.ravel(), kind="stable")
        start = np.searchsorted(self.triangles.ravel()[corner], np.arange(len(self.vertices) + 1))
        count = start[points + 1] - start[points]
        point = np.repeat(np.arange(len(points)), count)
        inside = count_up(count)
        return corner[start[points][point] + inside] // 3, point

    def _collapses_well(self, moved: np.ndarray, kept: np.ndarray) -> np.ndarray:
        """Return True where points `moved` can be merged into points `kept`, all (p,).

        The surface must stay the same closed surface, without long sides or thinner triangles.
        """
        ring, point = self._rings(moved)
        old = self.triangles[ring]
        new = np.where(old == moved[point][:, None], kept[point][:, None], old)
        stays = ~(old == kept[point][:, None]).any(axis=1)
        facing = np.einsum("ij,ij->i", self._area_vectors(old), self._area_vectors(new))
        corners = self.vertices[new]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        least = np.minimum(triangle_quality(self.vertices, old), 0.3)
        thinner = triangle_quality(self.vertices, new) < least
        wrong = stays & ((facing <= 0.0) | (longest > LONG * self.size) | thinner)
        bad = np.bincount(point[wrong], minlength=len(moved)) > 0
        # The two ends may share only the two neighbours across the edge. Otherwise the surface
        # would touch itself.
        n = len(self.vertices)
        who, other = np.divmod(np.unique(np.repeat(point, 3) * n + old.ravel()), n)
        shared = (other != moved[who]) & (other != kept[who]) & self._are_linked(other, kept[who])
        return np.asarray(~bad & (np.bincount(who[shared], minlength=len(moved)) == 2))
