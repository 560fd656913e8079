"""Subtract the coverage of two candidates at each point of the target.

Coverage at a point is the dented share of a window, a disc of the surface round the point.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from chamberopt.coverage.part_impacts import HITS_FILE, Hits, load_matching_hits
from chamberopt.geometry.triangles import areas
from chamberopt.results.arrays_file import load_result_arrays
from chamberopt.results.load import Result
from chamberopt.results.vtp_files import MM

# The target of a result as its folder stores it: the field and the impacts.

MIN_COSINE = 0.7  # between the normals of two places that count as neighbours
NEIGHBOURS = 8  # vertices that are examined for a place
NEAREST = 3  # nearest examined vertices with a similar normal; they give the value of the place


@dataclass(frozen=True)
class TargetSurface:
    """Coverage and impacts of a result on the target, as its folder stores them.

    Args:
        corners: corners of the part's triangles in the chamber [mm], shape (m, 3, 3).
        target: True for triangles of the target, shape (m,) bool.
        place: vertices of the display mesh on the target [mm], shape (v, 3).
        normal: unit normals at the vertices, shape (v, 3).
        area: share of the target's area that belongs to each vertex, shape (v,).
        coverage: coverage from 0 to 1, shape (v,). 0 at vertices out of reach.
        interval: width of the 95 % interval of coverage, shape (v,). 0 at vertices out of reach.
        resolved: True at vertices with enough dents, and at vertices out of reach, shape (v,).
        window_radius: radius of the windows, the discs in which coverage is measured [mm].
        dents: number of simulated dents in the median window.
        hits: single impacts on the target.
    """

    corners: np.ndarray
    target: np.ndarray
    place: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    coverage: np.ndarray
    interval: np.ndarray
    resolved: np.ndarray
    window_radius: float
    dents: float
    hits: Hits

    def at(self, other: TargetSurface) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return this result's coverage, interval and `resolved` at the vertices of another result.

        Each value is a mean over this result's nearest vertices with a similar normal, weighted by
        inverse distance.
        """
        from scipy.spatial import cKDTree

        place, normal = self._moved(other)
        count = min(NEIGHBOURS, len(self.place))
        distance, vertex = cKDTree(self.place).query(place, k=count)
        distance, vertex = distance.reshape(-1, count), vertex.reshape(-1, count)
        cosine = np.einsum("ij,ikj->ik", normal, self.normal[vertex])
        weight = np.where(cosine > MIN_COSINE, 1.0 / np.maximum(distance, 1e-9), 0.0)
        weight *= np.cumsum(weight > 0.0, axis=1) <= NEAREST
        weight[weight.sum(axis=1) == 0.0, 0] = 1.0
        weight /= weight.sum(axis=1, keepdims=True)
        coverage, interval, resolved = (
            (weight * column[vertex]).sum(axis=1)
            for column in (self.coverage, self.interval, self.resolved)
        )
        return coverage, interval, resolved > 0.5

    def _moved(self, other: TargetSurface) -> tuple[np.ndarray, np.ndarray]:
        """Return another result's vertices and normals, moved to this result's pose of the part.

        The rotation fits the triangles of one result to the triangles of the other
        (W. Kabsch, Acta Cryst. A32 (1976) 922).
        """
        here, there = (one.corners.reshape(-1, 3) for one in (self, other))
        u, _, v = np.linalg.svd((there - there.mean(axis=0)).T @ (here - here.mean(axis=0)))
        u[:, 2] *= np.sign(np.linalg.det(u @ v))
        rotation = u @ v
        place = (other.place - there.mean(axis=0)) @ rotation + here.mean(axis=0)
        return place, other.normal @ rotation


def read_target_surface(result: Result) -> TargetSurface:
    """Read coverage and impacts of a result on its target.

    Raises InputError if files are missing or damaged.
    """
    arrays = load_result_arrays(result)
    part, mesh, field = arrays.chamber.part, arrays.display.mesh, arrays.display.fields
    triangles = mesh.triangles[part.target[mesh.part_triangle]]
    used, corner = np.unique(triangles, return_inverse=True)
    points = mesh.vertices * MM
    area = np.repeat(areas(points, triangles) / 3.0, 3)
    share = np.bincount(corner.ravel(), area, len(used)) / area.sum()
    reached = field["reachable"][used] > 0.5
    hits = load_matching_hits(result.path(HITS_FILE), arrays.elements["impacts"])
    return TargetSurface(
        corners=(part.vertices * MM)[part.triangles],
        target=part.target,
        place=points[used],
        normal=mesh.normal[used].astype(float),
        area=share,
        coverage=np.where(reached, field["coverage"][used], 0.0).astype(float),
        interval=np.where(reached, field["coverage_interval"][used], 0.0).astype(float),
        resolved=~reached | (field["resolved"][used] > 0.5),
        window_radius=math.sqrt(result.design.process.accuracy.gauge_mm2 / math.pi),
        dents=result.record.field.dents_in_median_window,
        hits=hits.on(part.target & (arrays.chamber.exposed_area > 0.0)),
    )


# Dents in the smallest discs: a difference is smaller than either coverage and has more noise.
DENTS = 60.0
# Largest radius of a disc as a share of the target's size: a wider disc could hide a pattern.
MAX_RADIUS_SHARE = 0.12
GROWTH = 1.5  # of the radius from discs to the next wider ones
# Half-widths of 95 % by which an average may lie beside that of a smaller disc. More gives smoother
# pictures, in which sharp borders are wider.
BESIDE = 1.0
FALSE_SHARE = 0.05  # of the area that counts as different, may be so by chance


@dataclass(frozen=True)
class LocalDifference:
    """Coverage of a later candidate minus coverage of the first, at vertices on the target.

    Args:
        value: the difference, -1 to 1, at the vertices of the first candidate's field, shape (v,).
        real: True where the difference is more than noise, shape (v,) bool. Of their area, a share
            of at most FALSE_SHARE is expected to be so by chance.
        told: True where both have enough dents to tell, shape (v,) bool.
        radius: radius of the disc over which both coverages are averaged at each vertex [mm], 0 for
            no averaging, shape (v,). All that is finer is noise.
        more: share of the target's area where `real` is True and the later candidate has more.
        less: share of the target's area where `real` is True and the later candidate has less.
    """

    value: np.ndarray
    real: np.ndarray
    told: np.ndarray
    radius: np.ndarray
    more: float
    less: float

    @property
    def radii(self) -> tuple[float, float]:
        """Smallest and largest radius [mm] where the difference is real, else of all places."""
        used = self.radius[self.real] if self.real.any() else self.radius
        return float(used.min()), float(used.max())


def local_difference(first: TargetSurface, other: TargetSurface) -> LocalDifference:
    """Return coverage of `other` minus coverage of `first`, two results with the same target.

    At each place both coverages are averaged over the same disc. The smallest discs hold about
    DENTS dents, each wider one has GROWTH times the radius, up to a share of the target's size. A
    place has the widest disc whose average agrees with those of all smaller ones: all that is finer
    is noise. So a sharp difference stays sharp, and a weak one is seen where it extends far enough.

    Each place is a test, and many are right by chance. They are judged together, so that of the
    area that counts as different an expected FALSE_SHARE is none. Where a result has too few dents
    in its windows, no difference counts as real.

    Source, by heart: intersection of confidence intervals, A. Goldenshluger and A. Nemirovski,
    Math. Methods Statist. 6 (1997) 135; Y. Benjamini and Y. Hochberg, J. R. Stat. Soc. B 57 (1995)
    289, here by area in the place of numbers.
    """
    from scipy.stats import norm

    coverage, interval, resolved = other.at(first)
    told = resolved & first.resolved
    gap, width = coverage - first.coverage, np.hypot(interval, first.interval)
    low, high = np.full(len(gap), -np.inf), np.full(len(gap), np.inf)
    value, half_width, radius = np.zeros((3, len(gap)))
    for wider in _radii(first, other):
        mean, half = _averaged(first, gap, width, wider)
        low, high = np.maximum(low, mean - BESIDE * half), np.minimum(high, mean + BESIDE * half)
        agrees = low <= high  # once they do not, the wider ones do neither
        value = np.where(agrees, mean, value)
        half_width = np.where(agrees, half, half_width)
        radius = np.where(agrees, wider, radius)
    z = np.abs(value) / np.maximum(half_width / norm.isf(0.025), 1e-12)
    chance = np.where(told, 2.0 * norm.sf(z), 1.0)
    real = chance <= _largest_chance(chance, first.area)
    more, less = (float(first.area[real & sign].sum()) for sign in (value > 0.0, value < 0.0))
    return LocalDifference(value, real, told, radius, more, less)


def _radii(first: TargetSurface, other: TargetSurface) -> list[float]:
    """Return the radii of the discs over which coverage is averaged [mm], the smallest first."""
    window, dents = first.window_radius, max(min(first.dents, other.dents), 1.0)
    most = MAX_RADIUS_SHARE * float(np.linalg.norm(np.ptp(first.place, axis=0)))
    radii = [min(window * math.sqrt(max(0.0, DENTS / dents - 1.0)), most)]
    while (wider := GROWTH * max(radii[-1], window)) < most:
        radii.append(wider)
    return radii


def _averaged(
    surface: TargetSurface, gap: np.ndarray, width: np.ndarray, radius: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return a difference averaged over discs, and the half-width of its 95 % interval, (v,) each.

    The intervals of the two coverages assume independent dents. Averaging narrows them: the mean
    coverage of windows of radius l over a piece of surface of area A scatters like the coverage of
    one window of radius sqrt(l² + A / pi).

    Args:
        gap: difference at each vertex, (v,).
        width: width of the 95 % interval of the difference at each vertex, (v,).
        radius: radius of the discs [mm].

    Source: G. Y. Zou and A. Donner, "Construction of confidence limits about effect measures",
    Statistics in Medicine 27 (2008) 1693.
    """
    if radius == 0.0:
        return gap, 0.5 * width
    average, share = _averages(surface, radius)
    whole = float(areas(surface.corners[surface.target].reshape(-1, 3), _rows(surface)).sum())
    window = surface.window_radius
    narrower = window / np.sqrt(window**2 + share * whole / math.pi)
    return average(gap), 0.5 * average(width) * narrower


def _rows(surface: TargetSurface) -> np.ndarray:
    """Return the triangles (m, 3) of a target whose corners stand one after the other."""
    return np.arange(3 * int(surface.target.sum())).reshape(-1, 3)


def _largest_chance(chance: np.ndarray, area: np.ndarray) -> float:
    """Return the chance up to which a difference is real; -1 if none is.

    Args:
        chance: chance of a difference as large by noise alone, at each place, (v,).
        area: share of the target's area that belongs to each place, (v,).
    """
    order = np.argsort(chance)
    kept = np.flatnonzero(chance[order] <= FALSE_SHARE * np.cumsum(area[order]))
    return float(chance[order][kept[-1]]) if len(kept) else -1.0


def _averages(
    surface: TargetSurface, radius: float
) -> tuple[Callable[[np.ndarray], np.ndarray], np.ndarray]:
    """Return a function that averages values, shape (v,), over a disc round each vertex.

    Vertices in the disc whose normal has another direction are left out. Return also the share of
    the target's area that is averaged over, shape (v,). `radius` is in mm.
    """
    from scipy.spatial import cKDTree

    pairs = cKDTree(surface.place).query_pairs(radius, output_type="ndarray")
    cosine = np.einsum("ij,ij->i", surface.normal[pairs[:, 0]], surface.normal[pairs[:, 1]])
    i, j = pairs[cosine > MIN_COSINE].T

    def sums(own: np.ndarray) -> np.ndarray:
        return np.asarray(own + np.bincount(i, own[j], len(own)) + np.bincount(j, own[i], len(own)))

    total = sums(surface.area)
    return lambda values: sums(values * surface.area) / total, total
