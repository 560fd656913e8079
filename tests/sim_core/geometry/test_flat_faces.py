"""Fine triangles on a flat face are one face to the ball.

Contacts are those of the fine mesh, and impacts are recorded on its triangles.
"""

import numpy as np
import pytest
import shapely
import trimesh

from sim_core import Balls, Gravity, Physics, Scene, TriangleMesh, simulate
from sim_core.detect.ball_mesh import first_contact, new_scratch
from sim_core.geometry import flat_faces
from sim_core.geometry.flat_faces import (
    LONE,
    LONG_OUTLINE,
    FlatFaces,
    Quadrangles,
    cover_with_quadrangles,
)
from sim_core.geometry.obstacle_set import ObstacleSet, build_obstacle_set
from sim_core.numerics.vec3 import Flight, Vec3
from sim_core.scene.invariants import clearance, contained
from tests.helpers.scenes.cavities import CEILING, WEIGHTLESS, box_around, cylinder

RADIUS = 1.5e-3


def fine(mesh: TriangleMesh, times: int) -> TriangleMesh:
    """Every triangle split in four so many times."""
    vertices, triangles, tags = mesh.vertices, mesh.triangles, mesh.tags
    for _ in range(times):
        vertices, triangles, parents = trimesh.remesh.subdivide(
            vertices, triangles, return_index=True
        )
        origin = np.empty(len(triangles), dtype=int)
        for old, new in parents.items():
            origin[new] = old
        tags = tags[origin]
    return TriangleMesh(vertices, triangles, tags)


def slanted_block() -> TriangleMesh:
    """A room with a block in it that lies along no axis: 24 edges' worth of flats, inside and
    outside.
    """
    block = trimesh.creation.box((0.02, 0.015, 0.01))
    block.apply_transform(trimesh.transformations.rotation_matrix(0.7, [0.3, 0.5, 0.8]))
    return box_around(block, 0.03)


def without_flat_faces(mesh: TriangleMesh, monkeypatch: pytest.MonkeyPatch) -> ObstacleSet:
    def none(corners: np.ndarray, *_: object) -> FlatFaces:
        return FlatFaces(
            np.full(len(corners), LONE, np.int32), np.zeros(0, np.int32), np.zeros((0, 3, 3)), []
        )

    with monkeypatch.context() as patch:
        patch.setattr(flat_faces, "find_flat_faces", none)
        return build_obstacle_set(mesh, (RADIUS,))


def places_for_a_ball(room: TriangleMesh, count: int, rng: np.random.Generator) -> np.ndarray:
    """Random places (count, 3) [m] in the cavity, clear of its surface."""
    places = rng.uniform(room.vertices.min(axis=0), room.vertices.max(axis=0), (8 * count, 3))
    places = places[contained(room, places)]
    return places[clearance(room.corners, places, 2 * RADIUS) > 1.01 * RADIUS][:count]


@pytest.mark.parametrize(
    "mesh", [fine(slanted_block(), 3), cylinder(0.03, 0.03, 48, 3)], ids=["block", "cylinder"]
)
def test_contacts_with_a_flat_are_those_with_its_triangles(
    mesh: TriangleMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    merged, split = build_obstacle_set(mesh, (RADIUS,)), without_flat_faces(mesh, monkeypatch)
    assert len(merged.tree.kinds) < 0.1 * len(split.tree.kinds)
    scratch, rng = new_scratch(), np.random.default_rng(1)
    for place in places_for_a_ball(mesh, 2000, rng) - mesh.middle:
        velocity = Vec3(*rng.normal(0.0, 3.0, 3).tolist())
        ball = Flight(Vec3(*place.tolist()), velocity, Vec3(*Gravity()))
        one, two = (
            first_contact(
                *(None, None, None, -1, surfaces.tree, scratch, ball),
                *(None, None, None, surfaces.face_overlap, 0.0, 0.1),
            )
            for surfaces in (merged, split)
        )
        speed = np.linalg.norm(ball.velocity) + 1.0
        assert (
            one[0] == two[0] or abs(one[0] - two[0]) * speed < 5e-12
        )  # metres along the path, for any angle


def test_a_hit_on_a_flat_is_booked_on_the_triangle_under_the_ball() -> None:
    room = fine(slanted_block(), 3)
    rng = np.random.default_rng(2)
    logs = []
    for place in places_for_a_ball(room, 300, rng):
        ball = Balls(place[None], rng.normal(0.0, 3.0, (1, 3)), 2 * RADIUS)
        logs.append(simulate(Scene(room, ball, Physics(WEIGHTLESS), duration=0.03)).impacts)
    triangle = np.concatenate([log.triangle for log in logs])
    centre = np.concatenate([log.position for log in logs])
    gap = [
        clearance(room.corners[[t]], c[None], 2 * RADIUS)[0]
        for t, c in zip(triangle, centre, strict=True)
    ]
    assert len(triangle) > 1000
    assert len(np.unique(triangle)) > 300
    assert (room.tags[triangle] == CEILING).any()
    np.testing.assert_allclose(gap, RADIUS, rtol=0, atol=1e-12)


def outline(*rings: list[tuple[float, float]]) -> np.ndarray:
    """Segments (n, 2, 2) of closed rings."""
    return np.concatenate(
        [np.stack([np.array(ring), np.roll(ring, -1, axis=0)], axis=1) for ring in rings]
    )


def some_star(seed: int, corners: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners))
    return np.column_stack([np.cos(angle), np.sin(angle)]) * rng.uniform(0.6, 1.0, corners)[:, None]


HOLE = np.array([[-0.1, -0.1], [0.2, -0.1], [0.2, 0.2], [-0.1, 0.2]])


def cover(*outlines: np.ndarray, areas: list[float]) -> Quadrangles:
    count = np.repeat(np.arange(len(outlines)), [len(one) for one in outlines])
    return cover_with_quadrangles(np.concatenate(outlines), count, np.array(areas))


def test_a_cover_fills_an_outline_with_holes_once() -> None:
    star = some_star(3, 200)
    region = shapely.Polygon(star, [HOLE])
    found = cover(outline(star.tolist(), HOLE.tolist()), areas=[region.area])
    assert found.covered.all()
    faces = shapely.polygons(found.corners)
    assert shapely.area(faces).sum() == pytest.approx(region.area, rel=1e-12)
    assert shapely.union_all(faces).symmetric_difference(region).area < 1e-12


def test_a_convex_outline_of_few_corners_is_a_fan() -> None:
    angle = 2.0 * np.pi * np.arange(6) / 6
    for corners, fans in ((3, 1), (4, 1), (5, 2), (6, 2)):
        ring = np.column_stack([np.cos(angle), np.sin(angle)])[:corners]
        area = shapely.Polygon(ring).area
        found = cover(outline(ring.tolist()), areas=[area])
        assert found.corners.shape == (fans, 4, 2)
        assert shapely.area(shapely.polygons(found.corners)).sum() == pytest.approx(area)


@pytest.mark.parametrize("corners", [60, LONG_OUTLINE])
def test_outlines_are_covered_together_as_each_alone(corners: int) -> None:
    star = some_star(4, corners)
    outlines = [
        outline(star.tolist(), HOLE.tolist()),
        outline([(0, 0), (1, 1), (1, 0), (0, 1)]),  # crosses itself
        outline(HOLE.tolist()),
        outline([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]),
    ]
    outlines.append(2.0 * outlines[0])
    areas = [shapely.Polygon(star, [HOLE]).area, 1.0, 0.09, 3.0]
    areas.append(4.0 * areas[0])
    whole = cover(*outlines, areas=areas)
    assert whole.covered.tolist() == [True, False, True, True, True]
    assert (np.diff(whole.outline) >= 0).all()
    for k, one in enumerate(outlines):
        alone = cover(one, areas=[areas[k]])
        np.testing.assert_array_equal(alone.corners, whole.corners[whole.outline == k])


def test_an_outline_that_crosses_itself_is_left_to_its_triangles() -> None:
    found = cover(outline([(0, 0), (1, 1), (1, 0), (0, 1)]), areas=[1.0])
    assert not found.covered.any()
    assert not len(found.corners)
