"""By what an end of a part is gripped: flat faces for jaws, and the thickness of its metal."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

from chamberopt.chamber.checks.openings import find_openings, mounting, walls_end_at
from chamberopt.chamber.layout.grip import (
    ON_WALLS,
    Clamp,
    _round_end,
    _round_radius,
    flat_jaws,
    outside_clamp,
    thin_grip,
)
from chamberopt.chamber.propose.text import clauses
from tests.chamberopt.chamber.checks.test_openings import chamber_of


@pytest.mark.parametrize(("deep", "is_shallow"), [(2.5, True), (6.0, True), (9.0, False)])
def test_jaws_reach_deep_over_the_faces_that_they_close_on(deep: float, is_shallow: bool) -> None:
    bar = trimesh.creation.box((60, 15, deep))
    across = np.abs(bar.face_normals[:, 1]) > 0.9
    jaws = flat_jaws(1e-3 * bar.vertices, bar.faces, np.where(across, 1e-6 * bar.area_faces, 0.0))
    assert jaws.text.startswith("jaws on its flat faces that look to ")
    assert jaws.is_shallow == is_shallow
    assert (f"SHALLOW GRIP, {deep:g} mm" in jaws.text) == is_shallow


def test_jaws_close_on_flat_faces_back_to_back() -> None:
    """A channel: its flanges' inner faces look at each other, so that no jaws close on them."""
    channel = trimesh.creation.box((60, 40, 30))
    groove = trimesh.creation.box((70, 30, 30))
    groove.apply_translation((0.0, 0.0, 5.0))
    mesh = trimesh.boolean.difference([channel, groove])
    area = mesh.area_faces * 1e-6
    across = np.abs(mesh.face_normals[:, 1]) > 0.9
    jaws = flat_jaws(1e-3 * mesh.vertices, mesh.faces, np.where(across, area, 0.0))
    assert jaws.text.startswith("jaws on its flat faces that look to ")
    assert {"+y (1800 mm² of it)", "-y (1800 mm² of it)"} == {
        one.strip() for one in jaws.text.partition("look to ")[2].split(" and ")
    }
    inner = across & (np.abs(mesh.triangles_center[:, 1]) < 16.0)
    assert flat_jaws(1e-3 * mesh.vertices, mesh.faces, np.where(inner, area, 0.0)) == Clamp("")
    along = np.where(np.abs(mesh.face_normals[:, 0]) > 0.9, area, 0.0)
    assert flat_jaws(1e-3 * mesh.vertices, mesh.faces, along) == Clamp("")  # its ends, 60 mm apart
    ball = trimesh.creation.icosphere(3, radius=20.0)
    assert flat_jaws(1e-3 * ball.vertices, ball.faces, 1e-6 * ball.area_faces) == Clamp("")


def solid(made: Manifold) -> trimesh.Trimesh:
    mesh = made.to_mesh()
    return trimesh.Trimesh(mesh.vert_properties, mesh.tri_verts, process=False)


def blade_on_root(thick: float, long: float) -> trimesh.Trimesh:
    """A blade, 30 mm wide, that stands along z on a block of 40 x 30 x 20 mm [mm]."""
    root = Manifold.cube((40, 30, 20)).translate([-20, -15, -20])
    return solid(root + Manifold.cube((30, thick, long)).translate([-15, -0.5 * thick, 0]))


@pytest.mark.parametrize("larger", [1.0, 3.0])
@pytest.mark.parametrize(
    ("thick", "long", "axis", "is_thin"),
    [
        (2.0, 60.0, (0, 0, 1), True),
        (3.0, 60.0, (0, 0, 1), True),
        (12.0, 60.0, (0, 0, 1), False),  # of thick metal
        (2.0, 20.0, (0, 0, 1), False),  # the centre of mass is near
        (2.0, 60.0, (0, 0, -1), False),  # held by its root
    ],
)
def test_a_blade_is_not_held_by_its_tip(
    thick: float, long: float, axis: tuple[int, int, int], is_thin: bool, larger: float
) -> None:
    body = blade_on_root(thick, long)
    grip = larger * 8e-3
    found = thin_grip(1e-3 * larger * body.vertices, body.faces, np.array(axis, float), grip)
    assert (found is not None) == is_thin
    if found is not None:
        middle = body.center_mass[2]
        assert found.metal == pytest.approx(1e-3 * larger * thick, rel=0.1)
        assert found.overhang == pytest.approx(1e-3 * larger * (long - 8.0 - middle), rel=1e-3)
        assert "THIN GRIP" in clauses(found.text)[1][0].sentence


@pytest.mark.parametrize(("share", "is_held"), [(0.07, False), (0.08, True)])
def test_both_jaws_together_close_on_enough_of_what_stands_out(share: float, is_held: bool) -> None:
    """Two sides of a bar, and a face without another one behind it; 15 % takes both sides."""
    bar = trimesh.creation.box((60, 20, 20))
    across, above = np.abs(bar.face_normals[:, 1]) > 0.9, bar.face_normals[:, 2] > 0.9
    outside = np.where(across, share / 2.0, np.where(above, (1.0 - 2.0 * share) / 2.0, 0.0))
    jaws = flat_jaws(1e-3 * bar.vertices, bar.faces, 0.015 * outside)
    assert bool(jaws.text) == is_held
    assert flat_jaws(1e-3 * bar.vertices, bar.faces, 0.015 * outside, least_of_all=0.0).text


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_journal_is_round_and_splines_and_bores_are_not(axis: int) -> None:
    tube = trimesh.creation.annulus(12.0, 20.0, 15.0, sections=48)
    turned = np.roll(tube.triangles, axis - 2, axis=2)
    radius = np.linalg.norm(tube.triangles_center[:, :2], axis=1)
    level = np.abs(tube.face_normals[:, 2]) > 0.9
    area = 1e-6 * tube.area_faces
    for marked, is_round in [
        (~level & (radius > 15.0), True),
        (~level & (radius < 15.0), False),  # a bore
        (level, False),
        (~level & (radius > 15.0) & (tube.triangles_center[:, 0] > 0.0), False),  # half of it
    ]:
        outside = np.where(marked, area, 0.0)
        radius_mm = 1e3 * _round_radius(1e-3 * turned, outside, axis)
        assert radius_mm == pytest.approx(20.0 if is_round else 0.0, rel=1e-3)
    shank = ~level & (radius > 15.0)
    low = np.where(np.arange(3) == axis, 0.3, 1.0) * 1e-3  # 4.5 mm long
    assert not _round_radius(low * turned, np.where(shank, 0.3 * area, 0.0), axis)


def test_a_shank_with_a_key_and_an_end_face_is_held_by_its_diameter() -> None:
    """A shank of 20 x 30 mm along z with a key of 6 x 6 x 15 mm on it."""
    shank = trimesh.creation.cylinder(10.0, 30.0, sections=64)
    key = trimesh.creation.box((6.0, 6.0, 15.0))
    key.apply_translation((9.0, 0.0, 0.0))
    body = trimesh.boolean.union([shank, key], engine="manifold")
    outside = np.where(body.triangles_center[:, 2] > -14.0, 1e-6 * body.area_faces, 0.0)
    vertices, triangles = 1e-3 * body.vertices, np.asarray(body.faces)
    assert 1e3 * _round_end(vertices, triangles, outside, [2]) == pytest.approx(10.0, rel=1e-3)
    assert _round_end(vertices, triangles, outside, [0]) == 0.0
    square = trimesh.creation.box((20.0, 20.0, 30.0))
    sides = 1e-6 * square.area_faces
    assert _round_end(1e-3 * square.vertices, np.asarray(square.faces), sides, [2]) == 0.0


def rounded(length: float, width: float, corner: float, deep: float, sides: int) -> Manifold:
    """A plate of these sides along x and y with rounded corners [mm], from 0 up.

    Args:
        sides: of each full round.
    """
    high = [length / 2.0 - corner, width / 2.0 - corner]
    posts = [
        Manifold.cylinder(deep, corner, circular_segments=sides).translate([i * x, j * y, 0.0])
        for x, y in [high]
        for i in (-1.0, 1.0)
        for j in (-1.0, 1.0)
    ]
    return Manifold.batch_hull(posts)


@pytest.mark.parametrize(
    ("body", "axis", "radius_mm"),
    [
        (rounded(90, 70, 8, 10, 64), 0, 0.0),  # a flange: the edges of its rim lie on one circle
        (rounded(90, 70, 8, 10, 64), 1, 0.0),
        (rounded(90, 70, 8, 10, 64), 2, 0.0),
        (rounded(90, 70, 2, 10, 64), 2, 0.0),  # so do the ends of its sides, nearly
        (rounded(60, 60, 3, 20, 64), 2, 0.0),
        (rounded(60, 50, 20, 20, 64), 2, 0.0),
        (rounded(40, 40, 19.9999, 20, 64), 2, 20.0),  # a round
        (rounded(40, 40, 19.9999, 20, 16), 2, 20.0),  # of few sides
        # Flats opposite on a shank of 40 mm: two quarters of it left, and nearly all.
        (
            Manifold.cylinder(20, 20, circular_segments=96) ^ Manifold.cube((28.3, 60, 60), True),
            2,
            0.0,
        ),
        (
            Manifold.cylinder(20, 20, circular_segments=96) ^ Manifold.cube((39, 60, 60), True),
            2,
            20.0,
        ),
    ],
)
def test_what_is_as_far_from_an_axis_by_its_edges_alone_is_no_round(
    body: Manifold, axis: int, radius_mm: float
) -> None:
    mesh = solid(body)
    area, triangles = 1e-6 * mesh.area_faces, np.asarray(mesh.faces)
    found = 1e3 * _round_end(1e-3 * mesh.vertices, triangles, area, [axis])
    assert found == pytest.approx(radius_mm, rel=1e-3)


@pytest.mark.parametrize("turns", [False, True])
def test_a_lid_is_pressed_on_its_walls_and_a_shaft_is_turned_by_no_blocks(
    turns: bool, tmp_path: Path
) -> None:
    """A flange that sinks by 0.2 mm into a box 60 mm long, and a shaft through it."""
    lug = solid(rounded(70, 40, 8, 10, 64).translate([0, 0, 24.8]) + Manifold.cube([8, 8, 25]))
    lid = chamber_of(tmp_path, lug)
    ends = [one for one in find_openings(lid) if walls_end_at([one]) is not None]
    assert {mounting(lid.part, one, 2e-4) for one in ends} == {"lies on it"}
    assert outside_clamp(lid) == Clamp(ON_WALLS, way=(0.0, 0.0, 1.0))
    shaft = trimesh.creation.cylinder(5.0, 120.0, sections=64)
    shaft.apply_transform(trimesh.geometry.align_vectors((0, 0, 1), (1, 0, 0)))
    text = outside_clamp(chamber_of(tmp_path, shaft), turns).text
    assert text.endswith("round its diameter of 10 mm")
    assert ("vee blocks" in text, "chuck" in text) == (not turns, turns)
