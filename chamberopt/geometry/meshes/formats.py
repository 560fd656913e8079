"""Find the format of a mesh file, by its content and then by its name, and read the file."""

from __future__ import annotations

import logging
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.abaqus import read_abaqus
from chamberopt.geometry.meshes.gmsh import read_gmsh
from chamberopt.geometry.meshes.nastran import read_nastran
from chamberopt.geometry.meshes.obj import read_obj
from chamberopt.geometry.meshes.ply import read_ply
from chamberopt.geometry.meshes.raw_mesh import RawMesh
from chamberopt.geometry.meshes.step import read_step
from chamberopt.geometry.meshes.step_tessellation import Tessellation
from chamberopt.geometry.meshes.stl import is_binary_stl, read_stl
from chamberopt.geometry.meshes.threemf import read_3mf
from chamberopt.geometry.meshes.vtk import read_vtk


class MeshFormat(NamedTuple):
    """Mesh format: how its files are recognised, and the function that reads them."""

    name: str
    suffixes: tuple[str, ...]  # usual endings of file names
    content: re.Pattern[bytes]  # start of the file, or a line in it
    read: Callable[[Path, bytes], RawMesh]


def _begins_with(pattern: str) -> re.Pattern[bytes]:
    return re.compile(rb"\A\s*(?:" + pattern.encode() + rb")")


def _has_line(pattern: str) -> re.Pattern[bytes]:
    """Return a pattern that matches any line of a file that begins with `pattern`."""
    return re.compile(rb"^[ \t]*(?:" + pattern.encode() + rb")", re.M | re.I)


VTK = r"# vtk DataFile|(?:<\?xml[^>]*>\s*)?<VTKFile"
NASTRAN = r"GRID\*?(?:[ \t]+|,)[ \t]*\d|BEGIN[ \t]+BULK"
MESH_FORMATS = (
    MeshFormat("3MF", (".3mf",), _begins_with(r"PK\x03\x04"), read_3mf),
    MeshFormat("STEP", (".step", ".stp"), _begins_with("ISO-10303-21"), read_step),
    MeshFormat("PLY", (".ply",), _begins_with(r"ply\s"), read_ply),
    MeshFormat("Gmsh", (".msh",), _begins_with(r"\$MeshFormat"), read_gmsh),
    MeshFormat("VTK", (".vtk", ".vtp", ".vtu"), _begins_with(VTK), read_vtk),
    MeshFormat("STL", (".stl",), _begins_with(r"solid[^\0]*facet"), read_stl),
    MeshFormat("Nastran", (".dat", ".data", ".bdf", ".nas"), _has_line(NASTRAN), read_nastran),
    MeshFormat("Abaqus", (".inp",), _has_line(r"\*(?:HEADING|NODE|PART)\b"), read_abaqus),
    MeshFormat("OBJ", (".obj",), _has_line(r"v[ \t]+[-+.\d]+[ \t]+[-+.\d]"), read_obj),
)
SUFFIXES = tuple(suffix for one in MESH_FORMATS for suffix in one.suffixes)
HEAD = 1 << 16  # bytes in which a text file shows its format, even after comments
BINARY_HEAD = 1 << 10


def is_mesh_name(name: str) -> bool:
    """Return True if a file's name has the usual ending of a mesh or CAD format."""
    return name.lower().endswith(SUFFIXES)


def read_raw_mesh(path: Path, content: bytes, how: Tessellation | None = None) -> RawMesh:
    """Read the triangles of a mesh file of any supported format.

    Args:
        how: fineness of the triangles of a STEP file; None for the usual fineness.

    Raises:
        InputError: for an unknown format, for another format than STEP if `how` is given, or for a
            damaged or truncated file.
    """
    found = _find_format(path, content)
    if how is not None and found.name != "STEP":
        raise InputError(
            f"{path}: part.tessellation is for STEP, and the file is {found.name}, which has its "
            "own triangles; leave it out, or see part.target.element_mm"
        )
    try:
        with _libraries_quiet():
            return found.read(path, content) if how is None else read_step(path, content, how)
    except (InputError, MemoryError):
        raise
    except Exception as error:  # each library fails in its own way on a damaged file
        text = str(error).strip() or type(error).__name__
        raise InputError(
            f"{path}: cannot be read as {found.name}, it is damaged or truncated "
            f"({text.splitlines()[0][:120]}); export it again"
        ) from None


@contextmanager
def _libraries_quiet() -> Iterator[None]:
    """Suppress messages of libraries during a `with` block, because the mesh is checked later."""
    before = logging.root.manager.disable
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        logging.disable(logging.ERROR)
        try:
            yield
        finally:
            logging.disable(before)


def _find_format(path: Path, content: bytes) -> MeshFormat:
    if is_binary_stl(content):
        return next(one for one in MESH_FORMATS if one.name == "STL")
    is_binary = b"\0" in content[:BINARY_HEAD]
    head = content[: BINARY_HEAD if is_binary else HEAD]
    for one in MESH_FORMATS:
        if one.content.search(head):
            return one
    for one in MESH_FORMATS:
        if path.suffix.lower() in one.suffixes:
            return one
    suffixes = ", ".join(suffix for one in MESH_FORMATS for suffix in one.suffixes)
    raise InputError(
        f"{path}: its mesh format is not known, by its content or name; use {suffixes}"
    )
