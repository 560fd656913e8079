"""Surfaces that must not be peened, by their names."""

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.propose.proposed_mask import NEVER, pads
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.meshes.raw_mesh import number_by_position


@pytest.mark.parametrize(
    "name",
    ["BORE", "bores", "BOLT_HOLES", "hole_3", "M6 thread", "BEARING_SEAT", "keyway", "spline"],
)
def test_what_fits_to_other_parts_is_masked(name: str) -> None:
    assert NEVER.search(name)


@pytest.mark.parametrize("name", ["BASE", "wholesale", "SHANK", "boretto", "TIP", "FILLETS"])
def test_other_names_are_not(name: str) -> None:
    assert not NEVER.search(name)


def test_a_pad_stands_on_level_tops_beside_the_target() -> None:
    """A stair with tops of 20 x 30 and 40 x 30 mm, a wall and a target on the lower one."""
    body = trimesh.boolean.union(
        [
            trimesh.creation.box(bounds=((0, 0, 0), (60, 30, 10))),
            trimesh.creation.box(bounds=((0, 0, 0), (20, 30, 25))),
        ],
        engine="manifold",
    )
    triangles = body.faces.astype(np.int32)
    numbering = number_by_position(len(triangles))
    mesh = PartMesh(1e-3 * body.vertices, triangles, numbering, (), "", {})
    below = body.triangles_center[:, 2] < 1e-6
    both, one = pads(mesh, below, (0.0, 0.0, 0.0), 1e-3)
    assert [at["at_mm"][2] for at in both["faces"]] == [10.0, 25.0]  # the largest first
    assert one["faces"] == both["faces"][:1]
    lower = np.abs(body.triangles_center[:, 2] - 10.0) < 1e-6
    (only,) = pads(mesh, below | lower, (0.0, 0.0, 0.0), 1e-3)
    assert [at["at_mm"][2] for at in only["faces"]] == [25.0]
    assert pads(mesh, below, (30.0, 0.0, 0.0), 1e-3) == []
    assert pads(mesh, below, (0.0, 0.0, 0.0), 0.05) == []  # no ball finds room
