"""Wavefront OBJ files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.readers.raw_mesh import ElementNumbers, RawMesh


def read_obj(path: Path, content: bytes) -> RawMesh:
    """Faces of any number of corners, as fans; objects (o), groups (g) and materials (usemtl) give names."""
    points: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    fans: list[int] = []  # triangles of each face
    names: dict[str, tuple[str, ...]] = {}  # by keyword, those in force
    runs: list[tuple[int, tuple[str, ...]]] = []  # from which triangle on, which names
    for number, line in enumerate(content.decode("utf-8", errors="replace").splitlines(), start=1):
        keyword, *words = line.split("#")[0].split() or [""]
        if keyword == "v":
            try:
                points.append([float(word) for word in words[:3]])
            except ValueError:
                raise InputError(
                    f"{path}: line {number}: 'v' with no number; export it again"
                ) from None
        elif keyword == "f":
            try:
                ring = [int(word.split("/")[0]) for word in words]
            except ValueError:
                raise InputError(
                    f"{path}: line {number}: 'f' with no number; export it again"
                ) from None
            ring = [k - 1 if k > 0 else len(points) + k for k in ring]
            if len(ring) < 3 or min(ring) < 0:
                raise InputError(
                    f"{path}: line {number}: a face of {len(ring)} corners that are not there; export again"
                )
            triangles += [(ring[0], ring[k], ring[k + 1]) for k in range(1, len(ring) - 1)]
            fans.append(len(ring) - 2)
        elif keyword in ("o", "g", "usemtl"):
            names[keyword] = tuple(words) if keyword == "g" else (" ".join(words),)
            runs.append(
                (
                    len(triangles),
                    tuple(dict.fromkeys(name for kept in names.values() for name in kept)),
                )
            )
    if triangles and max(map(max, triangles)) >= len(points):
        raise InputError(
            f"{path}: truncated: a face names a vertex that is not there; export or copy it again"
        )
    corners = (
        np.array(points, dtype=np.float64)[np.array(triangles)]
        if triangles
        else np.zeros((0, 3, 3))
    )
    groups: dict[str, np.ndarray] = {}
    ends = [start for start, _ in runs[1:]] + [len(triangles)]
    for (start, told), end in zip(runs, ends, strict=True) if runs else ():
        for name in told if end > start else ():
            groups.setdefault(name, np.zeros(len(triangles), dtype=bool))[start:end] = True
    faces = ElementNumbers(
        np.repeat(np.arange(1, len(fans) + 1), fans), np.zeros(len(triangles), dtype=np.int8)
    )
    return RawMesh(corners, groups, numbering=faces)
