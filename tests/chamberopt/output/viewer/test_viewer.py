"""Surfaces read back to the last bit, pictures that show something, and no crash where none can be drawn."""

import json
import os
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import trimesh
from matplotlib.image import imread

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.coverage.coverage_from_impacts import coverage_at
from chamberopt.output.disc_averages import average_over_discs
from chamberopt.output.viewer import (
    ResultInfo,
    ViewState,
    draw_coverage,
    draw_part,
    inspect,
    missing_opengl,
    subprocess_drawing,
    window,
)
from chamberopt.output.vtp_files import read_surface, write_chamber, write_coverage
from chamberopt.simulation.triangle_fields import compute_triangle_fields
from tests.helpers.synthetic import plate_design, poisson_evaluation

DESIGN = plate_design()
needs_opengl = pytest.mark.skipif(missing_opengl() is not None, reason="no OpenGL library")


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple:
    folder = tmp_path_factory.mktemp("viewer") / "a plate, simulated"
    folder.mkdir()
    chamber = build_chamber(DESIGN)
    evaluation = poisson_evaluation(DESIGN, chamber)
    write_coverage(
        folder / "coverage.vtp",
        chamber,
        compute_triangle_fields(DESIGN, chamber, evaluation),
        "avrami",
    )
    write_chamber(folder, chamber)
    return folder, chamber, evaluation


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


@needs_opengl
def test_picture_shows_part_sonotrode_and_scale(case: tuple, tmp_path: Path) -> None:
    picture = tmp_path / "coverage.png"
    assert draw_coverage([case[0]], ["plate"], picture) is None
    image = imread(picture)[..., :3]
    assert image.shape == (900, 1800, 3)
    assert 0.2 < (image > 0.99).all(axis=2).mean() < 0.9  # background, and not only background
    orange = np.array([0xE0, 0x8A, 0x2E]) / 255
    assert (np.abs(image[:, :900] - orange).max(axis=2) < 0.08).mean() > 0.01  # the sonotrode
    assert (
        len(np.unique((image * 32).astype(int).reshape(-1, 3), axis=0)) > 60
    )  # a scale of colours
    assert [path.name for path in tmp_path.iterdir()] == ["coverage.png"]


@needs_opengl
def test_side_by_side(case: tuple, tmp_path: Path) -> None:
    assert draw_coverage([case[0]] * 2, ["one", "two"], tmp_path / "both.png") is None
    image = imread(tmp_path / "both.png")
    assert image.shape[:2] == (1500, 1800)
    lower = image[800:, :, :3]
    difference = np.abs(lower[:, :700] - lower[:, 900:1600]).mean()
    assert (
        difference < 0.1
    )  # the same part on the same scale (the colour bar moves the second aside)


def test_screenshot_without_a_display(
    case: tuple, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list = []
    monkeypatch.setattr(window, "draw_in_subprocess", lambda *arguments: drawn.append(arguments))
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    subject, look = (
        ResultInfo(str(case[0]), "a plate", 5.0, 25.0, 336, 5.0),
        ViewState("speed", below=90.0),
    )
    inspect([subject], look, tmp_path / "shot.png")
    ((job, picture),) = drawn
    assert (job["draw"], job["results"], picture) == (
        "inspect",
        [asdict(subject)],
        tmp_path / "shot.png",
    )
    assert ViewState.from_json(json.loads(json.dumps(job["state"]))) == look
    if sys.platform.startswith("linux"):
        with pytest.raises(InputError, match=r"no display.*--screenshot"):
            inspect([subject], look)
    with pytest.raises(InputError, match=r"\.png"):
        inspect([subject], look, tmp_path / "shot.bmp")
    with pytest.raises(InputError, match="does not exist"):
        inspect([subject], look, tmp_path / "nowhere" / "shot.png")
    monkeypatch.setattr(window, "draw_in_subprocess", lambda *_: "shot.png skipped: install this")
    with pytest.raises(InputError, match="install this"):
        inspect([subject], look, tmp_path / "shot.png")


def test_without_an_opengl_library_one_line_says_what_to_install(
    case: tuple, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(subprocess_drawing.sys, "platform", "linux")
    monkeypatch.setattr(subprocess_drawing, "offscreen_window", lambda: None)
    remark = draw_coverage([case[0]], ["plate"], tmp_path / "coverage.png")
    assert remark is not None
    assert "coverage.png skipped" in remark
    assert "libegl1" in remark
    assert "\n" not in remark


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="EGL vendors are a Linux matter")
@needs_opengl
def test_an_opengl_library_without_a_driver_costs_the_picture_only(
    case: tuple, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # VTK does not raise here, it dies of a segmentation fault: seen with libEGL but no vendor.
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_DIRS", "/nonexistent")
    remark = draw_coverage([case[0]], ["plate"], tmp_path / "coverage.png")
    assert remark is not None
    assert "libegl1" in remark
    assert "\n" not in remark
    assert not list(tmp_path.iterdir())


def test_averaging_keeps_the_mean_and_does_not_cross_edges() -> None:
    # Two faces back to back, densities 1 and 3 with noise: each is smoothed to itself.
    rng = np.random.default_rng(0)
    grid = np.stack(np.meshgrid(np.arange(30.0), np.arange(30.0)), axis=-1).reshape(-1, 2)
    centre = np.vstack([np.column_stack([grid, np.zeros(900)])] * 2)
    normal = np.repeat([[0, 0, 1.0], [0, 0, -1.0]], 900, axis=0)
    truth = np.repeat([1.0, 3.0], 900)
    dents = rng.poisson(truth)
    shown, reach = average_over_discs(centre, normal, dents.astype(float), np.ones(1800), dents)
    assert 1.0 < reach < 3.0
    for side in (slice(0, 900), slice(900, 1800)):
        assert shown[side].std() < 0.5 * dents[side].std()
        assert shown[side].mean() == pytest.approx(truth[side].mean(), rel=0.1)
    plenty = np.full(1800, 100)
    np.testing.assert_array_equal(
        average_over_discs(centre, normal, truth, np.ones(1800), plenty)[0], truth
    )


def test_importing_chamberopt_does_not_import_pyvista() -> None:
    modules = "chamberopt.output.results.load, chamberopt.output.compare.comparison_folder"
    code = f"import sys, {modules}; assert 'pyvista' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, env=dict(os.environ))


@needs_opengl
def test_a_part_is_drawn_with_its_target_or_with_its_fault_in_red(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.01)
    corners, upper = ball.triangles, ball.triangles_center[:, 2] > 0.0
    edges = corners[:80, [0, 1, 1, 2]].reshape(-1, 2, 3)

    assert draw_part(corners, "a ball", tmp_path / "target.png", marked=upper) is None
    assert draw_part(corners, "a hole", tmp_path / "fault.png", edges=edges) is None

    target, fault = (imread(tmp_path / f"{name}.png")[..., :3] for name in ("target", "fault"))
    red = [
        (picture[..., 0] - picture[..., 1:].max(axis=2) > 0.5).mean() for picture in (target, fault)
    ]
    orange = [(picture[..., 1] - picture[..., 2] > 0.1).mean() for picture in (target, fault)]
    assert red[1] > 5e-4 > 10 * red[0]
    assert orange[0] > 0.05 > 10 * orange[1]


def test_a_part_is_drawn_only_where_there_can_be_such_a_file(tmp_path: Path) -> None:
    for name, said in (("part.jpg", r"\.png"), ("nowhere/part.png", "does not exist")):
        with pytest.raises(InputError, match=said):
            draw_part(np.zeros((1, 3, 3)), "a part", tmp_path / name)
