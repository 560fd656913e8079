"""Mesh files of parts and set-ups: read them, close their surface, find their groups."""

from chamberopt.geometry.mesh_io.formats import MESH_FORMATS
from chamberopt.geometry.mesh_io.part_mesh import (
    PartMesh,
    TriangleSoup,
    close_surface,
    read_part,
    read_part_cached,
    read_triangles,
    select_triangles,
)
from chamberopt.geometry.mesh_io.readers.raw_mesh import ElementNumbers
from chamberopt.geometry.mesh_io.surface_error import (
    OpenSurfaceError,
    SurfaceError,
    format_box,
    format_point,
)

__all__ = [
    "MESH_FORMATS",
    "ElementNumbers",
    "OpenSurfaceError",
    "PartMesh",
    "SurfaceError",
    "TriangleSoup",
    "close_surface",
    "format_box",
    "format_point",
    "read_part",
    "read_part_cached",
    "read_triangles",
    "select_triangles",
]
