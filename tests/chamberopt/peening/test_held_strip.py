"""A strip is held at the target's height, with its screws, where the room has room for both."""

from dataclasses import replace

import numpy as np
import pytest

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.design.almen_strip import StripType
from chamberopt.design.design import Design
from chamberopt.peening.held_strip import HeldStrip, held_strip
from tests.helpers.synthetic import plate_design


@pytest.fixture(scope="module")
def chamber() -> Chamber:
    return build_chamber(plate_design())


def held_in(
    chamber: Chamber, room: dict[str, object], level: float, strip: StripType = "A"
) -> HeldStrip:
    """A strip in a room of 55 mm with a target that is as far from the sonotrode [m]."""
    design: Design = plate_design().changed({
        "chamber": {"height_mm": 55.0, "sonotrode_distance_mm": 15.0, **room}
    })  # fmt: skip
    flat = chamber.part.vertices * [1.0, 1.0, 0.0] + [0.0, 0.0, level]
    high = chamber.vertices.copy()
    high[:, 2] *= 55e-3 / high[:, 2].max()
    part = replace(chamber.part, vertices=flat)
    found = held_strip(design, replace(chamber, part=part, vertices=high), strip)
    assert found is not None
    return found


def cylinder(diameter: float) -> dict[str, object]:
    return {"shape": "cylinder", "diameter_mm": diameter}


def test_its_face_is_as_high_as_the_target_and_its_block_reaches_down_to_it(
    chamber: Chamber,
) -> None:
    """By hand: 55 = 52 + 1.7 + the thickness of 1.3 mm; none hangs above its ceiling."""
    for strip, level, block in (("A", 52.0, 1.7), ("N", 52.0, 2.2), ("C", 30.0, 22.6)):
        held = held_in(chamber, cylinder(80.0), 1e-3 * level, strip)
        assert (held.level_mm, held.block_mm) == (level, block)
    under = held_in(chamber, cylinder(80.0), 54.8e-3)
    assert (under.level_mm, under.block_mm) == (53.7, 0.0)


def test_a_room_too_narrow_for_the_heads_of_its_screws_takes_a_piece(chamber: Chamber) -> None:
    """Heads of 9.5 mm, 12.1 mm beside the middle of a strip of 19.05 mm: 33.7 mm across."""
    box = {"shape": "box", "length_mm": 34.0, "width_mm": 80.0}
    wide = held_in(chamber, box, 47e-3)
    assert (wide.is_whole, wide.along, wide.walls) == (True, "y", "")
    assert wide.options == "--distance-mm 47"
    narrow = held_in(chamber, box | {"length_mm": 24.0}, 47e-3)
    assert not narrow.is_whole
    assert "with those of M5 it is 33.7 mm wide, and the room 24 mm" in narrow.why_no_whole
    assert narrow.walls == "at −x or +x"
    assert not narrow.is_on_gauge
    for held, half in ((wide, 17.0), (narrow, 12.0)):
        assert held.screws_mm[1] + 0.5 * 9.5 <= half
        assert held.screws_mm[1] >= 500.0 * held.size.width + 2.5


def test_a_piece_is_cut_from_a_strip_and_no_wider(chamber: Chamber) -> None:
    """The diagonal of a piece is no longer than the room; nothing but a coupon goes into 20 mm."""
    for diameter, on_gauge in ((60.0, True), (50.0, True), (40.0, False)):
        held = held_in(chamber, cylinder(diameter), 31e-3, "N")
        assert held.size is not None
        assert held.is_on_gauge == on_gauge
        assert 1e3 * held.size.width <= 19.0 + 1e-9
        assert 1e3 * np.hypot(held.size.length, held.size.width) <= diameter
        assert np.hypot(*held.screws_mm) + 0.5 * 9.5 <= 0.5 * diameter
        assert held.options.startswith("--type N --size-mm ")
    assert held_in(chamber, cylinder(20.0), 31e-3).size is None
