"""Surfaces in files for other programs have a result's numbers to the last bit."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.results.vtp_files import pyvista, save_surface


def test_part_file_holds_the_values_of_the_triangles(case: tuple) -> None:
    folder, chamber, evaluation, found = case
    surface = pyvista().read(folder / "part.vtp")
    np.testing.assert_array_equal(surface.points, chamber.part.vertices * 1e3)
    np.testing.assert_array_equal(surface.regular_faces, chamber.part.triangles)
    for name, values in found.element_values.items():
        np.testing.assert_array_equal(surface[name], values)
    impacts = sum(np.bincount(one.triangle, minlength=surface.n_cells) for one in evaluation.hits)
    np.testing.assert_array_equal(surface["impacts"], impacts)
    hidden = chamber.exposed_area == 0
    assert hidden.any()
    assert np.isnan(surface["impacts_per_mm2"][hidden]).all()


def test_coverage_file_holds_the_field_and_the_triangles_own_values(case: tuple) -> None:
    folder, chamber, _, found = case
    surface, mesh = pyvista().read(folder / "coverage.vtp"), found.display.mesh
    np.testing.assert_array_equal(surface.points, mesh.vertices * 1e3)
    np.testing.assert_array_equal(surface.regular_faces, mesh.triangles)
    np.testing.assert_allclose(surface.point_data.active_normals, mesh.normal, atol=1e-6)
    for name, values in found.display.fields.items():
        np.testing.assert_array_equal(surface.point_data[name], values.astype(np.float32))
    own = surface["triangle"]
    for name, column in (
        ("element", chamber.part.elements),
        ("target", chamber.part.target),
        ("element_coverage", found.element_values["coverage"]),
        ("element_interval", found.element_values["coverage_interval"]),
        ("element_impacts", found.element_values["impacts"]),
    ):
        np.testing.assert_array_equal(surface[name], column[own])


def test_chamber_files_are_closed_and_tagged(case: tuple) -> None:
    folder, chamber, *_ = case
    solid = trimesh.load(folder / "chamber.stl")
    assert solid.is_watertight
    assert solid.volume * 1e-9 == pytest.approx(
        chamber.volume, rel=1e-5
    )  # STL has single precision
    np.testing.assert_array_equal(pyvista().read(folder / "chamber.vtp")["tag"], chamber.tags)


def test_importing_chamberopt_does_not_import_pyvista() -> None:
    modules = "chamberopt.results.load, chamberopt.workflows.comparison_folder"
    code = f"import sys, {modules}; assert 'pyvista' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, env=dict(os.environ))


@pytest.mark.parametrize(("finer", "values", "width"), [(1, 0, 1), (1, 3, 1), (5, 1, 20)])
def test_room_for_a_file_is_there_before_vtk_writes_it(
    finer: int, values: int, width: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ball, rng = pyvista().wrap(trimesh.creation.icosphere(finer)), np.random.default_rng(0)
    for number in range(values):
        ball.cell_data[f"value {number}"] = rng.random((ball.n_cells, width)).squeeze()
    reserved: list[int] = []
    save = type(ball).save

    def saved(surface: object, name: str) -> None:
        reserved.append(Path(name).stat().st_size)
        save(surface, name)

    monkeypatch.setattr(type(ball), "save", saved)
    for suffix in ("vtkhdf", "vtp"):
        save_surface(tmp_path / f"ball.{suffix}", ball)
        read = pyvista().read(tmp_path / f"ball.{suffix}")
        for name in ball.cell_data:
            np.testing.assert_array_equal(read.cell_data[name], ball.cell_data[name])
    (room,) = reserved
    assert 1.0 <= room / (tmp_path / "ball.vtkhdf").stat().st_size < 2.0
