import numpy as np
import pytest
import trimesh

from chamberopt.geometry.cut import cut_at_box, facets, piece_beyond
from chamberopt.geometry.smoothing.divide import Surface
from chamberopt.geometry.triangles import areas, edge_keys


def surface_of(mesh: trimesh.Trimesh) -> Surface:
    return facets(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def area_inside(surface: Surface, box: np.ndarray) -> float:
    middle = surface.vertices[surface.triangles].mean(axis=1)
    inside = ((middle >= box[0]) & (middle <= box[1])).all(axis=1)
    return float(areas(surface.vertices, surface.triangles)[inside].sum())


@pytest.mark.parametrize("subdivisions", [0, 1, 3])
@pytest.mark.parametrize("seed", range(4))
def test_the_area_in_a_box_is_that_of_the_surface_however_it_is_divided(
    subdivisions: int, seed: int
) -> None:
    """The six faces of a cube, cut at a box whose low corner is in it: three squares' shares."""
    rng = np.random.default_rng(seed)
    cube = trimesh.creation.box((2.0, 2.0, 2.0))
    for _ in range(subdivisions):
        cube = cube.subdivide()
    corner = rng.uniform(-0.9, 0.9, 3)
    box = np.array([corner, [9.0, 9.0, 9.0]])
    cut = cut_at_box(surface_of(cube), box, np.ones(len(cube.faces), dtype=bool))
    x, y, z = 1.0 - corner
    assert area_inside(cut, box) == pytest.approx(x * y + y * z + z * x, rel=0.03)
    assert areas(cut.vertices, cut.triangles).sum() == pytest.approx(24.0)


def test_a_cut_surface_stays_closed_and_in_place() -> None:
    """Also where only some triangles are to be cut. Zones of a sphere: Archimedes' hat-box."""
    ball = trimesh.creation.icosphere(4)
    box = np.array([[-0.37, -9.0, -9.0], [0.51, 9.0, 9.0]])
    wanted = ball.triangles_center[:, 2] > 0.0
    for some in (wanted, np.ones_like(wanted)):
        cut = cut_at_box(surface_of(ball), box, some)
        _, times = np.unique(edge_keys(cut.triangles), return_counts=True)
        assert (times == 2).all()
        made = trimesh.Trimesh(cut.vertices, cut.triangles, process=False)
        assert made.is_watertight
        assert made.volume == pytest.approx(ball.volume, rel=1e-12)
        assert len(cut.triangles) > len(ball.faces)
        moved = areas(cut.vertices, cut.triangles)
        of_parent = np.bincount(cut.parent, moved, len(ball.faces))
        np.testing.assert_allclose(of_parent, ball.area_faces, rtol=1e-9)
    assert area_inside(cut, box) == pytest.approx(2.0 * np.pi * 0.88, rel=5e-3)
    np.testing.assert_allclose(np.linalg.norm(cut.normals, axis=2), 1.0)


def test_a_side_of_the_box_close_to_a_corner_makes_no_sliver() -> None:
    cube = trimesh.creation.box((2.0, 2.0, 2.0))
    box = np.array([[-9.0, -9.0, -9.0], [9.0, 9.0, 0.99]])
    surface = surface_of(cube)
    whole = cut_at_box(surface, box, np.ones(len(cube.faces), dtype=bool))
    assert len(whole.triangles) == len(cube.faces)


@pytest.mark.parametrize("least", [0.3, 2.0])
def test_a_piece_beyond_a_distance_lacks_a_disc(least: float) -> None:
    """Two triangles of a square of 10, and what is farther than a distance from its middle."""
    square = np.array([[-5.0, -5.0, 0.0], [5.0, -5.0, 0.0], [5.0, 5.0, 0.0], [-5.0, 5.0, 0.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])

    def distance(places: np.ndarray) -> np.ndarray:
        return np.asarray(np.linalg.norm(places, axis=1))

    vertices, kept, values = piece_beyond(square, triangles, distance, least, 2.0 * square)
    np.testing.assert_allclose(values, 2.0 * vertices, atol=1e-12)
    # The border is a polygon whose sides are up to 2 % of the distance too near.
    disc = 100.0 - areas(vertices, kept).sum()
    assert disc == pytest.approx(np.pi * least**2, rel=0.04)
    assert (distance(vertices) > 0.95 * least).all()
    assert trimesh.Trimesh(vertices, kept, process=False).euler_number == 0  # a ring
    assert len(piece_beyond(square, triangles, distance, 8.0, square)[1]) == 0
