"""Write a mesh of another library as the file of a part: designs name files, and stay files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import check_new_file, claim_file, read_file, write_bytes
from chamberopt.geometry.meshes.part_mesh import close_surface, triangles_in
from chamberopt.geometry.meshes.ply import ply_content
from chamberopt.geometry.meshes.surface_error import SurfaceError
from chamberopt.geometry.meshes.units import METRES_PER

PLY = ".ply"


def write_part(mesh: Any, path: str | Path, unit: str) -> Path:
    """Write a mesh as a PLY file, and return the file's absolute path.

    The mesh is checked as a part's file is when it is read, before anything is written. A file that
    holds the same mesh already stays as it is, so that a notebook can be run again.

    Args:
        mesh: a trimesh.Trimesh or a pyvista.PolyData.
        path: the file, *.ply.
        unit: unit of the mesh's numbers: um, mm, cm, m or in.
    Raises:
        InputError: the mesh is of another kind, empty, open, not finite or crosses itself, has a
            size that no part has, or another file is at `path`.
    """
    path = Path(path).absolute()
    if path.suffix.lower() != PLY:
        raise InputError(f"{path}: the part is written as {PLY}; give such a name")
    if unit not in METRES_PER:
        raise InputError(f"unit: given {unit!r}; give one of {', '.join(METRES_PER)}")
    content = ply_content(*mesh_arrays(mesh), unit)
    try:
        close_surface(triangles_in(path, content, unit))
    except SurfaceError as error:
        error.__notes__.clear()  # they tell how to see the faults of a file that is there
        raise
    if path.is_file() and read_file(path) == content:
        return path
    with claim_file(check_new_file(path)):
        write_bytes(path, content)
    return path


def mesh_arrays(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (n, 3) and triangles (m, 3) of a mesh of trimesh or PyVista.

    The two are told by their attributes, so that neither has to be imported for the other.
    """
    if hasattr(mesh, "regular_faces") and hasattr(mesh, "points"):
        flat = mesh if mesh.is_all_triangles else mesh.triangulate()
        corners = flat.regular_faces if flat.n_cells else np.zeros((0, 3), dtype=int)
        return np.asarray(flat.points, dtype=np.float64), np.asarray(corners)
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        vertices = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
        return vertices, np.asarray(mesh.faces, dtype=int).reshape(-1, 3)
    raise InputError(
        f"mesh: given {type(mesh).__name__}; give a trimesh.Trimesh or a pyvista.PolyData, or name "
        "a file of it as part.mesh"
    )
