"""Openings through which the part goes out: bodies whose openings are known."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from shapely import Polygon

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.openings import (
    Opening,
    find_openings,
    find_walls_in_holes,
    mounting,
    part_at_wall,
    thin_ribs,
)
from chamberopt.design.design import Design, validate
from chamberopt.design.load import load_design

DESIGNS = Path(__file__).resolve().parents[4] / "designs"


def chamber_of(
    folder: Path, body: trimesh.Trimesh, plugs: dict[str, object] | None = None, **part: object
) -> Chamber:
    """The chamber of `design_of`."""
    return build_chamber(design_of(folder, body, plugs, **part))


def design_of(
    folder: Path, body: trimesh.Trimesh, plugs: dict[str, object] | None = None, **part: object
) -> Design:
    """A body in mm, 15 mm over the floor of a box of 60 x 50 x 40 mm; its underside is peened.

    Args:
        plugs: keys that choose the walls of holes that are plugged.
    """
    body.export(folder / "body.stl")
    data = load_design(DESIGNS / "gear.toml").model_dump()
    down = {"direction": (0, 0, -1), "angle_deg": (0, 30)}
    given = {"mesh": str(folder / "body.stl"), "unit": "mm", "target": down, "smoothing": "off"}
    sizes = {"length_mm": 60.0, "width_mm": 50.0, "height_mm": 40.0, "sonotrode_distance_mm": 15.0}
    chamber = {"shape": "box", **sizes}
    mask = None if plugs is None else {"plugs": True, "at": plugs}
    own = {"part": {**given, **part}, "chamber": chamber, "mask": mask}
    return validate(Design, {**data, **own})


@pytest.mark.parametrize("way", [(0, 0, 1), (1, 0, 0), (0, -1, 0), (-0.6, 0.0, 0.8)])
@pytest.mark.parametrize(
    ("inside", "outside", "mounted"),
    [
        (4.0, 10.0, "part goes in"),
        (10.0, 4.0, "wall goes over"),
        (10.0, 10.0, "split"),
        (4.0, 4.0, "part goes in"),
    ],
)
def test_a_wall_is_split_only_where_neither_end_passes_its_opening(
    inside: float, outside: float, mounted: str, way: tuple[float, float, float]
) -> None:
    """A round of 5 mm radius in the opening, with others inside and outside of it."""
    body = trimesh.boolean.union(
        [
            trimesh.creation.cylinder(radius, segment=[(0, 0, 1e-3 * a), (0, 0, 1e-3 * b)])
            for radius, a, b in (
                (0.005, -10, 10),
                (1e-3 * inside, -20, -9),
                (1e-3 * outside, 9, 20),
            )
        ],
        engine="manifold",
    )
    place = np.array([0.02, 0.01, -0.03])
    turn = trimesh.geometry.align_vectors((0, 0, 1), way)
    body.apply_transform(turn).apply_translation(place)
    part = SimpleNamespace(vertices=np.array(body.vertices), triangles=np.array(body.faces))
    opening = Opening("the wall", (0.01, 0.01), tuple(place), 0.02, way)
    assert mounting(part, opening, 1e-4) == mounted
    # A side wall that ends on the part carries it, whatever would pass.
    assert mounting(part, opening._replace(form="edge"), 1e-4) == "lies on it"
    ceiling = opening._replace(wall="the ceiling", form="edge")
    assert mounting(part, ceiling, 1e-4) == mounted


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


def test_the_form_of_an_opening_is_that_of_the_parts_section(tmp_path: Path) -> None:
    """Posts through the ceiling: round, of 24 to 96 facets; rectangular; a U; a hexagon; an ell."""
    rim = [(-10.0, -6.0), (10.0, -6.0), (10.0, 6.0), (-10.0, 6.0)]
    notch = [(-10.0, -6.0), (10.0, -6.0), (10.0, 6.0), (7.0, 6.0), (7.0, -3.0), (-7.0, -3.0)]
    angles = np.radians(np.arange(0, 360, 60))
    hexagon = 8.0 * np.c_[np.cos(angles), np.sin(angles)]
    posts = {
        "rectangle": [trimesh.creation.extrude_polygon(Polygon(rim), 50.0)],
        "round": [trimesh.creation.cylinder(8.0, 50.0, sections=k) for k in (24, 96)],
        "other": [
            trimesh.creation.extrude_polygon(Polygon([*notch, (-7.0, 6.0), (-10.0, 6.0)]), 50.0),
            trimesh.creation.extrude_polygon(Polygon(hexagon), 50.0),
            trimesh.creation.extrude_polygon(Polygon([*notch[:4], (7.0, 0.0), (-10.0, 0.0)]), 50.0),
        ],
    }
    for form, bodies in posts.items():
        for body in bodies:
            (one,) = find_openings(chamber_of(tmp_path, body))
            assert one.form == form
            assert one.outline is not None
            assert 0.5 * np.array(one.size) == pytest.approx(abs(one.outline).max(axis=(0, 1)))
            area = body.volume / 50.0
            (x1, y1), (x2, y2) = 1e3 * one.outline[:, 0].T, 1e3 * one.outline[:, 1].T
            assert 0.5 * abs(np.sum(x1 * y2 - x2 * y1)) == pytest.approx(area, rel=1e-6)


def test_a_tapered_lid_as_long_as_its_chamber_has_one_opening(tmp_path: Path) -> None:
    """Its sides run across the ceiling: neither of them is an opening by itself."""
    outline = [(-40.0, -16.0), (40.0, -12.0), (40.0, 12.0), (-40.0, 16.0)]
    lid = trimesh.creation.extrude_polygon(Polygon(outline), 30.0)
    *aside, up = sorted(find_openings(chamber_of(tmp_path, lid)), key=lambda one: one.place[2])
    assert (up.wall, up.form) == ("the ceiling", "other")
    assert 1e3 * np.array(up.size) == pytest.approx([60.0, 31.0], abs=1e-3)
    assert [one.form for one in aside] == ["rectangle", "rectangle"]


def test_a_part_that_widens_in_the_wall(tmp_path: Path) -> None:
    """A post with a head on it, which begins inside, 4 mm or 14 mm outside of the ceiling."""
    post = trimesh.creation.box(bounds=((-5, -4, 0), (5, 4, 60)))
    for start, want in ((20, None), (29, (18.0, 12.0)), (39, None)):
        head = trimesh.creation.box(bounds=((-9, -6, start), (9, 6, 60)))
        body = trimesh.boolean.union([post, head], engine="manifold")
        (one,) = find_openings(chamber_of(tmp_path, body))
        assert one.wider == (want if want is None else pytest.approx(1e-3 * np.array(want)))
    bar = trimesh.creation.box((30, 20, 8))  # over a corner: the rest is of the other wall
    over = find_openings(chamber_of(tmp_path, bar, offset_mm=(25.0, 20.0)))
    assert [one.wider for one in over] == [None, None]


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


def test_openings_that_nearly_meet_leave_a_rib_too_thin_to_stand(tmp_path: Path) -> None:
    """A bar through the wall at x = 30 mm, and on it a post through the ceiling at z = 40 mm."""
    for gap, ribs in ((0.6, [math.hypot(0.6, 0.6)]), (2.0, [])):
        bar = trimesh.creation.box((30, 12, 25 - gap))
        bar.apply_translation((25, 0, 0.5 * (25 - gap)))  # from z = 15 to 40 - gap in the chamber
        post = trimesh.creation.box((8, 12, 20))
        post.apply_translation((30 - gap - 4, 0, 25))
        body = trimesh.boolean.union([bar, post], engine="manifold")
        found = find_openings(chamber_of(tmp_path, body, offset_mm=(25.0, 0.0)))
        assert {one.wall for one in found} == {"the wall", "the ceiling"}
        assert [1e3 * rib.width for rib in thin_ribs(found)] == pytest.approx(ribs, rel=1e-3)
    corner = chamber_of(tmp_path, trimesh.creation.box((30, 20, 8)), offset_mm=(25.0, 20.0))
    assert thin_ribs(find_openings(corner)) == []  # they meet at the edge


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
    assert {one.form for one in lines} == {"edge"}


def drilled(
    body: trimesh.Trimesh, radius: float, middle: tuple[float, ...], axis: int
) -> trimesh.Trimesh:
    """A body with a hole through it along an axis, 0 to 2."""
    drill = trimesh.creation.cylinder(radius, 200.0, sections=64)
    ends = np.zeros((4, 4))
    ends[[0, 1, 2, 3], [(axis + 1) % 3, (axis + 2) % 3, axis, 3]] = 1.0
    drill.apply_transform(ends.T)
    drill.apply_translation(middle)
    left: trimesh.Trimesh = trimesh.boolean.difference([body, drill], engine="manifold")
    return left


def test_the_ceiling_stands_in_the_bore_of_a_tube(tmp_path: Path) -> None:
    """Open at the sonotrode, the wall stands in it; closed there, no ball gets into it."""
    tube = trimesh.creation.annulus(6.0, 8.0, 60.0, sections=64)
    chamber = chamber_of(tmp_path, tube)
    (hole,) = find_walls_in_holes(chamber)
    assert hole.opening.wall == "the ceiling"
    place = [*hole.opening.size, *hole.opening.place]
    assert 1e3 * np.array(place) == pytest.approx([12, 12, 0, 0, 40], abs=0.05)
    middles = 1e3 * chamber.part.vertices[chamber.part.triangles].mean(axis=1)
    inner = np.hypot(*middles.T[:2]) < 6.5
    assert inner[hole.beside].all()
    assert {*hole.beside} < {*np.flatnonzero(part_at_wall(chamber))}  # the outside meets it too

    plate = trimesh.creation.cylinder(8.0, 2.0, sections=64)
    plate.apply_translation((0, 0, -29))
    closed = trimesh.boolean.union([tube, plate], engine="manifold")
    assert find_walls_in_holes(chamber_of(tmp_path, closed)) == []


def test_the_wall_stands_in_the_holes_of_a_plate_that_it_crosses(tmp_path: Path) -> None:
    """The wall, at y = 25 mm, is 0.2 mm deep in a plate with two holes; a third one is beside."""
    plate = trimesh.creation.box(bounds=((-29, 24.8, -10), (29, 34.8, 10)))
    foot = trimesh.creation.box(bounds=((-3, 0, -10), (3, 30, -8)))
    body = trimesh.boolean.union([plate, foot], engine="manifold")
    for x, radius in ((-15, 4.0), (15, 2.5)):
        body = drilled(body, radius, (x, 0, 0), 1)
    body = drilled(body, 1.0, (0, 5, 0), 2)
    large, small = find_walls_in_holes(chamber_of(tmp_path, body, offset_mm=(0, 17.4)))
    for hole, wide in ((large, 8.0), (small, 5.0)):
        assert hole.opening.wall == "the wall"
        assert 1e3 * np.array(hole.opening.size) == pytest.approx([wide, wide], rel=5e-3)
        assert 1e3 * hole.opening.place[1] == pytest.approx(25.0, abs=1e-6)


def test_the_wall_above_a_plate_that_divides_the_room_is_in_no_hole(tmp_path: Path) -> None:
    """Balls get through its hole to the walls above it, which are not in the hole."""
    plate = drilled(trimesh.creation.box((70, 60, 4)), 3.0, (0, 0, 0), 2)
    assert find_walls_in_holes(chamber_of(tmp_path, plate)) == []


def test_a_hole_along_the_wall_meets_it_beside_its_mouths(tmp_path: Path) -> None:
    bar = drilled(trimesh.creation.box((100, 12, 8)), 2.5, (30, 0, 0), 2)
    chamber = chamber_of(tmp_path, bar)
    assert find_walls_in_holes(chamber) == []
    part = chamber.part
    in_hole = np.hypot(*(1e3 * part.vertices - [30, 0, 0])[:, :2].T) < 2.6
    rows = in_hole[part.triangles].all(axis=1) & (np.abs(part.corner_normals[:, 0, 2]) < 0.1)
    assert part_at_wall(chamber)[rows].any()

    assert len([one for one in find_openings(chamber) if one.place[0] > 0.0]) == 2  # beside it
    wall: dict[str, object] = {"faces": [{"at_mm": (27.5, 0.0, 0.0), "crease_deg": 30.0}]}
    plugged = chamber_of(tmp_path, bar, wall)
    assert not part_at_wall(plugged)[rows].any()
    (whole,) = (one for one in find_openings(plugged) if one.place[0] > 0.0)
    assert 1e3 * np.array(whole.size) == pytest.approx([12, 8], abs=1e-6)
