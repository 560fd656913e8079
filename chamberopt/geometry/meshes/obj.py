"""Read Wavefront OBJ files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.raw_mesh import ElementNumbers, RawMesh


def read_obj(path: Path, content: bytes) -> RawMesh:
    """Read an OBJ file. Its objects (o), groups (g) and materials (usemtl) become groups.

    Faces with more than three corners become fans of triangles.
    """
    points: list[list[float]] = []
    directions: list[list[float]] = [[0.0, 0.0, 0.0]]  # the first row stands for no direction
    # rows of directions at the corners of the triangles
    of_corners: list[tuple[int, int, int]] = []
    triangles: list[tuple[int, int, int]] = []
    fan_sizes: list[int] = []  # triangles of each face
    current: dict[str, tuple[str, ...]] = {}  # present names, by keyword
    # first triangle of each run, and the names of its triangles
    runs: list[tuple[int, tuple[str, ...]]] = []
    for number, line in enumerate(content.decode("utf-8", errors="replace").splitlines(), start=1):
        keyword, *words = line.split("#")[0].split() or [""]
        try:
            if keyword == "v":
                points.append([float(word) for word in words[:3]])
            elif keyword == "vn":
                directions.append([float(word) for word in words[:3]])
            elif keyword == "f":
                ring = [int(word.split("/")[0]) for word in words]
                facing = [_direction(word, len(directions)) for word in words]
                ring = [k - 1 if k > 0 else len(points) + k for k in ring]
                if len(ring) < 3 or min(ring) < 0:
                    why = f"a face of {len(ring)} corners that are not there"
                    raise InputError(f"{path}: line {number}: {why}; export it again")
                fan = range(1, len(ring) - 1)
                triangles += [(ring[0], ring[k], ring[k + 1]) for k in fan]
                of_corners += [(facing[0], facing[k], facing[k + 1]) for k in fan]
                fan_sizes.append(len(ring) - 2)
            elif keyword in ("o", "g", "usemtl"):
                current[keyword] = tuple(words) if keyword == "g" else (" ".join(words),)
                names = dict.fromkeys(name for names in current.values() for name in names)
                runs.append((len(triangles), tuple(names)))
        except ValueError:
            text = f"line {number}: {keyword!r} with no number; export it again"
            raise InputError(f"{path}: {text}") from None
    is_short = max(map(max, triangles), default=0) >= max(len(points), 1)
    if is_short or max(map(max, of_corners), default=0) >= len(directions):
        why = "a face names a vertex or a normal that is not there"
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
    normals = np.array(directions)[np.array(of_corners)] if len(directions) > 1 and count else None
    return RawMesh(corners, groups, numbering=numbering, normals=normals)


def _direction(word: str, count: int) -> int:
    """Return the row of the normal that a corner such as 3/1/2 names, or 0 if it names none.

    Args:
        count: number of normals read so far, from which negative numbers count backwards.
    """
    parts = word.split("/")
    number = int(parts[2]) if len(parts) > 2 and parts[2] else 0
    return number if number >= 0 else max(count + number, 0)
