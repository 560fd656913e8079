"""Colour bars have round labels, names are no formulas, and what is cut is filled."""

from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.design.shape_surface import TAG_WALL
from chamberopt.pictures.actors import add_section, colour_bar_ticks, escape_dollars
from chamberopt.pictures.charts.colours import FIXTURE_COLOURS, PART_GREY
from chamberopt.results.vtp_files import FIXTURE_BODY, pyvista


@pytest.mark.parametrize("high", [0.35, 1.5, 2.0, 8.5, 90.0, 100.0, 500.0])
def test_bars_have_round_labels(high: float) -> None:
    steps, written = colour_bar_ticks((0.0, high))
    labels = [high * k / steps for k in range(steps + 1)]
    assert [float(written % label) for label in labels] == pytest.approx(labels)
    assert len({written % label for label in labels}) == len(labels)


def test_a_dollar_in_a_name_is_no_formula() -> None:
    assert escape_dollars("x$y$_{z}") == r"x\$y\$_{z}"


class Drawn(list[Any]):
    """A plotter that keeps what is added to it, each surface with its colour."""

    def add_mesh(self, surface: Any, color: str, **_: Any) -> None:
        self.append((surface, color))


def test_bodies_are_filled_where_they_are_cut() -> None:
    """A holder of 20 x 20 x 10 mm round a post of 8 x 8 mm, which goes through it.

    Its section is filled beside the post, and the post's where it is cut too and closed.
    """
    box = trimesh.creation.box((20.0, 20.0, 10.0))
    post = trimesh.creation.box((8.0, 8.0, 30.0))
    holder = trimesh.boolean.difference([box, post])
    chamber = pyvista().Box((-30.0, 30.0, -30.0, 30.0, -30.0, 30.0)).triangulate()
    chamber["tag"] = np.full(chamber.n_cells, TAG_WALL)
    chamber["fixture"] = np.arange(chamber.n_cells) < 2  # its ends of the cavity, as if it were
    for key, value in zip(FIXTURE_BODY, (holder.vertices, holder.faces), strict=True):
        chamber.field_data[key.format("holder")] = value
    part = pyvista().wrap(post)
    open_part = part.extract_cells(range(11)).extract_surface(algorithm="dataset_surface")
    for own, filled in ((None, 0.0), (part, 8.0 * 30.0), (open_part, 0.0)):
        drawn = Drawn()
        add_section(drawn, chamber, own, (0.0, 1.0, 0.0), (0.0, 0.5, 0.0))
        areas = dict.fromkeys((FIXTURE_COLOURS["holder"], PART_GREY), 0.0)
        for surface, colour in drawn:
            areas[colour] = areas.get(colour, 0.0) + surface.area
        assert areas[FIXTURE_COLOURS["holder"]] == pytest.approx(12.0 * 10.0)
        assert areas[PART_GREY] == pytest.approx(filled)
