"""Single impacts on the part, and their file hits.npz, for distributions and percentiles.

An impact takes 32 bytes in this form, and about 100 bytes in the simulator's log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.limits import MAX_NUMBER
from chamberopt.common.npz_files import UNREADABLE, read_arrays, save_arrays
from chamberopt.coverage.dents import ball_diameters, dent_diameters, impact_angle_deg
from chamberopt.geometry.triangles import interpolate

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.part import Part
    from chamberopt.design.load import Design
    from sim_core import ImpactLog

HITS_FILE = "hits.npz"


@dataclass(frozen=True)
class Hits:
    """Impacts of one or more replicas (simulations) on the part, one row for each impact."""

    triangle: np.ndarray  # part triangle, (k,) int32
    place: (
        np.ndarray
    )  # contact point in the part's own frame [m], (k, 3) float32 as all that follow
    speed: np.ndarray  # normal speed [m/s], (k,)
    angle: np.ndarray  # angle between path and surface [degrees]; 90 is head on
    dent: np.ndarray  # diameter of the dent [m]; 0 if the impact leaves none
    energy: np.ndarray  # kinetic energy of the motion along the normal, m v² / 2 [J]

    def __len__(self) -> int:
        return len(self.triangle)

    def on(self, triangles: np.ndarray) -> Hits:
        """Return the impacts on the part triangles that `triangles` marks, (m,) bool."""
        return self.select(triangles[self.triangle])

    def select(self, rows: slice | np.ndarray) -> Hits:
        return Hits(*(getattr(self, column.name)[rows] for column in fields(Hits)))


@dataclass(frozen=True)
class TargetImpacts:
    """Impacts of some replicas (simulations) on the triangles of the target inside the chamber."""

    hits: tuple[Hits, ...]  # of each replica
    time: float  # simulated time of the impacts [s]
    area: float  # of the exposed target [m²]

    @property
    def count(self) -> int:
        return sum(len(one) for one in self.hits)

    def total(self, column: str) -> float:
        """Return the sum of a column of Hits, such as "speed", over all impacts."""
        return float(sum(getattr(one, column).sum(dtype=float) for one in self.hits))


@dataclass(frozen=True)
class HitsByTriangle:
    """Impacts in the order of the part triangles that they hit."""

    first: np.ndarray  # rows first[t] to first[t + 1] belong to triangle t, (m + 1,) int64
    hits: Hits

    def of(self, triangle: int) -> Hits:
        """Return the impacts on one part triangle."""
        return self.hits.select(slice(self.first[triangle], self.first[triangle + 1]))

    def on(self, triangles: np.ndarray) -> Hits:
        """Return the impacts on the part triangles that `triangles` marks, (m,) bool."""
        return self.hits.select(np.repeat(triangles, np.diff(self.first)))


def hits_on_part(impacts: ImpactLog, chamber: Chamber, design: Design) -> Hits:
    """Return the impacts in a simulator log that hit the part."""
    from sim_core import closest_on_each

    source = chamber.source[impacts.triangle]
    on_part = source >= 0
    speed = np.asarray(impacts.normal_speed)
    mass = design.shot.density * np.pi / 6.0 * ball_diameters(impacts, design) ** 3
    corners = chamber.vertices[chamber.triangles[impacts.triangle[on_part]]]
    place = closest_on_each(corners, np.asarray(impacts.position)[on_part])
    columns = (
        speed,
        impact_angle_deg(np.asarray(impacts.velocity), speed),
        dent_diameters(impacts, chamber, design),
        0.5 * mass * speed * speed,
    )
    return Hits(
        source[on_part],
        place.astype(np.float32),
        *(column[on_part].astype(np.float32) for column in columns),
    )


def join_hits(hits: Sequence[Hits]) -> Hits:
    """Return impacts together, one after another."""
    return Hits(
        *(np.concatenate([getattr(one, column.name) for one in hits]) for column in fields(Hits))
    )


def in_pose_of(hits: Hits, part: Part, other: Part) -> Hits:
    """Return impacts on a part at their places on the same part in another pose."""
    corners, there = (one.vertices[one.triangles[hits.triangle]] for one in (part, other))
    place = interpolate(there, corners, hits.place.astype(float))
    return replace(hits, place=place.astype(np.float32))


def sort_hits_by_triangle(hits: Sequence[Hits], triangles: int) -> HitsByTriangle:
    """Return the impacts of several replicas together, in the order of the part triangles that they
    hit.

    Args:
        triangles: number of triangles of the part.
    """
    together = join_hits(hits)
    first = np.concatenate([[0], np.cumsum(np.bincount(together.triangle, minlength=triangles))])
    return HitsByTriangle(first, together.select(np.argsort(together.triangle, kind="stable")))


def save_hits(path: Path, hits: HitsByTriangle) -> None:
    """Write impacts to an .npz file. The triangles are not stored because `first` implies them."""
    columns = {
        column.name: getattr(hits.hits, column.name)
        for column in fields(Hits)
        if column.name != "triangle"
    }
    save_arrays(path, first=hits.first, **columns)


def load_hits(path: Path) -> HitsByTriangle:
    """Read the impacts from an .npz file that `save_hits` wrote.

    Raises:
        InputError: the file is missing, damaged, or not written by this version.
    """
    columns = read_arrays(path, "restore it, or simulate again")
    try:
        first = columns.pop("first")
        _require_sound(first, columns)
        triangle = np.repeat(np.arange(len(first) - 1, dtype=np.int32), np.diff(first))
        return HitsByTriangle(first, Hits(triangle, **columns))
    except UNREADABLE as error:
        raise InputError(f"{path}: damaged ({error}); simulate again") from None


def _require_sound(first: np.ndarray, columns: dict[str, np.ndarray]) -> None:
    """Raise ValueError unless `first` holds the first row of each triangle, and the columns hold
    values of impacts.
    """
    if first.dtype != np.int64 or first.ndim != 1 or not len(first) or first[0] != 0:
        raise ValueError("first is no list of rows from 0")
    if (first[1:] < first[:-1]).any():  # a difference could overflow
        raise ValueError("first goes down")
    require_impacts(columns, int(first[-1]))


def require_impacts(columns: dict[str, np.ndarray], count: int) -> None:
    """Raise ValueError unless the columns have `count` rows of the types and ranges that impacts
    have.
    """
    for name, column in columns.items():
        shape = (count, 3) if name == "place" else (count,)
        if column.dtype != np.float32 or column.shape != shape:
            raise ValueError(f"{name}: {column.dtype} of shape {column.shape}, expected {shape}")
        low = -MAX_NUMBER if name == "place" else 0.0
        if not ((column >= low) & (column <= MAX_NUMBER)).all():
            raise ValueError(f"{name} has a number that no impact has")


def load_matching_hits(path: Path, impacts: np.ndarray) -> HitsByTriangle:
    """Return the single impacts of a results folder, after a check that they belong to its
    arrays.npz.

    Args:
        path: of the hits.npz.
        impacts: number of impacts of each triangle by arrays.npz, (m,).

    Raises:
        InputError: the file is missing, damaged or belongs to another result.
    """
    found = load_hits(path)
    if not np.array_equal(np.diff(found.first), impacts):
        raise InputError(
            f"{path}: its impacts are not those of the arrays.npz beside it but of another "
            "result; simulate again"
        )
    return found
