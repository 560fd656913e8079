"""Surfaces read back to the last bit, and damaged files are refused in one sentence."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.common.errors import InputError
from chamberopt.coverage.coverage_from_impacts import coverage_at
from chamberopt.output.viewer import ResultInfo
from chamberopt.output.vtp_files import read_surface
from tests.helpers.synthetic import plate_design

DESIGN = plate_design()


def test_coverage_file_holds_what_was_computed(case: tuple) -> None:
    folder, chamber, evaluation = case
    surface = read_surface(folder / "coverage.vtp")
    assert surface.n_cells == len(chamber.part.triangles)
    np.testing.assert_array_equal(surface.points, chamber.part.vertices * 1e3)
    np.testing.assert_array_equal(surface.regular_faces, chamber.part.triangles)
    expected = coverage_at(evaluation.total, chamber, DESIGN.process.treatment_time)
    np.testing.assert_array_equal(surface["coverage"], expected)
    np.testing.assert_allclose(-np.expm1(-surface["dent_density"]), expected, rtol=1e-9)
    np.testing.assert_array_equal(surface["target"], chamber.part.target)
    hit = evaluation.total.impacts > 0
    np.testing.assert_allclose(surface["mean_normal_speed"][hit], 3.0)
    np.testing.assert_allclose(surface["mean_angle_deg"][hit], 70.0)
    hidden = chamber.exposed_area == 0
    assert hidden.any()
    assert np.isnan(surface["impacts_per_mm2"][hidden]).all()
    # 20 dents per mm² in the simulated time, scaled to the treatment time.
    scale = DESIGN.process.treatment_time / evaluation.total.simulated_time
    area = surface["exposed_area_mm2"]
    mean = np.nansum(surface["impacts_per_mm2"] * area) / area.sum()
    assert mean == pytest.approx(20.0 * scale, rel=0.05)


def test_chamber_files_are_closed_and_tagged(case: tuple) -> None:
    folder, chamber, _ = case
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
    modules = "chamberopt.output.results.load, chamberopt.output.compare.comparison_folder"
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
