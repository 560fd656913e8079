"""The largest flat face of a part tells a fitter how it is turned."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from shapely import Polygon

from chamberopt.chamber.checks.flat_faces import largest_flat_face
from chamberopt.chamber.part import Part
from tests.helpers.synthetic import chamber_round


def part_of(body: trimesh.Trimesh) -> Part:
    return chamber_round(body).part


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_the_largest_face_of_a_wedge_looks_where_it_is_turned_to(turn: int) -> None:
    """A wedge 30 mm long over a right triangle of 6 x 8 mm: its slope is the largest face."""
    corners = [(0.0, 0.0), (6e-3, 0.0), (0.0, 8e-3)]
    ends = np.array([[x, y, z] for z in (0.0, 30e-3) for x, y in corners])
    wedge = trimesh.convex.convex_hull(np.roll(ends, turn, axis=1))
    face = largest_flat_face(chamber_round(wedge).part)
    assert face.area == pytest.approx(10e-3 * 30e-3)
    assert face.normal == pytest.approx(np.roll([0.8, 0.6, 0.0], turn), abs=1e-9)
    assert face.is_alone


def test_of_faces_alike_the_lowest_is_taken_and_a_ball_has_none() -> None:
    part = chamber_round(trimesh.creation.box((20e-3, 20e-3, 5e-3))).part
    face = largest_flat_face(part)
    assert face.normal == pytest.approx((0.0, 0.0, -1.0))
    assert face.off == pytest.approx(-float(part.vertices[:, 2].min()))
    assert not face.is_alone
    ball = trimesh.creation.icosphere(3, 10e-3)
    round_one = replace(part, vertices=ball.vertices, triangles=ball.faces.astype(np.int32))
    assert largest_flat_face(round_one) is None


@pytest.mark.parametrize(("sides", "is_found"), [(31, True), (35, False)])
def test_a_face_of_less_than_three_per_cent_of_the_surface_is_none(
    sides: int, is_found: bool
) -> None:
    """A tall prism, of whose surface each side is nearly its share."""
    prism = trimesh.creation.cylinder(1e-3, 0.2, sections=sides)
    found = largest_flat_face(part_of(prism))
    assert (found is not None) == is_found
    if found is not None:
        assert found.area == pytest.approx(2e-3 * np.sin(np.pi / sides) * 0.2)
        assert not found.is_alone


@pytest.mark.parametrize(("longer", "is_alone"), [(1.0, False), (1.009, False), (1.011, True)])
def test_a_face_is_alone_where_the_next_is_a_hundredth_smaller(
    longer: float, is_alone: bool
) -> None:
    """A tall bar over a thin trapeze, of which one long side is longer."""
    outline = Polygon([(0, 0), (5e-3, 0), (5e-3, longer * 20e-3), (0, 20e-3)])
    bar = trimesh.creation.extrude_polygon(outline, 0.3)
    found = largest_flat_face(part_of(bar))
    assert found is not None
    assert found.is_alone == is_alone
    assert found.area == pytest.approx(longer * 20e-3 * 0.3, rel=0.012)
