"""Make the surfaces of a result, and write them for ParaView and other programs.

part.vtp: the part in its own triangles, with a value for each triangle.
coverage.vtp: the same surface in finer triangles, with coverage etc. at each vertex.
chamber.vtp: the cavity, which is the closed surface round the air in the chamber.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.files import new_file, write_bytes
from chamberopt.design.shape_surface import TAG_SONOTRODE

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.part import Part
    from chamberopt.coverage.field.display_mesh import DisplayField
    from chamberopt.design.sonotrode import Face

PART, COVERAGE, CHAMBER = "part.vtp", "coverage.vtp", "chamber.vtp"
# Names of cell data in coverage.vtp, and names of the same columns in part.vtp.
OF_ELEMENT = {
    "element": "element",
    "target": "target",
    "element_coverage": "coverage",
    "element_interval": "coverage_interval",
    "element_impacts": "impacts",
}
ZONE = "zone"  # a column of both files, in results with zones
FIXTURES = {"holder": 1, "mask": 2}  # numbers of the cell data "fixture" in chamber.vtp
FIXTURE_BODY = "{}_points", "{}_triangles"  # field data of chamber.vtp: their closed surfaces
JOINTS = "joints"  # field data of a cavity to draw
MM = 1e3
# VTK's writer of .vtkhdf gives each column of numbers room for 25,000 at least, of 8 bytes. The
# mesh takes as much as 11 columns.
COLUMN, OF_MESH = 200_000, 11

Surface = Any
"""A pyvista.PolyData. It is Any, because pyvista's annotations do not fit numpy's."""


def pyvista() -> ModuleType:
    """Import pyvista and return the module.

    It is imported only when it is used, because this takes half a second.
    """
    import pyvista

    return pyvista


def part_surface(part: Part, values: dict[str, np.ndarray]) -> Surface:
    """Return the part's surface where it stands in the chamber [mm].

    `values` has values for each triangle, by name.
    """
    return _surface(part.vertices, part.triangles, values)


def field_surface(display: DisplayField, values: dict[str, np.ndarray]) -> Surface:
    """Return the mesh that is drawn of a part [mm], with coverage and other values at its vertices.

    Each of its triangles has the number of the part's triangle in which it lies (`triangle`) and
    some values of that triangle: the columns OF_ELEMENT and, if the part has zones, ZONE.

    Args:
        values: values for each triangle of the part, by name.
    """
    mesh = display.mesh
    columns = OF_ELEMENT | ({ZONE: ZONE} if ZONE in values else {})
    own = {name: values[column][mesh.part_triangle] for name, column in columns.items()}
    surface = _surface(mesh.vertices, mesh.triangles, {"triangle": mesh.part_triangle, **own})
    surface.point_data.update(display.fields)
    surface.point_data.active_normals = mesh.normal
    return surface


def cavity_surface(chamber: Chamber, face: Face | None = None) -> Surface:
    """Return the closed cavity [mm] with these values for each triangle.

    tag: surface to which it belongs: 0 part, 1 sonotrode, 2 wall, 3 and more further sonotrodes.
    source: number of the same triangle in the part, -1 off the part.
    fitting: number of its hole, deflector, holder or mask (fitting), -1 for none. Only
        chambers with fittings have this value.
    fixture: 1 on the holder, 2 on the mask, 0 elsewhere. Only chambers with either have this value.

    The closed surfaces of holder and mask, which also lie on walls and part, are its field data, as
    points [mm] and triangles. So are the ends of the joints between the blocks of a face [mm].
    """
    fields = {"tag": chamber.tags, "source": chamber.source}
    if chamber.fitting is not None:
        fields["fitting"] = chamber.fitting
    if chamber.fixtures:
        marks = sum(number * chamber.on_fixture(name) for name, number in FIXTURES.items())
        fields["fixture"] = np.asarray(marks, dtype=np.uint8)
    surface = _surface(chamber.vertices, chamber.triangles, fields)
    for name, one in chamber.fixtures.items():
        points, triangles = (key.format(name) for key in FIXTURE_BODY)
        surface.field_data[points] = one.vertices * MM
        surface.field_data[triangles] = one.triangles
    if face is not None and face.count > 1:
        floor = chamber.triangles[chamber.tags == TAG_SONOTRODE]
        ends = face.joints_on(chamber.vertices, floor).reshape(-1, 3)
        surface.field_data[JOINTS] = ends * MM
    return surface


def fixture_body(cavity: Surface, name: str) -> Surface:
    """Return the closed surface [mm] of a cavity's holder or mask."""
    points, triangles = (np.asarray(cavity.field_data[key.format(name)]) for key in FIXTURE_BODY)
    return pyvista().PolyData.from_regular_faces(points, triangles)


def fixture_marks(cavity: Surface) -> dict[str, np.ndarray]:
    """Return marks (k,) of the triangles of a cavity on its holder and its mask, if there are."""
    if "fixture" not in cavity.cell_data:
        return {}
    numbers = np.asarray(cavity["fixture"])
    marks = {name: numbers == number for name, number in FIXTURES.items()}
    return {name: own for name, own in marks.items() if own.any()}


def write_coverage(folder: Path, part: Surface, field: Surface) -> None:
    """Write the part as part.vtp, and `field`, the finer mesh with coverage, as coverage.vtp."""
    save_surface(folder / PART, part)
    save_surface(folder / COVERAGE, field)


def write_chamber(folder: Path, chamber: Chamber) -> None:
    """Write the closed cavity [mm] as chamber.stl for CAD and as chamber.vtp."""
    save_surface(folder / CHAMBER, cavity_surface(chamber))
    write_stl(folder / "chamber.stl", chamber.vertices * MM, chamber.triangles)


def _surface(vertices: np.ndarray, triangles: np.ndarray, cells: dict[str, np.ndarray]) -> Surface:
    surface = pyvista().PolyData.from_regular_faces(vertices * MM, triangles)
    surface.cell_data.update(cells)
    return surface


def save_surface(path: Path, surface: Surface) -> None:
    """Write a surface as .vtp or .vtkhdf, whole or not at all.

    On a full disk VTK's writer of .vtp ends the process, and its writer of .vtkhdf leaves a
    damaged file. A .vtp file is therefore written into memory first. For a .vtkhdf file, room on
    the disk is reserved first.
    """
    if path.suffix.lower() == ".vtp":
        writer = pyvista()._vtk.vtkXMLPolyDataWriter()
        writer.SetInputData(surface)
        writer.SetDataModeToBinary()
        writer.WriteToOutputStringOn()
        writer.Write()
        write_bytes(path, writer.GetOutputString().encode())
        return
    values = [*surface.point_data.values(), *surface.cell_data.values()]
    columns = OF_MESH + sum(one.size // max(1, len(one)) for one in values)
    with new_file(path) as file:
        file.write(bytes(1024 * surface.actual_memory_size + columns * COLUMN))
        file.flush()
        surface.save(file.name)


def write_stl(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Write a mesh of triangles as a binary STL file."""
    from trimesh import Trimesh

    content: Any = Trimesh(vertices, triangles, process=False).export(file_type="stl")
    write_bytes(path, content)


def size_text(surface: Surface) -> str:
    """Return the length, width and height of a surface [mm] as text."""
    x, y, z = np.ptp(np.reshape(surface.bounds, (3, 2)), axis=1)
    return f"{x:.4g} × {y:.4g} × {z:.4g} mm"
