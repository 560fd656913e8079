"""Scenes that cannot be simulated are refused, with the ball, triangle or field
named.
"""

import math

import numpy as np
import pytest

from sim_core import (
    Balls,
    Friction,
    Gravity,
    PartRotation,
    Physics,
    Rest,
    Restitution,
    Scene,
    SceneError,
    SimulationError,
    TriangleMesh,
    Vibration,
    simulate,
)
from sim_core.loop.simulate import Simulation
from tests.helpers.scenes.cavities import CEILING, FLOOR, box

ROOM = box((0.03, 0.03, 0.03))
MIDDLE = [0.015, 0.015, 0.015]


def balls(*positions: list[float], diameter: float = 3e-3) -> Balls:
    return Balls(np.array(positions), np.zeros((len(positions), 3)), diameter)


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ([0.05, 0.015, 0.015], "ball 1 .* is outside the mesh"),
        ([0.001, 0.015, 0.015], "ball 1 .* overlaps a surface by 0.0005 m"),
        ([0.015, 0.015, 0.0165], "balls 0 and 1 overlap by 0.0015 m"),
    ],
)
def test_a_ball_in_the_wrong_place_is_named(where: list[float], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        Scene(ROOM, balls(MIDDLE, where), Physics(), 1.0)


def test_a_ball_inside_the_raised_sonotrode_is_named() -> None:
    raised = Physics(vibration=Vibration(FLOOR, 40e-6, 20e3, phase=math.pi / 2))
    with pytest.raises(SceneError, match=r"ball 0 .* starts 3e-05 m inside the vibrating surface"):
        Scene(ROOM, balls([0.015, 0.015, 1.5e-3 + 10e-6]), raised, 1.0)
    lowered = Physics(vibration=Vibration(FLOOR, 40e-6, 20e3, phase=-math.pi / 2))
    for height in (
        10e-6,
        -10e-6,
    ):  # the second lies below where the mesh has the face, but the face is not there
        Scene(ROOM, balls([0.015, 0.015, 1.5e-3 + height]), lowered, 1.0)


@pytest.mark.parametrize(
    ("physics", "said"),
    [
        (Physics(gravity=Gravity(z=math.nan)), "gravity"),
        (Physics(restitution=Restitution(((0.9, 1.0),), (0.9, 1.0))), "tags 0 to 2"),
        (
            Physics(restitution=Restitution(((1.1, 1.0),) * 3, (0.9, 1.0))),
            r"surfaces\[0\] is \(1.1, 1.0\)",
        ),
        (Physics(vibration=Vibration(7, 1e-6, 20e3)), "tag is 7, but the mesh has tags"),
        (Physics(vibration=Vibration(1, -1e-6, 20e3)), "amplitude"),
        (Physics(vibration=Vibration(1, 1e-6, 0.0)), "frequency"),
    ],
)
def test_physics_out_of_range_is_named(physics: Physics, said: str) -> None:
    with pytest.raises(SceneError, match=said):
        Scene(ROOM, balls(MIDDLE), physics, 1.0)


def test_an_open_an_inside_out_and_a_broken_mesh_are_refused() -> None:
    v, t, tags = ROOM.vertices, ROOM.triangles, ROOM.tags
    with pytest.raises(SceneError, match=r"not closed: 3 open edge\(s\)"):
        TriangleMesh(v, t[1:], tags[1:])
    with pytest.raises(SceneError, match="inside out"):
        TriangleMesh(v, t[:, ::-1], tags)
    with pytest.raises(SceneError, match="run along a shared edge the same way"):
        TriangleMesh(v, np.concatenate([t[:1, ::-1], t[1:]]), tags)
    broken = v.copy()
    broken[3] = np.nan
    with pytest.raises(SceneError, match="vertex 3"):
        TriangleMesh(broken, t, tags)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_body_wound_the_wrong_way_is_found_whichever_way_its_largest_face_looks(
    axis: int, sign: float
) -> None:
    """A flat tetrahedron stands in the room: its base is its largest face."""
    corners = 1e-3 * np.array([(1.0, 1.0, 0.0), (4.0, 1.0, 0.0), (1.0, 4.0, 0.0), (2.0, 2.0, sign)])
    body = 0.005 + np.roll(corners, axis + 1, axis=1)
    faces = np.array([(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)])
    volume = np.linalg.det(body[faces[1:]] - body[0]).sum()
    inward = faces if volume < 0.0 else faces[:, ::-1]
    right, wrong = (
        TriangleMesh(
            np.concatenate([ROOM.vertices, body]),
            np.concatenate([ROOM.triangles, one + len(ROOM.vertices)]),
            np.append(ROOM.tags, np.zeros(4, dtype=ROOM.tags.dtype)),
        )
        for one in (inward, inward[:, ::-1])
    )
    Scene(right, balls(MIDDLE), Physics(), 1.0)
    with pytest.raises(SceneError, match="inside out"):
        Scene(wrong, balls(MIDDLE), Physics(), 1.0)


def test_numbers_that_are_none_are_refused() -> None:
    with pytest.raises(SceneError, match="ball 0"):
        Balls(np.array([[math.inf, 0, 0]]), np.zeros((1, 3)), 3e-3)
    with pytest.raises(SceneError, match="diameter"):
        balls(MIDDLE, diameter=-1.0)
    with pytest.raises(SceneError, match=r"balls\.diameter has 9 different values: at most 8"):
        Balls(np.zeros((9, 3)), np.zeros((9, 3)), 1e-3 * np.arange(1.0, 10.0))
    with pytest.raises(SceneError, match=r"balls\.diameter has shape \(3,\)"):
        Balls(np.zeros((2, 3)), np.zeros((2, 3)), np.ones(3))
    with pytest.raises(SceneError, match=r"balls\.density of ball 1 is -1\.0"):
        Balls(np.zeros((2, 3)), np.zeros((2, 3)), 1e-3, np.array([1.0, -1.0]))
    with pytest.raises(SceneError, match="duration"):
        Scene(ROOM, balls(MIDDLE), Physics(), 0.0)


def test_whole_numbers_in_gravity_are_as_good_as_fractions() -> None:
    one, two = (
        simulate(Scene(ROOM, balls(MIDDLE), Physics(gravity=g), 0.1)).balls.positions
        for g in (Gravity(0, 0, -9), Gravity(0.0, 0.0, -9.0))
    )
    assert (one == two).all()


def test_balls_in_one_place_are_two_balls() -> None:
    with pytest.raises(SceneError, match=r"balls (0 and 1|1 and 0) overlap by 0.003 m"):
        Scene(ROOM, balls(MIDDLE, MIDDLE), Physics(), 1.0)


@pytest.mark.parametrize(
    "wrong", [{"duration": "1"}, {"duration": 1e12}, {"warmup": math.nan}, {"record": (9,)}]
)
def test_a_wrong_scene_field_is_named(wrong: dict) -> None:
    with pytest.raises(SceneError, match=rf"scene\.{next(iter(wrong))}"):
        Scene(ROOM, balls(MIDDLE), Physics(), **{"duration": 1.0, **wrong})


@pytest.mark.parametrize(
    ("physics", "field"),
    [
        (Physics(vibration=Vibration(FLOOR, "tall", 20e3)), "vibration.amplitude is 'tall'"),
        (Physics(Gravity(), rest=True), "physics.rest is True: give a Rest, or None"),
        (Physics(Gravity(), rest=Rest(capture="slow")), "rest.capture is 'slow'"),
        (Physics(part_rotation=PartRotation(CEILING, rpm="fast")), "part_rotation.rpm is 'fast'"),
        (Physics(restitution=0.9), "physics.restitution is 0.9"),
        (Physics(friction=Friction(((0.3, 0.2),) * 2, {})), "friction.balls {}: give"),  # type: ignore[arg-type]
        (Physics({}), "gravity is {}: give three numbers"),  # type: ignore[arg-type]
        (Physics((1.0,)), "gravity is .*: give three numbers"),  # type: ignore[arg-type]
    ],
    ids=lambda given: given if isinstance(given, str) else "",
)
def test_what_is_no_number_or_no_effect_is_named(physics: Physics, field: str) -> None:
    with pytest.raises(SceneError, match=field):
        Scene(ROOM, balls([0.015, 0.015, 0.01]), physics, 1.0)


def test_a_diameter_that_is_no_number_is_named() -> None:
    with pytest.raises(SceneError, match=r"balls\.diameter is '3mm': give a number"):
        Balls(np.zeros((1, 3)), np.zeros((1, 3)), "3mm")  # type: ignore[arg-type]


def test_balls_that_came_to_overlap_stop_the_run() -> None:
    apart = Balls(np.array([[0.01, 0.01, 0.01], [0.02, 0.01, 0.01]]), np.zeros((2, 3)), 3e-3)
    run = Simulation(Scene(ROOM, apart, Physics(), 1.0))
    run.state.motion[1, :3] = run.state.motion[0, :3] + [0.001, 0.0, 0.0]
    with pytest.raises(SimulationError, match=r"balls 0 and 1 overlap by 0\.002 m"):
        run.play(0.1, record=False)
