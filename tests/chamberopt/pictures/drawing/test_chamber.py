"""The drawing of a chamber shows it with its dimensions, as large as there is room."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure

from chamberopt.chamber.build import build_chamber
from chamberopt.design.sonotrode import Face
from chamberopt.documents.wording import plain
from chamberopt.peening.held_strip import HeldStrip
from chamberopt.peening.strip import StripSize
from chamberopt.pictures.drawing.chamber import Shown, draw_chamber, drawing_height, drawing_scale
from chamberopt.pictures.drawing.cuts import section_planes
from tests.helpers.drawings import on_sonotrode
from tests.helpers.synthetic import chamber_round, plate_design


def test_the_place_of_a_section_beside_the_axis_is_dimensioned() -> None:
    for x, y, right in ((0.0, 9.0, 0), (11.0, 0.0, 1)):
        size = (40e-3, 4e-3, 4e-3) if right == 0 else (4e-3, 40e-3, 4e-3)
        bar = trimesh.creation.box(size)
        bar.apply_translation((1e-3 * x, 1e-3 * y, 0.0))
        chamber = on_sonotrode(chamber_round(bar))
        (plane,) = section_planes(chamber)
        assert plane.right == right
        axes = Figure().add_axes((0.0, 0.0, 1.0, 1.0))
        draw_chamber(axes, chamber, 0.0, 100.0, (180.0, 100.0))
        assert plain(x + y) in [one.get_text() for one in axes.texts]


def test_what_stands_out_of_the_chamber_is_drawn_or_broken_off() -> None:
    """A post of 6 mm through the ceiling: as long as there is room for it, else with a wave."""
    waves = {}
    for beyond in (5e-3, 0.5):
        chamber = on_sonotrode(chamber_round(trimesh.creation.box((6e-3, 6e-3, 20e-3))))
        vertices = chamber.part.vertices.copy()
        vertices[vertices[:, 2] > 0.0, 2] = chamber.vertices[:, 2].max() + beyond
        chamber = replace(chamber, part=replace(chamber.part, vertices=vertices))
        axes = Figure().add_axes((0.0, 0.0, 1.0, 1.0))
        draw_chamber(axes, chamber, 0.0, 150.0, (180.0, 150.0))
        curves = [np.array(one.get_xydata()) for one in axes.lines]
        waves[beyond] = [one for one in curves if len(one) > 5 and np.ptp(one[:, 1]) < 1.1]
    assert waves[5e-3] == []
    (wave,) = waves[0.5]
    assert np.ptp(wave[:, 0]) > 5.0


def test_the_section_shows_the_part() -> None:
    """One plane along a bar beside the axis; two for bars across each other, apart."""
    bar = trimesh.creation.box((40e-3, 4e-3, 4e-3))
    bar.apply_translation((0.0, 9e-3, 0.0))
    (plane,) = section_planes(chamber_round(bar))
    assert plane.right == 0
    assert 7.0 < plane.at < 11.0
    assert plane.span == pytest.approx(1.0)
    other = trimesh.creation.box((4e-3, 40e-3, 4e-3))
    other.apply_translation((30e-3, -30e-3, -20e-3))
    planes = section_planes(chamber_round(trimesh.util.concatenate([bar, other])))
    assert {one.right for one in planes} == {0, 1}
    axes = Figure().add_axes((0.0, 0.0, 1.0, 1.0))
    chamber = chamber_round(trimesh.util.concatenate([bar, other]))
    chamber = on_sonotrode(chamber)
    drawn = draw_chamber(axes, chamber, 0.0, 100.0, (180.0, 100.0))
    assert drawn.startswith("Sections A–A and B–B")
    assert "Dashed" not in drawn
    for face, text in (
        (Face(diameter_mm=40.0), ""),
        (Face(size_mm=(78.0, 36.0)), " Dashed: the sonotrode's rim."),
        (Face(size_mm=(72.0, 72.0)), told_beyond(11, 20)),  # it would be cut off
        (
            Face(size_mm=(80.0, 80.0), columns=2),
            f" Dashed: the joints of the floor's blocks.{told_beyond(55, 24)}",
        ),
    ):
        told = draw_chamber(axes, chamber, 0.0, 100.0, (180.0, 100.0), Shown(face=face))
        assert told == f"{drawn}{text}"
    before = len(axes.lines)
    held = HeldStrip("A", StripSize(), "y", 12.0, 1.7)
    told = draw_chamber(axes, chamber, 0.0, 100.0, (180.0, 100.0), Shown(held=held))
    assert "Dotted: an Almen strip, 12 mm from the sonotrode, with its block" in told
    dotted = [one for one in axes.lines[before:] if len(one.get_xdata()) == 5]
    wide, tall = (float(np.ptp(ends)) for ends in (dotted[-1].get_xdata(), dotted[-1].get_ydata()))
    assert tall / wide == pytest.approx(76.2 / 19.0)


def told_beyond(x: int, y: int) -> str:
    """How far a face that has no room in the plan goes on [mm], in words."""
    over = f"by {x} mm in x and {y} mm in y"
    return f" Not drawn: the sonotrode's face goes on beyond the walls {over}."


def test_a_drawing_takes_no_more_height_than_its_views() -> None:
    """At the same scale it is drawn in less height, which leaves larger letters room."""
    chamber = build_chamber(plate_design())
    height = drawing_height(chamber, (186.0, 118.0))
    assert height < 118.0
    assert drawing_height(chamber, (186.0, height)) == height
    assert drawing_height(chamber, (186.0, height - 1.0)) < height - 1.0


def test_the_plan_is_below_the_sections_where_that_allows_a_larger_scale() -> None:
    """Section and plan of a long room fit beside each other at 1:5, and below at 1:2."""
    room = {"shape": "box", "length_mm": 200, "width_mm": 100, "height_mm": 60}
    chamber_table = {**room, "sonotrode_distance_mm": 15}
    design = plate_design().changed({"chamber": chamber_table})
    chamber = build_chamber(design)
    assert drawing_scale(chamber, (186.0, 70.0)) == pytest.approx(0.2)
    assert drawing_scale(chamber, (186.0, 150.0)) == pytest.approx(0.5)
    for tall in (70.0, 150.0):
        page = Figure().add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, 186.0), ylim=(0.0, tall))
        draw_chamber(page, chamber, 0.0, tall, (186.0, tall))
        places = {text.get_text(): text.get_position() for text in page.texts}
        plan, section = places["plan: x to the right, y up"], places["A–A: x to the right, z up"]
        assert (plan[1] < section[1] - 20.0) == (tall > 100.0)
        assert (plan[0] > section[0] + 20.0) == (tall < 100.0)
