"""Choose the triangles that must be covered, by the file's names, by direction, and by box."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.part_mesh import PartMesh, select_triangles
from chamberopt.geometry.triangles import area_vectors

if TYPE_CHECKING:
    from chamberopt.design.part import Target


def chosen_triangles(mesh: PartMesh, wanted: Target) -> np.ndarray:
    """Which triangles (m,) meet all conditions of the target; InputError if none does."""
    chosen = select_triangles(
        mesh.groups, wanted.surface, len(mesh.triangles), "part.target.surface"
    )
    if wanted.direction is not None and wanted.angle_deg is not None:
        normal = area_vectors(mesh.vertices, mesh.triangles)
        direction = np.asarray(wanted.direction) / np.linalg.norm(wanted.direction)
        # atan2 of sine and cosine: acos is a hundred times coarser near 0 and 180 degrees
        angle = np.degrees(
            np.arctan2(np.linalg.norm(np.cross(normal, direction), axis=1), normal @ direction)
        )
        low, high = wanted.angle_deg
        chosen &= (angle >= low) & (angle <= high)
    if wanted.box_mm is not None:
        centroid_mm = mesh.vertices[mesh.triangles].mean(axis=1) * 1e3
        low_corner, high_corner = np.asarray(wanted.box_mm)
        chosen &= ((centroid_mm >= low_corner) & (centroid_mm <= high_corner)).all(axis=1)
    if not chosen.any():
        low_text, high_text = _corner(mesh.vertices.min(axis=0)), _corner(mesh.vertices.max(axis=0))
        raise InputError(
            f"part.target: chooses none of the {len(chosen)} triangles; in its own file the part "
            f"goes from {low_text} to {high_text} mm: widen box_mm or angle_deg"
        )
    return chosen


def _corner(point: np.ndarray) -> str:
    return str([float(f"{1e3 * value:.6g}") for value in point])
