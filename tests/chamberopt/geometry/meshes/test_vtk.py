"""VTK files: cell fields as groups."""

from pathlib import Path

import numpy as np
import pytest
import pyvista

from chamberopt.geometry.meshes.part_mesh import read_part
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
