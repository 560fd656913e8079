"""Thickness of bodies whose thickness is known."""

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection

from chamberopt.geometry.thickness import (
    bare_behind,
    border_distance,
    depth_below,
    measure_depth,
    only_plates,
    thickness_of_triangles,
)

BALL = 2e-3  # m, the length of the smoothing


def thickness(body: trimesh.Trimesh, reach: float = 10e-3) -> np.ndarray:
    """Thickness of each triangle of a body [mm]."""
    vertices, triangles = np.asarray(body.vertices), np.asarray(body.faces)
    samples = only_plates(measure_depth(vertices, triangles, BALL, reach))
    return 1e3 * thickness_of_triangles(samples, vertices, triangles, BALL)


def split(body: trimesh.Trimesh, times: int) -> trimesh.Trimesh:
    for _ in range(times):
        body = body.subdivide()
    return body


def prism(outline_mm: list[tuple[float, float]], length_mm: float) -> trimesh.Trimesh:
    """A prism along z over a polygon."""
    mesh = CrossSection([outline_mm]).extrude(length_mm).to_mesh()
    return trimesh.Trimesh(1e-3 * mesh.vert_properties[:, :3].astype(float), mesh.tri_verts)


@pytest.mark.parametrize("times", [0, 2, 4])
def test_a_plate_is_as_thick_everywhere_however_it_is_split(times: int) -> None:
    """Its faces have its thickness to their edges and corners; its narrow sides are no plates."""
    body = split(trimesh.creation.box((0.04, 0.03, 0.0015)), times)
    found, face = thickness(body), np.abs(body.face_normals[:, 2]) > 0.5
    np.testing.assert_allclose(found[face], 1.5, rtol=1e-6)
    assert np.isinf(found[~face]).all()


def test_a_block_and_a_cube_are_no_plates() -> None:
    assert np.isinf(thickness(trimesh.creation.box((0.04, 0.03, 0.02)))).all()
    cube = split(trimesh.creation.box((0.004, 0.004, 0.004)), 2)  # thin, but as wide as thick
    assert np.isinf(thickness(cube)).all()


def test_a_wedge_has_the_thickness_of_each_place() -> None:
    """From 1 to 3 mm thick on 40 mm: rays along the normals measure it to 0.1 %."""
    flat = [(0.0, 0.0), (40.0, 0.0), (40.0, 3.0), (0.0, 1.0)]
    body = split(prism(flat, 30.0), 5)
    found, middle = thickness(body), 1e3 * body.triangles_center
    face = (np.abs(body.face_normals[:, 1]) > 0.5) & (np.abs(middle[:, 0] - 20.0) < 18.0)
    expected = 1.0 + middle[:, 0] / 20.0
    np.testing.assert_allclose(found[face], expected[face], rtol=0.06)
    assert abs(np.mean(found[face] / expected[face]) - 1.0) < 0.01


def test_splitting_a_wedge_keeps_its_mean_mobility() -> None:
    """The mean of h⁻² is 1 / (h_1 h_2) over a wedge, whichever its triangles are."""
    flat = [(0.0, 0.0), (40.0, 0.0), (40.0, 3.0), (0.0, 1.0)]
    for times in (0, 3, 5):
        body = split(prism(flat, 30.0), times)
        found, face = thickness(body), np.abs(body.face_normals[:, 1]) > 0.5
        mean = np.average(found[face] ** -2.0, weights=body.area_faces[face])
        assert mean == pytest.approx(1.0 / 3.0, rel=0.02)


def test_a_tube_is_a_plate_and_a_bar_is_none() -> None:
    tube = trimesh.creation.annulus(0.009, 0.01, 0.03, sections=128)
    round_side = np.abs(tube.face_normals[:, 2]) < 0.5
    np.testing.assert_allclose(thickness(tube)[round_side], 1.0, rtol=0.02)
    bar = trimesh.creation.cylinder(0.002, 0.03, sections=64)
    assert np.isinf(thickness(bar)).all()


def on_a_block(height_mm: float, wide_mm: float) -> tuple[trimesh.Trimesh, np.ndarray]:
    """A fin on a block of 30 x 30 x 15 mm, and which triangles are the flanks of the fin."""
    half = 0.5 * wide_mm
    outline = [
        (-15.0, -15.0), (15.0, -15.0), (15.0, 0.0), (half, 0.0), (half, height_mm),
        (-half, height_mm), (-half, 0.0), (-15.0, 0.0),
    ]  # fmt: skip
    body = split(prism(outline, 30.0), 3)
    flank = (np.abs(body.face_normals[:, 0]) > 0.5) & (body.triangles_center[:, 1] > 0.0)
    return body, flank


def test_a_fin_is_a_plate_but_a_tooth_is_none() -> None:
    """A tooth of 3 mm that is 4 mm high holds no disc of two thicknesses about its middle."""
    fin, flank = on_a_block(20.0, 1.0)
    found = thickness(fin)
    np.testing.assert_allclose(found[flank], 1.0, rtol=1e-6)
    assert np.isinf(found[~flank]).all()
    tooth, _ = on_a_block(4.0, 3.0)
    assert np.isinf(thickness(tooth)).all()


def test_borders_are_as_far_as_the_edges() -> None:
    body = split(trimesh.creation.box((0.04, 0.03, 0.0015)), 2)
    samples = only_plates(measure_depth(body.vertices, body.faces, BALL, 10e-3))
    radius = np.where(np.isfinite(samples.thickness), 5e-3, np.inf)
    found = border_distance(samples, radius)
    edge = np.min([0.02, 0.015] - np.abs(samples.place[:, :2]), axis=1)
    plate = np.isfinite(samples.thickness)
    assert np.isinf(found[plate & (edge > 5e-3)]).all()
    near = plate & (edge < 4e-3)
    # borders are known at sample points, half a ball apart and now and then more
    assert (np.abs(found[near] - edge[near]) < 1.5e-3).mean() > 0.97


@pytest.mark.parametrize("share", [0.1, 0.9])
def test_the_depth_below_a_share_of_a_step(share: float) -> None:
    """A step of 2 and 6 mm, half of whose top is thin: its thinner tenth has 2 mm, its rest 6."""
    mm = [(0.0, 0.0), (60.0, 0.0), (60.0, 6.0), (30.0, 6.0), (30.0, 2.0), (0.0, 2.0)]
    step = split(prism(mm, 40.0), 2)
    vertices, triangles = np.asarray(step.vertices), np.asarray(step.faces)
    top = step.face_normals[:, 1] > 0.9
    found = 1e3 * depth_below(vertices, triangles, top, share, 10e-3)
    assert found == pytest.approx(2.0 if share < 0.5 else 6.0, rel=0.02)
    assert depth_below(vertices, triangles, top, 0.9, 5e-3) == np.inf


@pytest.mark.parametrize(("thick_mm", "share"), [(1.5, 1.0), (8.0, 0.0)])
def test_a_sheet_of_which_one_side_is_chosen_is_bare_behind(thick_mm: float, share: float) -> None:
    sheet = trimesh.creation.box((0.06, 0.06, 1e-3 * thick_mm))
    up = sheet.face_normals[:, 2]
    for chosen, wanted in ((up > 0.5, share), (np.abs(up) > 0.5, 0.0), (np.abs(up) < 0.5, 0.0)):
        found = bare_behind(sheet.vertices, sheet.faces, chosen, chosen, 2.3e-3)
        assert found == pytest.approx(wanted, abs=0.05)
        everywhere = np.ones(len(sheet.faces), dtype=bool)  # peened beside what is chosen
        assert bare_behind(sheet.vertices, sheet.faces, chosen, everywhere, 2.3e-3) == 0.0
