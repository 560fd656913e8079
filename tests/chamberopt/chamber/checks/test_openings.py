"""Openings through which the part goes out: bodies whose openings are known."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from shapely import Polygon

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.openings import find_openings
from chamberopt.design.design import Design, validate
from chamberopt.design.load import load_design

DESIGNS = Path(__file__).resolve().parents[4] / "designs"


def chamber_of(folder: Path, body: trimesh.Trimesh, **part: object) -> Chamber:
    """A body in mm, 15 mm over the floor of a box of 60 x 50 x 40 mm; its underside is peened."""
    body.export(folder / "body.stl")
    data = load_design(DESIGNS / "gear.toml").model_dump()
    down = {"direction": (0, 0, -1), "angle_deg": (0, 30)}
    given = {"mesh": str(folder / "body.stl"), "unit": "mm", "target": down, "smoothing": "off"}
    sizes = {"length_mm": 60.0, "width_mm": 50.0, "height_mm": 40.0, "sonotrode_distance_mm": 15.0}
    chamber = {"shape": "box", **sizes}
    return build_chamber(validate(Design, {**data, "part": {**given, **part}, "chamber": chamber}))


def test_a_bar_through_both_side_walls_and_a_post_through_the_ceiling(tmp_path: Path) -> None:
    bar = trimesh.creation.box((100, 12, 8))
    post = trimesh.creation.box((6, 4, 50))
    post.apply_translation((0, 0, 21))  # from the bar's underside at z = -4 to z = 46
    body = trimesh.boolean.union([bar, post], engine="manifold")
    up, *aside = find_openings(chamber_of(tmp_path, body))[::-1]

    assert up.wall == "the ceiling"
    assert 1e3 * np.array([*up.size, *up.place]) == pytest.approx([6, 4, 0, 0, 40], abs=1e-6)
    assert 1e3 * up.beyond == pytest.approx(15 + 50 - 40)
    assert [one.wall for one in aside] == ["the wall"] * 2
    for one in aside:
        assert 1e3 * np.array(one.size) == pytest.approx([12, 8], abs=1e-6)
        assert 1e3 * np.abs(one.place) == pytest.approx([30, 0, 19], abs=1e-6)
        assert 1e3 * one.beyond == pytest.approx(20)


def test_a_smaller_opening_in_the_wall_opposite_is_one_of_its_own(tmp_path: Path) -> None:
    """A leaf wider than the chamber is long, 40 mm wide at one wall and 36 mm at the other."""
    outline = [(-31.0, -18.0), (31.0, -20.0), (31.0, 20.0), (-31.0, 18.0)]
    leaf = trimesh.creation.extrude_polygon(Polygon(outline), 3.0)
    large, small = find_openings(chamber_of(tmp_path, leaf))
    assert 1e3 * large.place[0] == pytest.approx(30.0, abs=1e-6)
    assert 1e3 * small.place[0] == pytest.approx(-30.0, abs=1e-6)
    assert small.size[0] < large.size[0]


def test_a_plate_that_closes_the_chamber_leaves_one_opening(tmp_path: Path) -> None:
    """A plate as long as the chamber goes out through its ceiling: two straight joints."""
    plate = trimesh.creation.box((60, 12, 50))
    one, *_ = find_openings(chamber_of(tmp_path, plate))
    assert one.wall == "the ceiling"
    assert 1e3 * np.array(one.size) == pytest.approx([60, 12], abs=1e-6)
    assert 1e3 * one.beyond == pytest.approx(15 + 50 - 40)


def test_a_pipe_has_one_opening_and_a_part_in_the_air_none(tmp_path: Path) -> None:
    pipe = trimesh.creation.annulus(6.0, 8.0, 60.0, sections=64)
    plate = trimesh.creation.cylinder(8.0, 2.0, sections=64)
    plate.apply_translation((0, 0, -29))
    closed = trimesh.boolean.union([pipe, plate], engine="manifold")
    (one,) = find_openings(chamber_of(tmp_path, closed))

    assert 1e3 * np.array(one.size) == pytest.approx([16, 16], abs=0.05)
    assert 1e3 * one.beyond == pytest.approx(15 + 60 - 40)
    assert find_openings(chamber_of(tmp_path, trimesh.creation.box((20, 12, 8)))) == []


def test_a_part_over_an_edge_between_walls_has_an_opening_in_each(tmp_path: Path) -> None:
    """A bar of 30 x 20 x 8 mm round the corner at x = 30, y = 25 mm."""
    corner = chamber_of(tmp_path, trimesh.creation.box((30, 20, 8)), offset_mm=(25.0, 20.0))
    beside, end = find_openings(corner)

    assert 1e3 * np.array([*beside.size, *beside.place]) == pytest.approx([20, 8, 20, 25, 19])
    assert 1e3 * np.array([*end.size, *end.place]) == pytest.approx([15, 8, 30, 17.5, 19])
    assert (beside.way, end.way) == (pytest.approx((0, 1, 0)), pytest.approx((1, 0, 0)))
    assert 1e3 * np.array([beside.beyond, end.beyond]) == pytest.approx([5, 10])


def test_holes_of_a_part_in_the_plane_of_a_wall_are_no_openings(tmp_path: Path) -> None:
    """A plate over the corner, with a hole in its end, near the edge of the opening there."""
    hole = trimesh.creation.cylinder(1.5, 40.0, sections=24)
    hole.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0)))
    hole.apply_translation((0, -8, 4))
    plate = trimesh.boolean.difference(
        [trimesh.creation.box((30, 20, 16)), hole], engine="manifold"
    )
    for offset, want in (((25.0, 0.0), [[20, 16]]), ((25.0, 20.0), [[20, 16], [15, 16]])):
        found = find_openings(chamber_of(tmp_path, plate, offset_mm=offset))
        assert [[*1e3 * np.array(one.size)] for one in found] == [pytest.approx(x) for x in want]


def test_a_lid_wider_than_its_chamber_ends_all_walls(tmp_path: Path) -> None:
    lines = find_openings(chamber_of(tmp_path, trimesh.creation.box((80, 70, 40))))
    assert sorted(1e3 * max(one.size) for one in lines) == pytest.approx([50, 50, 60, 60])
    assert all(min(one.size) < 1e-9 for one in lines)
