"""From where a chosen part of a surface is seen best: boxes, and a box below a roof."""

import numpy as np
import pytest
import trimesh

from chamberopt.geometry.sight import way_to_see


@pytest.mark.parametrize(
    ("normal", "height"), [([0, 0, -1], -40.0), ([0, 0, 1], 40.0), ([1, 0, 0], 20.0)]
)
def test_a_face_of_a_box_is_seen(normal: list[float], height: float) -> None:
    box = trimesh.creation.box([2.0, 2.0, 2.0])
    way = way_to_see(box.vertices, box.faces, box.face_normals @ normal > 0.9)
    assert np.linalg.norm(way) == pytest.approx(1.0)
    assert np.degrees(np.arcsin(way[2])) == pytest.approx(height)
    assert way @ normal > 0.5


def test_what_a_roof_hides_is_seen_from_below() -> None:
    """The top of a small box is near to a wide roof, through which it cannot be seen."""
    box = trimesh.creation.box([4.0, 4.0, 1.0])
    roof = trimesh.creation.box([9.0, 9.0, 0.1])
    roof.apply_translation([0.0, 0.0, 4.0])
    both = trimesh.util.concatenate(box, roof)
    chosen = np.arange(len(both.faces)) < len(box.faces)
    top = chosen & (both.face_normals[:, 2] > 0.9)
    assert 0.0 < way_to_see(both.vertices, both.faces, top)[2] < 0.5  # below the roof's border
    roof.apply_translation([0.0, 0.0, -3.0])  # close above
    near = trimesh.util.concatenate(box, roof)
    assert way_to_see(near.vertices, near.faces, chosen & (near.face_normals[:, 2] < -0.9))[2] < 0


def test_without_a_target_the_eye_is_at_the_usual_place() -> None:
    box = trimesh.creation.box()
    usual = way_to_see(box.vertices, box.faces, np.zeros(len(box.faces), dtype=bool))
    assert usual == pytest.approx([0.497, -0.798, 0.342], abs=1e-3)
