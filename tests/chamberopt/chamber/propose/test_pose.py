"""The reason for a proposed pose says how evenly the target is exposed in it."""

from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.propose.pose import propose_pose


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
