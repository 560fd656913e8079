"""Read chamber.npz, which stores a result's cavity, part and target as they were simulated.

A finished result reads only chamber.npz, never again the files that its design names.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from chamberopt.chamber.build import Chamber
from chamberopt.chamber.part import Part, PartOfFile
from chamberopt.common.errors import InputError
from chamberopt.common.npz_files import is_of_type, load_record
from chamberopt.design.shapes import TAG_PART, TAG_SONOTRODE
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.meshes.raw_mesh import ElementNumbers
from chamberopt.geometry.meshes.units import METRES_PER
from chamberopt.geometry.smoothing.part import SmoothingFacts

if TYPE_CHECKING:
    from chamberopt.results.load import Result

CHAMBER_FILE = "chamber.npz"
LARGEST = 1e4  # m, m² or m³; every part and chamber is smaller
STEEPEST = 1e12  # 1/m; every curvature is smaller, and so is every component of a normal
REMEDY = "restore the file, or simulate again"
_Column: TypeAlias = tuple[str, np.ndarray, str, tuple[int, ...], tuple[int, int] | None]
"""Name, values, type, shape, and first number and end of whole numbers."""


def load_chamber(result: Result) -> Chamber:
    """Return the cavity, part and target of a result, read from chamber.npz in its folder.

    The whole chamber is checked, because compiled functions trust their input.

    Raises:
        InputError: the file is missing, damaged or not the file that was written.
    """
    path = result.path(CHAMBER_FILE)
    parts = Part, PartOfFile, PartMesh, ElementNumbers, SmoothingFacts
    chamber = load_record(path, Chamber, parts, REMEDY)
    try:
        _require_sound(chamber)
    except (ValueError, TypeError, AttributeError, KeyError) as error:
        raise InputError(f"{path}: damaged ({error}); {REMEDY}") from None
    return chamber


def _require_sound(chamber: Chamber) -> None:
    """Raise ValueError unless all arrays of a chamber have their types, shapes and ranges.

    The compiled simulator does not check them again.
    """
    part, file = chamber.part, chamber.part.file
    if not isinstance(part, Part) or not isinstance(file, PartOfFile):
        raise ValueError("without its part")
    corners, faces = len(chamber.vertices), len(chamber.triangles)
    points, own = len(part.vertices), len(part.triangles)
    columns: list[_Column] = [
        ("vertices", chamber.vertices, "f8", (corners, 3), None),
        ("triangles", chamber.triangles, "i4", (faces, 3), (0, corners)),
        ("tags", chamber.tags, "u1", (faces,), None),
        ("source", chamber.source, "i", (faces,), (-1, own)),
        ("exposed area", chamber.exposed_area, "f8", (own,), None),
        ("part's area", part.area, "f8", (own,), None),
        ("target", part.target, "b", (own,), None),
        ("part's rotation", file.rotation, "f8", (3, 3), None),
        ("part's shift", file.shift, "f8", (3,), None),
        *((f"zone {name}", zone, "b", (own,), None) for name, zone in part.zones.items()),
        *_mesh_columns("part", part.vertices, part.triangles),
        *_mesh_columns("simulated part", file.simulated.vertices, file.simulated.triangles),
        ("elements", file.simulated.elements, "i", (own,), None),
        ("element faces", file.simulated.numbering.faces, "i", (own,), None),
    ]
    if len(file.simulated.vertices) != points or len(file.simulated.triangles) != own:
        raise ValueError("the part has another size than in its file's frame")
    if part.normals is not None:
        columns.append(("normals", part.normals, "f4", (own, 3, 3), None))
    if part.hollow is not None:
        columns.append(("curvature", part.hollow, "f4", (own,), None))
    if part.smoothing is not None and not is_of_type(part.smoothing, SmoothingFacts):
        raise ValueError("what smoothing did is not of its types")
    if chamber.fitting is not None:
        columns.append(("fitting", chamber.fitting, "i", (faces,), (-1, faces)))
    if file.original is not None:
        own = len(file.original.triangles)
        columns += _mesh_columns("original part", file.original.vertices, file.original.triangles)
        columns.append(("original elements", file.original.elements, "i", (own,), None))
    for name, column, dtype, shape, limits in columns:
        if not isinstance(column, np.ndarray):
            raise ValueError(f"{name} is no array")
        if column.dtype != dtype and column.dtype.kind != dtype:
            raise ValueError(f"{name} is of type {column.dtype}")
        if column.shape != shape:
            raise ValueError(f"{name} has the shape {column.shape}, expected {shape}")
        largest = {"f8": LARGEST, "f4": STEEPEST}.get(dtype, np.inf)
        if not (np.abs(column) <= largest).all():
            raise ValueError(f"{name} has a number that is not finite, or too large")
        if limits and len(column) and not limits[0] <= column.min() <= column.max() < limits[1]:
            raise ValueError(f"{name} is not from {limits[0]} to {limits[1] - 1}")
    for tag, surface in ((TAG_PART, "part"), (TAG_SONOTRODE, "sonotrode")):
        if not (chamber.tags == tag).any():
            raise ValueError(f"without a {surface} in the cavity")
    if part.unit not in METRES_PER:
        raise ValueError(f"unit {part.unit!r}")
    if type(chamber.volume) is not float or not 0.0 < chamber.volume <= LARGEST:
        raise ValueError(f"volume {chamber.volume!r}")
    meshes = [file.simulated, *([file.original] if file.original else [])]
    texts = [*chamber.notes, chamber.shape_sha256, part.name, part.sha256, part.unit, *part.names]
    for mesh in meshes:
        texts += [*mesh.notes, mesh.sha256, mesh.unit, mesh.numbering.instance]
    if not all(isinstance(text, str) for text in texts):
        raise ValueError("a name or note is no text")
    if any(mesh.groups or mesh.unit not in METRES_PER for mesh in meshes):
        raise ValueError("the part in its file's frame has groups, or no unit")
    if any(mesh.normals is not None for mesh in meshes):
        raise ValueError("the part in its file's frame has normals")


def _mesh_columns(name: str, vertices: np.ndarray, triangles: np.ndarray) -> list[_Column]:
    limits = 0, len(vertices)
    return [
        (f"{name}'s vertices", vertices, "f8", (len(vertices), 3), None),
        (f"{name}'s triangles", triangles, "i4", (len(triangles), 3), limits),
    ]
