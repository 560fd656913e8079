"""Every dent as a disc on the part's own surface: what is marked counts once, across triangles and round edges.

The surface is sampled by points; a dent marks those nearer to its contact point than its radius, measured along the
surface. Where p and q lie on two planes that meet in an edge, at angle theta between the normals n_p and n_q, that is

    distance² = |p - q|² + 2 a b / (1 + cos theta),   a = (p - q).n_q,   b = (q - p).n_p,

exact for the straight way over the edge: with h and y the distances of p and q from it and s along it,
a = -h sin theta, b = -y sin theta (both + in a hollow), |p - q|² = h² + y² + 2 h y cos theta + s², and unfolded it is
(h + y)² + s². The far side of a thin blade faces the other way, cos theta = -1, and is infinitely far.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.coverage.dents import dents_on_part
from chamberopt.coverage.metrics import exposed_target
from chamberopt.geometry.triangles import area_vectors

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import ImpactLog

MOST_POINTS = 5_000_000  # about a gigabyte with what is computed on the way
AT_ONCE = 5_000  # dents looked up together
FEW_POINTS = (
    25  # a triangle; with 13 of them the gear's uniform_coverage is 0.03 too low (docs/accuracy.md)
)


@dataclass(frozen=True)
class SamplePoints:
    """Points on the part's exposed surface: place, normal (p, 3) m · triangle (p,) of the part · area (p,) m² each."""

    place: np.ndarray
    normal: np.ndarray
    triangle: np.ndarray
    area: np.ndarray


def few_points_note(samples: SamplePoints, chamber: Chamber) -> tuple[str, ...]:
    """What is said where a triangle of the target has too few sample points to tell a coverage by."""
    on_target = exposed_target(chamber)[samples.triangle]
    each = np.bincount(samples.triangle[on_target], minlength=len(chamber.part.triangles))
    middle = float(np.median(each[each > 0])) if each.any() else 0.0
    if middle >= FEW_POINTS:
        return ()
    return (
        f"a triangle of the target has {middle:.0f} sample points in the middle, fewer than {FEW_POINTS}: std_coverage "
        "comes out too large and uniform_coverage too low; lower process.accuracy.sample_mm",
    )


def sample_points(chamber: Chamber, spacing: float) -> SamplePoints:
    """About one point for each spacing² [m²] of the part's exposed surface, at least one a triangle of the cavity.

    Spread within a triangle by the additive recurrence of the plastic number (M. Roberts, "The unreasonable
    effectiveness of quasirandom sequences", 2018), folded from the square: even, and the same every time. Raises
    InputError for more points than can be held.
    """
    index = np.flatnonzero(chamber.source >= 0)
    vectors = area_vectors(chamber.vertices, chamber.triangles[index])
    area = np.linalg.norm(vectors, axis=1)
    index, vectors, area = (column[area > 0.0] for column in (index, vectors, area))
    count = np.maximum(1, np.rint(area / spacing**2)).astype(int)
    if count.sum() > MOST_POINTS:
        raise InputError(
            f"process.accuracy.sample_mm: given {spacing * 1e3:g}, which takes {count.sum():,} points for a surface of "
            f"{area.sum() * 1e6:.4g} mm²; at most {MOST_POINTS:,} are supported: raise it"
        )
    owner = np.repeat(np.arange(len(index)), count)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    plastic = 1.32471795724474602596
    # Each triangle begins elsewhere in the sequence: else all single points would be at the same corner.
    u, v = (
        ((number + 0.5) / plastic**power + owner / plastic ** (power + 2) + 0.5) % 1.0
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


def first_marked_times(
    samples: SamplePoints, impacts: ImpactLog, chamber: Chamber, design: Design
) -> np.ndarray:
    """When each point is first inside a dent [s], (p,); inf for never."""
    dents = dents_on_part(impacts, chamber, design)
    return mark_points(samples, dents.place, dents.normal, dents.radius, dents.time)


def mark_points(
    samples: SamplePoints,
    place: np.ndarray,
    normal: np.ndarray,
    radius: np.ndarray,
    time: np.ndarray,
) -> np.ndarray:
    """First time (p,) at which each point is inside one of these discs: place, normal (k, 3), radius, time (k,)."""
    from scipy.spatial import cKDTree

    first = np.full(len(samples.area), np.inf)
    tree = cKDTree(samples.place)
    for begin in range(0, len(place), AT_ONCE):
        some = slice(begin, begin + AT_ONCE)
        point, dent, _ = points_in_dents(
            tree, samples.normal, place[some], normal[some], radius[some]
        )
        np.minimum.at(first, point, time[some][dent])
    return first


def points_in_dents(
    tree: cKDTree, facing: np.ndarray, place: np.ndarray, normal: np.ndarray, radius: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which points lie in which discs: rows of point, dent, and their distance as a share of the dent's radius.

    tree: of the points, facing (p, 3) their normals · place, normal (k, 3), radius (k,): of the discs.
    """
    from scipy.spatial import cKDTree

    # No way along a surface is shorter than the straight one: what is near in space holds all candidates.
    pairs = tree.sparse_distance_matrix(cKDTree(place), radius.max(), output_type="ndarray")
    point, dent = pairs["i"], pairs["j"]
    cosine = (facing[point] * normal[dent]).sum(axis=1)
    away = place[dent] - tree.data[point]
    bend = (away * facing[point]).sum(axis=1) * -(away * normal[dent]).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        detour = np.where(bend > 0.0, 2.0 * bend / (1.0 + cosine), 0.0)
    square = pairs["v"] ** 2 + detour
    hit = square <= radius[dent] ** 2
    return point[hit], dent[hit], np.sqrt(square[hit]) / radius[dent[hit]]


def marked_share(
    samples: SamplePoints, first: np.ndarray, time: float, triangles: int
) -> np.ndarray:
    """Share of each part triangle's exposed area that is inside a dent by a time [s], (triangles,); NaN unexposed."""
    area = np.bincount(samples.triangle, samples.area, triangles)
    marked = np.bincount(samples.triangle, samples.area * (first <= time), triangles)
    return np.divide(marked, area, out=np.full(triangles, np.nan), where=area > 0.0)
