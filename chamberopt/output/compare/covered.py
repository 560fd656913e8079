"""The target of one result, triangle by triangle, as its folder has it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chamberopt.coverage.part_impacts import Hits, HitsByTriangle, load_matching_hits
from chamberopt.geometry.triangles import area_vectors
from chamberopt.output.results.load import Result, load_coverage


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
    hits: HitsByTriangle | None

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
    surface = load_coverage(result)
    points, triangles = np.asarray(surface.points, dtype=float), np.asarray(surface.regular_faces)
    vectors = area_vectors(points, triangles)
    area = np.linalg.norm(vectors, axis=1)
    return Covered(
        centre=points[triangles].mean(axis=1),
        normal=vectors / np.maximum(area, 1e-300)[:, None],
        target=np.asarray(surface["target"]) > 0,
        area=area,
        exposed=np.asarray(surface["exposed_area_mm2"], dtype=float),
        coverage=np.nan_to_num(np.asarray(surface["coverage"], dtype=float)),
        dents=np.asarray(surface["dents"], dtype=float),
        times=result.design.process.treatment_time_s / float(result.data["simulated_time_s"]),
        hits=load_matching_hits(result.folder, np.asarray(surface["impacts"])),
    )
