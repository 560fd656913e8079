"""A smoothed part as the mesh of a part."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import sim_core
from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.geometry.smoothing.part import (
    MOST_KEPT,
    Rule,
    SmoothingFacts,
    _near,
    _usual_turn,
    kept,
    key_of,
    smooth,
)


def test_another_mesh_of_as_many_triangles_is_not_the_files(tmp_path: Path) -> None:
    trimesh.creation.box((10, 20, 30)).export(tmp_path / "box.stl")
    mesh = read_part(tmp_path / "box.stl", "mm")
    every = np.ones(len(mesh.triangles), dtype=bool)
    made = smooth(mesh, Rule(every, False, np.radians(6.0), 6e-5, np.inf), [])
    assert made.of_part(mesh) is mesh
    turned = replace(made, triangles=made.triangles[::-1], origin=made.origin[::-1])
    assert (turned.of_part(mesh).elements == mesh.elements[::-1]).all()


def test_the_usual_turn_is_that_which_nine_tenths_of_the_area_do_not_exceed() -> None:
    """Of ten facets alike, and a tenth of which is as large as all others together."""
    turn, every = np.array([0.1, 0.3, 0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]), np.ones(10, bool)
    assert _usual_turn(turn, np.ones(10), every) == 0.9
    assert _usual_turn(turn, np.where(turn == 1.0, 0.5, 1.0), every) == 0.9
    assert _usual_turn(turn, np.where(turn == 1.0, 9.0, 1.0), every) == 1.0
    assert _usual_turn(turn, np.where(turn == 0.1, 81.0, 1.0), every) == 0.1
    assert _usual_turn(turn, np.ones(10), turn < 0.35) == 0.3
    assert _usual_turn(0.0 * turn, np.ones(10), every) == 0.0  # flat


def test_near_is_at_most_two_millimetres_from_a_chosen_corner() -> None:
    """A strip of squares whose corners are 0.9 mm apart, of which the first is chosen."""
    x = 0.9e-3 * np.arange(9)
    vertices = np.concatenate([np.c_[x, 0 * x, 0 * x], np.c_[x, 0 * x + 0.9e-3, 0 * x]])
    left = np.arange(8)
    lower, upper = np.c_[left, left + 1, left + 9], np.c_[left + 1, left + 10, left + 9]
    triangles = np.concatenate([lower, upper])
    chosen = np.arange(16) == 0
    near = _near(vertices, triangles, chosen)
    # Of its corners, 0.9 mm is within 2 mm of the lower corners up to 2.7 and the upper up to 1.8.
    np.testing.assert_array_equal(near, np.r_[left <= 3, left <= 2])


def test_records_are_kept_by_all_that_they_depend_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sim_core, "user_cache", lambda: tmp_path)
    made: list[str] = []

    def make(name: str) -> SmoothingFacts:
        made.append(name)
        return SmoothingFacts(1e-6, 0.5, 0.0, len(name), 0, 0.1, 0.0, 0.0, 0.0, 0.0)

    keys = [key_of([np.arange(3), name]) for name in ("a", "b", "a")]
    assert keys[0] == keys[2] != keys[1]
    assert key_of([np.arange(3.0)]) != key_of([np.arange(3)]) != key_of([np.arange(3)[:, None]])
    one, two, again = (kept(SmoothingFacts, [], key, lambda key=key: make(key)) for key in keys)
    assert made == keys[:2]
    assert again == one
    assert two == one
    for number in range(MOST_KEPT + 2):
        kept(SmoothingFacts, [], f"{number}", lambda: make("other"))
    assert len(list((tmp_path / "kept").iterdir())) == MOST_KEPT
    monkeypatch.setattr(sim_core, "user_cache", lambda: None)
    made.clear()
    for _ in range(2):
        kept(SmoothingFacts, [], keys[0], lambda: make("new"))
    assert made == ["new", "new"]
