"""Faces and creases of bodies whose faces and edges can be counted."""

import numpy as np
import pytest
import trimesh

from chamberopt.coverage.field.smooth_faces import DIVISIONS, Creases, Faces, find_faces


def divided(mesh: trimesh.Trimesh, target: np.ndarray | None = None) -> tuple[Faces, Creases]:
    wanted = np.ones(len(mesh.faces), dtype=bool) if target is None else target
    return find_faces(np.asarray(mesh.vertices), np.asarray(mesh.faces), wanted)


def faces_of(mesh: trimesh.Trimesh, target: np.ndarray | None = None) -> tuple[np.ndarray, Creases]:
    """The faces and creases of a mesh whose edges are sharp or smooth by all divisions."""
    faces, creases = divided(mesh, target)
    assert len(faces.joined) == len(creases.line) == 1
    return faces.of_triangle, creases._replace(line=creases.line[0])


def crease_length(creases: Creases) -> float:
    return float(np.linalg.norm(creases.ends[:, 1] - creases.ends[:, 0], axis=1).sum())


def roof(turn: float) -> trimesh.Trimesh:
    """Two strips of 1 by 4 that meet in the y axis, each divided in 8; turn > 0 is convex."""
    slope = np.radians(0.5 * turn)
    y = np.linspace(0.0, 4.0, 5)
    row = [
        np.stack([np.full(5, x * np.cos(slope)), y, np.full(5, -abs(x) * np.sin(slope))], axis=1)
        for x in (-1.0, 0.0, 1.0)
    ]
    a = np.concatenate([np.arange(4), np.arange(5, 9)])
    triangles = np.concatenate(
        [np.stack([a, a + 5, a + 1], axis=1), np.stack([a + 1, a + 5, a + 6], axis=1)]
    )
    return trimesh.Trimesh(np.concatenate(row), triangles, process=False)


def test_a_box_has_six_faces_and_twelve_creases_that_are_lines_of_their_own() -> None:
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    face, creases = faces_of(box)
    assert len(set(face)) == 6
    assert len(creases.ends) == 12
    assert len(set(creases.line)) == 12
    assert crease_length(creases) == pytest.approx(4 * (1 + 2 + 3))
    for own in set(face):
        normals = box.face_normals[face == own]
        assert np.allclose(normals, normals[0])
    # Outward of an edge of a box is away from its middle, at 45 degrees to both sides.
    middle = creases.ends.mean(axis=1)
    assert (np.einsum("ij,ij->i", creases.outward, middle) > 0.0).all()
    assert np.allclose(np.sort(np.abs(creases.outward), axis=1), [0.0, 0.5**0.5, 0.5**0.5])
    assert (creases.faces[:, 0] != creases.faces[:, 1]).all()


def test_a_cylinder_has_three_faces_and_two_round_lines() -> None:
    cylinder = trimesh.creation.cylinder(1.0, 3.0, sections=64)
    face, creases = faces_of(cylinder)
    assert len(set(face)) == 3
    assert len(creases.ends) == 128
    assert len(set(creases.line)) == 2
    assert crease_length(creases) == pytest.approx(2 * 64 * 2 * np.sin(np.pi / 64))


@pytest.mark.parametrize("kind", ["box", "cylinder"])
def test_splitting_triangles_changes_no_face_and_no_crease(kind: str) -> None:
    whole = (
        trimesh.creation.box((1.0, 2.0, 3.0))
        if kind == "box"
        else trimesh.creation.cylinder(1.0, 3.0, sections=32)
    )
    face, creases = faces_of(whole)
    area = np.bincount(face, whole.area_faces)
    for times in (1, 2):
        split = whole.copy()
        for _ in range(times):
            split = split.subdivide()
        finer, more = faces_of(split)
        assert np.sort(np.bincount(finer, split.area_faces)) == pytest.approx(np.sort(area))
        assert len(set(more.line)) == len(set(creases.line))
        assert crease_length(more) == pytest.approx(crease_length(creases))
        assert len(more.ends) == 2**times * len(creases.ends)


@pytest.mark.parametrize(
    ("turn", "faces", "creases"),
    [(30.0, 1, 0), (50.0, 2, 4), (90.0, 2, 4), (-41.0, 1, 0), (-50.0, 1, 0), (-70.0, 2, 0)],
)
def test_edges_divide_by_how_sharply_they_turn(turn: float, faces: int, creases: int) -> None:
    """Convex edges are creases from 50 degrees on; hollow ones divide from 70 on and are none."""
    found, sharp = faces_of(roof(turn))
    assert len(set(found)) == faces
    assert len(sharp.ends) == creases
    assert len(set(sharp.line)) == min(creases, 1)


@pytest.mark.parametrize("turn", [32.0, 38.5, 40.0, 41.5, 49.0, -52.0, -60.0, -66.0])
def test_edges_of_a_middling_turn_divide_for_a_share_of_the_windows(turn: float) -> None:
    """From no window at 30 degrees to all at 50, and at hollow edges from 50 to 70."""
    faces, creases = divided(roof(turn))
    wanted = (turn - 30.0) / 20.0 if turn > 0.0 else (-turn - 50.0) / 20.0
    whole = (faces.joined == faces.joined[:, :1]).all(axis=1)
    assert whole.tolist() == [False, True]
    assert faces.shares[0] == pytest.approx(wanted, abs=0.5 / DIVISIONS + 1e-9)
    for count in (100, 2000, 20_000):
        seen = faces.divisions(count)
        for some in (seen, seen[::2], seen[3::10]):
            assert (some == 0).mean() == pytest.approx(wanted, abs=2.0 / len(some) + 0.02)
    if turn > 0.0:
        assert (creases.line >= 0).tolist() == [[True] * 4, [False] * 4]


def test_corners_of_a_line_divide_it_for_a_share_of_the_windows() -> None:
    """The rim of an octagonal prism turns by 45 degrees at each corner, and so do its sides."""
    prism = trimesh.creation.cylinder(1.0, 3.0, sections=8)
    faces, creases = divided(prism)
    lines = [len(set(line[line >= 0])) for line in creases.line]
    assert faces.shares[lines.index(8 + 16)] == 0.5  # the rims in pieces, the sides apart
    assert faces.shares[lines.index(2)] == 0.25  # round rims, one side
    assert faces.shares[lines.index(8 + 2)] == 0.25


def test_the_border_of_the_target_divides_faces_but_is_no_crease() -> None:
    box = trimesh.creation.box((1.0, 2.0, 3.0)).subdivide()
    upper = box.triangles_center[:, 2] > 0.0
    face, creases = faces_of(box, upper)
    assert len(set(face)) == 6 + 4
    assert not set(face[upper]) & set(face[~upper])
    # The upper half has the four edges of its top and half of the four that stand on it.
    assert len(creases.ends) == 12
    assert crease_length(creases) == pytest.approx(2 * (1 + 2) + 4 * 1.5)


def test_triangles_know_the_creases_at_their_sides_and_corners() -> None:
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    _, creases = faces_of(box)
    triangles, vertices = np.asarray(box.faces), np.asarray(box.vertices)
    assert (creases.of_triangle >= 0).sum() == 2 * 12
    for triangle, side in np.argwhere(creases.of_triangle >= 0):
        ends = creases.ends[creases.of_triangle[triangle, side]]
        own = vertices[triangles[triangle, [side, (side + 1) % 3]]]
        assert sorted(map(tuple, ends)) == sorted(map(tuple, own))
    assert (creases.at_corner >= 0).all()
    for triangle, corner in np.ndindex(creases.at_corner.shape):
        ends = creases.ends[creases.at_corner[triangle, corner]]
        assert np.linalg.norm(ends - vertices[triangles[triangle, corner]], axis=1).min() == 0.0
