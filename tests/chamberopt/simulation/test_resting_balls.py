"""Notes on balls at rest: a part in the middle of a room, and balls at known places."""

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import Chamber
from chamberopt.chamber.part import Part
from chamberopt.geometry.triangles import unit_normals
from chamberopt.simulation.resting_balls import (
    RestingBalls,
    find_resting_balls,
    resting_notes,
    triangles_near,
)
from sim_core import Resting, closest_on_each
from tests.helpers.scenes.cavities import box_around

BALL = 3e-3  # m
NOBODY = [-1, -1, -1, -1]


@pytest.fixture(scope="module")
def chamber() -> Chamber:
    """A room of 20 mm with a part of 14 x 8 x 8 mm in its middle: 3 mm of space at both ends."""
    mesh = box_around(trimesh.creation.box((14e-3, 8e-3, 8e-3)), 10e-3)
    part = Part(
        mesh.vertices, mesh.triangles, np.ones(len(mesh.triangles)), np.ones(1, dtype=bool), "box"
    )
    none = np.zeros(len(mesh.triangles), dtype=np.int32)
    return Chamber(mesh.vertices, mesh.triangles, mesh.tags, none, 1.0, part, none, ())


def triangle(chamber: Chamber, tag: int, axis: int, at: float) -> int:
    """One that lies in a plane ``axis`` = ``at`` [m]."""
    corners = chamber.vertices[chamber.triangles]
    return int(
        np.flatnonzero((chamber.tags == tag) & np.isclose(corners[..., axis], at).all(axis=1))[0]
    )


def resting(*balls: tuple[list[float], float, int, int, bool]) -> Resting:
    """Balls by place [mm], start of rest [s], triangle and ball under them, and whether jammed."""
    place, since, under, on, jammed = zip(*balls, strict=True)
    return Resting(
        np.arange(len(balls)),
        1e-3 * np.array(place),
        np.array(since),
        np.array([[t, *NOBODY[1:]] for t in under]),
        np.array([[t, *NOBODY[1:]] for t in on]),
        np.array(jammed),
    )


def test_groups_say_how_many_on_what_and_where(chamber: Chamber) -> None:
    top, floor = triangle(chamber, 0, 2, 4e-3), triangle(chamber, 2, 2, -10e-3)
    balls = resting(
        ([-3.0, 0.0, 5.5], 0.7, top, -1, False),
        ([0.0, 0.0, 5.5], 0.41, top, -1, False),
        ([-1.5, 0.0, 8.1], 0.9, -1, 0, False),  # on those two
        ([8.5, 0.0, 0.0], 0.2, -1, -1, True),
        ([-5.0, -5.0, -8.5], -0.1, floor, -1, False),
    )
    found = find_resting_balls(balls, [BALL] * 200, chamber, part_turns=False)
    assert found is not None
    assert found.share == 0.025
    assert found.line == (
        "5 of 200 balls lie still at the end, places in the chamber's frame: "
        "3 on the part's upper side around (-1.5, 0.0, 6.4) mm, the longest since 0.41 s; "
        "1 jammed between the part's side and the wall at (8.5, 0.0, 0.0) mm, since 0.20 s; "
        "1 on a ledge of the wall at (-5.0, -5.0, -8.5) mm, since -0.10 s"
    )


def test_a_part_that_turns_is_elsewhere_by_then(chamber: Chamber) -> None:
    found = find_resting_balls(
        resting(([8.5, 0.0, 0.0], 0.2, -1, -1, True)), [BALL] * 20, chamber, part_turns=True
    )
    assert found is not None
    assert (
        "1 jammed between the wall and other balls or the part at (8.5, 0.0, 0.0) mm" in found.line
    )


def test_far_apart_is_two_places_and_the_smallest_are_counted_only(chamber: Chamber) -> None:
    top = triangle(chamber, 0, 2, 4e-3)
    ends = [([x, y, 5.5], 0.5, top, -1, False) for x in (-6.0, 6.0) for y in (-1.5, 1.5)]
    floor = triangle(chamber, 2, 2, -10e-3)
    corners = [([x, y, -8.5], 0.5, floor, -1, False) for x in (-8.0, 8.0) for y in (-8.0, 8.0)]
    found = find_resting_balls(resting(*ends, *corners), [BALL] * 10, chamber, part_turns=False)
    assert found is not None
    assert found.line.count("2 on the part's upper side around") == 2
    assert found.line.endswith("; 3 elsewhere")


@pytest.mark.parametrize(
    ("gap", "others"), [(0.9, "the part's side and the wall"), (1.1, "the part's side and other")]
)
def test_a_ball_is_held_by_what_it_touches_within_the_contact_gap(
    chamber: Chamber, gap: float, others: str
) -> None:
    place = 8.5 - 1e3 * gap * 2e-5  # the part ends at 7 mm and the wall is at 10 mm
    found = find_resting_balls(
        resting(([place, 0.0, 0.0], 0.2, -1, -1, True)), [BALL] * 20, chamber, part_turns=False
    )
    assert found is not None
    assert f"1 jammed between {others}" in found.line


def test_between_other_balls_only(chamber: Chamber) -> None:
    found = find_resting_balls(
        resting(([0.0, 0.0, 8.0], 0.2, -1, -1, True)), [BALL] * 20, chamber, part_turns=False
    )
    assert found is not None
    assert "1 jammed among other balls at" in found.line


def test_nothing_lies_still(chamber: Chamber) -> None:
    nothing = Resting(
        np.zeros(0, int),
        np.zeros((0, 3)),
        np.zeros(0),
        *(np.zeros((0, 4), int),) * 2,
        np.zeros(0, bool),
    )
    assert find_resting_balls(nothing, [BALL] * 20, chamber, part_turns=False) is None


def test_one_note_on_all_replicas() -> None:
    assert resting_notes([], 8) == ()
    notes = resting_notes(
        [RestingBalls(0.1, "few"), RestingBalls(0.3, "many"), RestingBalls(0.2, "some")], 8
    )
    assert notes == (
        "balls came to rest in 3 of 8 replicas and no longer peen: at the end 7.5 % of the shot, "
        "on average over all replicas; in the worst one, many",
    )


@pytest.mark.parametrize("apart", [1e-3, 2e-3])
def test_triangles_are_near_within_the_reach(chamber: Chamber, apart: float) -> None:
    """From outside of a box of all of them, opposite the middle of each."""
    corners = chamber.vertices[chamber.triangles]
    every = np.arange(len(corners))
    normals = unit_normals(corners)
    for k in every:
        place = corners[k].mean(axis=0) + apart * normals[k]
        closest = closest_on_each(corners, np.tile(place, (len(every), 1)))
        away = np.linalg.norm(closest - place, axis=1)
        for reach in (0.9 * apart, 1.1 * apart):
            near = triangles_near(chamber, every, place, reach)
            np.testing.assert_array_equal(near, np.flatnonzero(away <= reach))
        assert k in near
        assert k not in triangles_near(chamber, every[every != k], place, 1.1 * apart)
