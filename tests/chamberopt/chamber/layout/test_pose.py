"""The reason for a proposed pose says how evenly the target is exposed in it."""

from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.layout.pose import pose_in_words, propose_pose, square_poses
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
