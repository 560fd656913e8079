"""Read STL files: binary files as an array of records, and text files with trimesh.

Reading the records is faster than importing trimesh, and most parts are binary STL files.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.raw_mesh import RawMesh, read_scene

HEADER = 84  # bytes of a binary STL before the triangles
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
RECORD = TRIANGLE.itemsize


def read_stl(path: Path, content: bytes) -> RawMesh:
    """Read an STL file. The named solids of a text file become groups of triangles."""
    content = _complete_stl(path, content)
    if _is_text_stl(content):
        return read_scene(io.BytesIO(content), "stl")
    return RawMesh(np.frombuffer(content, TRIANGLE, offset=HEADER)["corners"].astype(np.float64))


def is_binary_stl(content: bytes) -> bool:
    """Return True if the content is a binary STL file.

    Its only mark is that the length fits the number of triangles that it states.
    """
    length = HEADER + RECORD * _declared_triangles(content)
    return len(content) >= HEADER and len(content) == length and not _is_text_stl(content)


def _complete_stl(path: Path, content: bytes) -> bytes:
    """Return the content of an STL file without data that some exporters append.

    Raises InputError if it is truncated.

    A binary STL states its number of triangles, a text STL ends with "endsolid".
    """
    if _is_text_stl(content):
        if not content.rstrip().splitlines()[-1].strip().lower().startswith(b"endsolid"):
            why = "truncated, the last line is not 'endsolid'"
            raise InputError(f"{path}: {why}; export or copy it again")
        return content
    declared = _declared_triangles(content)
    if len(content) < HEADER:
        reason = "shorter than its header"
    elif len(content) < HEADER + RECORD * declared:
        held = (len(content) - HEADER) // RECORD
        reason = f"it says {declared} triangles and holds {held}"
    else:
        return content[: HEADER + RECORD * declared]
    raise InputError(f"{path}: truncated or not an STL: {reason}; export or copy it again")


def _declared_triangles(content: bytes) -> int:
    return int.from_bytes(content[80:84], "little")


def _is_text_stl(content: bytes) -> bool:
    """Return True if the content is a text STL file. Binary files may begin with "solid" too."""
    return content.lstrip()[:5].lower() == b"solid" and b"facet" in content[:2000].lower()
