"""Outlines of openings are drawn with the dimensions by which they are cut."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from chamberopt.chamber.checks.openings import Opening
from chamberopt.documents.sheet import AsBuilt, drawn_openings
from chamberopt.pictures.drawing.openings import draw_openings
from chamberopt.printers.sheet_page import HEIGHT, MARGIN, WIDTH
from tests.helpers.drawings import boxes_of, require_apart


def sides(*corners: tuple[float, float]) -> np.ndarray:
    """The lines from each of the corners [mm] to the next one, (k, 2, 2) [m]."""
    return 1e-3 * np.stack([corners[:-1], corners[1:]], axis=1)


def test_outlines_of_openings_are_drawn_with_two_dimensions() -> None:
    """A U, a U whose wall ends above it, and a wedge that goes on to both sides."""
    legs = [(-20, 9), (-20, -9), (-17, -9), (-17, 6), (17, 6), (17, -9), (20, -9), (20, 9)]
    wedge = np.concatenate([sides((-30, -12), (30, -8)), sides((30, 8), (-30, 12))])
    shapes = [
        ((40, 18), sides(*legs, legs[0]), 2 * 3 * 18 + 34 * 3),
        ((40, 18), sides(*legs), 2 * 3 * 18 + 34 * 3),
        ((60, 24), wedge, 60 * 20),
    ]
    for (wide, tall), outline, area in shapes:
        at = (0.0, 0.0, 0.1), 0.01, (0.0, 0.0, 1.0)
        one = Opening("the ceiling", (1e-3 * wide, 1e-3 * tall), *at, "other", outline)
        (words, _), *_ = drawn = drawn_openings(AsBuilt((50.0,), [one, one, one]))
        assert words == "the ceiling, middle\nat x = 0 and y = 0 mm from the room's axis"
        figure = Figure(figsize=(WIDTH / 25.4, HEIGHT / 25.4))
        axes = figure.add_axes((0, 0, 1, 1), xlim=(0, WIDTH), ylim=(0, HEIGHT))
        scale = draw_openings(axes, drawn, MARGIN, 200.0, (180.0, 180.0))
        assert scale == "1:1"
        boxes = boxes_of(figure)
        require_apart(boxes)
        assert [text for text, _ in boxes].count(str(wide)) == 3
        assert [text for text, _ in boxes].count(str(tall)) == 3
        (x, y) = axes.patches[0].get_path().vertices.T
        found = 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
        assert found == pytest.approx(area, rel=1e-6)
        places = {"3", "37", "15"} if tall == 18 else {"4", "20"}  # from the lower left
        assert places <= {text.strip() for text, _ in boxes}


def test_the_round_of_an_opening_with_a_keyway_has_its_diameter() -> None:
    angle = np.radians(np.linspace(15.0, 345.0, 111))
    arc = [(10.0 * np.cos(one), 10.0 * np.sin(one)) for one in angle]
    key = [(14.0, arc[-1][1]), (14.0, arc[0][1])]
    at = (0.0, 0.0, 0.1), 0.01, (0.0, 0.0, 1.0)
    outline = sides(*arc, *key, arc[0]) - [2e-3, 0.0]
    one = Opening("the ceiling", (0.024, 0.02), *at, "other", outline)
    figure = Figure(figsize=(WIDTH / 25.4, HEIGHT / 25.4))
    axes = figure.add_axes((0, 0, 1, 1), xlim=(0, WIDTH), ylim=(0, HEIGHT))
    draw_openings(axes, [("a shank", one)], MARGIN, 200.0, (180.0, 180.0))
    boxes = boxes_of(figure)
    require_apart(boxes)
    assert {"Ø 20", "24", "20", "19.7", "7.4", "12.6"} <= {text.strip() for text, _ in boxes}
