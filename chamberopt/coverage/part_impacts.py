"""Impacts on the part one by one, as few columns as their distributions need: 20 bytes each, a hundred in a log."""

from __future__ import annotations

import zipfile
import zlib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import atomic_write
from chamberopt.coverage.dents import ball_diameters, dent_diameters, impact_angle_deg

if TYPE_CHECKING:
    from collections.abc import Sequence

    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import ImpactLog

HITS_FILE = "hits.npz"


@dataclass(frozen=True)
class Hits:
    """Impacts of one or more replicas, (k,) each.

    triangle int32, of the part · float32: speed [m/s] along the normal · angle [degrees], 90 is head on · dent [m],
    its diameter, 0 where there is none · energy [J] of the motion along the normal, m v² / 2.
    """

    triangle: np.ndarray
    speed: np.ndarray
    angle: np.ndarray
    dent: np.ndarray
    energy: np.ndarray

    def __len__(self) -> int:
        return len(self.triangle)


@dataclass(frozen=True)
class HitsByTriangle:
    """Hits in the order of their triangles: those of triangle t are the rows first[t] to first[t + 1].

    first (m + 1,) int64 · the columns of Hits.
    """

    first: np.ndarray
    hits: Hits

    def of(self, triangle: int) -> Hits:
        """The hits of one part triangle."""
        return _rows(self.hits, slice(self.first[triangle], self.first[triangle + 1]))

    def on(self, triangles: np.ndarray) -> Hits:
        """The hits of all triangles that are marked, (m,) bool."""
        return _rows(self.hits, np.repeat(triangles, np.diff(self.first)))


def hits_on_part(impacts: ImpactLog, chamber: Chamber, design: Design) -> Hits:
    """The impacts of a log that are on the part."""
    source = chamber.source[impacts.triangle]
    on_part = source >= 0
    speed = np.asarray(impacts.normal_speed)
    mass = design.shot.density * np.pi / 6.0 * ball_diameters(impacts, design) ** 3
    columns = (
        impact_angle_deg(np.asarray(impacts.velocity), speed),
        dent_diameters(impacts, design),
        0.5 * mass * speed * speed,
    )
    return Hits(
        source[on_part], *(column[on_part].astype(np.float32) for column in (speed, *columns))
    )


def sort_hits_by_triangle(hits: Sequence[Hits], triangles: int) -> HitsByTriangle:
    """Hits of replicas together, by part triangle; triangles: how many the part has."""
    whole = Hits(
        *(np.concatenate([getattr(one, column.name) for one in hits]) for column in fields(Hits))
    )
    first = np.concatenate([[0], np.cumsum(np.bincount(whole.triangle, minlength=triangles))])
    return HitsByTriangle(first, _rows(whole, np.argsort(whole.triangle, kind="stable")))


def save_hits(path: Path, found: HitsByTriangle) -> None:
    """Write them, whole or not at all: a .npz without the triangles, which `first` says."""
    columns = {
        column.name: getattr(found.hits, column.name)
        for column in fields(Hits)
        if column.name != "triangle"
    }
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        np.savez(file, first=found.first, **columns)


def load_hits(path: Path) -> HitsByTriangle:
    """Read them back. InputError for a file gone, damaged, or not written by this version."""
    try:
        with np.load(path, allow_pickle=False) as file:
            columns = {name: file[name] for name in file.files}
        first = columns.pop("first")
        found = HitsByTriangle(
            first,
            Hits(np.repeat(np.arange(len(first) - 1, dtype=np.int32), np.diff(first)), **columns),
        )
    except FileNotFoundError:
        raise InputError(
            f"{path}: not there: an older result, without single impacts; simulate again"
        ) from None
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        EOFError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        raise InputError(f"{path}: damaged ({error}); simulate again") from None
    if any(len(column) != first[-1] for column in columns.values()):
        raise InputError(f"{path}: damaged (columns of different lengths); simulate again")
    return found


def load_matching_hits(folder: Path, impacts: np.ndarray) -> HitsByTriangle | None:
    """The single impacts of a results folder, None of an older result. impacts (m,): how many each triangle had, as
    coverage.vtp says; InputError where these are others.
    """
    path = folder / HITS_FILE
    if not path.is_file():
        return None
    found = load_hits(path)
    if not np.array_equal(np.diff(found.first), impacts):
        raise InputError(
            f"{path}: its impacts are not those of the coverage.vtp beside it, but of another result; simulate again"
        )
    return found


def _rows(hits: Hits, rows: slice | np.ndarray) -> Hits:
    return Hits(*(getattr(hits, column.name)[rows] for column in fields(Hits)))
