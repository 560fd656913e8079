"""Places to look at, of made-up coverage fields."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.design.shape_surface import TAG_PART, TAG_WALL
from chamberopt.results.looked_places import looked_places

TAGS = {True: TAG_PART, False: TAG_WALL}


def strip_before(is_part: bool) -> Any:
    """A strip of 40 x 10 mm, whose vertices lie at its ends alone, in a room 20 mm high.

    It is the room's floor, and its dents are fewest at its lower end along x.

    Args:
        is_part: whether the ceiling is of the part.
    """
    room = trimesh.creation.box(bounds=[[0.0, 0.0, 0.0], [0.04, 0.01, 0.02]])
    vertices, triangles = np.asarray(room.vertices), np.asarray(room.faces)
    heights = vertices[triangles][..., 2]
    tags = np.where((heights < 1e-9).all(axis=1), TAG_PART, TAG_WALL).astype(np.uint8)
    tags[(heights > 0.02 - 1e-9).all(axis=1)] = TAGS[is_part]
    corners = np.array([[0.0, 0.0, 0.0], [0.04, 0.0, 0.0], [0.04, 0.01, 0.0], [0.0, 0.01, 0.0]])
    mesh = SimpleNamespace(
        vertices=corners,
        triangles=np.array([[0, 1, 2], [0, 2, 3]]),
        normal=np.tile([0.0, 0.0, 1.0], (4, 1)),
        face=np.zeros(4, dtype=int),
        part_triangle=np.array([0, 1]),
    )
    fields = {"reachable": np.ones(4), "resolved": np.ones(4)}
    fields["dent_density"] = np.array([1.0, 2.0, 2.0, 1.0])
    part = SimpleNamespace(target=np.ones(2, dtype=bool))
    chamber = SimpleNamespace(vertices=vertices, triangles=triangles, tags=tags, part=part)
    return SimpleNamespace(display=SimpleNamespace(mesh=mesh, fields=fields), chamber=chamber)


@pytest.mark.parametrize("is_part", [True, False])
def test_a_place_to_look_at_is_off_the_edges_whatever_the_facets_are(is_part: bool) -> None:
    """Patches are 5 x 5 mm, so that the first is 2.5 mm off the end and 2.5 mm off a side.

    Its coverage is between those at the ends, linearly. What is in front of it is the ceiling.
    """
    first, *_ = looked_places(strip_before(is_part), 1e-6)
    assert first.at[0] == pytest.approx(2.5e-3, abs=0.5e-3)
    assert min(first.at[1], 0.01 - first.at[1]) == pytest.approx(2.5e-3, abs=0.5e-3)
    low, high = 1.0 - np.exp(-1.0), 1.0 - np.exp(-2.0)
    assert first.coverage(1.0) == pytest.approx(low + (high - low) * 2.5 / 40.0, abs=0.01)
    assert first.normal == pytest.approx([0.0, 0.0, 1.0])
    assert first.faces_part == is_part
