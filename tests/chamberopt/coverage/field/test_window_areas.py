"""Areas that circles and triangles have in common, folded over edges, against sampled ones."""

import numpy as np
import pytest
import trimesh

from chamberopt.coverage.field.smooth_faces import Places
from chamberopt.coverage.field.surface_points import spread_points
from chamberopt.coverage.field.window_areas import (
    SurfacePieces,
    joined_pieces,
    surface_pieces,
    window_areas,
)
from chamberopt.coverage.field.windows import Windows
from chamberopt.geometry.triangles import areas, unit_normals
from sim_core import TriangleMesh


def pieces_of(corners: np.ndarray, face: np.ndarray) -> SurfacePieces:
    """Pieces that a ball can touch everywhere."""
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1)
    return SurfacePieces(corners, unit_normals(corners), face, area, np.ones(len(corners)))


def window_at(place: list[float], normal: list[float], radius: float, face: int = 0) -> Windows:
    points = Places(np.array([place]), np.array([normal]), np.array([face]))
    return Windows(points, radius)


SQUARE = np.array([[[0, 0, 0], [2, 0, 0], [2, 2, 0]], [[0, 0, 0], [2, 2, 0], [0, 2, 0]]], float)


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ([1.0, 1.0, 0.0], np.pi * 0.25),  # inside, over the diagonal
        ([0.0, 1.0, 0.0], np.pi * 0.125),  # on a side
        ([0.0, 0.0, 0.0], np.pi * 0.0625),  # at a corner
        ([-0.25, 1.0, 0.0], 0.25 * np.arccos(0.5) - 0.25 * np.sqrt(0.25 - 0.0625)),  # beyond
        ([3.0, 1.0, 0.0], 0.0),
    ],
)
def test_a_circle_on_a_square(place: list[float], expected: float) -> None:
    found = window_areas(
        window_at(place, [0, 0, 1.0], 0.5), pieces_of(SQUARE, np.zeros(2, dtype=int))
    )
    assert found == pytest.approx(expected, abs=1e-12)


def test_other_faces_and_what_no_ball_can_touch_count_nothing() -> None:
    window = window_at([1.0, 1.0, 0.0], [0, 0, 1.0], 0.5)
    pieces = pieces_of(SQUARE, np.array([0, 1]))
    assert window_areas(window, pieces) == pytest.approx(np.pi * 0.125)
    half = pieces._replace(face=np.zeros(2, dtype=int), touched=np.array([1.0, 0.5]))
    assert window_areas(window, half) == pytest.approx(0.75 * np.pi * 0.25)
    both = joined_pieces(pieces, pieces)
    assert window_areas(window, both) == pytest.approx(np.pi * 0.25)


@pytest.mark.parametrize("turn_deg", [10.0, 35.0, -35.0, 55.0])
def test_a_window_folded_over_an_edge_keeps_its_area(turn_deg: float) -> None:
    """Unfolded it is a whole circle."""
    turn = np.radians(turn_deg)
    tilted = SQUARE - np.array([2.0, 0.0, 0.0])
    across = -tilted[..., 0]
    tilted = np.stack([-across * np.cos(turn), tilted[..., 1], -across * np.sin(turn)], axis=-1)
    corners = np.concatenate([SQUARE, tilted])
    pieces = pieces_of(corners, np.zeros(4, dtype=int))
    window = window_at([0.2, 1.0, 0.0], [0, 0, 1.0], 0.5)
    assert window_areas(window, pieces) == pytest.approx(np.pi * 0.25)


def test_areas_on_a_faceted_cylinder_are_those_of_points_seen_by_windows() -> None:
    mesh = trimesh.creation.cylinder(1.0, 4.0, sections=24)
    side = np.abs(mesh.face_normals[:, 2]) < 0.5
    corners = mesh.triangles[side]
    pieces = pieces_of(corners, np.zeros(len(corners), dtype=int))
    spread = spread_points(
        mesh.vertices, mesh.faces[side], areas(mesh.vertices, mesh.faces[side]), 400_000
    )
    rows = np.flatnonzero(np.abs(spread.place[:, 2]) < 1.4)[::20_000]
    windows = Windows(
        Places(spread.place[rows], spread.normal[rows], np.zeros(len(rows), dtype=int)), 0.4
    )
    contacts = Places(spread.place, spread.normal, np.zeros(len(spread.place), dtype=int))
    one = pieces.area.sum() / len(spread.place)
    sampled = windows.sums(contacts, np.full(len(spread.place), one))
    assert window_areas(windows, pieces) == pytest.approx(sampled, rel=0.01)


def test_pieces_divide_the_surface_and_know_what_a_ball_can_touch() -> None:
    """In a box of 20 mm a ball of 4 mm cannot touch the 2 mm beside each edge."""
    box = trimesh.creation.box((20e-3,) * 3)
    mesh = TriangleMesh(box.vertices, box.faces, np.zeros(12, dtype=np.uint8))
    inward = box.triangles[:, ::-1]
    normals = np.repeat(-box.face_normals[:, None], 3, axis=1)
    corners = np.concatenate([inward, normals], axis=2)
    for radius in (1e-3, 4e-3):
        pieces = surface_pieces(corners, np.arange(12), mesh, 2e-3, radius)
        assert pieces.area.sum() == pytest.approx(box.area)
        share = (pieces.area * pieces.touched).sum() / box.area
        assert share == pytest.approx((16.04 / 20.0) ** 2, abs=0.01)
        sides = np.linalg.norm(pieces.corners - np.roll(pieces.corners, 1, axis=1), axis=2)
        assert sides.max() <= radius
        middle = np.abs(pieces.corners.mean(axis=1))
        inside = np.sort(middle, axis=1)[:, 1] < 8e-3 - radius
        assert (pieces.touched[inside] == 1.0).all()
