"""PLY files, text and binary, read by trimesh."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.readers.raw_mesh import RawMesh

MAX_COLOURS = 64  # a photograph on the part is no set of names


def read_ply(path: Path, content: bytes) -> RawMesh:
    """Text or binary; a triangle painted in one colour, by face or by its three corners, is named "#rrggbb"."""
    import trimesh

    _require_all_lines(path, content)
    mesh: Any = trimesh.load(io.BytesIO(content), file_type="ply", process=False)
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        return RawMesh(np.zeros((0, 3, 3)))
    corners = np.asarray(mesh.vertices, dtype=np.float64)[mesh.faces]
    colours = _colours(mesh)
    if colours is None:
        return RawMesh(corners)
    kinds, of_triangle = np.unique(colours, axis=0, return_inverse=True)
    names = (
        []
        if len(kinds) > MAX_COLOURS
        else ["#" + "".join(f"{int(c):02x}" for c in kind) for kind in kinds]
    )
    groups = {
        name: of_triangle.reshape(-1) == k for k, name in enumerate(names) if kinds[k, 0] >= 0
    }
    return RawMesh(corners, groups)


def _require_all_lines(path: Path, content: bytes) -> None:
    """A text file holds a line for each element its header counts; of one cut short the reader takes what is there."""
    header, end, body = content.partition(b"end_header")
    if not end or not re.search(rb"^format\s+ascii", header, re.MULTILINE):
        return
    said = sum(int(count) for count in re.findall(rb"^element\s+\S+\s+(\d+)", header, re.MULTILINE))
    there = sum(1 for line in body.splitlines() if line.strip())
    if there < said:
        raise InputError(
            f"{path}: truncated: its header counts {said} lines and {there} are there; export it again"
        )


def _colours(mesh: Any) -> np.ndarray | None:
    """Red, green, blue (m, 3) of each triangle, -1 where its corners differ; None without colours."""
    if mesh.visual.kind == "face":
        return np.asarray(mesh.visual.face_colors)[:, :3].astype(np.int64)
    if mesh.visual.kind == "vertex":
        of_corner = np.asarray(mesh.visual.vertex_colors)[:, :3].astype(np.int64)[mesh.faces]
        same = (of_corner == of_corner[:, :1]).all(axis=(1, 2))
        return np.where(same[:, None], of_corner[:, 0], -1)
    return None
