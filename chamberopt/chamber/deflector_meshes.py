"""Meshes of a design's deflectors: read from their files, or made from their sizes."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.design.shapes import lofted
from chamberopt.geometry.mesh_io.part_mesh import read_part_cached
from chamberopt.geometry.mesh_io.surface_error import SurfaceError
from chamberopt.geometry.triangles import rotation_matrix

if TYPE_CHECKING:
    from chamberopt.design.design import Design
    from chamberopt.design.shapes.hole_and_deflector_tables import Deflector

SIDES = 64  # flat sides of a round rod, their corners on the circle


class DeflectorMesh(NamedTuple):
    """A deflector as it stands in the chamber."""

    name: str  # in the design
    at_mm: tuple[float, float, float]  # its middle in the design, for messages
    vertices: np.ndarray  # [m], (n, 3)
    triangles: np.ndarray  # (m, 3), normals outward
    notes: list[str]  # what was assumed and repaired in its file


def read_deflectors(design: Design) -> list[DeflectorMesh]:
    """All deflectors of a design; InputError for a file that cannot be used."""
    deflectors = []
    for k, one in enumerate(design.chamber.deflectors):
        name = f"chamber.deflectors.{k}"
        vertices, triangles, notes = _mesh_about_its_middle(one, name)
        vertices = vertices @ rotation_matrix(one.rotate_deg).T + np.array(one.at)
        deflectors.append(DeflectorMesh(name, one.at_mm, vertices, triangles, notes))
    return deflectors


def _mesh_about_its_middle(
    deflector: Deflector, name: str
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Vertices [m], triangles and notes of a deflector before it is turned."""
    import trimesh

    if deflector.kind == "mesh":
        try:
            mesh = read_part_cached(deflector.mesh_path, deflector.unit)
        except SurfaceError:
            raise
        except InputError as error:  # its message is about a part
            raise InputError(f"{name}.mesh: {str(error).replace('part.unit', 'unit')}") from None
        middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2.0
        notes = [
            note.replace("part.unit", f"{name}.unit").replace("the part measures", "it measures")
            for note in mesh.notes
        ]
        return mesh.vertices - middle, mesh.triangles, notes
    if deflector.kind == "ball":
        ball = trimesh.creation.icosphere(subdivisions=3, radius=deflector.diameter / 2.0)
        return np.asarray(ball.vertices), np.asarray(ball.faces), []
    if deflector.kind == "plate":
        box = trimesh.creation.box(deflector.size)
        return np.asarray(box.vertices), np.asarray(box.faces), []
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    circle = deflector.diameter / 2.0 * np.c_[np.cos(angle), np.sin(angle)]
    half = deflector.length / 2.0
    rod = lofted([np.c_[circle, np.full(SIDES, -half)], np.c_[circle, np.full(SIDES, half)]])
    return rod.vertices, rod.triangles, []
