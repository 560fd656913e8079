"""Strips of a target, and plugs: bodies whose numbers are known."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.facts import _fixture_facts
from chamberopt.chamber.checks.strips import StripOfTarget, strip_of_target
from chamberopt.chamber.fixture import plugs_in_words, plugs_of
from chamberopt.documents.facts import _texts
from tests.chamberopt.chamber.checks.test_openings import design_of, drilled

DOWN = {"direction": (0, 0, -1), "angle_deg": (0, 30)}


@pytest.mark.parametrize(
    ("low", "high", "want"), [(-25, 25, (2, 3)), (-75, -25, (1, 3)), (25, 90, (3, 3))]
)
def test_a_strip_of_a_plate(tmp_path: Path, low: float, high: float, want: tuple[int, int]) -> None:
    """A plate 150 mm long: strips of 50 mm, the last one with what is left."""
    plate = trimesh.creation.box((150, 20, 6))
    box = {"box_mm": ((low, -20, -10), (high, 20, 10)), "cut": True}
    design = design_of(tmp_path, plate, target={**DOWN, **box}, offset_mm=(-0.5 * (low + high), 0))
    strip = strip_of_target(design, build_chamber(design).part)
    assert strip is not None
    assert (strip.before + 1, strip.settings) == want
    assert strip.axis == 0
    ends = 1e3 * np.array(strip[1:])
    assert ends == pytest.approx([low, min(high, 75), -75, 75], abs=1e-4)


def test_a_target_that_is_whole_is_no_strip(tmp_path: Path) -> None:
    plate = trimesh.creation.box((40, 20, 6))
    wide = {"box_mm": ((-30, -20, -10), (30, 20, 10)), "cut": True}
    corner = {"box_mm": ((-30, -20, -10), (5, 5, 10)), "cut": True}
    uncut = {"box_mm": ((-10, -20, -10), (10, 20, 10)), "cut": False}
    bare = {"box_mm": ((-30, -20, -10), (12, 20, 10)), "cut": True}  # an end of 8 of 40 mm
    for box in ({}, wide, corner, uncut, bare):
        design = design_of(tmp_path, plate, target={**DOWN, **box})
        assert strip_of_target(design, build_chamber(design).part) is None
    assert StripOfTarget(0, 4.9, 5.1, 0.0, 10.0).settings == 1 + 2 * 25


def test_plugs_of_several_holes(tmp_path: Path) -> None:
    plate = trimesh.creation.box((50, 30, 6))
    for x, radius in ((-15, 4.0), (0, 2.5), (15, 2.5)):
        plate = drilled(plate, radius, (x, 0, 0), 2)
    walls = [{"at_mm": (x + radius, 0.0, 0.0)} for x, radius in ((-15, 4.0), (0, 2.5), (15, 2.5))]
    for some, want in (
        (walls, "in 1 hole of Ø 8 × 6 mm, 2 holes of Ø 5 × 6 mm deep"),
        (walls[1:], "in 2 holes of Ø 5 × 6 mm deep"),
    ):
        design = design_of(tmp_path, plate, {"faces": some})
        assert plugs_in_words(plugs_of(design, build_chamber(design).part)) == want
    design = design_of(tmp_path, plate)
    assert plugs_of(design, build_chamber(design).part) == []


def test_check_tells_the_holes_of_plugs_and_no_length(tmp_path: Path) -> None:
    plate = trimesh.creation.box((50, 30, 6))
    for x, radius in ((-15, 4.0), (0, 2.5), (15, 2.5)):
        plate = drilled(plate, radius, (x, 0, 0), 2)
    walls = [{"at_mm": (x + radius, 0.0, 0.0)} for x, radius in ((-15, 4.0), (0, 2.5), (15, 2.5))]
    design = design_of(tmp_path, plate, {"faces": walls})
    mask = _fixture_facts(design, build_chamber(design))["mask"]
    assert (mask["kind"], mask["holes"]) == ("plugs", 3)
    assert mask["hole_diameters_mm"] == pytest.approx([8.0, 5.0], rel=1e-3)
    assert mask["hole_depths_mm"] == pytest.approx([6.0, 6.0])
    told = ", ".join(_texts(mask))
    assert "holes 3, hole diameters (8, 5) mm, hole depths (6, 6) mm" in told
    assert "length" not in told
