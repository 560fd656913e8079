"""STL files, binary and text, read by trimesh."""

from __future__ import annotations

from pathlib import Path

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.readers.raw_mesh import RawMesh, joined, load_pieces


def read_stl(path: Path, content: bytes) -> RawMesh:
    """Binary or text; the solids of a text file by their names."""
    return joined(load_pieces("stl", _whole_stl(path, content)))


def _whole_stl(path: Path, content: bytes) -> bytes:
    """The STL without what some exporters put behind it. InputError when it is truncated.

    A binary STL says how many triangles it holds, a text one ends with endsolid.
    """
    if is_text_stl(content):
        if not content.rstrip().splitlines()[-1].strip().lower().startswith(b"endsolid"):
            raise InputError(
                f"{path}: truncated, the last line is not 'endsolid'; export or copy it again"
            )
        return content
    declared = int.from_bytes(content[80:84], "little")
    if len(content) < 84 or len(content) < 84 + 50 * declared:
        held = max(0, (len(content) - 84) // 50)
        told = (
            f"it says {declared} triangles and holds {held}"
            if len(content) >= 84
            else "shorter than its header"
        )
        raise InputError(f"{path}: truncated or not an STL: {told}; export or copy it again")
    return content[: 84 + 50 * declared]


def is_text_stl(content: bytes) -> bool:
    """A text STL; binary ones may begin with 'solid' too."""
    return content.lstrip()[:5].lower() == b"solid" and b"facet" in content[:2000].lower()
