"""Places that are named in messages."""

from dataclasses import replace

import numpy as np
import trimesh

from chamberopt.chamber.checks.place_names import (
    CEILING,
    PART_SIDE,
    SIDE_WALL,
    SONOTRODE,
    UNDERSIDE,
    UPPER_SIDE,
    around,
    mm2,
    one_of,
    surface_names,
)
from chamberopt.design.shapes import TAG_PART, TAG_SONOTRODE
from chamberopt.geometry.triangles import area_vectors
from tests.helpers.synthetic import chamber_round


def test_the_place_named_of_a_ring_lies_on_it() -> None:
    """Points of the bore are nearer to the ring's middle, and have no weight."""
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    round_it = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    points = 1e-3 * np.concatenate([8.0 * round_it, 25.0 * round_it])
    named = one_of(points, np.repeat([0.0, 1.0], len(angle)))
    x, y, _ = map(float, named.strip("() m").split(", "))
    assert abs(np.hypot(x, y) - 25.0) < 0.1


def test_surfaces_are_named_by_what_they_are_and_the_way_they_look() -> None:
    """A roof of 59 or 61 degrees is an upper side or a side; the room's floor is a ledge."""
    for slope, name in ((59.0, UPPER_SIDE), (61.0, PART_SIDE)):
        rise = np.tan(np.radians(slope))
        tent = trimesh.convex.convex_hull([[-1, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0],
                                           [0, -1, rise], [0, 1, rise]])  # fmt: skip
        chamber = chamber_round(trimesh.Trimesh(1e-2 * tent.vertices, tent.faces))
        names, up = surface_names(chamber), -area_vectors(chamber.vertices, chamber.triangles)[:, 2]
        part = chamber.tags == TAG_PART
        assert set(names[part & (up > 1e-9)]) == {name}
        assert set(names[part & (up < -1e-9)]) == {UNDERSIDE}
        assert set(names[part & (abs(up) < 1e-9)]) == {PART_SIDE}
        assert set(names[~part & (up > 1e-9)]) == {"a ledge of the wall"}
        assert set(names[~part & (up < -1e-9)]) == {CEILING}
        assert set(names[~part & (abs(up) < 1e-9)]) == {SIDE_WALL}
        floor = np.where(~part & (up > 1e-9), TAG_SONOTRODE, chamber.tags)
        assert set(surface_names(replace(chamber, tags=floor))[floor == TAG_SONOTRODE]) == {
            SONOTRODE
        }


def test_places_and_areas_are_told_in_mm() -> None:
    points = np.array([[1e-3, -2e-3, 0.0], [3e-3, 2e-3, -1e-9]])
    assert around(points) == "(2.0, 0.0, 0.0) mm"
    assert around(points, np.array([3.0, 1.0])) == "(1.5, -1.0, 0.0) mm"
    assert mm2(1.23456e-4) == "123 mm²"
