"""The target of one result, triangle by triangle, as stored in its folder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chamberopt.coverage.part_impacts import Hits, HitsByTriangle, load_matching_hits
from chamberopt.geometry.triangles import area_vectors
from chamberopt.output.results.load import Result, load_coverage


@dataclass(frozen=True)
class TargetSurface:
    """The triangles of a part; only those of the target are compared.

    Args:
        centre: in the chamber [mm], shape (m, 3).
        normal: unit vectors, shape (m, 3).
        target: which triangles belong to the target, shape (m,) bool.
        area: [mm²], shape (m,).
        exposed: exposed area [mm²], shape (m,).
        coverage: 0 to 1, 0 outside the cavity, shape (m,).
        dents: number of simulated dents, shape (m,).
        time_ratio: treatment time over simulated time.
        hits: single impacts; None in results of older versions.
    """

    centre: np.ndarray
    normal: np.ndarray
    target: np.ndarray
    area: np.ndarray
    exposed: np.ndarray
    coverage: np.ndarray
    dents: np.ndarray
    time_ratio: float
    hits: HitsByTriangle | None

    @property
    def hits_on_target(self) -> Hits | None:
        """The single impacts on the exposed target."""
        return None if self.hits is None else self.hits.on(self.target & (self.exposed > 0.0))

    @property
    def dents_per_triangle(self) -> float:
        """Mean number of dents over the triangles of the target."""
        return float(self.dents[self.target].mean())


def read_target_surface(result: Result) -> TargetSurface:
    """Read the target of a results folder; InputError if files are missing or damaged."""
    surface = load_coverage(result)
    points, triangles = np.asarray(surface.points, dtype=float), np.asarray(surface.regular_faces)
    vectors = area_vectors(points, triangles)
    area = np.linalg.norm(vectors, axis=1)
    return TargetSurface(
        centre=points[triangles].mean(axis=1),
        normal=vectors / np.maximum(area, 1e-300)[:, None],
        target=np.asarray(surface["target"]) > 0,
        area=area,
        exposed=np.asarray(surface["exposed_area_mm2"], dtype=float),
        coverage=np.nan_to_num(np.asarray(surface["coverage"], dtype=float)),
        dents=np.asarray(surface["dents"], dtype=float),
        time_ratio=result.design.process.treatment_time_s / float(result.data["simulated_time_s"]),
        hits=load_matching_hits(result.folder, np.asarray(surface["impacts"])),
    )
