"""Surfaces that must not be peened, by their names."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.checks.openings import Opening
from chamberopt.chamber.propose import proposed_mask
from chamberopt.chamber.propose.proposed_mask import NEVER, moved_openings, pads, sharp_edges
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


def test_sharp_edges_are_those_of_the_target_that_turn_outwards() -> None:
    """A step of 8 on a base: a top of 40 x 40 mm has four outer edges, its inner ones are none."""
    base, step = trimesh.creation.box((80, 80, 8)), trimesh.creation.box((40, 40, 8))
    step.apply_translation((0.0, 0.0, 8.0))
    both = trimesh.boolean.union([base, step])
    normal = both.face_normals[:, 2]
    top = (normal > 0.9) & (both.triangles_center[:, 2] > 11.0)
    ground = (normal > 0.9) & (both.triangles_center[:, 2] < 5.0)
    for target, length in ((top, 160.0), (ground, 320.0), (top | ground, 480.0)):
        assert sharp_edges(1e-3 * both.vertices, both.faces, target) == pytest.approx(1e-3 * length)
    ball = trimesh.creation.icosphere(3)
    assert sharp_edges(ball.vertices, ball.faces, np.ones(len(ball.faces), bool)) == 0.0


def test_openings_that_move_in_a_second_pose_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    here = Opening("the wall", (0.02, 0.01), (0.03, 0.0, 0.015), 0.02, (1.0, 0.0, 0.0))
    up = here._replace(place=(0.03, 0.0, 0.017))
    top = here._replace(wall="the ceiling")

    def told(*poses: list[Opening]) -> str:
        monkeypatch.setattr(proposed_mask, "find_openings", lambda step: step)
        return moved_openings(SimpleNamespace(steps=poses))  # type: ignore[arg-type]

    assert told() == told([here, top], [top, here]) == ""
    assert told([here], [up]).startswith(
        "OPENINGS MOVE in the second pose, one from (30, 0, 15) mm to (30, 0, 17) mm: a second wall"
    )
    assert " to none: " in told([here], [top])
    wider = here._replace(size=(0.02, 0.012))
    assert "OPENINGS MOVE" in told([here], [wider])
