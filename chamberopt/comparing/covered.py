"""The target of one result, triangle by triangle, as its folder has it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from chamberopt.errors import InputError
from chamberopt.hits import HITS, Hits, SortedHits, load_hits
from chamberopt.opened import own_coverage
from chamberopt.results import Result
from chamberopt.viewer import COVERAGE


@dataclass(frozen=True)
class Covered:
    """Triangles of a part, (m,) each, of which only the target's count.

    centre (m, 3) mm, in the chamber · normal (m, 3), unit vectors · target bool · area, exposed mm² · coverage 0..1, 0
    where hidden from the shot · dents: simulated numbers · times: treatment over simulated time · hits: None in results
    of older versions.
    """

    centre: np.ndarray
    normal: np.ndarray
    target: np.ndarray
    area: np.ndarray
    exposed: np.ndarray
    coverage: np.ndarray
    dents: np.ndarray
    times: float
    hits: SortedHits | None

    @property
    def hits_on_target(self) -> Hits | None:
        """The impacts that count, one by one."""
        return None if self.hits is None else self.hits.on(self.target & (self.exposed > 0.0))

    @property
    def dents_a_triangle(self) -> float:
        """Mean over the target."""
        return float(self.dents[self.target].mean())


def covered(result: Result) -> Covered:
    """Read a results folder. Raises InputError for files gone or damaged."""
    surface = own_coverage(result)
    corners = np.asarray(surface.points, dtype=float)[surface.regular_faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice = np.linalg.norm(cross, axis=1)
    return Covered(
        centre=corners.mean(axis=1),
        normal=cross / np.maximum(twice, 1e-300)[:, None],
        target=np.asarray(surface["target"]) > 0,
        area=0.5 * twice,
        exposed=np.asarray(surface["exposed_area_mm2"], dtype=float),
        coverage=np.nan_to_num(np.asarray(surface["coverage"], dtype=float)),
        dents=np.asarray(surface["dents"], dtype=float),
        times=result.design.process.treatment_time_s / float(result.data["simulated_time_s"]),
        hits=_hits(result.folder / HITS, np.asarray(surface["impacts"])),
    )


def _hits(file: Path, impacts: np.ndarray) -> SortedHits | None:
    """The single impacts, None of an older result. InputError where they are not as many as each triangle had, (m,)."""
    if not file.is_file():
        return None
    hits = load_hits(file)
    if not np.array_equal(np.diff(hits.first), impacts):
        raise InputError(f"{file}: its impacts are not those of the {COVERAGE} beside it; simulate again")
    return hits
