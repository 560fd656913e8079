"""What a reader returns: triangles as the file gives them, with element numbers and group names."""

from __future__ import annotations

import io
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np


@dataclass(frozen=True)
class ElementNumbers:
    """The origin of each of m triangles.

    elements (m,) int64: the number that the file gives the element, shared by the triangles of a quadrilateral; where
    the file numbers none (``own`` false) the place, from 1, of the triangle in it (OBJ: of the polygon, VTK: of the
    cell); 0 is not in the file: it closes a hole · faces (m,) int8: which face of a solid element, from 1 as Abaqus
    counts its S1, S2 ...; 0 is a shell · instance: Abaqus's instance that the numbers count in, "" without.
    """

    elements: np.ndarray
    faces: np.ndarray
    own: bool = False
    instance: str = ""

    def of(self, rows: np.ndarray) -> ElementNumbers:
        """That of some of the triangles, in the order of rows: indices, -1 for one that is new, or a mask."""
        if rows.dtype == bool:
            rows = np.flatnonzero(rows)
        elements, faces = (
            np.where(rows >= 0, column[rows], 0) for column in (self.elements, self.faces)
        )
        return replace(self, elements=elements, faces=faces)


def number_by_position(count: int) -> ElementNumbers:
    """That of a file which numbers nothing: its triangles from 1 on."""
    return ElementNumbers(np.arange(1, count + 1), np.zeros(count, dtype=np.int8))


@dataclass(frozen=True)
class RawMesh:
    """The triangles of a file, before anything is judged or put right.

    corners (m, 3, 3) in the file's numbers and order · groups: name -> (m,) bool, the file's sets, groups,
    properties, colours · unit: what the file states its numbers are in, None where it does not · notes: what
    was left out or turned into triangles · numbering of its elements, None where triangles are all it has.
    """

    corners: np.ndarray
    groups: dict[str, np.ndarray] = field(default_factory=dict)
    unit: str | None = None
    notes: tuple[str, ...] = ()
    numbering: ElementNumbers | None = None


def joined(pieces: list[tuple[str, np.ndarray]]) -> RawMesh:
    """One mesh of named pieces (name, corners (k, 3, 3)); pieces of one name make one group, "" makes none."""
    pieces = [(name, corners) for name, corners in pieces if len(corners)]
    if not pieces:
        return RawMesh(np.zeros((0, 3, 3)))
    piece_of = np.repeat(np.arange(len(pieces)), [len(corners) for _, corners in pieces])
    groups: dict[str, np.ndarray] = {}
    for index, (name, _) in enumerate(pieces):
        if name:
            groups[name] = groups.get(name, False) | (piece_of == index)
    return RawMesh(np.concatenate([corners for _, corners in pieces]), groups)


def scene_pieces(scene: Any) -> list[tuple[str, np.ndarray]]:
    """(name, corners (k, 3, 3)) of each mesh in a scene, moved to where the scene puts it."""
    pieces = []
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        mesh = scene.geometry[name]
        if not hasattr(mesh, "faces"):
            continue  # lines and points
        vertices = (
            np.asarray(mesh.vertices, dtype=np.float64) @ transform[:3, :3].T + transform[:3, 3]
        )
        told = str(mesh.metadata.get("name") or node)
        pieces.append(("" if told.startswith("geometry_") else told, vertices[mesh.faces]))
    return pieces


def load_pieces(kind: str, content: bytes) -> list[tuple[str, np.ndarray]]:
    """Read a file of some kind ("stl", "3mf") with trimesh: name and corners (k, 3, 3) of each mesh."""
    import trimesh

    return scene_pieces(trimesh.load_scene(io.BytesIO(content), file_type=kind, process=False))
