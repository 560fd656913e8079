"""Write and read the surfaces of a results folder, which also open in ParaView.

part.vtp is the part in its own triangles with their values, coverage.vtp the same surface in
triangles that suit the field, with its values at their corners, chamber.vtp the closed cavity.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import new_file, write_bytes
from chamberopt.output.vtp_reader import DamagedSurfaceError, read_arrays

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.coverage.field.display_mesh import DisplayField

PART, COVERAGE, CHAMBER = "part.vtp", "coverage.vtp", "chamber.vtp"
# Cell data of coverage.vtp, and their columns in part.vtp.
OF_ELEMENT = {
    "element": "element",
    "target": "target",
    "element_coverage": "coverage",
    "element_interval": "coverage_interval",
    "element_impacts": "impacts",
}
ZONE = "zone"  # one more column of both, in results with zones
# Columns without which files cannot be used: cell data of part.vtp, point data of coverage.vtp.
ELEMENT_COLUMNS = ("coverage", "impacts", "dents", "exposed_area_mm2", "target", "element")
FIELD_COLUMNS = ("coverage", "dent_density", "coverage_interval", "reachable", "resolved")
WHOLE_NUMBERS = ("impacts", "dents", "target", "element", "triangle", "element_impacts", "tag",
                 "source", "fitting", ZONE)  # fmt: skip
# Columns that are shares, from 0 to 1, and others that are never negative.
SHARES = ("coverage", "coverage_interval", "reachable", "resolved", "element_coverage",
          "element_interval")  # fmt: skip
NOT_NEGATIVE = ("impacts", "dents", "target", "triangle", "element_impacts", "tag", "dent_density",
                "exposed_area_mm2", "reachable_area_mm2", "impacts_per_mm2", "energy_per_mm2",
                "mean_normal_speed", "p90_normal_speed", "mean_angle_deg",
                "mean_dent_um")  # fmt: skip
ROUNDING = 1e-6  # of single precision
MM = 1e3

Surface = Any
"""A pyvista.PolyData; pyvista's own annotations do not fit numpy's."""


def pyvista() -> Any:
    """Import pyvista only where it is used, because that takes half a second."""
    import pyvista

    return pyvista


def write_coverage(
    folder: Path, chamber: Chamber, values: dict[str, np.ndarray], display: DisplayField
) -> None:
    """Write the part, posed in the chamber [mm], as part.vtp and as coverage.vtp.

    Args:
        values: of each triangle of the part, by name, (m,) each: the cell data of part.vtp.
        display: fields at the vertices of a mesh to draw: the point data of coverage.vtp. Its
            triangles have the number of the part's triangle in which they lie (triangle), and of
            that its element, target, element_coverage, element_interval, element_impacts and,
            where there are zones, zone.
    """
    part, mesh = chamber.part, display.mesh
    _write_surface(folder / PART, part.vertices, part.triangles, values)
    columns = OF_ELEMENT | ({ZONE: ZONE} if ZONE in values else {})
    own = {name: values[column][mesh.part_triangle] for name, column in columns.items()}
    _write_surface(
        folder / COVERAGE,
        mesh.vertices,
        mesh.triangles,
        {"triangle": mesh.part_triangle, **own},
        {name: column.astype(np.float32) for name, column in display.fields.items()},
        mesh.normal,
    )


def write_chamber(folder: Path, chamber: Chamber) -> None:
    """Write the closed cavity [mm] as chamber.stl for CAD and as chamber.vtp with cell data.

    tag: 0 part, 1 sonotrode, 2 wall, 3 and more further sonotrodes.
    source: triangle of the part, -1 elsewhere.
    fitting: number of the hole or deflector, -1 elsewhere; only in chambers that have some.
    """
    fields = {"tag": chamber.tags, "source": chamber.source}
    if chamber.fitting is not None:
        fields["fitting"] = chamber.fitting
    _write_surface(folder / CHAMBER, chamber.vertices, chamber.triangles, fields)
    write_stl(folder / "chamber.stl", chamber.vertices * MM, chamber.triangles)


def _write_surface(
    path: Path,
    vertices: np.ndarray,
    triangles: np.ndarray,
    cells: dict[str, np.ndarray],
    points: dict[str, np.ndarray] | None = None,
    normal: np.ndarray | None = None,
) -> None:
    surface = pyvista().PolyData.from_regular_faces(vertices * MM, triangles)
    surface.cell_data.update(cells)
    surface.point_data.update(points or {})
    if normal is not None:
        surface.point_data.active_normals = normal.astype(np.float32)
    save_surface(path, surface)


def save_surface(path: Path, surface: Surface) -> None:
    """Write a surface as .vtp or .vtkhdf, whole or not at all.

    Where a file has no room, VTK's writer of .vtp ends the process, and that of .vtkhdf leaves a
    damaged file. So the one writes into memory; for the other, room is reserved first.
    """
    if path.suffix.lower() == ".vtp":
        writer = pyvista()._vtk.vtkXMLPolyDataWriter()
        writer.SetInputData(surface)
        writer.SetDataModeToBinary()
        writer.WriteToOutputStringOn()
        writer.Write()
        write_bytes(path, writer.GetOutputString().encode())
        return
    with new_file(path) as file:
        file.write(bytes(1024 * (surface.actual_memory_size + 1024)))
        file.flush()
        surface.save(file.name)


def write_stl(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Write triangles as binary STL."""
    from trimesh import Trimesh

    content: Any = Trimesh(vertices, triangles, process=False).export(file_type="stl")
    write_bytes(path, content)


def read_surface(path: Path, cells: Sequence[str] = (), points: Sequence[str] = ()) -> Surface:
    """Read a .vtp of a results folder.

    Raises:
        InputError: it is missing or damaged, or lacks one of these columns.
    """
    if not path.is_file():
        raise InputError(
            f"{path}: not there; give a results folder that simulate or run has finished"
        )
    try:
        found = read_arrays(path)
        for column in (*found.cells.items(), *found.vertices.items()):
            _require_sound(*column)
    except DamagedSurfaceError as error:
        raise InputError(f"{path}: damaged ({error}); simulate again") from None
    for names, there in ((cells, found.cells), (points, found.vertices)):
        if missing := [name for name in names if name not in there]:
            raise InputError(
                f"{path}: has no {missing[0]}, so it is not the file that was written here; "
                "simulate again"
            )
    surface = pyvista().PolyData.from_regular_faces(found.points.copy(), found.triangles)
    surface.cell_data.update({name: column.copy() for name, column in found.cells.items()})
    surface.point_data.update({name: column.copy() for name, column in found.vertices.items()})
    if found.normals is not None:
        surface.point_data.active_normals = found.normals.copy()
    return surface


def size_text(surface: Surface) -> str:
    """Length, width and height of a surface."""
    x, y, z = np.ptp(np.reshape(surface.bounds, (3, 2)), axis=1)
    return f"{x:.4g} × {y:.4g} × {z:.4g} mm"


def _require_sound(name: str, column: np.ndarray) -> None:
    """Raise DamagedSurfaceError for a column that has no such values in any result."""
    if name in WHOLE_NUMBERS and column.dtype.kind not in "iu":
        raise DamagedSurfaceError(f"{name} are no whole numbers")
    known = column[~np.isnan(column)] if column.dtype.kind == "f" else column
    if not len(known):
        return
    low, high, is_share = known.min(), known.max(), name in SHARES
    if (low < 0 and (is_share or name in NOT_NEGATIVE)) or (is_share and high > 1.0 + ROUNDING):
        allowed = "0 to 1" if is_share else "0 or more"
        raise DamagedSurfaceError(f"{name} is from {low:g} to {high:g}, allowed: {allowed}")
