"""What a reader returns: triangles as the file gives them, with element numbers and group names."""

from __future__ import annotations

import io
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np


@dataclass(frozen=True)
class ElementNumbers:
    """The element of the file to which each of m triangles belongs; results can be exported by it.

    The triangles of a quadrilateral share a number. If the file does not number its elements (`own`
    is false), the number is the position from 1 of the triangle, polygon (OBJ) or cell (VTK).
    """

    elements: np.ndarray  # (m,) int64, the element's number; 0: not in the file
    faces: np.ndarray  # (m,) int8, face of a solid element, from 1 as Abaqus's S1, S2 ...; 0: shell
    own: bool = False  # whether the numbers are the file's own
    instance: str = ""  # the Abaqus instance in which the numbers count, if any

    def select(self, rows: np.ndarray) -> ElementNumbers:
        """Numbers of some triangles, by a mask (m,) or by indices; index -1: not in the file."""
        if rows.dtype == bool:
            rows = np.flatnonzero(rows)
        elements, faces = (
            np.where(rows >= 0, column[rows], 0) for column in (self.elements, self.faces)
        )
        return replace(self, elements=elements, faces=faces)


def number_by_position(count: int) -> ElementNumbers:
    """Numbers for a file that has none: its triangles from 1 on."""
    return ElementNumbers(np.arange(1, count + 1), np.zeros(count, dtype=np.int8))


@dataclass(frozen=True)
class RawMesh:
    """The triangles of a file, before they are checked.

    Groups are the file's sets, groups, properties or colours: name -> triangles, (m,) bool.
    """

    corners: np.ndarray  # (m, 3, 3), in the file's numbers and order
    groups: dict[str, np.ndarray] = field(default_factory=dict)
    unit: str | None = None  # of the file's numbers, if the file states one
    notes: tuple[str, ...] = ()  # what was left out or turned into triangles
    numbering: ElementNumbers | None = None  # None if the file has only triangles


def join_pieces(pieces: list[tuple[str, np.ndarray]]) -> RawMesh:
    """Join pieces (name, corners (k, 3, 3)); pieces of one name make one group, "" makes none."""
    pieces = [(name, corners) for name, corners in pieces if len(corners)]
    if not pieces:
        return RawMesh(np.zeros((0, 3, 3)))
    piece_of = np.repeat(np.arange(len(pieces)), [len(corners) for _, corners in pieces])
    groups: dict[str, np.ndarray] = {}
    for index, (name, _) in enumerate(pieces):
        if name:
            groups[name] = groups.get(name, False) | (piece_of == index)
    return RawMesh(np.concatenate([corners for _, corners in pieces]), groups)


def load_pieces(kind: str, content: bytes) -> list[tuple[str, np.ndarray]]:
    """Read a file of some kind ("stl", "3mf") with trimesh; pieces as `scene_pieces` gives them."""
    import trimesh

    return scene_pieces(trimesh.load_scene(io.BytesIO(content), file_type=kind, process=False))


def scene_pieces(scene: Any) -> list[tuple[str, np.ndarray]]:
    """Name and corners (k, 3, 3) of each mesh of a trimesh scene, placed as in the scene."""
    pieces = []
    for node in scene.graph.nodes_geometry:
        transform, key = scene.graph[node]
        mesh = scene.geometry[key]
        if not hasattr(mesh, "faces"):
            continue  # lines and points
        points = np.asarray(mesh.vertices, dtype=np.float64)
        points = points @ transform[:3, :3].T + transform[:3, 3]
        name = str(mesh.metadata.get("name") or node)
        pieces.append(("" if name.startswith("geometry_") else name, points[mesh.faces]))
    return pieces
