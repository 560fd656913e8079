"""Every ball is where the simulation has it at the time of the frame."""

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.design.shapes import TAG_PART, TAG_SONOTRODE
from chamberopt.pictures.film import rotation_about_line
from chamberopt.results.flight import (
    face_displacement,
    require_simulated,
    rotation_angle,
    simulate_flight,
)
from chamberopt.results.load import Result
from chamberopt.results.rebuild import RebuiltReplica, rebuild_replica
from sim_core import Balls, Gravity, PartRotation, Physics, Scene, simulate
from sim_core.effects.gravity import STANDARD as G
from sim_core.effects.part_rotation import angle_at, new_rotation_state, rotate_points
from tests.helpers.results.short_plate import plate_result

COLUMNS = ("time", "ball", "triangle", "position", "velocity", "normal_speed")


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return plate_result(tmp_path_factory.mktemp("replay") / "plate")


@pytest.fixture(scope="module")
def replica(result: Result) -> RebuiltReplica:
    return rebuild_replica(result, 1)


def test_a_ball_alone_is_where_the_closed_form_has_it(replica: RebuiltReplica) -> None:
    """A ball is dropped on a floor that returns all energy, and drifts sideways.

    Its height is z = r + h - g τ²/2, where τ is the time from the nearest apex.
    """
    r, h, drift = 1.5e-3, 6.5e-3, 0.05
    ball = Balls(np.array([[0.0, 0.0, r + h]]), np.array([[drift, 0.0, 0.0]]), 2 * r)
    scene = Scene(
        replica.scene.mesh, ball, Physics(gravity=Gravity()), 0.3, warmup=0.02, record=(TAG_PART,)
    )
    seen = simulate_flight(
        replace(replica, scene=scene), start=0.0137, span=0.2, frames=77, trail=3
    )
    assert seen.time[0] == 0.0137
    assert seen.time[-1] == pytest.approx(0.2137, abs=1e-15)
    np.testing.assert_allclose(np.diff(seen.time), 0.2 / 76, rtol=1e-9)
    period = 2.0 * np.sqrt(2.0 * h / G)

    def exact(time: np.ndarray) -> np.ndarray:
        age = scene.warmup + time
        since_apex = (age + 0.5 * period) % period - 0.5 * period
        return np.stack([drift * age, np.zeros(len(age)), r + h - 0.5 * G * since_apex**2], axis=1)

    np.testing.assert_allclose(seen.balls[:, 0], exact(seen.time), atol=1e-11)
    thirds = seen.time[:-1, None] + np.arange(3) * (0.2 / 76 / 3)
    np.testing.assert_allclose(
        seen.trail[1:, :, 0].reshape(-1, 3), exact(thirds.ravel()), atol=1e-11
    )
    assert np.isnan(seen.trail[0]).all()
    assert len(seen.impacts) == len(seen.dents) == 0


def test_what_is_shown_is_the_run_itself(replica: RebuiltReplica) -> None:
    """A scene cut short where the film ends gives the same bits as the whole scene.

    At an impact the ball is on the part.
    """
    whole = simulate(replica.scene).impacts
    seen = simulate_flight(replica, 0.05, 0.1, 11)
    shown = (whole.time >= 0.05) & (whole.time <= seen.time[-1])
    assert shown.sum() > 100
    for column in COLUMNS:
        np.testing.assert_array_equal(getattr(seen.impacts, column), getattr(whole, column)[shown])
    for row in np.flatnonzero(np.diff(whole.time, append=np.inf) > 1e-9)[[5, 50, 100]]:
        at = simulate_flight(replica, float(whole.time[row]), 1e-3, 2)
        np.testing.assert_allclose(at.balls[0, whole.ball[row]], whole.position[row], atol=1e-12)


def test_the_sonotrode_is_where_the_shot_met_it(replica: RebuiltReplica) -> None:
    scene = replace(replica.scene, record=(TAG_SONOTRODE,), duration=0.1)
    met = simulate(scene).impacts
    face = face_displacement(scene.physics.vibrations[0], scene.warmup + met.time)
    lowest = met.position[:, 2] - scene.balls.radius
    assert np.ptp(lowest) > 2e-5
    np.testing.assert_allclose(face[:, 2], lowest, atol=1e-9)
    seen = simulate_flight(replica, 0.01, 0.002, 5)
    np.testing.assert_array_equal(
        seen.sonotrodes[TAG_SONOTRODE],
        face_displacement(scene.physics.vibrations[0], scene.warmup + seen.time),
    )


@pytest.mark.parametrize("motion", [{"rpm": 300.0}, {"amplitude": 0.4, "frequency": 7.0}])
def test_a_turning_part_is_drawn_as_the_simulator_has_it(motion: dict[str, float]) -> None:
    point, axis = (0.01, 0.02, 0.03), (0.0, 0.6, 0.8)
    turn = PartRotation(TAG_PART, point, axis, phase=0.7, **motion)
    turning = new_rotation_state(turn, np.zeros(3))
    assert turning is not None
    times = np.array([0.0, 0.013, 0.4])
    expected = np.array([angle_at(turning, time) for time in times])
    np.testing.assert_allclose(
        np.exp(1j * rotation_angle(turn, times)), np.exp(1j * expected), atol=1e-12
    )
    np.testing.assert_array_equal(rotation_angle(None, times), 0.0)
    corners = np.random.default_rng(0).normal(size=(5, 3))
    matrix = rotation_about_line(np.array(point), np.array(axis), expected[1])
    there = rotate_points(corners, np.array(point), np.array(axis), expected[1])
    np.testing.assert_allclose(corners @ matrix[:3, :3].T + matrix[:3, 3], there, atol=1e-14)


@pytest.mark.parametrize(
    ("start", "span", "frames", "said"),
    [
        (0.3, 0.01, 5, "--from-s: given 0.3; the replica was simulated from 0 to 0.3 s"),
        (-0.1, 0.01, 5, "--from-s: given -0.1"),
        (0.29, 0.02, 5, r"--span-ms: given 20; from 0.29 s on, 10 ms were simulated"),
        (0.0, 0.0, 5, "--span-ms: given 0"),
        (0.0, 0.01, 1, "--frames: given 1; 2 to 2000"),
    ],
)
def test_what_was_not_simulated_is_not_shown(
    replica: RebuiltReplica, start: float, span: float, frames: int, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        simulate_flight(replica, start, span, frames)


def test_frames_lie_in_the_recorded_time_and_are_not_too_many() -> None:
    scene: Any = SimpleNamespace(duration=2.0, balls=range(1000))
    for start, span, frames, trail, wrong in (
        (0.0, 2.0, 2, 4, None),
        (1.5, 0.5, 2000, 4, None),
        (2.0, 1e-3, 2, 4, "--from-s: given 2; the replica was simulated from 0 to 2 s"),
        (-0.1, 1e-3, 2, 4, "--from-s"),
        (1.5, 0.51, 2, 4, "--span-ms: given 510; from 1.5 s on, 500 ms were simulated"),
        (0.0, 0.9e-6, 2, 4, "--span-ms"),
        (0.0, 1e-6, 2, 4, None),
        (0.0, 1.0, 1, 4, "--frames: given 1; 2 to 2000"),
        (0.0, 1.0, 2001, 4, "--frames: given 2001; 2 to 2000"),
        (0.0, 1.0, 1000, 10, None),
        (0.0, 1.0, 1001, 10, "at most 1000 are supported"),
    ):
        with pytest.raises(InputError, match=wrong) if wrong else nullcontext():
            require_simulated(scene, start, span, frames, trail)
