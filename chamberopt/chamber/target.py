"""Choose the triangles that must be covered, by names, faces, direction, box and radius."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.faces import Faces
from chamberopt.geometry.mesh_io.part_mesh import PartMesh, select_triangles
from chamberopt.geometry.triangles import area_vectors

if TYPE_CHECKING:
    from chamberopt.design.part import FaceAt, Selection

NEAR = 0.01  # of the part's diagonal: a place further from the surface is a mistake


def chosen_triangles(mesh: PartMesh, wanted: Selection, field: str = "part.target") -> np.ndarray:
    """Which triangles (m,) meet all conditions; InputError, which names the field, if none does."""
    chosen = select_triangles(mesh.groups, wanted.surface, len(mesh.triangles), f"{field}.surface")
    if wanted.faces:
        chosen &= _on_faces(mesh, wanted.faces, field)
    if wanted.direction is not None and wanted.angle_deg is not None:
        normal = area_vectors(mesh.vertices, mesh.triangles)
        direction = np.asarray(wanted.direction) / np.linalg.norm(wanted.direction)
        # atan2 of sine and cosine: acos is a hundred times coarser near 0 and 180 degrees
        angle = np.degrees(
            np.arctan2(np.linalg.norm(np.cross(normal, direction), axis=1), normal @ direction)
        )
        low, high = wanted.angle_deg
        chosen &= (angle >= low) & (angle <= high)
    centroid_mm = mesh.vertices[mesh.triangles].mean(axis=1) * 1e3
    if wanted.radius_mm is not None:
        radius, (low, high) = np.hypot(*centroid_mm.T[:2]), wanted.radius_mm
        chosen &= (radius >= low) & (radius <= high)
    if wanted.box_mm is not None:
        low_corner, high_corner = np.asarray(wanted.box_mm)
        chosen &= ((centroid_mm >= low_corner) & (centroid_mm <= high_corner)).all(axis=1)
    if not chosen.any():
        low_text, high_text = _corner(mesh.vertices.min(axis=0)), _corner(mesh.vertices.max(axis=0))
        raise InputError(
            f"{field}: chooses none of the {len(chosen)} triangles; in its own file the part "
            f"goes from {low_text} to {high_text} mm: widen box_mm, radius_mm or angle_deg"
        )
    return chosen


def _on_faces(mesh: PartMesh, wanted: Sequence[FaceAt], field: str) -> np.ndarray:
    """Which triangles (m,) are on one of the faces; InputError for a place beside the surface."""
    by_crease: dict[float, Faces] = {}
    chosen = np.zeros(len(mesh.triangles), dtype=bool)
    for k, one in enumerate(wanted):
        faces = by_crease.get(one.crease_deg)
        if faces is None:
            faces = by_crease[one.crease_deg] = Faces(mesh.vertices, mesh.triangles, one.crease_deg)
        place = np.array(one.at_mm) * 1e-3
        face, away = faces.at(place)
        if away > NEAR * np.linalg.norm(mesh.size):
            raise InputError(
                f"{field}.faces.{k}.at_mm: given {list(one.at_mm)}, {1e3 * away:.3g} mm beside the "
                f"part, which goes from {_corner(mesh.vertices.min(axis=0))} to "
                f"{_corner(mesh.vertices.max(axis=0))} mm in its own file; give a place on the face"
            )
        numbers = np.flatnonzero(faces.alike(face)) if one.alike else [face]
        chosen |= np.isin(faces.of_triangle, numbers)
    return chosen


def _corner(point: np.ndarray) -> str:
    return str([float(f"{1e3 * value:.6g}") for value in point])
