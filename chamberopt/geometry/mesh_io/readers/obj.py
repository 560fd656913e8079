"""Read Wavefront OBJ files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.readers.raw_mesh import ElementNumbers, RawMesh


def read_obj(path: Path, content: bytes) -> RawMesh:
    """Read an OBJ; o, g and usemtl give names. Faces with more corners become fans."""
    points: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    fan_sizes: list[int] = []  # triangles of each face
    current: dict[str, tuple[str, ...]] = {}  # names in force, by keyword
    runs: list[tuple[int, tuple[str, ...]]] = []  # first triangle, and the names from there on
    for number, line in enumerate(content.decode("utf-8", errors="replace").splitlines(), start=1):
        keyword, *words = line.split("#")[0].split() or [""]
        try:
            if keyword == "v":
                points.append([float(word) for word in words[:3]])
            elif keyword == "f":
                ring = [int(word.split("/")[0]) for word in words]
                ring = [k - 1 if k > 0 else len(points) + k for k in ring]
                if len(ring) < 3 or min(ring) < 0:
                    why = f"a face of {len(ring)} corners that are not there"
                    raise InputError(f"{path}: line {number}: {why}; export it again")
                triangles += [(ring[0], ring[k], ring[k + 1]) for k in range(1, len(ring) - 1)]
                fan_sizes.append(len(ring) - 2)
            elif keyword in ("o", "g", "usemtl"):
                current[keyword] = tuple(words) if keyword == "g" else (" ".join(words),)
                names = dict.fromkeys(name for names in current.values() for name in names)
                runs.append((len(triangles), tuple(names)))
        except ValueError:
            text = f"line {number}: {keyword!r} with no number; export it again"
            raise InputError(f"{path}: {text}") from None
    if triangles and max(map(max, triangles)) >= len(points):
        why = "a face names a vertex that is not there"
        raise InputError(f"{path}: truncated: {why}; export or copy it again")
    count = len(triangles)
    corners = np.array(points)[np.array(triangles)] if count else np.zeros((0, 3, 3))
    groups: dict[str, np.ndarray] = {}
    ends = [start for start, _ in runs[1:]] + [count]
    for (start, names_here), end in zip(runs, ends, strict=False):
        for name in names_here if end > start else ():
            groups.setdefault(name, np.zeros(count, dtype=bool))[start:end] = True
    faces = np.repeat(np.arange(1, len(fan_sizes) + 1), fan_sizes)
    numbering = ElementNumbers(faces, np.zeros(count, dtype=np.int8))
    return RawMesh(corners, groups, numbering=numbering)
