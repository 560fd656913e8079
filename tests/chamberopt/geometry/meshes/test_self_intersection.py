"""Surfaces that cross themselves are refused with the place."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from chamberopt.geometry.meshes import self_intersection
from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.geometry.meshes.surface_error import SurfaceError
from tests.helpers.mesh_files import ball_corners, box_corners, write_stl


def test_a_body_that_crosses_itself_is_refused_with_its_place(tmp_path: Path) -> None:
    """A ball whose top has been pushed down through its bottom."""
    corners = ball_corners(2)
    corners[np.linalg.norm(corners - [0, 0, 10], axis=2) < 1e-6] = [0.1, 0.2, -12.0]

    with pytest.raises(
        SurfaceError, match=r"crosses itself: \d+ pairs of triangles, the first near \(.*\) mm"
    ) as caught:
        read_part(write_stl(tmp_path / "ball.stl", corners), "mm")
    place = caught.value.edges.reshape(-1, 3)
    assert place[:, 2].min() == pytest.approx(-0.012)


def test_bodies_that_overlap_do_not_cross_themselves(tmp_path: Path) -> None:
    corners = np.r_[
        box_corners(), box_corners(at=(10, 10, 10)), ball_corners() + np.array([40, 0, 0])
    ]

    assert read_part(write_stl(tmp_path / "three.stl", corners), "mm").notes == ()


def segment_meets(triangle: np.ndarray, ends: np.ndarray) -> bool:
    """Whether the ends lie on both sides of the plane and the line passes inside the triangle."""

    def side(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
        return float(np.linalg.det([b - a, c - a, d - a]))

    (a, b, c), (p, q) = triangle, ends
    around = [side(p, q, *edge) > 0 for edge in ((a, b), (b, c), (c, a))]
    return side(a, b, c, p) * side(a, b, c, q) < 0 and len(set(around)) == 1


def test_crossing_triangles_are_found_as_by_trying_each_edge_against_each_triangle() -> None:
    rng = np.random.default_rng(4)
    corners = rng.uniform(0, 1, (120, 1, 3)) + rng.uniform(-0.2, 0.2, (120, 3, 3))
    expected = set()
    for i, j in itertools.combinations(range(len(corners)), 2):
        for one, other in ((i, j), (j, i)):
            edges = corners[one][[[0, 1], [1, 2], [2, 0]]]
            if any(segment_meets(corners[other], ends) for ends in edges):
                expected.add((i, j))

    found = [
        self_intersection._crossing(corners, a, b, 0.0)
        for a, b in self_intersection._close_pairs(corners)
    ]

    pairs = [
        (min(i, j), max(i, j))
        for a, b in found
        for i, j in zip(a.tolist(), b.tolist(), strict=True)
    ]
    assert len(pairs) == len(set(pairs))
    assert set(pairs) == expected
    assert len(expected) > 20
