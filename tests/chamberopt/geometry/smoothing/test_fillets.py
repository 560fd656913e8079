"""Fillets of files without faces: their radius, area and number, however the facets are cut."""

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.meshes.raw_mesh import number_by_position
from chamberopt.geometry.smoothing import fillets
from chamberopt.geometry.smoothing.fillets import face_at, faces_of, fillets_of
from chamberopt.geometry.triangles import areas, rotation_matrix
from tests.chamberopt.geometry.smoothing.test_exact_solids import BALL, BLOCKS, SHAFT, TORUS
from tests.helpers.scenes.rounded_solids import Mesh, Solid, circle, outline


def part(mesh: Mesh) -> PartMesh:
    vertices, triangles = mesh
    numbers = number_by_position(len(triangles))
    return PartMesh(vertices, np.asarray(triangles, np.int32), numbers, (), "")


def area_of(mesh: PartMesh, fillet: int) -> float:
    own = fillets_of(mesh).of_triangle == fillet
    return float(areas(mesh.vertices, mesh.triangles)[own].sum())


@pytest.mark.parametrize("degrees", [5.0, 10.0, 22.5, 30.0])
@pytest.mark.parametrize("times", BLOCKS)
def test_a_fillet_of_a_block_is_found(times: float, degrees: float) -> None:
    mesh = part(BLOCKS[times].strips(np.radians(degrees)))
    (curvature,) = fillets_of(mesh).curvature
    assert curvature * times * BALL == pytest.approx(1.0, abs=0.02)
    quarter = 0.5 * np.pi * times * BALL * 10 * BALL
    assert area_of(mesh, 0) == pytest.approx(quarter, rel=0.02)


@pytest.mark.parametrize("degrees", [10.0, 22.5])
def test_the_fillet_of_a_shaft_goes_all_round(degrees: float) -> None:
    mesh = part(SHAFT.strips(np.radians(degrees)))
    (curvature,) = fillets_of(mesh).curvature
    assert curvature * 1.5 * BALL == pytest.approx(1.0, abs=0.05)
    # a quarter of a circle of 1.5 r round an axis, its centre 7.5 r off: Pappus
    middle = 7.5 * BALL - 1.5 * BALL * 2.0 / np.pi
    exact = 0.5 * np.pi * 1.5 * BALL * 2.0 * np.pi * middle
    assert area_of(mesh, 0) == pytest.approx(exact, rel=0.05)


@pytest.mark.parametrize("change", ["divided", "shuffled", "turned", "irregular"])
def test_the_cut_of_the_facets_does_not_count(change: str) -> None:
    vertices, triangles = BLOCKS[1.5].strips(np.radians(22.5))
    if change == "divided":
        vertices, triangles = trimesh.remesh.subdivide(vertices, triangles)
        vertices, triangles = trimesh.remesh.subdivide(vertices, triangles)
    if change == "shuffled":
        triangles = np.random.default_rng(1).permutation(triangles)
    if change == "turned":
        vertices = vertices @ rotation_matrix((17.0, 40.0, 5.0)).T + 0.03
    if change == "irregular":
        vertices, triangles = BLOCKS[1.5].irregular(np.radians(15.0), 4e-3)
    mesh = part((vertices, triangles))
    (curvature,) = fillets_of(mesh).curvature
    assert curvature * 1.5 * BALL == pytest.approx(1.0, abs=0.05)
    quarter = 0.5 * np.pi * 1.5 * BALL * 10 * BALL
    assert area_of(mesh, 0) == pytest.approx(quarter, rel=0.03)


@pytest.mark.parametrize(
    "solid",
    [
        pytest.param(Solid(circle(5 * BALL), 10 * BALL), id="a cylinder"),
        pytest.param(TORUS, id="the inside of a coil, which bulges more than it is hollow"),
        pytest.param(
            Solid(outline([(4e-3, 0), (9e-3, 0), (9e-3, 9e-3), (4e-3, 9e-3)])),
            id="a bore, which ends at sharp edges",
        ),
        pytest.param(
            Solid(
                outline([(0, 0), (20 * BALL, 0), (20 * BALL, 5 * BALL), (10 * BALL, 5 * BALL),
                         (8 * BALL, 7 * BALL), (8 * BALL, 15 * BALL), (0, 15 * BALL)]),
                10 * BALL,
            ),
            id="a bevel of 45 degrees",
        ),
    ],
)  # fmt: skip
def test_what_is_no_fillet(solid: Solid) -> None:
    assert not len(fillets_of(part(solid.strips(np.radians(15.0)))).curvature)


@pytest.mark.parametrize(
    "edge",
    [pytest.param(1.2, marks=pytest.mark.long), 1.7, pytest.param(2.3, marks=pytest.mark.long)],
)
def test_the_bore_of_a_grids_mesh_is_none(edge: float) -> None:
    """Its triangles are irregular and its ends ragged, as those of a scan are."""

    def depth(x: float, y: float, z: float) -> float:
        return -max(abs(np.hypot(y, z) - 14.0) - 3.0, abs(x) - 20.0)

    mesh = Manifold.level_set(depth, (-25, -20, -20, 25, 20, 20), edge, 0.0).to_mesh()
    solid = 1e-3 * mesh.vert_properties.astype(float), np.asarray(mesh.tri_verts)
    assert not len(fillets_of(part(solid)).curvature)


def test_a_bowl_is_none() -> None:
    """It is hollow both ways, and goes on smoothly over its rounded rim."""
    low, rim = np.radians(np.linspace(-90, -30, 13)), np.radians(np.linspace(150, 90, 13))
    bowl = np.column_stack([12.0 * np.cos(low), 12.0 * np.sin(low)])
    middle = 15.0 * np.array([np.cos(low[-1]), np.sin(low[-1])])
    edge = middle + 3.0 * np.column_stack([np.cos(rim), np.sin(rim)])
    profile = np.concatenate([bowl, edge[1:], [[25.0, edge[-1, 1]], [25.0, -20.0], [0.0, -20.0]]])
    body = trimesh.creation.revolve(1e-3 * profile[::-1], sections=64)
    assert body.is_watertight
    assert not len(fillets_of(part((body.vertices, body.faces))).curvature)


def test_a_fillet_beside_a_face_that_is_a_little_hollow_is_found() -> None:
    """An upright plate, a fillet of 3 mm, and a floor that rises along a radius of 100 mm."""
    turn, rise = np.radians(np.linspace(180, 270, 10)), np.linspace(0.0, 0.3, 12)
    fillet = np.column_stack([3.0 + 3.0 * np.cos(turn), 3.0 + 3.0 * np.sin(turn)])
    floor = np.column_stack([3.0 + 100.0 * np.sin(rise), 100.0 - 100.0 * np.cos(rise)])
    back = [[floor[-1, 0], -10.0], [-10.0, -10.0], [-10.0, 40.0], [0.0, 40.0]]
    section = CrossSection([np.concatenate([fillet, floor[1:], back])[::-1]])
    mesh = section.extrude(30.0).to_mesh()
    solid = 1e-3 * mesh.vert_properties.astype(float), np.asarray(mesh.tri_verts)
    (curvature,) = fillets_of(part(solid)).curvature
    assert 3e-3 * curvature == pytest.approx(1.0, abs=0.1)


def test_of_a_large_scan_none_is_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fillets, "MOST_TRIANGLES", 10)
    mesh = part(BLOCKS[3.0].strips(np.radians(15.0)))
    assert not len(fillets_of(mesh).curvature)
    with pytest.raises(InputError, match="no fillet there, or the part has over 10 triangles"):
        face_at(mesh, faces_of(mesh, "fillet"), "fillet", np.zeros(3))


def test_a_place_beside_a_fillet_is_refused() -> None:
    mesh = part(BLOCKS[3.0].strips(np.radians(15.0)))
    faces = faces_of(mesh, "fillet")
    own = fillets_of(mesh).of_triangle == 0
    inside = mesh.vertices[mesh.triangles[own][0]].mean(axis=0)
    face, away = face_at(mesh, faces, "fillet", inside)
    assert away < 1e-9
    assert ((faces.of_triangle == face) == own).all()
    with pytest.raises(InputError, match="no fillet there"):
        face_at(mesh, faces, "fillet", mesh.vertices[mesh.vertices[:, 1].argmax()])
