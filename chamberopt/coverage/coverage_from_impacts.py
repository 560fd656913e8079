"""Coverage of windows (discs of the surface round points of the target) from impacts.

Notation
    A  area of a window that a ball can touch [m²]                       (gauge.area, (p,))
    s  area of a dent, pi a², a its radius [m]                           (radius)
    w  footprint: share of a point's window that a dent takes            (weight)
    x  dent density: sum of w of all dents that fall within a time
    C  coverage, 1 - exp(-x) for dents that fall independently (Avrami's equation)

A dent on a smooth face takes w = s / A of every window around it. Convex creases collect many dents
in a band as narrow as a dent. Spread over a window, these dents would count as if they covered all
of it. So a dent on a crease is spread along the crease alone. At a distance h < a from the crease

    w = 2 sqrt(a² - h²) / (length of the crease in its window)

on both sides. This share is exact across the crease.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeVar

import numpy as np

from chamberopt.common.memory import MEMORY
from chamberopt.coverage.field.crease_bands import on_lines
from chamberopt.coverage.part_impacts import Hits

if TYPE_CHECKING:
    from chamberopt.coverage.field.smooth_faces import Places
    from chamberopt.coverage.field.target_field import Gauge, TargetField

T = TypeVar("T")

ON_CREASE = 1e-6  # m: a contact nearer to a crease is on the crease
MAX_BATCHES = 40  # batches of replicas; more batches would not improve the intervals


class Prints(Protocol):
    """Interface to the footprints of one or more replicas (independent simulations).

    Footprints are the shares of windows that dents take.

    Attributes:
        area: sum of the areas of all dents on the target [m²].
        area_on_creases: sum of the areas of dents on creases [m²].
        squares: sum of the squared areas of all dents [m⁴].
    """

    @property
    def area(self) -> float: ...
    @property
    def area_on_creases(self) -> float: ...
    @property
    def squares(self) -> float: ...

    def pairs(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield the indices of windows, and the shares of these windows that single dents take,
        (k,) each, always in the same order.
        """
        ...


class Footprints(NamedTuple):
    """Pairs of a point of the target and the share of its window that a dent takes.

    Attributes:
        point: index of the window's point in each pair, shape (k,).
        weight: share of the window that the dent takes, shape (k,).
        area: sum of the areas of all dents on the target [m²].
        area_on_creases: sum of the areas of dents on creases [m²].
        squares: sum of the squared areas of all dents [m⁴].
    """

    point: np.ndarray
    weight: np.ndarray
    area: float
    area_on_creases: float
    squares: float

    def pairs(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        yield self.point, self.weight


class JoinedFootprints(NamedTuple):
    """Footprints of several replicas, read from the footprints of each replica without a copy."""

    replicas: tuple[Prints, ...]
    area: float
    area_on_creases: float
    squares: float

    def pairs(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        for one in self.replicas:
            yield from one.pairs()


class FoundAgain(NamedTuple):
    """Footprints of one replica that are computed again at each use.

    This saves memory: a dent takes 80 bytes, but it is in 60 to 340 windows, and each of these
    pairs takes 12 bytes more.
    """

    find: Callable[[], Footprints]
    area: float
    area_on_creases: float
    squares: float

    def pairs(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        yield from self.find().pairs()


class Batch(NamedTuple):
    """Number of replicas (independent simulations) in a batch, and footprints of their dents."""

    replicas: int
    footprints: Prints


def coverage_from_dent_density(dent_density: np.ndarray) -> np.ndarray:
    """Return the coverage 1 - exp(-x) of areas with dent density x, by Avrami's equation.

    The dent density is the sum of the shares of an area that its dents take.

    >>> coverage_from_dent_density(np.array([np.log(50.0)]))
    array([0.98])
    """
    return np.asarray(-np.expm1(-dent_density))


def in_batches(replicas: Sequence[T]) -> list[Sequence[T]]:
    """Divide the list of replicas into at most MAX_BATCHES parts whose lengths differ by at most 1.

    >>> in_batches("abc")
    ['a', 'b', 'c']
    """
    count = len(replicas)
    ends = np.linspace(0, count, min(count, MAX_BATCHES) + 1).astype(int)
    return [replicas[a:b] for a, b in pairwise(ends)]


def joined(replicas: Sequence[Prints]) -> Prints:
    if len(replicas) == 1:
        return replicas[0]
    return JoinedFootprints(
        tuple(replicas),
        sum(one.area for one in replicas),
        sum(one.area_on_creases for one in replicas),
        sum(one.squares for one in replicas),
    )


def batches_of(replicas: Sequence[Prints]) -> list[Batch]:
    return [Batch(len(part), joined(part)) for part in in_batches(replicas)]


def kept_footprints(field: TargetField, gauge: Gauge, dents: LocatedDents) -> Prints:
    """Return the shares of windows that the dents of one replica take, kept in memory if they fit.

    If there is no room, they are computed again at each use, with the same values.
    """
    found = find_footprints(field, gauge, dents)
    if MEMORY.keeps(found.point, found.weight):
        return found
    return FoundAgain(lambda: find_footprints(field, gauge, dents), *found[2:])


def footprints_again(field: TargetField, gauge: Gauge, in_sector: Hits) -> FoundAgain:
    """Return the shares of windows that the dents of one replica take, computed at each use.

    In memory are only 20 bytes of each impact that leaves a dent in a window.

    Args:
        in_sector: impacts, turned into the sector of the chamber in which the windows lie.
    """
    own = in_sector.select((in_sector.dent > 0.0) & field.has_windows[in_sector.triangle])
    # Speed, angle and energy play no part, so the dents stand in their places.
    own = Hits(own.triangle, own.place, own.dent, own.dent, own.dent, own.dent)
    size = 0.25 * np.pi * own.dent[field.on_target[own.triangle]].astype(float) ** 2
    return FoundAgain(
        lambda: find_footprints(field, gauge, locate_dents(field, own)),
        area=float(size.sum()),
        area_on_creases=math.nan,
        squares=float((size**2).sum()),
    )


class LocatedDents(NamedTuple):
    """Dents of one replica (simulation) with the smooth face or the crease under each dent.

    They lie on the target, or for pictures on the whole part.

    Attributes:
        contacts: positions of the dents.
        triangle: part triangle under each dent, shape (k,).
        radius: radius of each dent [m], shape (k,).
        edge: crease under each dent, -1 on a smooth face, shape (k,).
    """

    contacts: Places
    triangle: np.ndarray
    radius: np.ndarray
    edge: np.ndarray

    def select(self, rows: slice) -> LocatedDents:
        columns = (self.triangle, self.radius, self.edge)
        return LocatedDents(self.contacts.select(rows), *(one[rows] for one in columns))


def locate_dents(field: TargetField, in_sector: Hits) -> LocatedDents:
    """Return the dents that impacts leave, with the smooth face or the crease under each.

    Args:
        in_sector: impacts, turned into the sector of the chamber in which the windows lie.
    """
    dents = in_sector.select((in_sector.dent > 0.0) & field.has_windows[in_sector.triangle])
    contacts = field.places_of(dents, np.arange(len(dents)))
    edge = crease_of_contacts(field, contacts.place, dents.triangle)
    return LocatedDents(contacts, dents.triangle, 0.5 * dents.dent.astype(float), edge)


def find_footprints(field: TargetField, gauge: Gauge, hits: Hits | LocatedDents) -> Footprints:
    """Return the share of each window that each dent of one replica takes.

    Dents off the target do not count.

    Args:
        gauge: the windows, all of one size.
    """
    dents = hits if isinstance(hits, LocatedDents) else locate_dents(field, field.in_sector(hits))
    contacts, radius, edge = dents.contacts, dents.radius, dents.edge
    on_face, size = edge < 0, np.pi * radius**2
    point, weight = gauge.windows.shares(contacts.select(on_face), size[on_face], gauge.area)
    if not on_face.all():
        found = [(point, weight), *_on_soft_edges(field, gauge, dents)]
        found += _on_creases(field, gauge, dents)
        points, weights = zip(*found, strict=True)
        point, weight = np.concatenate(points), np.concatenate(weights)
    own = field.on_target[dents.triangle]
    on_crease = own & ~on_face
    return Footprints(
        point,
        weight,
        area=float(size[own].sum()),
        area_on_creases=float((size[on_crease] * field.sharpness(edge[on_crease])).sum()),
        squares=float((size[own] ** 2).sum()),
    )


Pairs = Iterator[tuple[np.ndarray, np.ndarray]]
"""Pairs of points and of the shares of their windows that dents take."""


def _on_creases(field: TargetField, gauge: Gauge, dents: LocatedDents) -> Pairs:
    """Yield the windows beside creases (sharp edges), and the share of each window that a dent on
    its crease takes.
    """
    band, own = gauge.band, np.flatnonzero(dents.edge >= 0)
    if band is None:
        return
    lines, of_own = on_lines(field.creases, dents.contacts.place[own], dents.edge[own])
    radius = dents.radius[own[of_own]]
    for row, contact in band.windows.pairs(lines):
        half = radius[contact] ** 2 - band.height[row] ** 2
        row, half = row[half > 0.0], half[half > 0.0]
        yield band.point[row], 2.0 * np.sqrt(half) / band.length[row]


def _on_soft_edges(field: TargetField, gauge: Gauge, dents: LocatedDents) -> Pairs:
    """Yield the windows to which an edge under a dent is no crease, and the share of each window
    that the dent takes.

    An edge may turn so little that only some of the windows treat it as a crease.
    """
    line, windows = field.creases.line, gauge.windows
    own = np.flatnonzero((dents.edge >= 0) & (line[-1, dents.edge] < 0))
    for point, contact in windows.pairs(dents.contacts.select(own)):
        goes_on = line[windows.division[point], dents.edge[own[contact]]] < 0
        point, size = point[goes_on], np.pi * dents.radius[own[contact[goes_on]]] ** 2
        yield point, size / gauge.area[point]


def in_halves(
    field: TargetField, contacts: Places, triangle: np.ndarray
) -> tuple[Places, np.ndarray, np.ndarray]:
    """Divide each contact on a crease (a sharp edge) into two halves, one on the face on each side.

    Both halves are the same whichever of the two faces was hit.

    Args:
        triangle: part triangle of each contact, (k,).
    Returns:
        The contacts and halves, the row of each in the given contacts, and its share of the dent.
    """
    edge = crease_of_contacts(field, contacts.place, triangle)
    on = np.flatnonzero(edge >= 0)
    rows = np.concatenate([np.arange(len(edge)), on])
    doubled = contacts.select(rows)
    doubled.face[on], doubled.face[len(edge) :] = field.creases.faces[edge[on]].T
    return doubled, rows, np.where(edge >= 0, 0.5, 1.0)[rows]


def crease_of_contacts(field: TargetField, place: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """Return the index of the crease under each contact point, (k,), or -1 on a smooth face."""
    creases = field.creases
    found = np.full(len(place), -1)
    borders = np.asarray((creases.at_corner >= 0).any(axis=1))
    near = np.flatnonzero(borders[triangle])
    at, own = place[near], triangle[near]
    corners = field.corners[own]
    for side in range(3):
        crease = creases.of_triangle[own, side]
        start, along = corners[:, side], corners[:, (side + 1) % 3] - corners[:, side]
        away = np.linalg.norm(np.cross(at - start, along), axis=1) / np.maximum(
            np.linalg.norm(along, axis=1), 1e-12
        )
        touches = (crease >= 0) & (away < ON_CREASE)
        found[near[touches]] = crease[touches]
    # Corners come last: the sharpest crease at a corner counts, whichever triangle was hit.
    for side in range(3):
        corner = creases.at_corner[own, side]
        touches = (corner >= 0) & (np.linalg.norm(at - corners[:, side], axis=1) < ON_CREASE)
        found[near[touches]] = corner[touches]
    return found
