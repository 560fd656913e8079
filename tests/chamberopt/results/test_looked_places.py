"""Places to look at, of made-up coverage fields."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.results.looked_places import looked_places


def test_a_place_to_look_at_is_off_the_edges_whatever_the_facets_are() -> None:
    """A block's top of 40 x 10 mm is two triangles, with vertices at its ends alone.

    Its dents are fewest at its lower end along x. Patches are 5 x 5 mm, so that the first is 2.5 mm
    off that end and off a side. Its coverage is between those at the ends, linearly.
    """
    block = trimesh.creation.box(bounds=[[0.0, 0.0, -0.01], [0.04, 0.01, 0.0]])
    vertices, triangles = np.asarray(block.vertices), np.asarray(block.faces)
    top = (vertices[triangles][..., 2] > -1e-9).all(axis=1)
    mesh = SimpleNamespace(
        vertices=np.array([[0, 0, 0], [0.04, 0, 0], [0.04, 0.01, 0], [0, 0.01, 0]]),
        triangles=np.array([[0, 1, 2], [0, 2, 3]]),
        normal=np.tile([0.0, 0.0, 1.0], (4, 1)),
        face=np.zeros(4, dtype=int),
        part_triangle=np.flatnonzero(top),
    )
    fields = {"reachable": np.ones(4), "resolved": np.ones(4)}
    fields["dent_density"] = np.array([1.0, 2.0, 2.0, 1.0])
    part = SimpleNamespace(target=top, vertices=vertices, triangles=triangles)
    arrays: Any = SimpleNamespace(
        display=SimpleNamespace(mesh=mesh, fields=fields), chamber=SimpleNamespace(part=part)
    )
    first, *_ = looked_places(arrays, 1e-6)
    assert first.at[0] == pytest.approx(2.5e-3, abs=0.5e-3)
    assert min(first.at[1], 0.01 - first.at[1]) == pytest.approx(2.5e-3, abs=0.5e-3)
    low, high = 1.0 - np.exp(-1.0), 1.0 - np.exp(-2.0)
    assert first.coverage(1.0) == pytest.approx(low + (high - low) * 2.5 / 40.0, abs=0.01)
    assert first.normal == pytest.approx([0.0, 0.0, 1.0])
