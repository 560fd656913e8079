"""Read PLY files, text and binary, with trimesh, and write them. Colours become groups."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.raw_mesh import RawMesh

MAX_COLOURS = 64  # more colours are a photograph on the part, not names of groups


def read_ply(path: Path, content: bytes) -> RawMesh:
    """Read a PLY file. Triangles of one colour become a group with the name "#rrggbb".

    A triangle has the colour of its face or, if they are alike, of its corners.
    """
    import trimesh

    _require_all_lines(path, content)
    mesh: Any = trimesh.load(io.BytesIO(content), file_type="ply", process=False)
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        return RawMesh(np.zeros((0, 3, 3)))
    corners = np.asarray(mesh.vertices, dtype=np.float64)[mesh.faces]
    colours = _triangle_colours(mesh)
    if colours is None:
        return RawMesh(corners)
    distinct, of_triangle = np.unique(colours, axis=0, return_inverse=True)
    groups = {
        "#" + "".join(f"{int(part):02x}" for part in colour): of_triangle.reshape(-1) == k
        for k, colour in enumerate(distinct)
        if colour[0] >= 0 and len(distinct) <= MAX_COLOURS
    }
    return RawMesh(corners, groups)


def ply_content(vertices: np.ndarray, triangles: np.ndarray, unit: str) -> bytes:
    """Return the content of a binary PLY file with the surface's coordinates to the last bit.

    Args:
        vertices: positions in the unit of the file, shape (n, 3).
        triangles: shape (m, 3).
        unit: unit of the positions, which a comment of the file states.
    """
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"comment unit = {unit}\n"
        f"element vertex {len(vertices)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(triangles)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    faces = np.zeros(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    return header.encode() + np.asarray(vertices, dtype="<f8").tobytes() + faces.tobytes()


def _require_all_lines(path: Path, content: bytes) -> None:
    """Raise InputError for a truncated text file, because trimesh would read the remaining part.

    A text file has a line for each element that its header counts.
    """
    header, end, body = content.partition(b"end_header")
    if not end:
        return
    declared = sum(map(int, re.findall(rb"^element\s+\S+\s+(\d+)", header, re.MULTILINE)))
    is_text = re.search(rb"^format\s+ascii", header, re.MULTILINE)
    held = sum(1 for line in body.splitlines() if line.strip()) if is_text else len(body)
    if held < declared:
        counted = "lines and" if is_text else "elements, and bytes for"
        why = f"its header counts {declared} {counted} {held} are there"
        raise InputError(f"{path}: truncated: {why}; export it again")


def _triangle_colours(mesh: Any) -> np.ndarray | None:
    """Return red, green and blue of each triangle, (m, 3), or None if the file has no colours.

    The values are -1 for a triangle whose corners differ in colour.
    """
    if mesh.visual.kind == "face":
        return np.asarray(mesh.visual.face_colors)[:, :3].astype(np.int64)
    if mesh.visual.kind == "vertex":
        of_corner = np.asarray(mesh.visual.vertex_colors)[:, :3].astype(np.int64)[mesh.faces]
        same = (of_corner == of_corner[:, :1]).all(axis=(1, 2))
        return np.where(same[:, None], of_corner[:, 0], -1)
    return None
