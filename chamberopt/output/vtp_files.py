"""Write and read the surfaces of a results folder, which also open in ParaView.

part.vtp is the part in its own triangles with their values, coverage.vtp the same surface in
triangles that suit the field, with its values at their corners, chamber.vtp the closed cavity.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import atomic_write, write_bytes

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
# Columns without which files cannot be used: cell data of part.vtp, point data of coverage.vtp.
ELEMENT_COLUMNS = ("coverage", "impacts", "dents", "exposed_area_mm2", "target", "element")
FIELD_COLUMNS = ("coverage", "dent_density", "coverage_interval", "reachable", "resolved")
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
            that its element, target, element_coverage, element_interval and element_impacts.
    """
    part, mesh = chamber.part, display.mesh
    _write_surface(folder / PART, part.vertices, part.triangles, values)
    own = {name: values[column][mesh.part_triangle] for name, column in OF_ELEMENT.items()}
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
    with atomic_write(path) as temporary:
        size = 1024 * (surface.actual_memory_size + 1024)
        temporary.write_bytes(bytes(size))
        surface.save(temporary)


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
    with _vtk_messages_off():
        surface = pyvista().read(path)
    # VTK reads a damaged file as an empty mesh.
    if not isinstance(surface, pyvista().PolyData) or surface.n_cells == 0:
        raise InputError(f"{path}: damaged, no triangles could be read; simulate again")
    for names, there in ((cells, surface.cell_data), (points, surface.point_data)):
        if missing := [name for name in names if name not in there]:
            raise InputError(
                f"{path}: has no {missing[0]}, so it is not the file that was written here; "
                "simulate again"
            )
    return surface


@contextmanager
def _vtk_messages_off() -> Iterator[None]:
    """Suppress VTK's messages on a damaged file: warnings, its own log and Python's log."""
    disabled = logging.root.manager.disable
    with warnings.catch_warnings(), pyvista().vtk_verbosity("off"):
        warnings.simplefilter("ignore")
        logging.disable(logging.ERROR)
        try:
            yield
        finally:
            logging.disable(disabled)
