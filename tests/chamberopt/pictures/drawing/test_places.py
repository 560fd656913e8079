"""Walls are drawn round the room, and what stands beside its middle has its place dimensioned."""

from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.layout.grip import ON_WALLS, Clamp, outside_clamp
from chamberopt.design.fixture import OpeningCut
from chamberopt.pictures.drawing import section
from chamberopt.pictures.drawing.arrangement import WALL, arrangement
from chamberopt.pictures.drawing.centres import Centre, centres, distinct, gaps
from chamberopt.pictures.drawing.chamber import Shown, draw_chamber
from chamberopt.pictures.drawing.cuts import _hides_way_out, section_planes
from chamberopt.pictures.drawing.dimensions import Limits
from chamberopt.pictures.drawing.section import JAWS
from chamberopt.pictures.drawing.walls import LID, WALLS
from chamberopt.printers.sheet_page import HEIGHT, MARGIN, WIDTH
from tests.helpers.drawings import boxes_of, require_apart
from tests.helpers.synthetic import plate_design

ROOM = {"shape": "box", "length_mm": 40, "width_mm": 30, "height_mm": 30}


def room_with(
    part: trimesh.Trimesh, folder: Path, offset_mm: tuple[float, float], **more: object
) -> Chamber:
    """A room of 40 x 30 x 30 mm, with the part 10 mm over the sonotrode and off the axis."""
    part.export(folder / "part.stl")
    below = {"direction": (0.0, 0.0, -1.0), "angle_deg": (0.0, 10.0)}
    mesh = {"mesh": str(folder / "part.stl"), "unit": "mm", "offset_mm": offset_mm, "target": below}
    chamber = {**ROOM, "sonotrode_distance_mm": 10}
    return build_chamber(plate_design().changed({"part": mesh, "chamber": chamber, **more}))


def texts_of(
    chamber: Chamber, limits: Limits = MappingProxyType({})
) -> tuple[list[str], dict[str, float]]:
    """The texts of its drawing at 1:1, and the area of what has each hatch [mm²]."""
    axes = Figure().add_axes((0.0, 0.0, 1.0, 1.0))
    draw_chamber(axes, chamber, 0.0, 70.0, (190.0, 70.0), Shown(limits))
    found: dict[str, float] = {}
    for one in axes.patches:
        if one.get_hatch():
            rings = [ring.T for ring in one.get_path().to_polygons()]  # holes the other way round
            area = 0.5 * sum(float(np.sum(x[:-1] * y[1:] - y[:-1] * x[1:])) for x, y in rings)
            found[one.get_hatch()] = found.get(one.get_hatch(), 0.0) + area
    return [one.get_text() for one in axes.texts], found


@pytest.mark.parametrize("along", [0, 1])
def test_a_section_across_a_bar_hides_the_walls_that_it_goes_out_through(
    along: int, tmp_path: Path
) -> None:
    """A square bar of 12 mm, longer than the room or within it, in a room of 40 x 30 mm."""
    for length in (60.0, 8.0):
        sides = np.full(3, 12.0)
        sides[along] = length
        bar = room_with(trimesh.creation.box(sides), tmp_path, (0.0, 0.0))
        assert not _hides_way_out(bar, along)
        assert _hides_way_out(bar, 1 - along) is (length == 60.0)


def test_a_second_section_shows_the_lid_beside_a_part_as_wide_as_the_room(tmp_path: Path) -> None:
    """A plate of 24 mm along x goes out of the ceiling, and over the walls along y."""
    plate = trimesh.creation.box((24.0, 30.0, 25.0))
    chamber = room_with(plate, tmp_path, (0.0, 0.0), holder={"kind": "bore", "clearance_mm": 0.2})
    assert [one.right for one in section_planes(chamber)] == [1, 0]
    axes = Figure().add_axes((0.0, 0.0, 1.0, 1.0))
    told = draw_chamber(
        axes, chamber, 0.0, 70.0, (190.0, 70.0), Shown(opening=OpeningCut(0.2, 0.0, 0.1))
    )
    assert told.startswith("Sections A–A and B–B")
    assert [one.get_text() for one in axes.texts].count("24.4 +0.1/0") == 1


def test_a_bar_through_a_side_wall_has_its_axis_and_its_end_dimensioned(tmp_path: Path) -> None:
    """A bar of 6 mm along x, from x = -9 to 27 mm, 5 mm beside the axis of the room."""
    chamber = room_with(trimesh.creation.box((36.0, 6.0, 6.0)), tmp_path, (9.0, 5.0))
    (one,) = centres(chamber)
    assert (one.axis, one.outwards) == (0, 1)
    assert one.place == pytest.approx((20.0, 5.0, 13.0), abs=1e-6)
    assert gaps(chamber, 0) == [pytest.approx((-20.0, -9.0))]
    assert gaps(chamber, 1) == [pytest.approx((-15.0, 2.0))]
    texts, area = texts_of(chamber)
    assert {"13", "11", "17", "20"} <= {*texts}
    # In both views the bar goes through the wall on the right.
    ring = 2.0 * (43.0 + 30.0) * WALL
    assert area[WALLS] == pytest.approx((60.0 - 6.0 - 6.0) * WALL + ring, rel=1e-3)
    assert area[LID] == pytest.approx(43.0 * WALL, rel=1e-3)


def test_what_is_in_the_middle_has_no_dimension_but_along_its_holder(tmp_path: Path) -> None:
    cube = trimesh.creation.box((10.0, 10.0, 10.0))
    held = {"holder": {"kind": "rod", "axis": (1.0, 0.0, 0.0), "diameter_mm": 4.0}}
    chamber = room_with(cube, tmp_path, (0.0, 0.0), **held)
    (one,) = centres(chamber)
    assert one == Centre(0, 1, one.place)
    assert one.place == pytest.approx((5.0, 0.0, 15.0), abs=1e-3)
    assert gaps(chamber, 0) == [pytest.approx((-20.0, -5.0))]
    assert gaps(chamber, 1) == []
    # The distance of the part follows from the height of the axis, which has its tolerance.
    texts, _ = texts_of(chamber, {"sonotrode_distance_mm": (10.0, 9.8, 10.3)})
    assert {"15 +0.3/−0.2", "(10)"} <= {*texts}
    assert distinct([3.0, 1.0, 3.02], known=[1.0]) == [3.0]


def test_no_wall_is_behind_the_name_of_a_short_holder(tmp_path: Path) -> None:
    """A rod of 6 mm between the part and the wall on the right, at 1:1."""
    cube = trimesh.creation.box((10.0, 10.0, 10.0))
    held = {"holder": {"kind": "rod", "axis": (1.0, 0.0, 0.0), "diameter_mm": 4.0}}
    axes = Figure().add_axes((0.0, 0.0, 1.0, 1.0))
    chamber = room_with(cube, tmp_path, (9.0, 0.0), **held)
    draw_chamber(axes, chamber, 0.0, 70.0, (190.0, 70.0))
    (name,) = (one for one in axes.texts if one.get_text().startswith("holder"))
    (rod,) = (one for one in axes.patches if one.get_hatch() == "....")
    (left, low), (right, high) = rod.get_path().get_extents().get_points()
    x, y = name.get_position()
    assert not low - 2.0 < y < high + 2.0  # two lines of 5 pt
    assert left < x < right - 3.0


@pytest.mark.parametrize(("wide", "is_below"), [(10.0, True), (36.0, False)])
def test_the_name_of_a_holder_leaves_the_name_of_the_section_alone(
    tmp_path: Path, wide: float, is_below: bool
) -> None:
    """A plate in the ceiling of a room of 40 mm, round a post, or round a block as wide as itself.

    Behind its middle is the part. Under it the name has room beside the post, not beside the block.
    """
    plate = {"kind": "plate", "size_mm": (37.0, 28.0), "axis": (0.0, 0.0, 1.0), "grip_mm": 6.0}
    part = trimesh.creation.box((wide, 10.0, 18.0))
    chamber = room_with(part, tmp_path, (0.0, 0.0), holder=plate)
    figure = Figure(figsize=(WIDTH / 25.4, HEIGHT / 25.4))
    axes = figure.add_axes((0, 0, 1, 1), xlim=(0, WIDTH), ylim=(0, HEIGHT))
    draw_chamber(axes, chamber, MARGIN, 200.0, (180.0, 70.0))
    boxes = boxes_of(figure)
    require_apart(boxes)
    (name,) = (box for text, box in boxes if text.startswith("holder"))
    (section_name,) = (box for text, box in boxes if text.startswith("A–A"))
    assert max(name[3], section_name[3]) < 200.0 / 25.4 * 72.0
    assert (name[3] < section_name[1] - 30.0) == is_below


def test_a_part_is_broken_off_before_a_hole_beyond_the_chamber(tmp_path: Path) -> None:
    """A bar of 80 mm with a hole of 4 mm, from 5 mm outside on: 15 mm would be drawn of it."""
    bar = trimesh.creation.box((80.0, 6.0, 6.0))
    hole = trimesh.creation.cylinder(2.0, 10.0)
    hole.apply_translation((27.0, 0.0, 0.0))
    for part, right in ((bar, 15.0), (trimesh.boolean.difference([bar, hole]), 5.0)):
        chamber = room_with(part, tmp_path, (0.0, 0.0))
        found = arrangement(chamber, section_planes(chamber), (190.0, 70.0))
        assert found.scale == 1.0
        assert found.outside[0] == pytest.approx((15.0, right, 0.0), abs=0.3)


@pytest.mark.parametrize(
    ("way", "are_drawn"), [(None, True), ((0.0, 0.0, -1.0), True), ((0.0, 1.0, 0.0), False)]
)
def test_jaws_are_drawn_on_the_faces_that_are_clamped(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    way: tuple[float, float, float] | None,
    are_drawn: bool,
) -> None:
    """A bar along x, out at both sides: the section along it shows what is above and below."""
    chamber = room_with(trimesh.creation.box((90.0, 9.0, 19.0)), tmp_path, (0.0, 0.0))
    assert np.abs(outside_clamp(chamber).way or 0.0) == pytest.approx([0.0, 1.0, 0.0])
    monkeypatch.setattr(section, "outside_clamp", lambda _: Clamp("", way=way))
    assert (JAWS in texts_of(chamber)[1]) == are_drawn


def test_what_lies_on_the_walls_is_clamped_from_above_alone(tmp_path: Path) -> None:
    """A plate of 60 x 6 x 6 mm lies on both walls across x: a clamp over each, none below."""
    bar = trimesh.creation.box((60.0, 6.0, 6.0))
    bar.export(tmp_path / "part.stl")
    design = plate_design().changed({
        "part": {"mesh": str(tmp_path / "part.stl"), "unit": "mm"},
        "chamber": {**ROOM, "sonotrode_distance_mm": 29.8},
        "holder": {"kind": "bore", "clearance_mm": 0.2},
    })  # fmt: skip
    chamber = build_chamber(design)
    assert outside_clamp(chamber).text == ON_WALLS
    axes = Figure().add_axes((0.0, 0.0, 1.0, 1.0))
    told = draw_chamber(axes, chamber, 0.0, 70.0, (190.0, 70.0))
    clamps = [one for one in axes.patches if one.get_hatch() == JAWS]
    assert len(clamps) == 2
    assert clamps[0].get_y() == pytest.approx(clamps[1].get_y())
    assert "White and crossed: clamps, down on the walls." in told


def test_jaws_are_as_long_as_what_stands_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At 1:1, 5.5 mm stand out: jaws of 4 mm would reach beyond the end of the part."""
    monkeypatch.setattr(section, "outside_clamp", lambda _: Clamp(""))
    for out, long in ((3.5, None), (5.5, 3.0), (20.0, 4.0)):
        bar = trimesh.creation.box((9.0, 9.0, 20.0 + out))
        chamber = room_with(bar, tmp_path, (0.0, 0.0))
        axes = Figure().add_axes((0.0, 0.0, 1.0, 1.0))
        draw_chamber(axes, chamber, 0.0, 80.0, (190.0, 80.0))
        jaws = [one.get_height() for one in axes.patches if one.get_hatch() == JAWS]
        assert jaws == ([] if long is None else [pytest.approx(long)] * 2)
