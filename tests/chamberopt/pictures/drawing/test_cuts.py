"""Planes cut a chamber where it shows the part best, and areas lie inside their lines."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import build_chamber
from chamberopt.pictures.drawing.cuts import cut, face_size_mm, inside, outline_path, section_planes
from tests.helpers.synthetic import chamber_round, plate_design


def test_the_section_shows_the_target() -> None:
    """No plane along x meets the faces of a cube at y = 10 and -10 mm; those across do."""
    cube = trimesh.creation.box((20e-3, 20e-3, 20e-3))
    chamber = chamber_round(cube)
    across = np.ptp(chamber.part.vertices[chamber.part.triangles][..., 1], axis=1) < 1e-9
    (plane,) = section_planes(replace(chamber, part=replace(chamber.part, target=across)))
    assert plane.right == 1


@pytest.mark.parametrize("thick", [1.0, 6.0])
def test_the_section_shows_a_part_in_one_piece_if_its_middle_does(thick: float) -> None:
    """Two bars one over the other, joined by a web in the middle, from which the target is gone.

    Beside the web the target's line is longer, but the bars look like two loose pieces.
    """
    bounds = [((-20, -9, 0), (20, 9, 6)), ((-20, -9, -20), (20, 9, -14))]
    bounds.append(((-19.9, -0.5 * thick, -15), (19.9, 0.5 * thick, 1)))
    bars = [trimesh.creation.box(bounds=1e-3 * np.array(one)) for one in bounds]
    body = trimesh.boolean.union(bars, engine="manifold")
    inner = np.abs(body.face_normals[:, 2]) > 0.9
    inner &= np.abs(1e3 * body.triangles_center[:, 2] + 7.0) < 7.1
    (plane,) = section_planes(chamber_round(body, inner))
    assert (plane.right, plane.at) == (0, pytest.approx(0.0, abs=1e-9))


def test_no_piece_of_the_part_floats_in_the_section() -> None:
    """A web across y with a foot and a head along y, wider than the web on both sides.

    The flanks of the head are peened. Planes along y through them show head and foot apart.
    """
    bounds = [((-12, -25, 0), (12, 25, 6)), ((-12, -25, 14), (12, 25, 20))]
    bounds.append(((-4, -25, 5), (4, 25, 15)))
    body = trimesh.boolean.union([trimesh.creation.box(bounds=1e-3 * np.array(x)) for x in bounds])
    middle = 1e3 * body.triangles_center
    beside = (np.abs(body.face_normals[:, 2]) > 0.9) & (np.abs(middle[:, 0]) > 4.1)
    chamber = chamber_round(body, beside & (np.abs(middle[:, 2] - 10.0) < 4.1))
    assert [(one.right, one.at) for one in section_planes(chamber)] == [
        (0, pytest.approx(0.0, abs=1e-9))
    ]


def test_the_section_shows_the_profile_that_is_peened() -> None:
    """Four ribs along y, the longer side: a plane along them shows a block."""
    bounds = [((-15e-3, -17e-3, 0.0), (15e-3, 17e-3, 10e-3))]
    bounds += [((x, -17e-3, -8e-3), (x + 4e-3, 17e-3, 1e-3)) for x in 1e-3 * np.arange(-14, 13, 8)]
    comb = trimesh.boolean.union([trimesh.creation.box(bounds=one) for one in bounds])
    below = comb.triangles_center[:, 2] < 1e-9
    chamber = chamber_round(comb, below)
    assert [one.right for one in section_planes(chamber)] == [0]


def test_a_section_has_its_area_without_holes() -> None:
    """A box of 6 x 4 mm with a tunnel of 2 x 2 mm along z, cut between and at its corners."""
    outer, hole = trimesh.creation.box((6e-3, 4e-3, 9e-3)), trimesh.creation.box((2e-3, 2e-3, 9e-3))
    vertices = np.concatenate([outer.vertices, hole.vertices])
    triangles = np.concatenate([outer.faces, hole.faces[:, ::-1] + len(outer.vertices)])
    for at in (0.0, 1e-3):
        lines, row = cut(vertices, triangles, 2, at)
        assert len(lines) == len(row) == 16
        (around, tunnel) = outline_path(inside(1e3 * lines)).to_polygons()
        areas = [np.sum(p[:-1, 0] * p[1:, 1] - p[1:, 0] * p[:-1, 1]) / 2 for p in (around, tunnel)]
        assert areas == pytest.approx([24.0, -4.0])  # of opposite sense: not filled
    assert outline_path(inside(cut(vertices, triangles, 2, 1.0)[0])) is None


def test_bodies_that_overlap_are_filled_everywhere() -> None:
    """Two boxes of 4 x 4 mm, of which 2 x 4 mm are in both."""
    one, other = (trimesh.creation.box((4e-3, 4e-3, 4e-3)) for _ in range(2))
    vertices = np.concatenate([one.vertices, np.add(other.vertices, [2e-3, 0.0, 0.0])])
    triangles = np.concatenate([one.faces, other.faces + len(one.vertices)])
    for axis, area in ((2, 24.0), (1, 24.0), (0, 16.0)):
        at = 0.5e-3 if axis else -1.5e-3
        assert inside(1e3 * cut(vertices, triangles, axis, at)[0]).area == pytest.approx(area)


def test_the_size_of_the_face() -> None:
    chamber = build_chamber(plate_design())
    assert face_size_mm(chamber) == pytest.approx((50.0,))
    stretched = replace(chamber, vertices=chamber.vertices * [2.0, 1.0, 1.0])
    assert face_size_mm(stretched) == pytest.approx((100.0, 50.0), rel=1e-3)
