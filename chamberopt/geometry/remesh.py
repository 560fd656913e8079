"""The target in triangles of a wished size, on the very surface that was given.

Sides longer than 4/3 of the size are halved, sides shorter than 0.6 of it are closed, edges turned until they
are Delaunay, points moved to the middle of their neighbours (M. Botsch and L. Kobbelt, Symposium on Geometry
Processing 2004, 185): each only where the surface does not change, that is within a flat face or along a
straight edge between two. A surface that curves in steps finer than the size stays in those steps.
"""

from __future__ import annotations

import numpy as np

from chamberopt.geometry.triangles import area_vectors, edge_keys, unit_vectors

LONG, SHORT = (
    4.0 / 3.0,
    0.6,
)  # of the size; a halved side is 2/3 of it, so that nothing is split and closed in turn
FLAT = 1e-6  # of the bounding box's diagonal: what a text format with 6 digits rounds away
STRAIGHT = 1e-3  # rad; turns a ball's path by less than roughness does
ROUNDS = 5


def remesh(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray, kinds: np.ndarray, size: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The closed surface with its target in triangles with sides of about size [m], and of which each one is.

    vertices (n, 3) m · triangles (m, 3) · target (m,) bool · kinds (m,): triangles of different kinds are
    never mixed. Returns vertices, triangles and (k,) one given triangle in the same flat face and of that kind.
    """
    net = _Net(vertices, triangles, target, _faces(vertices, triangles, kinds), size)
    for _ in range(ROUNDS):
        if not (net.split() | net.close()):
            break
        net.smooth()
    net.split()  # what turning and evening out made longer
    used, numbers = np.unique(net.triangles, return_inverse=True)
    return net.vertices[used], numbers.reshape(-1, 3), net.source


def triangle_quality(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """4 √3 area / sum of squared sides, (m,): 1 for an equilateral triangle, 0 for one without area."""
    corners = vertices[triangles]
    squares = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=(1, 2))
    area = np.linalg.norm(area_vectors(vertices, triangles), axis=1)
    return np.divide(
        4.0 * np.sqrt(3.0) * area, squares, out=np.zeros_like(area), where=squares > 0.0
    )


def _faces(vertices: np.ndarray, triangles: np.ndarray, kinds: np.ndarray) -> np.ndarray:
    """Which flat face (m,) each triangle is in: neighbours of one kind and plane."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    reach = FLAT * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    normal = unit_vectors(area_vectors(vertices, triangles))
    a, b = (np.argsort(edge_keys(triangles), kind="stable").reshape(-1, 2) // 3).T
    level = (kinds[a] == kinds[b]) & (
        np.einsum("ij,ij->i", normal[a], normal[b]) > np.cos(STRAIGHT)
    )
    graph = coo_array((np.ones(level.sum()), (a[level], b[level])), shape=(len(triangles),) * 2)
    count, face = connected_components(graph, directed=False)
    area = np.zeros((count, 3))
    np.add.at(area, face, area_vectors(vertices, triangles))
    first = np.zeros(count, dtype=np.int64)
    first[face[::-1]] = triangles[::-1, 0]
    off = np.einsum(
        "mkj,mj->mk", vertices[triangles] - vertices[first[face]][:, None], unit_vectors(area)[face]
    )
    bent = np.zeros(count, dtype=bool)
    bent[face[np.abs(off).max(axis=1) > reach]] = True  # many small steps that add up to a curve
    return np.where(bent[face], count + np.arange(len(face)), face)


class _Net:
    """A closed surface under way. Each change is made at many places at once, none of which touch one another."""

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
        self.links = np.zeros(0, dtype=np.int64)  # keys of all edges, in order
        self.lots = np.random.default_rng(0)
        self.touched = (
            target.copy()
        )  # outside of the target, only what its edges had to split may change

    def split(self) -> bool:
        """Halves sides of the target that are too long, until there is none; was there any?"""
        any_long = False
        while self._split_once():
            self.turn()  # at once, or the halves of a thin triangle would be halved on as they are
            any_long = True
        return any_long

    def _split_once(self) -> bool:
        """Halves one side that is too long in each triangle that has one."""
        edges, sides = self._edges()
        length = self._lengths(edges)
        beside = self.target[sides // 3].any(axis=1)
        # Within a class of lengths by lot: ranked by length, a row of equal strips would take its turns one by one.
        rank = self.lots.random(len(length)) - np.floor(4.0 * np.log2(length))
        chosen = self._independent(sides // 3, rank, (length > LONG * self.size) & beside)
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
        """Turns edges within flat faces until the angles across each add up to no more than 180 degrees."""
        for _ in range(50):
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
            normal = area_vectors(self.vertices, self.triangles[t]) + area_vectors(
                self.vertices, self.triangles[u]
            )
            wanted = c != d
            for new in (one, two):  # else the two are no convex quadrilateral
                wanted &= np.einsum("ij,ij->i", area_vectors(self.vertices, new), normal) > 0.0
            wanted &= ~self._linked(c, d)
            chosen = self._independent(np.stack([t, u], axis=1), -excess, wanted)
            # Two edges turned at once could become one and the same: only the first of such is turned.
            chosen = chosen[
                np.unique(
                    np.sort(np.stack([c, d], axis=1)[chosen], axis=1), axis=0, return_index=True
                )[1]
            ]
            if not len(chosen):
                return
            self.triangles[t[chosen]], self.triangles[u[chosen]] = one[chosen], two[chosen]

    def close(self) -> bool:
        """Closes sides that are too short, by moving a point that shapes nothing onto its neighbour."""
        changed = False
        for _ in range(20):
            edges, sides = self._edges()
            crease = self.face[sides // 3][:, 0] != self.face[sides // 3][:, 1]
            free, along = self._free(edges, crease)
            length = self._lengths(edges)
            short = np.flatnonzero(
                (length < SHORT * self.size) & self.touched[sides // 3].all(axis=1)
            )
            moved, kept = edges[short].T
            swap = ~free[moved] & ~(crease[short] & along[moved])
            moved, kept = np.where(swap, kept, moved), np.where(swap, moved, kept)
            usable = free[moved] | (crease[short] & along[moved])
            moved, kept, length = moved[usable], kept[usable], length[short][usable]
            if not len(moved):
                return changed
            ring, whose = self._rings(moved)
            fine = self._closes_well(moved, kept, ring, whose)
            chosen = self._apart(moved, kept, length, fine)
            if not len(chosen):
                return changed
            changed = True
            onto = np.arange(len(self.vertices))
            onto[moved[chosen]] = kept[chosen]
            self.triangles = onto[self.triangles]
            a, b, c = self.triangles.T
            whole = (a != b) & (b != c) & (c != a)
            for name in ("triangles", "target", "face", "source", "touched"):
                setattr(self, name, getattr(self, name)[whole])
            self.turn()
        return changed

    def smooth(self) -> None:
        """Moves points inside flat faces half way to the middle of their neighbours, where no triangle gets worse."""
        edges, sides = self._edges()
        crease = self.face[sides // 3][:, 0] != self.face[sides // 3][:, 1]
        free, _ = self._free(edges, crease)
        ends, others = np.r_[edges[:, 0], edges[:, 1]], np.r_[edges[:, 1], edges[:, 0]]
        sums = np.zeros_like(self.vertices)
        np.add.at(sums, ends, self.vertices[others])
        count = np.maximum(np.bincount(ends, minlength=len(self.vertices)), 1)[:, None]
        moved = np.where(free[:, None], 0.5 * (self.vertices + sums / count), self.vertices)
        before, old = (
            triangle_quality(self.vertices, self.triangles),
            area_vectors(self.vertices, self.triangles),
        )
        worst = np.full(len(self.vertices), np.inf)
        np.minimum.at(worst, self.triangles, before[:, None])
        for _ in range(20):
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

    def _edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Edges (e, 2), and the two sides (e, 2) at each: 3 t + k runs from corner k of triangle t to the next."""
        keys = edge_keys(self.triangles)
        sides = np.argsort(keys, kind="stable").reshape(-1, 2)
        self.links = keys[sides[:, 0]]
        t, k = sides[:, 0] // 3, sides[:, 0] % 3
        return np.stack([self.triangles[t, k], self.triangles[t, (k + 1) % 3]], axis=1), sides

    def _linked(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Are points a and b (e,) ends of an edge, of those that `_edges` saw last?"""
        keys = np.minimum(a, b) * (int(self.triangles.max()) + 1) + np.maximum(a, b)
        return (
            self.links[np.minimum(np.searchsorted(self.links, keys), len(self.links) - 1)] == keys
        )

    def _lengths(self, edges: np.ndarray) -> np.ndarray:
        a, b = self.vertices[edges].transpose(1, 0, 2)
        return np.linalg.norm(b - a, axis=1)

    def _angle(self, t: np.ndarray, k: np.ndarray) -> np.ndarray:
        """The angle (e,) of triangles t opposite their sides k."""
        a, b, apex = (self.vertices[self.triangles[t, (k + j) % 3]] for j in range(3))
        to_a, to_b = a - apex, b - apex
        return np.arctan2(
            np.linalg.norm(np.cross(to_a, to_b), axis=1), np.einsum("ij,ij->i", to_a, to_b)
        )

    def _independent(
        self, touching: np.ndarray, rank: np.ndarray, wanted: np.ndarray
    ) -> np.ndarray:
        """Those wanted (e,) that come first, by rank, in both triangles (e, 2) they touch."""
        at = np.flatnonzero(wanted)
        place = np.empty(len(at), dtype=np.int64)
        place[np.argsort(rank[at], kind="stable")] = np.arange(len(at))
        best = np.full(len(self.triangles), len(at))
        np.minimum.at(best, touching[at], place[:, None])
        return at[(best[touching[at]] == place[:, None]).all(axis=1)]

    def _free(self, edges: np.ndarray, crease: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which points (n,) lie inside a flat face, and which on a straight edge between two; all around touched."""
        n = len(self.vertices)
        quiet = np.ones(n, dtype=bool)
        quiet[self.triangles[~self.touched]] = False
        ends = edges[crease]
        count = np.bincount(ends.ravel(), minlength=n)
        ways = np.zeros((n, 3))
        unit = unit_vectors(self.vertices[ends[:, 1]] - self.vertices[ends[:, 0]])
        np.add.at(ways, ends[:, 0], unit)
        np.add.at(ways, ends[:, 1], -unit)
        straight = np.linalg.norm(ways, axis=1) < STRAIGHT * 1e-2
        return quiet & (count == 0), quiet & (count == 2) & straight

    def _rings(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The triangles around each of some points (p,): their indices, and which of the points each one is at."""
        corner = np.argsort(self.triangles.ravel(), kind="stable")
        start = np.searchsorted(self.triangles.ravel()[corner], np.arange(len(self.vertices) + 1))
        count = start[points + 1] - start[points]
        whose = np.repeat(np.arange(len(points)), count)
        inside = np.arange(len(whose)) - np.repeat(np.cumsum(count) - count, count)
        return corner[start[points][whose] + inside] // 3, whose

    def _closes_well(
        self, moved: np.ndarray, kept: np.ndarray, ring: np.ndarray, whose: np.ndarray
    ) -> np.ndarray:
        """Does the surface stay a surface, the same, without sides too long or thinner triangles?"""
        old = self.triangles[ring]
        new = np.where(old == moved[whose][:, None], kept[whose][:, None], old)
        stays = ~(old == kept[whose][:, None]).any(axis=1)
        before, after = area_vectors(self.vertices, old), area_vectors(self.vertices, new)
        corners = self.vertices[new]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        floor = np.minimum(triangle_quality(self.vertices, old), 0.3)
        wrong = stays & (
            (np.einsum("ij,ij->i", before, after) <= 0.0)
            | (longest > LONG * self.size)
            | (triangle_quality(self.vertices, new) < floor)
        )
        bad = np.bincount(whose[wrong], minlength=len(moved)) > 0
        # Neighbours that both ends have must be the two across the edge, else the surface would touch itself.
        n = len(self.vertices)
        who, other = np.divmod(np.unique(np.repeat(whose, 3) * n + old.ravel()), n)
        shared = (other != moved[who]) & (other != kept[who]) & self._linked(other, kept[who])
        return ~bad & (np.bincount(who[shared], minlength=len(moved)) == 2)

    def _apart(
        self, moved: np.ndarray, kept: np.ndarray, rank: np.ndarray, fine: np.ndarray
    ) -> np.ndarray:
        """Those fine (p,) that come first, by rank, in every triangle around both of their ends."""
        at = np.flatnonzero(fine)
        place = np.empty(len(at), dtype=np.int64)
        place[np.argsort(rank[at], kind="stable")] = np.arange(len(at))
        best = np.full(len(self.triangles), len(at))
        rings = [self._rings(end[at]) for end in (moved, kept)]
        for ring, whose in rings:
            np.minimum.at(best, ring, place[whose])
        first = np.ones(len(at), dtype=bool)
        for ring, whose in rings:
            np.logical_and.at(first, whose, best[ring] == place[whose])
        return at[first]
