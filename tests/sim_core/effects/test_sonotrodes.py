"""Several sonotrodes: bits that must not change, phases over many windows, and refusals."""

import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from sim_core import (
    Balls,
    Gravity,
    PartRotation,
    Physics,
    RandomPhase,
    Rest,
    Restitution,
    Scene,
    SceneError,
    SimulationResult,
    TriangleMesh,
    Vibration,
    pack_balls,
    simulate,
)
from sim_core.effects.contact_mode import ASLEEP
from sim_core.effects.sonotrodes import PARTS, clock_window, new_waves, shift_phases
from sim_core.effects.vibration import checked_waves
from sim_core.loop import compile_ahead
from sim_core.loop.simulate import Simulation
from sim_core.motion import WINDOW
from tests.helpers.scenes.cavities import CEILING, ELASTIC, FLOOR, SIDES, WEIGHTLESS, balls_at, box
from tests.sim_core.geometry.test_sonotrode_border import trough

LAW = (0.9, 1.0)
LAWS = Restitution((LAW,) * 4, LAW)
LOW = Vibration(FLOOR, 25e-6, 20e3, 0.3)
HIGH = Vibration(CEILING, 25e-6, 19.7e3, 1.0, (0.0, 0.0, -1.0))
ACROSS = Vibration(SIDES, 10e-6, 21.3e3, 2.0, (1.0, 0.0, 0.0))
ROOM = box((0.03, 0.03, 0.02))
MIDDLE = np.array([[0.015, 0.015, 0.01]])


def played(vibration: object, duration: float = 0.1) -> SimulationResult:
    rng = np.random.default_rng(3)
    places = pack_balls(ROOM, 20, 3e-3, rng, 1e-4)
    shot = Balls(places, rng.normal(0.0, 1.0, places.shape), 3e-3)
    return simulate(Scene(ROOM, shot, Physics(Gravity(), LAWS, vibration), duration))  # type: ignore[arg-type]


def test_a_tuple_of_one_is_that_one_to_the_last_bit() -> None:
    one, other = played(LOW), played((LOW,))
    assert one.collisions == other.collisions
    for name in ("time", "ball", "triangle", "position", "velocity"):
        np.testing.assert_array_equal(getattr(one.impacts, name), getattr(other.impacts, name))
    np.testing.assert_array_equal(one.balls.velocities, other.balls.velocities)


@pytest.mark.long
@pytest.mark.parametrize("still", [HIGH, HIGH._replace(frequency=19.7)])
def test_one_beside_it_that_keeps_still_changes_nothing(still: Vibration) -> None:
    """But the rounding of its clock, which a chamber makes ten times larger every hit or two: so
    the first hits.
    """
    one, other = played(LOW), played((still._replace(amplitude=0.0), LOW))
    np.testing.assert_array_equal(one.impacts.triangle[:60], other.impacts.triangle[:60])
    np.testing.assert_allclose(one.impacts.time[:60], other.impacts.time[:60], rtol=0.0, atol=1e-9)


def test_all_of_them_are_counted_as_sonotrodes() -> None:
    result = played((LOW, HIGH, ACROSS))
    assert result.collisions.walls == 0
    assert result.collisions.sonotrode == len(result.impacts)


FREQUENCIES = (20e3, 19.7e3, math.pi * 1e4, 40e3, 123.456, 20e3)


@pytest.mark.parametrize("windows", [1, 1_000_000])
def test_phases_do_not_drift(windows: int) -> None:
    """Against fractions: the window is a whole number of periods of the fastest, of which there are
    800 in it.
    """
    vibrations = tuple(Vibration(k, 25e-6, f, 0.1 * k) for k, f in enumerate(FREQUENCIES))
    window = clock_window(vibrations, WINDOW)
    assert window * 40e3 == 800
    waves = new_waves(vibrations, checked_waves(vibrations), window, np.array([0, 3, 2]))
    assert waves is not None
    assert waves.faces.tolist() == [0, 3, 2]
    for _ in range(windows):
        shift_phases(waves)
    for k, frequency in enumerate(FREQUENCIES):
        turns = Fraction(frequency) / Fraction(40e3) * 800 * windows % 1
        off = (waves.numbers[k, 2] - 0.1 * k) / math.tau - float(turns)
        assert abs(off - round(off)) < 1e-14 + windows / PARTS
    assert (
        waves.numbers[[3, 0, 5], 2] == [0.1 * 3, 0.0, 0.1 * 5]
    ).all()  # whole periods to the last bit


@pytest.mark.parametrize("frequency", [0.4, 0.123, 11.5, 30.0, 49.0])
def test_a_slow_phase_does_not_drift(frequency: float) -> None:
    """A window shorter than a period keeps its length, at any frequency."""
    slow = (Vibration(0, 1e-3, frequency, 0.1),)
    window = clock_window(slow, WINDOW)
    assert window == WINDOW
    waves = new_waves(slow, checked_waves(slow), window, np.array([0]))
    assert waves is not None
    for _ in range(100_000):
        shift_phases(waves)
    turns = Fraction(frequency) * Fraction(WINDOW) * 100_000 % 1
    off = (waves.numbers[0, 2] - 0.1) / math.tau - float(turns)
    assert abs(off - round(off)) < 1e-14 + 100_000 / PARTS


def test_a_slow_sonotrode_is_the_same_alone_and_beside_a_fast_one_that_keeps_still() -> None:
    """Alone its phase is carried on every 20 ms; beside the other every whole number of periods."""
    slow = Vibration(FLOOR, 3e-3, 7.3, 4.5)
    one, other = played(slow, 0.3), played((HIGH._replace(amplitude=0.0), slow), 0.3)
    np.testing.assert_array_equal(one.impacts.triangle[:60], other.impacts.triangle[:60])
    np.testing.assert_allclose(one.impacts.time[:60], other.impacts.time[:60], rtol=0.0, atol=1e-9)


def test_random_phases_keep_a_window_of_whole_periods() -> None:
    physics = Physics(Gravity(), vibration=LOW._replace(frequency=7.3), random_phase=RandomPhase(1))
    state = Simulation(Scene(ROOM, balls_at(MIDDLE), physics, 1.0)).state
    assert state.clock.window * 7.3 == pytest.approx(1.0, rel=1e-15)
    assert state.waves is None


def test_one_vibration_needs_no_table() -> None:
    assert new_waves((LOW,), checked_waves(LOW), 0.02, np.zeros(3)) is None
    assert (
        Simulation(Scene(ROOM, balls_at(MIDDLE), Physics(vibration=(LOW,)), 1.0)).state.waves
        is None
    )


@pytest.mark.long
@pytest.mark.parametrize("wall", [FLOOR, 3])
@pytest.mark.parametrize("phase", np.linspace(0.0, 2.0 * np.pi, 4, endpoint=False))
def test_a_vibrating_wall_beyond_does_not_hide_the_face_a_ball_comes_down_on(
    phase: float, wall: int
) -> None:
    """As in test_sonotrode_border, but behind the face there is a wall that vibrates, with the
    floor or on its own.
    """
    room = trough([(0.021, 1e-4), (0.022, -3e-3), (0.04, -3e-3)], left=0.012)
    behind = (room.corners[:, :, 0] == 0.012).all(axis=1)
    room = TriangleMesh(room.vertices, room.triangles, np.where(behind, wall, room.tags))
    start = Balls(np.array([[0.026, 0.02, 1.5e-3 - 10e-6]]), np.array([[-3.3, 0.0, 0.6]]), 3e-3)
    floor = LOW._replace(phase=phase)
    plates = (floor, ACROSS._replace(tag=wall)) if wall != FLOOR else floor
    physics = Physics(Gravity(0.0, 0.0, -500.0), ELASTIC, plates)  # type: ignore[arg-type]
    log = simulate(Scene(room, start, physics, 0.004)).impacts
    assert room.tags[log.triangle].tolist() == [FLOOR, wall]
    assert log.time[0] == pytest.approx(2 * 0.6 / 500, rel=0.05)


@pytest.mark.long
def test_a_ball_that_lies_still_waits_for_the_slowest() -> None:
    """It lies 0.2 mm from a wall that comes by 0.5 mm, five times a second, while the ceiling
    shakes at 20 kHz.
    """
    upright = box((0.03, 0.03, 0.02))
    west = (upright.corners[:, :, 0] == 0.0).all(axis=1)
    room = TriangleMesh(upright.vertices, upright.triangles, np.where(west, 3, upright.tags))
    wall = Vibration(3, 0.5e-3, 5.0, -2.0, (1.0, 0.0, 0.0))
    comes = (math.asin(0.4) - wall.phase) / (math.tau * 5.0)
    for plates in ((HIGH, wall), (wall, HIGH)):
        run = Simulation(
            Scene(
                room,
                balls_at(np.array([[1.7e-3, 0.015, 1.5e-3]])),
                Physics(Gravity(), LAWS, plates, Rest()),
                1.0,
            )
        )
        run.play(comes - 1e-9, record=False)
        assert run.state.contact is not None
        assert run.state.contact.mode[0] == ASLEEP
        run.play(comes + 1e-6, record=True)
        assert run.logs[-1].time[0] == pytest.approx(comes, abs=1e-12)
        assert run.balls().velocities[0, 0] == pytest.approx(
            (1.0 + 0.9) * wall.peak_speed * math.cos(math.asin(0.4)), rel=1e-3
        )


def two_faced(angle: float) -> TriangleMesh:
    """The trough, its floor and the slope beside it [degrees] of two tags."""
    room = trough([(0.04, 0.02 * math.tan(math.radians(angle)))])
    slope = (room.corners[:, :, 0] >= 0.02).all(axis=1) & (room.corners[:, :, 2] < 0.019).all(
        axis=1
    )
    slope &= np.ptp(room.corners[:, :, 1], axis=1) > 0.0
    return TriangleMesh(room.vertices, room.triangles, np.where(slope, 3, room.tags))


@pytest.mark.parametrize(
    ("vibration", "said"),
    [
        ((), r"physics.vibration is \(\): give a Vibration, a tuple of several"),
        ((LOW, 3), r"physics.vibration is .*: give a Vibration, a tuple of several"),
        (0.5, "physics.vibration is 0.5: give a Vibration, a tuple of several"),
        (
            (LOW, HIGH._replace(tag=FLOOR)),
            r"vibration\[1\].tag is 1, the same as vibration\[0\].tag",
        ),
        ((LOW, HIGH._replace(tag=7)), r"vibration.tag is 7, but the mesh has tags \[0, 1, 2\]"),
        ((LOW, HIGH._replace(amplitude=-1e-6)), r"vibration\[1\].amplitude is -1e-06"),
        ((LOW, HIGH._replace(frequency="high")), r"vibration\[1\].frequency is 'high'"),
        ((LOW, HIGH._replace(frequency=0.0)), r"vibration\[1\].frequency is 0.0"),
        ((LOW, HIGH._replace(phase=math.nan)), r"vibration\[1\].phase is nan"),
        ((LOW, HIGH._replace(axis=(0.0, 0.0, 0.0))), r"vibration\[1\].axis is"),
    ],
)
def test_a_wrong_one_of_several_is_named(vibration: object, said: str) -> None:
    with pytest.raises(SceneError, match=said):
        Scene(ROOM, balls_at(MIDDLE), Physics(vibration=vibration), 1.0)  # type: ignore[arg-type]


def test_what_several_cannot_be_beside_is_refused() -> None:
    both = Physics(vibration=(LOW, HIGH))
    with pytest.raises(
        SceneError, match=r"random_phase is given, and 2 vibrating surfaces: not supported together"
    ):
        Scene(ROOM, balls_at(MIDDLE), both._replace(random_phase=RandomPhase()), 1.0)
    with pytest.raises(SceneError, match=r"part_rotation.tag and vibration.tag are both 0"):
        Scene(
            ROOM, balls_at(MIDDLE), both._replace(part_rotation=PartRotation(CEILING, rpm=1.0)), 1.0
        )


@pytest.mark.parametrize("blunt", [0.0, 8.0])
def test_two_that_meet_in_a_blunt_edge_are_refused(blunt: float) -> None:
    plates = (LOW, LOW._replace(tag=3, phase=1.0))
    ball = balls_at(np.array([[0.01, 0.02, 0.01]]))
    with pytest.raises(
        SceneError, match=r"vibrating triangles \d+ and \d+, of tags (1 and 3|3 and 1), meet"
    ):
        simulate(Scene(two_faced(blunt), ball, Physics(vibration=plates), 0.01))
    simulate(Scene(two_faced(20.0), ball, Physics(WEIGHTLESS, ELASTIC, plates), 0.01))


def test_a_ball_inside_one_of_them_is_named_with_its_tag() -> None:
    lowered = (LOW._replace(phase=-0.5 * math.pi), HIGH._replace(phase=0.5 * math.pi))
    near = balls_at(np.array([[0.015, 0.015, 0.02 - 1.5e-3 - 10e-6]]))
    with pytest.raises(
        SceneError,
        match=r"starts 1.5e-05 m inside the vibrating surface of tag 0, which is displaced",
    ):
        Scene(ROOM, near, Physics(vibration=lowered), 1.0)
    Scene(
        ROOM, near, Physics(vibration=(lowered[0], lowered[1]._replace(phase=-0.5 * math.pi))), 1.0
    )


def test_both_of_two_narrow_the_gap_between_them() -> None:
    """3.04 mm: enough for a ball of 3 mm and one swing of 25 um, not for two."""
    tight = box((0.03, 0.03, 3.04e-3))
    ball = balls_at(np.array([[0.015, 0.015, 1.52e-3]]))
    at_rest = (LOW._replace(phase=0.0), HIGH._replace(phase=0.0))
    for one in at_rest:
        Scene(tight, ball, Physics(vibration=one), 1.0)
    said = (
        r"does not fit between the vibrating surface of tag [01] \(triangle \d+\) and the "
        "vibrating surface of tag "
        r"[01] \(triangle \d+\): the gap is narrower than the ball by 1e-05 m at the end of its "
        "swing"
    )
    with pytest.raises(SceneError, match=said):
        Scene(tight, ball, Physics(vibration=at_rest), 1.0)


@pytest.mark.parametrize("turn", [None, PartRotation(1, rpm=10.0)])
def test_the_simulator_is_compiled_ahead_for_several(
    turn: PartRotation | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scene it is compiled with has two of them; and the code for one is not taken for that."""
    scenes: list[Scene] = []
    monkeypatch.setattr(compile_ahead, "simulate", scenes.append)
    monkeypatch.setattr(compile_ahead, "CACHE_FOLDER", tmp_path)
    several = tuple(one._replace(tag=tag) for one, tag in ((LOW, 0), (HIGH, 3), (ACROSS, 2)))
    physics = Physics(None, LAWS, several, part_rotation=turn)
    compile_ahead.compile_simulator(physics._replace(vibration=LOW._replace(tag=0)))
    assert not compile_ahead.is_compiled(physics, 1)
    compile_ahead.compile_simulator(physics)
    assert compile_ahead.is_compiled(physics, 1)
    assert (
        new_waves(
            scenes[1].physics.vibrations, checked_waves(several[:2]), 0.02, scenes[1].mesh.tags
        )
        is not None
    )
    assert {0, 3} < set(scenes[1].mesh.tags.tolist())
