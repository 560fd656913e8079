"""Tell the shapes of a surface's faces: holes, tubes, teeth, rings of faces, fillets, bevels."""

from __future__ import annotations

import math

import numpy as np

from chamberopt.geometry.faces import Faces
from chamberopt.geometry.triangles import area_vectors, areas, side_pairs, unit_vectors

PATTERN = 6  # number of alike faces, or of teeth, that make a repeated feature
ALL_ROUND = 0.2  # sum of a face's area vectors over its area, below which it goes all round
FLAT = 0.95  # the same, above which a face is flat
# Faces stand round an axis where the variances of their middles along both axes of their plane
# differ by less than this share.
RING = 0.1
# A face may go on from tooth to tooth: the mean radius over the angle round its axis then swings by
# so much of itself or more, and repeats: this share of its variance is that of one harmonic and of
# its multiples.
SWING, PERIODIC, ANGLES = 0.02, 0.8, 720
# A fillet is a hollow face that goes on smoothly at this share of its border or more, up to this
# angle. It is more hollow than it bulges. Its radius is less than this share of the part's size.
SMOOTH_BORDER, SMOOTH_DEG, WIDE_FILLET = 0.5, 10.0, 0.2
# A bevel turns from its neighbours by angles between these, at this share of its border or more. It
# is narrower than a wide fillet.
BEVEL_DEG, BEVEL_BORDER = (20.0, 70.0), 0.5


def is_hole(vertices: np.ndarray, triangles: np.ndarray) -> bool:
    """Return whether faces of a part look towards their own middle, as the wall of a hole does."""
    vectors, middles = area_vectors(vertices, triangles), vertices[triangles].mean(axis=1)
    weight = np.linalg.norm(vectors, axis=1)
    inward = np.average(middles, axis=0, weights=weight) - middles
    return bool((inward * vectors).sum() > 0.0)


def is_inside_of_tube(vertices: np.ndarray, triangles: np.ndarray) -> bool:
    """Return whether a face is the inside of a tube, which looks at itself all round."""
    vectors = area_vectors(vertices, triangles)
    size = float(np.linalg.norm(vectors, axis=1).sum())
    is_round = np.linalg.norm(vectors.sum(axis=0)) < ALL_ROUND * size
    return bool(is_round and is_hole(vertices, triangles))


def is_ring(faces: Faces, vertices: np.ndarray, triangles: np.ndarray, own: np.ndarray) -> bool:
    """Return whether faces stand evenly round an axis.

    Args:
        faces: of the surface.
        vertices, triangles: of the surface [m], (n, 3) and (m, 3).
        own: marks the triangles of those faces that are asked for, (m,) bool.
    """
    weight = areas(vertices, triangles[own])
    middle = vertices[triangles[own]].mean(axis=1)
    numbers, row = np.unique(faces.of_triangle[own], return_inverse=True)
    whole = np.bincount(row, weight)
    places = np.stack([np.bincount(row, weight * x) / whole for x in middle.T], axis=1)
    _, wide, widest = np.linalg.eigvalsh(np.cov(places.T, bias=True))
    return len(numbers) > 2 and bool(widest - wide < RING * widest)


def teeth_of(vertices: np.ndarray, triangles: np.ndarray) -> int:
    """Return how often a face repeats round its axis, such as one of all teeth; 0 if it does not.

    Its axis goes through its middle, across the plane in which it spreads alike. A flat face, such
    as the end of a gear, has no teeth. Fewer than PATTERN are not told from a round face.
    """
    vectors, weight = area_vectors(vertices, triangles), areas(vertices, triangles)
    if np.linalg.norm(vectors.sum(axis=0)) > FLAT * np.linalg.norm(vectors, axis=1).sum():
        return 0
    middles = vertices[triangles].mean(axis=1)
    middles = middles - np.average(middles, axis=0, weights=weight)
    spread, axes = np.linalg.eigh(np.cov(middles.T, aweights=weight, bias=True))
    odd = 0 if spread[2] - spread[1] < spread[1] - spread[0] else 2
    x, y = (middles @ axes.T[k] for k in range(3) if k != odd)
    angle, radius = np.arctan2(y, x), np.hypot(x, y)
    own = np.floor((angle / (2.0 * np.pi) + 0.5) * ANGLES).astype(int) % ANGLES
    sums = np.bincount(own, weight, ANGLES), np.bincount(own, weight * radius, ANGLES)
    known = np.flatnonzero(sums[0])
    profile = sums[1][known] / sums[0][known]
    profile = np.interp(np.arange(ANGLES), known, profile, period=ANGLES)
    power = np.abs(np.fft.rfft(profile)[1:]) ** 2
    count = PATTERN + int(power[PATTERN - 1 :].argmax())
    if profile.std() < SWING * profile.mean() or not power.any():
        return 0
    share = power[count - 1 :: count].sum() / power.sum()
    return count if share >= PERIODIC else 0


def find_fillets(
    faces: Faces,
    vertices: np.ndarray,
    triangles: np.ndarray,
    normals: np.ndarray,
    least_bend: float = 0.0,
    bowl: float = 2.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of the faces that are fillets, and the curvature of each [1/m], both (k,).

    Args:
        faces: of the surface, as its CAD file has them or as its curvature parts them.
        vertices, triangles: of the surface [m], (n, 3) and (m, 3).
        normals: at the corners of each triangle, (m, 3, 3).
        least_bend: least angle by which a fillet turns over its mean width [rad].
        bowl: share of a fillet's curvature from which on what is as hollow across it is a bowl;
            above 1 nothing is one.
    """
    most, other = _hollow_curvatures(vertices, triangles, normals)
    hollow = np.where(most + other > 0.0, most, 0.0)  # not inside a coil, which bulges more
    corner = np.arange(triangles.size).reshape(-1, 3)
    after = np.roll(corner, -1, axis=1).reshape(-1)  # of each corner, the next one of its triangle
    one, two = side_pairs(triangles).T  # a side begins at its corner, the other one ends there
    of, beyond = faces.of_triangle[one // 3], faces.of_triangle[two // 3]
    places, flat_normals = vertices[triangles].reshape(-1, 3), normals.reshape(-1, 3)
    long = np.linalg.norm(places[one] - places[after[one]], axis=1) * (of != beyond)
    turn = np.einsum("ij,ij->i", flat_normals[one], flat_normals[after[two]])
    smooth = long * (turn > math.cos(math.radians(SMOOTH_DEG)))
    border, goes_on = (
        np.bincount(of, x, faces.count) + np.bincount(beyond, x, faces.count)
        for x in (long, smooth)
    )
    likely = np.flatnonzero((goes_on >= SMOOTH_BORDER * border) & (border > 0.0))
    bent, across = (
        np.array([np.median(one[faces.of_triangle == k]) for k in likely])
        for one in (hollow, other)
    )
    width = 2.0 * faces.area[likely] / border[likely]
    found = (bent > least_curvature(vertices)) & (bent * width > least_bend)
    found &= across < bowl * bent
    return likely[found], bent[found]


def find_bevels(faces: Faces, vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the numbers of the faces that bevel a hollow corner, as a fillet weld does, (k,).

    They meet their neighbours, which are no bevels, in hollow edges. The sides of a hexagon socket
    and the facets of a coarse fillet are none.

    Args:
        faces: of the surface, as its sharp edges part them.
        vertices, triangles: of the surface [m], (n, 3) and (m, 3).
    """
    sides, along, turn = _hollow_turns(vertices, triangles)
    of, beyond = (faces.of_triangle[one // 3] for one in sides.T)
    long = np.linalg.norm(along, axis=1) * (of != beyond)
    bevelled = (BEVEL_DEG[0] < turn) & (turn < BEVEL_DEG[1]) & (long > 0.0)
    border, hollow = (
        np.bincount(of, x, faces.count) + np.bincount(beyond, x, faces.count)
        for x in (long, long * bevelled)
    )
    widest = WIDE_FILLET * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    is_bevel = (hollow >= BEVEL_BORDER * border) & (2.0 * faces.area < widest * hollow)
    beside = bevelled & is_bevel[of] & is_bevel[beyond]
    is_bevel[of[beside]] = is_bevel[beyond[beside]] = False
    return np.flatnonzero(is_bevel)


def leg_of_bevel(vertices: np.ndarray, triangles: np.ndarray, own: np.ndarray) -> float:
    """Return the leg of bevels [m], how far they reach along their neighbours from the hidden root.

    It is the mean of several, each as wide along both of its neighbours.

    Args:
        vertices, triangles: of the surface [m], (n, 3) and (m, 3).
        own: marks the triangles of the bevels, (m,) bool.
    """
    sides, along, turn = _hollow_turns(vertices, triangles)
    long = np.linalg.norm(along, axis=1) * _is_toe(sides, turn, own)
    width = 2.0 * float(areas(vertices, triangles[own]).sum() / long.sum())
    return 0.5 * width / math.cos(math.radians(float(np.average(turn, weights=long))))


def beside(vertices: np.ndarray, triangles: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Mark the triangles of the faces that go on from a piece of a surface, (m,) bool.

    They go on over its hollow edges, such as the toes of a weld, and smoothly, as from a fillet.

    Args:
        vertices, triangles: of the surface [m], (n, 3) and (m, 3).
        own: marks the piece, (m,) bool. None of it is marked.
    """
    sides, _, turn = _hollow_turns(vertices, triangles)
    one, other = own[sides // 3].T
    touching = np.unique(sides[(one != other) & (turn > -BEVEL_DEG[0])] // 3)
    faces = Faces(vertices, triangles, BEVEL_DEG[0])
    return np.asarray(np.isin(faces.of_triangle, faces.of_triangle[touching]) & ~own)


def _is_toe(sides: np.ndarray, turn: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Mark pairs of sides (e,) at which a piece of a surface ends in a hollow edge.

    Args:
        sides, turn: as of _hollow_turns.
        own: marks the piece, (m,) bool.
    """
    one, other = own[sides // 3].T
    return np.asarray((one != other) & (turn > BEVEL_DEG[0]))


def hollow_edges(vertices: np.ndarray, triangles: np.ndarray, least_deg: float) -> np.ndarray:
    """Return the ends of the sides at which a surface is hollow and sharp, (k, 2, 3) [m].

    Args:
        vertices, triangles: of the surface [m], (n, 3) and (m, 3).
        least_deg: by which it turns there at least [degrees].
    """
    sides, along, turn = _hollow_turns(vertices, triangles)
    start = vertices[triangles].reshape(-1, 3)[sides[:, 0]]
    return np.stack([start, start + along], axis=1)[turn > least_deg]


def _hollow_turns(
    vertices: np.ndarray, triangles: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the pairs of sides of a surface, and by which angle it turns there to be hollow.

    Returns:
        Corners at which the one side begins and the other one ends, (e, 2).
        The one side, from its beginning to its end, (e, 3) [m].
        Angle [degrees], below 0 where the surface bulges, (e,).
    """
    normals = unit_vectors(area_vectors(vertices, triangles))
    sides = side_pairs(triangles)
    corners = vertices[triangles]
    along = (np.roll(corners, -1, axis=1) - corners).reshape(-1, 3)[sides[:, 0]]
    first, second = normals[sides // 3].swapaxes(0, 1)
    turn = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", first, second), -1.0, 1.0)))
    bulges = np.einsum("ij,ij->i", np.cross(first, second), along) >= 0.0
    return sides, along, np.where(bulges, -turn, turn)


def least_curvature(vertices: np.ndarray) -> float:
    """Return the least curvature of a part's fillets [1/m]."""
    return 1.0 / (WIDE_FILLET * float(np.linalg.norm(np.ptp(vertices, axis=0))))


def _hollow_curvatures(
    vertices: np.ndarray, triangles: np.ndarray, normals: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return how hollow each triangle is from its normals [1/m], most and across that, both (m,).

    Where it bulges they are negative.

    The curvatures along the three sides make up its second fundamental form: S. Rusinkiewicz,
    "Estimating Curvatures and Their Derivatives on Triangle Meshes" (2004).

    Args:
        vertices, triangles: [m], (n, 3) and (m, 3).
        normals: at the corners of each triangle, (m, 3, 3).
    """
    corners = vertices[triangles]
    step, bend = (np.roll(x, -1, axis=1) - x for x in (corners, normals))
    along = unit_vectors(step[:, 0])
    across = np.cross(unit_vectors(area_vectors(vertices, triangles)), along)
    square = np.maximum(np.einsum("mki,mki->mk", step, step), 1e-30)
    u, v = (np.einsum("mki,mi->mk", step, axis) for axis in (along, across))
    form = np.stack([u * u, 2.0 * u * v, v * v], axis=2) / square[..., None]
    value = np.einsum("mki,mki->mk", bend, step) / square
    p, q, r = np.einsum("mij,mj->mi", np.linalg.pinv(form), value).T
    half, mean = np.hypot(0.5 * (p - r), q), -0.5 * (p + r)
    return mean + half, mean - half
