"""Local thickness of a closed part, where it is a plate: on average over each of its triangles.

From points spread evenly over the surface, rays go inwards along the normal and in a cone about it.
The thickness at a point is the median of their depths, and then of those of its neighbours on the
same side of the part, so that a ray near an edge, which leaves through the side, does not count.

A tooth or a rib is no plate, however thin. A place counts as a plate if it lies in a disc on the
surface with a radius of DISC thicknesses and without a border inside: an edge, a corner, a fillet,
or where the part becomes twice as thick.

Notation:
    h: thickness at a sample point [m], inf where it is not a plate
    x, n: place [m] and unit normal of a sample point
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from chamberopt.geometry.triangles import EVEN_STEP, areas, count_up, unit_normals, unit_vectors

SPACING = 0.5  # of sample points, over the length of the smoothing
MAX_SAMPLES = 20_000
CONE_DEG = 20.0  # between the normal and the rays about it
RAYS = 6  # about the normal
NEIGHBOURS = 16  # of a sample point at most; SPACING makes about 12
DISC = 2.0  # thicknesses; a border nearer than this to all places of a thin region makes it a rib
SAME_SIDE = 0.7  # cosine between the normals of places on one side of a plate: 45 degrees
BECOMES_THICK = 2.0  # times the thickness: there a plate ends
RIM = 2.0  # discs' radii; a corner of a plate is 1.4 from the middle of the last disc in it
MAX_PAIRS = 400  # second points of a pair for each first one, about
AT_ONCE = 4000  # first points of pairs, which take 40 MB


class Samples(NamedTuple):
    """Points spread evenly over the surface of a part."""

    place: np.ndarray  # [m], (k, 3)
    normal: np.ndarray  # unit vectors outwards, (k, 3)
    triangle: np.ndarray  # triangle of each, (k,)
    thickness: np.ndarray  # [m], (k,); inf where the part is thicker than the reach, or no plate
    spacing: float  # [m]; each point stands for its square


def measure_depth(
    vertices: np.ndarray, triangles: np.ndarray, length: float, reach: float
) -> Samples:
    """Return points spread over a closed surface, with the thickness of the part at each.

    Teeth and ribs are still among them: `only_plates` leaves these out.

    Args:
        vertices, triangles: the surface [m], normals outwards.
        length: distance over which the thickness is smoothed [m].
        reach: largest thickness that is measured [m].
    """
    samples = _spread(vertices, triangles, length)
    depth = _depth(vertices[triangles], samples, reach)
    return _smoothed(samples._replace(thickness=depth), length)


def depth_below(
    vertices: np.ndarray, triangles: np.ndarray, chosen: np.ndarray, share: float, reach: float
) -> float:
    """Return the depth of material [m] than which a share of the chosen area has less.

    It is infinite from `reach` [m] on. The depth is smoothed over a fifth of that.

    Args:
        vertices, triangles: those of measure_depth.
        chosen: marks the chosen triangles, (m,).
    """
    samples = measure_depth(vertices, triangles, 0.2 * reach, reach)
    depths = np.sort(samples.thickness[chosen[samples.triangle]])
    return float(depths[int(share * len(depths))]) if len(depths) else float(np.inf)


def bare_behind(
    vertices: np.ndarray,
    triangles: np.ndarray,
    chosen: np.ndarray,
    peened: np.ndarray,
    thickest: float,
) -> float:
    """Return the share of a chosen area with a thinner part under it and nothing peened behind it.

    Args:
        vertices, triangles, chosen: those of depth_below.
        peened: marks the triangles that are peened, chosen or not, (m,).
        thickest: thickness [m] below which the part is thin.
    """
    samples = measure_depth(vertices, triangles, 0.2 * thickest, thickest)
    own = chosen[samples.triangle]
    thin = np.flatnonzero(own & np.isfinite(samples.thickness))
    if not len(thin):
        return 0.0
    normal = samples.normal[thin]
    behind = samples.place[thin] - samples.thickness[thin, None] * normal
    length = max(thickest, 2.0 * samples.spacing)
    beyond = _nearest(samples, behind, -normal, length)
    return float((~peened[samples.triangle[beyond]]).sum() / own.sum())


def only_plates(samples: Samples) -> Samples:
    """Return the points with an infinite thickness where the part is no plate."""
    return samples._replace(thickness=np.where(_in_plate(samples), samples.thickness, np.inf))


def thickness_of_triangles(
    samples: Samples, vertices: np.ndarray, triangles: np.ndarray, length: float
) -> np.ndarray:
    """Return the thickness of each triangle [m], (m,); inf where it is no plate or too thick.

    A triangle has the thickness h whose h⁻² is the mean over its area, as for a ball that may hit
    it anywhere.

    The arguments are those of measure_depth, and its points.
    """
    inverse = 1.0 / np.square(samples.thickness)
    count = np.bincount(samples.triangle, minlength=len(triangles))
    total = np.bincount(samples.triangle, inverse, len(triangles))
    mean = np.divide(total, count, out=np.zeros(len(triangles)), where=count > 0)
    lone = np.flatnonzero(count == 0)
    if len(lone) and inverse.any():
        corners = vertices[triangles[lone]]
        mean[lone] = inverse[_nearest(samples, corners.mean(axis=1), unit_normals(corners), length)]
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / np.sqrt(mean))


def _spread(vertices: np.ndarray, triangles: np.ndarray, length: float) -> Samples:
    """Return points over all triangles, as many as their areas ask for."""
    area = areas(vertices, triangles)
    each = max((SPACING * length) ** 2, area.sum() / MAX_SAMPLES)
    ends = np.floor(np.cumsum(area) / each + 0.5).astype(np.int64)
    count = np.diff(ends, prepend=0)
    triangle = np.repeat(np.arange(len(triangles)), count)
    share = (0.5 + (count_up(count)[:, None] + 1) * EVEN_STEP) % 1.0
    beyond = share.sum(axis=1) > 1.0
    share[beyond] = 1.0 - share[beyond]
    corners = vertices[triangles[triangle]]
    sides = corners[:, 1:] - corners[:, :1]
    place = corners[:, 0] + np.einsum("kj,kji->ki", share, sides)
    depth = np.full(len(place), np.inf)
    return Samples(place, unit_normals(corners), triangle, depth, float(np.sqrt(each)))


def _depth(corners: np.ndarray, samples: Samples, reach: float) -> np.ndarray:
    """Return the median depth of the part under each point by rays, (k,) [m]; inf beyond reach."""
    from sim_core import ray_lengths

    inwards, tilt = -samples.normal, np.radians(CONE_DEG)
    axis = np.eye(3)[np.abs(inwards).argmin(axis=1)]
    one = unit_vectors(np.cross(inwards, axis))
    two = np.cross(inwards, one)
    ways = [inwards]
    for angle in 2.0 * np.pi * np.arange(RAYS) / RAYS:
        aside = np.cos(angle) * one + np.sin(angle) * two
        ways.append(np.cos(tilt) * inwards + np.sin(tilt) * aside)
    starts = np.tile(samples.place, (len(ways), 1))
    lengths = ray_lengths(corners, starts, np.concatenate(ways), reach / np.cos(tilt))
    depths = lengths.reshape(len(ways), -1) * np.cos([[0.0], *[[tilt]] * RAYS])
    depth = np.median(depths, axis=0)
    return np.where(depth < reach, depth, np.inf)


def _tree_space(place: np.ndarray, normal: np.ndarray, length: float) -> np.ndarray:
    """Return places and normals in one space, (k, 6), where 1 radian is as far as ``length``."""
    return np.concatenate([place, length * normal], axis=1)


def _smoothed(samples: Samples, length: float) -> Samples:
    """Return the points with the median thickness of their neighbours within ``length``."""
    from scipy.spatial import KDTree

    if not np.isfinite(samples.thickness).any():
        return samples
    places = _tree_space(samples.place, samples.normal, length)
    most = min(NEIGHBOURS, len(places))
    found = KDTree(places).query(places, k=range(1, most + 1), distance_upper_bound=length)[1]
    values = np.append(samples.thickness, np.nan)[found]
    values.sort(axis=1)  # NaN last
    count = (found < len(places)).sum(axis=1)
    rows = np.arange(len(places))
    low, high = values[rows, (count - 1) // 2], values[rows, count // 2]
    return samples._replace(thickness=np.where(np.isinf(high), high, 0.5 * (low + high)))


def _nearest(samples: Samples, place: np.ndarray, normal: np.ndarray, length: float) -> np.ndarray:
    """Return the point nearest to each place on the same side of the part, (n,)."""
    from scipy.spatial import KDTree

    tree = KDTree(_tree_space(samples.place, samples.normal, length))
    return np.asarray(tree.query(_tree_space(place, normal, length))[1])


def _in_plate(samples: Samples) -> np.ndarray:
    """Mark the points (k,) that lie in a disc of DISC thicknesses on a plate, without a border."""
    radius = DISC * samples.thickness
    inside = border_distance(samples, radius) > radius  # the middle of such a disc
    found = inside.copy()
    for one, two, away in _pairs(samples, 1.1 * RIM * radius):
        # The disc around ``two`` counts as RIM times as wide, so that it fills corners.
        own = np.flatnonzero(inside[two] & (away <= RIM * radius[two]))
        one, two = one[own], two[own]
        cosine = np.einsum("ij,ij->i", samples.normal[one], samples.normal[two])
        found[one[cosine > SAME_SIDE]] = True
    return np.asarray(found & np.isfinite(samples.thickness))


def border_distance(samples: Samples, radius: np.ndarray) -> np.ndarray:
    """Return the distance of each point to the nearest border of its plate [m], (k,).

    It is inf if there is none within the radius, and where the thickness is inf.

    Args:
        radius: largest distance that is searched from each point [m], (k,).
    """
    least = np.full(len(samples.place), np.inf)
    for one, two, away in _pairs(samples, radius):
        near = np.flatnonzero(away <= radius[one])
        one, two, away = one[near], two[near], away[near]
        cosine = np.einsum("ij,ij->i", samples.normal[one], samples.normal[two])
        thick = samples.thickness[two] > BECOMES_THICK * samples.thickness[one]
        border = (np.abs(cosine) < SAME_SIDE) | ((cosine >= SAME_SIDE) & thick)
        np.minimum.at(least, one[border], away[border])
    return least


def _pairs(
    samples: Samples, radius: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield pairs of points in groups: rows of the first and the second, and their distance [m].

    All pairs within the radius (k,) [m] of the first point are among them, and some farther ones.
    Where the radius is wide, only every few points are second ones, evenly over the surface.
    """
    from scipy.spatial import KDTree

    finite = np.flatnonzero(np.isfinite(radius))
    if not len(finite):
        return
    order = np.random.default_rng(0).permutation(len(samples.place))
    step = np.floor(np.log(radius[finite] / radius[finite].min()) / np.log(1.5)).astype(np.int64)
    for k in np.unique(step):
        rows = finite[step == k]
        widest = float(radius[rows].max())
        every = max(1, int(np.pi * (widest / samples.spacing) ** 2 / MAX_PAIRS))
        others = np.sort(order[::every])
        tree = KDTree(samples.place[others])
        for some in np.array_split(rows, 1 + len(rows) // AT_ONCE):
            found = KDTree(samples.place[some]).sparse_distance_matrix(
                tree, widest, output_type="coo_matrix"
            )
            yield some[found.row], others[found.col], found.data
