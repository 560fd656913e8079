"""A scene that begins with the balls of a result goes on as the earlier one would have done."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_core import (
    Balls,
    Friction,
    Gravity,
    PartRotation,
    Physics,
    RandomPhase,
    Rest,
    Restitution,
    Scene,
    SceneError,
    SimulationResult,
    Vibration,
    simulate,
)
from sim_core.effects.gravity import STANDARD as G
from sim_core.scene.invariants import energy
from tests.helpers.scenes import contact_mode
from tests.helpers.scenes.cavities import CEILING, FLOOR, box, box_around
from tests.helpers.scenes.gas import lattice_gas
from tests.helpers.scenes.turning_parts import PART, bar

DIAMETER = 3e-3
SHAFT = box((0.02, 0.02, 0.2))
FREQUENCY = 30.0  # Hz: no window of 20 ms is whole periods of it


def one_ball(velocity: object = (0.0, 0.0, 0.0), spin: object = None) -> Balls:
    spins = None if spin is None else np.array([spin])
    return Balls([[0.01, 0.01, 0.02]], [velocity], DIAMETER, spins=spins)


def law(e: float) -> Restitution:
    return Restitution(((e, 1e3),) * contact_mode.TAGS, (e, 1e3))


def shaken(gamma: float, e: float, rest: Rest | None = None) -> Physics:
    """On a floor whose peak acceleration is ``gamma`` g."""
    amplitude = gamma * G / (2.0 * np.pi * FREQUENCY) ** 2
    return Physics(Gravity(), law(e), Vibration(FLOOR, amplitude, FREQUENCY, 0.4), rest)


def in_one_and_two(scene: Scene, first: float) -> tuple[SimulationResult, np.ndarray, Balls]:
    """The whole run; times and speeds (k, 2) of the impacts of one cut at ``first`` [s], without
    those at which balls in contact land again, of rounding; and the balls at its end.
    """
    whole, begun = simulate(scene), simulate(replace(scene, duration=first))
    left = scene.duration - first
    ended = simulate(replace(scene, balls=begun.balls, start_time=begun.time, duration=left))
    assert begun.time == scene.start_time + first
    assert ended.time == pytest.approx(whole.time, abs=1e-14)
    rows = [
        np.column_stack([log.time + start, log.normal_speed])
        for log, start in ((begun.impacts, 0.0), (ended.impacts, first))
    ]
    both = np.concatenate(rows)
    return whole, both[both[:, 1] > 1e-7], ended.balls


def assert_same(
    whole: SimulationResult, impacts: np.ndarray, balls: Balls, least: int, off: float
) -> None:
    """At least so many impacts, whose times [s] and speeds [m/s] are ``off`` at most."""
    assert len(impacts) == len(whole.impacts) >= least
    np.testing.assert_allclose(impacts[:, 0], whole.impacts.time, rtol=0.0, atol=off)
    np.testing.assert_allclose(impacts[:, 1], whole.impacts.normal_speed, rtol=0.0, atol=off)
    np.testing.assert_allclose(balls.positions, whole.balls.positions, rtol=0.0, atol=off)
    np.testing.assert_allclose(balls.velocities, whole.balls.velocities, rtol=0.0, atol=off)


@pytest.mark.parametrize("first", [1.0, 1.7531, 2.0])
def test_a_bouncing_ball_goes_on_with_the_floor_that_it_left(first: float) -> None:
    """It is locked to the floor: one bounce a period, at a phase that forgets where it began.

    Every flight takes 1/f, so that the ball leaves at g/2f, and the floor makes up for what the
    impact takes, A omega cos(phase) = g/2f (1 - e)/(1 + e).
    """
    gamma, e = 1.3, 0.5
    physics = shaken(gamma, e)
    phase = math.acos(math.pi / gamma * (1.0 - e) / (1.0 + e))
    floor = physics.vibrations[0]._replace(phase=phase)
    height = 0.5 * DIAMETER + floor.amplitude * math.sin(phase) + 1e-6
    start = Balls([[0.01, 0.01, height]], [[0.0, 0.0, 0.5 * G / FREQUENCY]], DIAMETER)
    scene = Scene(SHAFT, start, physics._replace(vibration=floor), 4.0)
    whole, impacts, balls = in_one_and_two(scene, first)
    assert_same(whole, impacts, balls, least=100, off=1e-9)
    assert np.diff(whole.impacts.time)[-5:] == pytest.approx(1.0 / FREQUENCY)


def test_the_surfaces_are_where_the_clock_has_them() -> None:
    """The floor that has gone down makes room for a ball where it was at the start."""
    down = 1.0 / (4.0 * FREQUENCY)
    vibration = Vibration(FLOOR, 5e-3, FREQUENCY, np.pi)
    low = Balls([[0.01, 0.01, -1e-3]], np.zeros((1, 3)), DIAMETER)
    with pytest.raises(SceneError, match="inside"):
        Scene(SHAFT, low, Physics(vibration=vibration), 1.0)
    Scene(SHAFT, low, Physics(vibration=vibration), 1.0, start_time=down)
    with pytest.raises(SceneError, match="inside"):
        Scene(SHAFT, low, Physics(vibration=vibration), 1.0, start_time=2.0 * down)


def test_several_sonotrodes_go_on() -> None:
    physics = shaken(1.3, 0.8)
    both = (*physics.vibrations, Vibration(CEILING, 1e-3, 17.0, 1.0))
    room, start = box((0.02, 0.02, 0.05)), one_ball((0.3, 0.2, 0.0))
    whole, *rest = in_one_and_two(Scene(room, start, physics._replace(vibration=both), 0.5), 0.2531)
    assert_same(whole, *rest, least=10, off=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(
    "turn",
    [
        PartRotation(PART, rpm=-437.0, phase=1.0),
        PartRotation(PART, amplitude=0.8, frequency=7.3, phase=1.0),
    ],
    ids=["steady", "to and fro"],
)
def test_a_turning_part_goes_on(turn: PartRotation) -> None:
    """Few impacts: between a bar and walls errors grow tenfold and more at each."""
    room = box_around(bar(), 0.02)
    start = Balls([[0.013, 0.006, 0.001]], [[0.3, -0.4, 0.1]], DIAMETER)
    whole, *rest = in_one_and_two(Scene(room, start, Physics(part_rotation=turn), 0.2), 0.1037)
    assert_same(whole, *rest, least=5, off=1e-9)


def test_a_gas_keeps_its_energy_through_any_number_of_restarts() -> None:
    gas = lattice_gas(3, 0.1, seed=1)
    balls, time, gravity = gas.balls, 0.0, Gravity()
    for piece in (0.0123, 0.02, 0.031, 0.5):
        result = simulate(
            Scene(gas.room, balls, Physics(gravity), piece, record=(), start_time=time)
        )
        balls, time = result.balls, result.time
    assert time == pytest.approx(0.5633, abs=1e-15)
    assert energy(balls, gravity) == pytest.approx(energy(gas.balls, gravity), rel=1e-13)


@pytest.mark.parametrize("first", [0.3, 0.507, 0.5153, 0.524])
def test_a_ball_that_rides_on_the_floor_goes_on(first: float) -> None:
    """With e = 0.3 and twice g it sticks to the floor for a part of each period."""
    scene = Scene(SHAFT, one_ball(), shaken(2.0, 0.3, Rest(1e-3, 0.0, True)), 1.0)
    whole, *rest = in_one_and_two(scene, first)
    assert_same(whole, *rest, least=50, off=1e-7)


@pytest.mark.parametrize("first", [0.4, 0.8, 1.9])
def test_a_ball_that_rolls_or_lies_still_goes_on(first: float) -> None:
    """It bounces, slips, rolls against a resistance that stops it after 1.6 s, and lies still."""
    alley = box((0.6, 0.1, 0.03))
    physics = Physics(
        Gravity(),
        law(0.3),
        rest=Rest(1e-3, 0.02),
        friction=Friction(((0.2, 0.2),) * contact_mode.TAGS, (0.2, 0.2)),
    )
    start = one_ball((0.4, 0.0, 0.0), spin=(0.0, -50.0, 5.0))
    whole, impacts, balls = in_one_and_two(Scene(alley, start, physics, 2.0), first)
    assert_same(whole, impacts, balls, least=5, off=1e-9)
    assert whole.balls.spins is not None
    assert balls.spins is not None
    np.testing.assert_allclose(balls.spins, whole.balls.spins, atol=1e-6)
    assert len(whole.resting) == 1


@pytest.mark.parametrize("first", [0.05, 0.2])
def test_a_heap_comes_to_rest_in_the_same_places(first: float) -> None:
    whole, _, balls = in_one_and_two(replace(contact_mode.small_scene(), duration=0.4), first)
    assert len(whole.resting) == len(balls)
    np.testing.assert_allclose(balls.positions, whole.balls.positions, atol=1e-12)
    np.testing.assert_array_equal(balls.velocities, 0.0)


def test_what_cannot_go_on_is_refused() -> None:
    physics = shaken(1.3, 0.5)._replace(random_phase=RandomPhase(1))
    with pytest.raises(SceneError, match=r"start_time is 1\.0 s, and physics\.random_phase"):
        Scene(SHAFT, one_ball(), physics, 1.0, start_time=1.0)
    for wrong in (-1.0, np.nan, "1"):
        with pytest.raises(SceneError, match=r"scene\.start_time is .*: give seconds from 0"):
            Scene(SHAFT, one_ball(), Physics(), 1.0, start_time=wrong)  # type: ignore[arg-type]
