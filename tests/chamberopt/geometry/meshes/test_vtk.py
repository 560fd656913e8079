"""VTK files: cell fields as groups."""

import re
from pathlib import Path

import numpy as np
import pytest
import pyvista
from vtkmodules import vtkCommonDataModel

from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.geometry.meshes.vtk import KINDS, POLYGON, QUAD, TRIANGLE, WITHOUT_SURFACE
from tests.helpers.mesh_files import CORNERS, QUADS, TOP_AREA, assert_box, named_area


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("suffix", ["vtp", "vtu", "vtk"])
@pytest.mark.parametrize("grid", [True, False])
def test_vtk_files_with_cell_fields_for_names(
    tmp_path: Path, suffix: str, binary: bool, grid: bool
) -> None:

    if (suffix, grid) in (("vtp", True), ("vtu", False)):
        pytest.skip("no such file")
    surface = pyvista.PolyData(CORNERS, np.insert(np.array(QUADS), 0, 4, axis=1).ravel())
    surface.cell_data["zone"] = np.array([7] + [8] * 5)
    surface.cell_data["thickness"] = np.full(6, 0.5)
    path = tmp_path / f"box.{suffix}"
    (surface.cast_to_unstructured_grid() if grid else surface).save(path, binary=binary)

    part = read_part(path, "mm")

    assert_box(part)
    assert named_area(part, "zone 7") == pytest.approx(TOP_AREA)
    assert set(part.groups) == {"zone 7", "zone 8"}


def test_numbers_of_cells_are_those_of_vtk() -> None:
    kinds = "triangle|quad|tetra|pyramid|wedge|hexahedron"
    of_surface = re.compile(rf"VTK_(?:(?:BI|TRI)?QUADRATIC_)*({kinds})", re.I)
    numbers = {
        getattr(vtkCommonDataModel, name): found[1].lower()
        for name in dir(vtkCommonDataModel)
        if (found := of_surface.fullmatch(name))
    }
    assert numbers == KINDS
    lines = [
        "EMPTY_CELL",
        "VERTEX",
        "POLY_VERTEX",
        "LINE",
        "POLY_LINE",
        "QUADRATIC_EDGE",
        "CUBIC_LINE",
    ]
    assert tuple(getattr(vtkCommonDataModel, f"VTK_{name}") for name in lines) == WITHOUT_SURFACE
    names = "TRIANGLE", "POLYGON", "QUAD"
    assert tuple(getattr(vtkCommonDataModel, f"VTK_{name}") for name in names) == (
        TRIANGLE,
        POLYGON,
        QUAD,
    )
