"""Windows along the twelve edges of a block, whose distances and lengths are known."""

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.scene import chamber_mesh
from chamberopt.coverage.field.crease_bands import (
    CREASE_LENGTH,
    PIECES_PER_WINDOW,
    CreaseBand,
    CreasePieces,
    crease_pieces,
    find_band,
)
from chamberopt.coverage.field.smooth_faces import Creases, Faces, Places, find_faces
from chamberopt.coverage.field.windows import Windows
from chamberopt.geometry.triangles import unit_normals
from tests.helpers.synthetic import chamber_round

RADIUS = 0.5e-3  # m, of a window
DENT = 0.1e-3  # m, largest radius of a dent
LONG, FLAT = (8e-3, 8e-3, 8e-3), (8e-3, 8e-3, 0.02e-3)  # m, sides of blocks


def block(sides: tuple[float, float, float]) -> tuple[Faces, Creases, CreasePieces, np.ndarray]:
    """Faces, creases with their pieces, and normals of the triangles of a block round 0."""
    chamber = chamber_round(trimesh.creation.box(sides), gap=0.02)
    part = chamber.part
    faces, creases = find_faces(part.vertices, part.triangles, part.target)
    pieces = crease_pieces(creases, chamber_mesh(chamber), 0.5e-3, RADIUS)
    return faces, creases, pieces, unit_normals(part.vertices[part.triangles])


def band_of(
    sides: tuple[float, float, float], places: np.ndarray, dent: float = DENT, axis: int = 2
) -> CreaseBand | None:
    """The windows along creases of places (n, 3) [m] on a block's face that looks along an axis."""
    faces, creases, pieces, normals = block(sides)
    on = int(np.argmax(normals[:, axis]))
    face = np.full(len(places), faces.of_triangle[on])
    windows = Windows(Places(places, np.tile(np.eye(3)[axis], (len(places), 1)), face), RADIUS)
    return find_band(windows, creases, pieces, dent)


def test_the_pieces_of_an_edge_are_all_of_it() -> None:
    _, creases, pieces, _ = block(LONG)
    assert len(creases.ends) == 12
    for edge, ends in enumerate(creases.ends):
        own = pieces.edge == edge
        assert pieces.length[own].sum() == pytest.approx(8e-3, rel=1e-12)
        np.testing.assert_allclose(pieces.place[own].mean(axis=0), ends.mean(axis=0), atol=1e-12)


@pytest.mark.parametrize("far_mm", [0.0, 0.03, 0.0999])
def test_a_window_beside_an_edge_knows_its_distance_and_the_edge_on_both_sides(
    far_mm: float,
) -> None:
    far = 1e-3 * far_mm
    band = band_of(LONG, np.array([[4e-3 - far, 0.0, 4e-3]]))
    assert band is not None
    assert band.height == pytest.approx([far], abs=1e-12)
    assert band.length == pytest.approx([2 * CREASE_LENGTH * RADIUS], rel=2 / PIECES_PER_WINDOW)


def test_no_window_is_beside_an_edge_farther_than_a_dent_reaches() -> None:
    assert band_of(LONG, np.array([[4e-3 - 1.001 * DENT, 0.0, 4e-3]])) is None


def test_near_the_end_of_an_edge_only_what_there_is_of_it_counts() -> None:
    """1 mm from the corner the window along the edge has 1 mm on one side, and 1.5 on the other."""
    band = band_of(LONG, np.array([[4e-3 - 0.05e-3, 3e-3, 4e-3]]))
    assert band is not None
    assert band.length == pytest.approx([1e-3 + CREASE_LENGTH * RADIUS], rel=2 / PIECES_PER_WINDOW)


def test_an_edge_shorter_than_a_dent_counts_as_long_as_the_dent() -> None:
    """A dent at the upright edge of a thin plate is spread over its radius, not over 0.02 mm.

    So the share of a window that it takes is at most 2, however short the edge is.
    """
    beside = np.array([[4e-3, 4e-3 - 0.01e-3, 0.0]])
    for dent in (DENT, 2.0 * DENT):
        band = band_of(FLAT, beside, dent, axis=0)
        assert band is not None
        is_upright = band.length < 1e-3
        assert is_upright.sum() == 1
        assert band.length[is_upright] == pytest.approx(dent, rel=1e-12)
        # The long edges above and below the window are not changed by the dent.
        long = (4e-3 - beside[0, 1]) + CREASE_LENGTH * RADIUS
        assert band.length[~is_upright] == pytest.approx([long, long], rel=2 / PIECES_PER_WINDOW)


def test_windows_do_not_depend_on_the_order_of_their_middles() -> None:
    rng = np.random.default_rng(1)
    places = np.column_stack([rng.uniform(-4e-3, 4e-3, (4000, 2)), np.full(4000, 4e-3)])
    one, two = band_of(LONG, places), band_of(LONG, places[::-1])
    assert one is not None
    assert two is not None
    assert len(one.point) == len(two.point) > 150
    found = [
        sorted(zip(*places[band.point, :2].T, band.height, band.length, strict=True))
        for band, places in ((one, places), (two, places[::-1]))
    ]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-9, atol=1e-15)
    # The distance is that to one of the upper face's four edges.
    away = 4e-3 - np.abs(places[one.point, :2])
    assert (np.abs(away - one.height[:, None]).min(axis=1) < 1e-12).all()
