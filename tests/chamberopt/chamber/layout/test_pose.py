"""The reason for a proposed pose says how evenly the target is exposed in it."""

from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.layout.pose import (
    Upright,
    axis_down,
    end_to_wall,
    hanging_pose,
    pose_by_size,
    pose_in_words,
    propose_pose,
    square_poses,
    square_to_walls,
    turns_down,
)
from chamberopt.chamber.layout.target import Surface
from chamberopt.geometry.triangles import rotation_matrix
from tests.chamberopt.chamber.layout.test_arbor import drum, part_of


@pytest.mark.parametrize(
    ("body", "is_target", "alike"),
    [
        (trimesh.creation.cylinder(5.0, 40.0, sections=64), lambda n: np.abs(n[:, 2]) < 0.5, True),
        (trimesh.creation.box((30.0, 20.0, 10.0)), lambda n: np.abs(n[:, 1]) > 0.5, True),
        (trimesh.creation.icosphere(3), lambda n: n[:, 0] < 2.0, False),
    ],
)
def test_only_what_stands_upright_has_all_its_sides_exposed_alike(
    body: trimesh.Trimesh, is_target: Callable[[np.ndarray], np.ndarray], alike: bool
) -> None:
    """A ball looks all ways: no pose exposes all of it alike."""
    target = is_target(body.face_normals)
    _, reason = propose_pose(1e-3 * np.asarray(body.vertices), np.asarray(body.faces), target)
    assert ("exposed alike" in reason) is alike


@pytest.mark.parametrize("turn", [85.0, -85.0, 30.0])
def test_a_turn_about_the_vertical_is_told_with_its_way(turn: float) -> None:
    mesh, _ = part_of(drum(10.0, 20.0))
    words = pose_in_words(mesh, [], (0.0, 0.0, turn))
    assert f"turned by {abs(turn):g} degrees about the vertical" in words
    assert words.endswith(", clockwise as seen from above") == (turn < 0.0)


def test_square_poses_are_those_near_a_tilted_one() -> None:
    assert square_poses((0.0, 0.0, 30.0)) == square_poses((90.0, 0.0, 0.0)) == []
    for turns, count in (((0.0, 30.0, 0.0), 1), ((0.0, 45.0, 0.0), 2), ((35.3, 45.0, 0.0), 1)):
        found = square_poses(turns)
        assert len(found) == count
        for one in found:
            assert not np.remainder(one, 90.0).any()
            cosine = rotation_matrix(one)[2] @ rotation_matrix(turns)[2]
            assert cosine > 0.6


AXES = [sign * np.eye(3)[k] for k in range(3) for sign in (1.0, -1.0)]


def random_ways(count: int) -> np.ndarray:
    ways = np.random.default_rng(4).normal(size=(count, 3))
    return np.asarray(ways / np.linalg.norm(ways, axis=1, keepdims=True))


def test_turns_bring_a_direction_down_and_none_is_about_the_vertical() -> None:
    for way in [*AXES, *random_ways(20)]:
        turns = turns_down(way)
        assert rotation_matrix(turns) @ way == pytest.approx([0, 0, -1], abs=1e-5)
        assert turns[2] == 0.0
        assert not (np.signbit(turns) & (np.array(turns) == 0.0)).any()


def test_the_axis_that_is_down_is_named_up_to_half_a_degree() -> None:
    for way, name in zip(AXES, ("+x", "-x", "+y", "-y", "+z", "-z"), strict=True):
        x, y, z = turns_down(way)
        for turn in (0.0, 70.0):
            assert axis_down((x, y, turn)) == name
        assert axis_down((x, y + 0.4, z)) == name
        assert axis_down((x, y + 0.6, z)) == ""


def test_a_flat_target_is_turned_down_however_it_is_drawn() -> None:
    """To the face itself, or to the axis of the file next to it where that is hardly worse."""
    box = trimesh.creation.box((3.0, 2.0, 1.0)).subdivide()
    target = box.face_normals[:, 2] > 0.5
    for way in random_ways(10):
        turned = np.linalg.inv(rotation_matrix(turns_down(way)))  # the face looks along -way
        turns, reason = propose_pose(box.vertices @ turned.T, np.asarray(box.faces), target)
        faces = rotation_matrix(turns) @ turned @ [0.0, 0.0, 1.0]
        steepest = np.abs(way).max()  # cosine to the nearest axis
        assert -faces[2] == pytest.approx(1.0 if steepest < 0.8 else max(-faces[2], steepest))
        assert reason == "the target faces the sonotrode"


@pytest.mark.parametrize("height", [1.5, 1.7, 8.0])
def test_a_long_part_hangs_if_its_sides_are_the_target(height: float) -> None:
    """One is long from 1.6 times its width on."""
    bar = trimesh.creation.box((1.0, height, 1.0))
    vertices, triangles, normal = np.asarray(bar.vertices), np.asarray(bar.faces), bar.face_normals
    sides = np.abs(normal[:, 1]) < 0.5
    lying, standing = (0.0, 0.0, 0.0), (90.0, 0.0, 0.0)
    found = hanging_pose(vertices, triangles, sides, lying)
    assert (found is None) == (height < 1.6)
    if found is not None:
        assert abs(rotation_matrix(found)[2, 1]) == pytest.approx(1.0)
    assert hanging_pose(vertices, triangles, sides, standing) is None
    # Lying, one side alone is hit squarely, which hanging takes half of.
    assert hanging_pose(vertices, triangles, normal[:, 2] < -0.5, lying) is None
    for sign in (1.0, -1.0):  # an end looks down
        found = hanging_pose(vertices, triangles, sign * normal[:, 1] > 0.5, lying)
        if height > 1.6:
            assert found is not None
            assert rotation_matrix(found) @ [0.0, sign, 0.0] == pytest.approx([0, 0, -1], abs=1e-6)


@pytest.mark.parametrize(("pose", "upright"), [("lying", 1.0), ("on-edge", 2.0), ("standing", 3.0)])
def test_a_part_stands_or_lies_by_its_sizes_with_its_target_down(
    pose: Upright, upright: float
) -> None:
    for sizes in ((1.0, 2.0, 3.0), (3.0, 1.0, 2.0), (2.0, 3.0, 1.0)):
        box = trimesh.creation.box(sizes)
        for way in AXES:
            target = box.face_normals @ way > 0.5
            turns = pose_by_size(np.asarray(box.vertices), np.asarray(box.faces), target, pose)
            turned = box.vertices @ rotation_matrix(turns).T
            assert np.ptp(turned[:, 2]) == pytest.approx(upright)
            if sizes[int(np.abs(way).argmax())] == upright:
                assert rotation_matrix(turns) @ way == pytest.approx([0, 0, -1], abs=1e-6)


@pytest.mark.parametrize("angle", [0.0, 30.0, 45.0, 60.0, 90.0, 100.0, 33.0, 71.3])
def test_the_long_side_is_turned_along_x_by_a_simple_turn(angle: float) -> None:
    bar = trimesh.creation.box((5.0, 1.0, 2.0))
    vertices = bar.vertices @ rotation_matrix((0.0, 0.0, angle)).T
    for turns in ((0.0, 0.0, 0.0), (180.0, 0.0, 0.0)):
        found = square_to_walls(vertices, turns)
        assert found[:2] == turns[:2]
        assert -90.0 < found[2] <= 90.0
        x, y, _ = np.ptp(vertices @ rotation_matrix(found).T, axis=0)
        assert x * y <= 5.0 * 1.05 + 1e-9
        assert x > 4.0 > y
        if angle % 15.0 == 0.0:
            assert (x, y) == pytest.approx((5.0, 1.0))
    assert square_to_walls(bar.vertices, (0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)


def test_a_level_axis_is_turned_along_x() -> None:
    for way in random_ways(10):
        turns = turns_down(way)
        level = np.linalg.inv(rotation_matrix(turns)) @ [0.6, -0.8, 0.0]
        found = end_to_wall(turns, level)
        assert found[:2] == turns[:2]
        assert rotation_matrix(found) @ level == pytest.approx([1, 0, 0], abs=1e-5)


def test_a_pose_is_told_by_what_is_level_in_it() -> None:
    """A drum, of whose faces the upper end and the side are known; the side is not flat."""
    mesh, body = part_of(drum(10.0, 20.0))
    is_end = body.face_normals[:, 2] > 0.5
    known = [
        Surface(name, {"faces": [{}]}, rows, "")
        for name, rows in (("side", ~is_end), ("end", is_end))
    ]
    for turns, words in (
        ((0.0, 0.0, 0.0), "as drawn"),
        ((180.0, 0.0, 0.0), "the file's +z down, end level facing down"),
        ((180.4, 0.0, 0.0), "the file's +z down, end level facing down"),
        ((0.0, 0.0, 45.0), "the file's -z down, end level facing up, turned by 45 degrees"),
        ((0.0, 90.0, 0.0), "the file's +x down"),
        ((20.0, 0.0, 0.0), "end tilted by 20 degrees"),
        ((160.0, 0.0, 0.0), "end tilted by 20 degrees"),
    ):
        found = pose_in_words(mesh, known, turns)
        assert found.removesuffix(" about the vertical") == words
    assert pose_in_words(mesh, known[:1], (20.0, 30.0, 0.0)) == (
        "turned by 20 degrees about x, then 30 degrees about y"
    )
