"""Coverage model "dents": the share of the surface inside discs, each dent one disc on the surface.

The surface is sampled by points. A dent marks the points that are nearer to its contact point than
its radius, measured along the surface, so it bends across triangles and round edges. What several
dents share counts once.

Notation
    p, q      sample point and contact point [m]            (samples.place, dents.place)
    n_p, n_q  unit normals of the surface there             (samples.normal, dents.normal)
    theta     angle between the normals
    a, b      (p - q).n_q and (q - p).n_p [m]

On two planes that meet in an edge the distance along the surface is

    distance² = |p - q|² + 2 a b / (1 + cos theta),

exact for the straight way over the edge. With h and y the distances of p and q from the edge and s
along it, a = -h sin theta and b = -y sin theta (both + in a hollow), |p - q|² = h² + y² + 2 h y cos
theta + s², and unfolded the distance² is (h + y)² + s². The far side of a thin blade faces the
other way, cos theta = -1, and is infinitely far.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.coverage.dents import Dents
from chamberopt.coverage.metrics import exposed_target
from chamberopt.geometry.triangles import area_vectors

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

    from chamberopt.chamber.build import Chamber

MAX_POINTS = 5_000_000  # about a gigabyte with all intermediate results
DENTS_AT_ONCE = 5_000  # searched for together, to bound memory
# Per target triangle. With 13 the gear's uniform_coverage is 0.03 too low (docs/accuracy.md).
MIN_POINTS_PER_TRIANGLE = 25
PLASTIC_NUMBER = 1.32471795724474602596  # real root of x³ = x + 1


@dataclass(frozen=True)
class SamplePoints:
    """Points on the part's exposed surface."""

    place: np.ndarray  # positions [m], (p, 3)
    normal: np.ndarray  # unit normals of the surface, (p, 3)
    triangle: np.ndarray  # part triangle of each point, (p,)
    area: np.ndarray  # area that each point stands for [m²], (p,)


def sample_points(chamber: Chamber, spacing: float) -> SamplePoints:
    """Spread points evenly over the part's exposed surface, the same ones every time.

    Within a triangle they follow the additive recurrence of the plastic number, folded from the
    square.

    Args:
        spacing: about one point for each spacing² [m], at least one a triangle of the cavity.

    Raises:
        InputError: the points would not fit into memory.

    Source: M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018.
    """
    index = np.flatnonzero(chamber.source >= 0)
    vectors = area_vectors(chamber.vertices, chamber.triangles[index])
    area = np.linalg.norm(vectors, axis=1)
    index, vectors, area = (column[area > 0.0] for column in (index, vectors, area))
    count = np.maximum(1, np.rint(area / spacing**2)).astype(int)
    if count.sum() > MAX_POINTS:
        raise InputError(
            f"process.accuracy.sample_mm: given {spacing * 1e3:g}, which takes {count.sum():,} "
            f"points for a surface of {area.sum() * 1e6:.4g} mm²; at most {MAX_POINTS:,} are "
            "supported: raise it"
        )
    owner = np.repeat(np.arange(len(index)), count)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    # Each triangle starts elsewhere in the sequence, or all single points would be in one corner.
    u, v = (
        ((number + 0.5) / PLASTIC_NUMBER**power + owner / PLASTIC_NUMBER ** (power + 2) + 0.5) % 1.0
        for power in (1, 2)
    )
    folded = u + v > 1.0
    u, v = np.where(folded, 1.0 - u, u), np.where(folded, 1.0 - v, v)
    a, b, c = (chamber.vertices[chamber.triangles[index[owner], k]] for k in range(3))
    return SamplePoints(
        place=a + u[:, None] * (b - a) + v[:, None] * (c - a),
        normal=(vectors / area[:, None])[owner],
        triangle=chamber.source[index[owner]],
        area=(area / count)[owner],
    )


def few_points_note(samples: SamplePoints, chamber: Chamber) -> tuple[str, ...]:
    """A note if the median target triangle has too few sample points to measure its coverage."""
    on_target = exposed_target(chamber)[samples.triangle]
    count = np.bincount(samples.triangle[on_target], minlength=len(chamber.part.triangles))
    median = float(np.median(count[count > 0])) if count.any() else 0.0
    if median >= MIN_POINTS_PER_TRIANGLE:
        return ()
    return (
        f"the median target triangle has {median:.0f} sample points, fewer than "
        f"{MIN_POINTS_PER_TRIANGLE}: std_coverage comes out too large and uniform_coverage too "
        "low; lower process.accuracy.sample_mm",
    )


def first_marked_times(samples: SamplePoints, dents: Dents) -> np.ndarray:
    """First time at which each point is inside a dent [s], (p,); inf if it never is."""
    from scipy.spatial import cKDTree

    first = np.full(len(samples.area), np.inf)
    tree = cKDTree(samples.place)
    for begin in range(0, len(dents), DENTS_AT_ONCE):
        some = slice(begin, begin + DENTS_AT_ONCE)
        point, dent = _points_in_discs(
            tree, samples.normal, dents.place[some], dents.normal[some], dents.radius[some]
        )
        np.minimum.at(first, point, dents.time[some][dent])
    return first


def _points_in_discs(
    tree: cKDTree, facing: np.ndarray, place: np.ndarray, normal: np.ndarray, radius: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the point and the disc of all pairs of a point and a disc that holds it.

    Args:
        tree: search tree of the points.
        facing: unit normals of the surface at the points, (p, 3).
    """
    from scipy.spatial import cKDTree

    # No way along the surface is shorter than the straight line, so the pairs that are near in
    # space include all pairs that are near along the surface.
    pairs = tree.sparse_distance_matrix(cKDTree(place), radius.max(), output_type="ndarray")
    point, dent = pairs["i"], pairs["j"]
    cosine = (facing[point] * normal[dent]).sum(axis=1)
    away = place[dent] - tree.data[point]
    bend = (away * facing[point]).sum(axis=1) * -(away * normal[dent]).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        detour = np.where(bend > 0.0, 2.0 * bend / (1.0 + cosine), 0.0)
    inside = pairs["v"] ** 2 + detour <= radius[dent] ** 2
    return point[inside], dent[inside]


def marked_share(
    samples: SamplePoints, first: np.ndarray, time: float, triangles: int
) -> np.ndarray:
    """Share of each part triangle's exposed area that is inside a dent after a peening time.

    Args:
        first: first time at which each point is inside a dent [s], (p,).
        time: peening time [s].
        triangles: number of triangles of the part.

    Returns:
        Share, (triangles,); NaN for triangles that are not exposed.
    """
    area = np.bincount(samples.triangle, samples.area, triangles)
    marked = np.bincount(samples.triangle, samples.area * (first <= time), triangles)
    return np.divide(marked, area, out=np.full(triangles, np.nan), where=area > 0.0)
