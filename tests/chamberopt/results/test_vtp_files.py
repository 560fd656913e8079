"""Surfaces read back to the last bit, and damaged files are refused in one sentence."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.common.errors import InputError
from chamberopt.results.vtp_files import read_surface
from chamberopt.viewer.opened_result import ResultInfo


def test_part_file_holds_the_values_of_the_triangles(case: tuple) -> None:
    folder, chamber, evaluation, found = case
    surface = read_surface(folder / "part.vtp")
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
    surface, mesh = read_surface(folder / "coverage.vtp"), found.display.mesh
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
    np.testing.assert_array_equal(read_surface(folder / "chamber.vtp")["tag"], chamber.tags)


def test_a_damaged_or_missing_file_is_said(tmp_path: Path, case: tuple) -> None:
    with pytest.raises(InputError, match="not there"):
        read_surface(tmp_path / "coverage.vtp")
    whole = (case[0] / "coverage.vtp").read_bytes()
    (tmp_path / "coverage.vtp").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="damaged"):
        read_surface(tmp_path / "coverage.vtp")


def test_importing_chamberopt_does_not_import_pyvista() -> None:
    modules = "chamberopt.results.load, chamberopt.workflows.comparison_folder"
    code = f"import sys, {modules}; assert 'pyvista' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, env=dict(os.environ))


def test_a_damaged_surface_is_one_sentence(
    ball: ResultInfo, capfd: pytest.CaptureFixture[str]
) -> None:
    file = Path(ball.folder) / "coverage.vtp"
    whole = file.read_bytes()
    for damaged in (whole[: len(whole) // 2], b"nothing of the kind" * 50):
        file.write_bytes(damaged)
        with pytest.raises(InputError, match="damaged"):
            read_surface(file)
    assert capfd.readouterr() == ("", "")
