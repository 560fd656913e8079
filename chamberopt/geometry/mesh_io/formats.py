"""Which formats are read, and how a file is known: by its content, whatever its name ends with."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.readers.abaqus import read_abaqus
from chamberopt.geometry.mesh_io.readers.gmsh import read_gmsh
from chamberopt.geometry.mesh_io.readers.nastran import read_nastran
from chamberopt.geometry.mesh_io.readers.obj import read_obj
from chamberopt.geometry.mesh_io.readers.ply import read_ply
from chamberopt.geometry.mesh_io.readers.raw_mesh import RawMesh
from chamberopt.geometry.mesh_io.readers.step import read_step
from chamberopt.geometry.mesh_io.readers.stl import is_text_stl, read_stl
from chamberopt.geometry.mesh_io.readers.threemf import read_3mf
from chamberopt.geometry.mesh_io.readers.vtk import read_vtk


@dataclass(frozen=True)
class MeshFormat:
    """A way to write a mesh: its usual endings, what its content begins with or holds, and its reader."""

    name: str
    suffixes: tuple[str, ...]
    content: re.Pattern[bytes]
    read: Callable[[Path, bytes], RawMesh]


def _anywhere(pattern: str) -> re.Pattern[bytes]:
    """A line that begins so, anywhere in the file."""
    return re.compile(rb"^[ \t]*(?:" + pattern.encode() + rb")", re.M | re.I)


def _first(pattern: str) -> re.Pattern[bytes]:
    """The file begins so."""
    return re.compile(rb"\A\s*(?:" + pattern.encode() + rb")")


MESH_FORMATS = (
    MeshFormat("3MF", (".3mf",), _first(r"PK\x03\x04"), read_3mf),
    MeshFormat("STEP", (".step", ".stp"), _first("ISO-10303-21"), read_step),
    MeshFormat("PLY", (".ply",), _first(r"ply\s"), read_ply),
    MeshFormat("Gmsh", (".msh",), _first(r"\$MeshFormat"), read_gmsh),
    MeshFormat(
        "VTK",
        (".vtk", ".vtp", ".vtu"),
        _first(r"# vtk DataFile|(?:<\?xml[^>]*>\s*)?<VTKFile"),
        read_vtk,
    ),
    MeshFormat("STL", (".stl",), _first(r"solid[^\0]*facet"), read_stl),
    MeshFormat(
        "Nastran",
        (".dat", ".data", ".bdf", ".nas"),
        _anywhere(r"GRID\*?(?:[ \t]+|,)[ \t]*\d|BEGIN[ \t]+BULK"),
        read_nastran,
    ),
    MeshFormat("Abaqus", (".inp",), _anywhere(r"\*(?:HEADING|NODE|PART)\b"), read_abaqus),
    MeshFormat("OBJ", (".obj",), _anywhere(r"v[ \t]+[-+.\d]+[ \t]+[-+.\d]"), read_obj),
)
HEAD = 1 << 16  # bytes in which a text file has shown what it is, comments at its head included


def read_raw(path: Path, content: bytes) -> RawMesh:
    """What the file holds. Raises InputError when it is of no known format, damaged or truncated."""
    found = _format_of(path, content)
    try:
        mesh = found.read(path, content)
    except (InputError, MemoryError):
        raise
    except Exception as error:  # each library fails in its own way on a damaged file
        reason = (
            str(error).strip().splitlines()[0][:120] if str(error).strip() else type(error).__name__
        )
        raise InputError(
            f"{path}: cannot be read as {found.name}, it is damaged or truncated ({reason}); export it again"
        ) from None
    return mesh


def _format_of(path: Path, content: bytes) -> MeshFormat:
    by_suffix = next((one for one in MESH_FORMATS if path.suffix.lower() in one.suffixes), None)
    if _is_binary_stl(content):
        return next(one for one in MESH_FORMATS if one.name == "STL")
    head = content[:HEAD]
    binary = b"\0" in head[:1024]
    for one in MESH_FORMATS:
        if one.content.search(head if not binary else head[:1024]):
            return one
    if by_suffix is None:
        told = ", ".join(suffix for one in MESH_FORMATS for suffix in one.suffixes)
        raise InputError(
            f"{path}: not a mesh file that is known, by its content or name; use {told}"
        )
    return by_suffix


def _is_binary_stl(content: bytes) -> bool:
    """The one format without a mark of its own: its length follows from its number of triangles."""
    declared = int.from_bytes(content[80:84], "little")
    return len(content) >= 84 and len(content) == 84 + 50 * declared and not is_text_stl(content)
