"""A replay shows what was simulated: each ball on its flight, at the very time; and says what it cannot show."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import imageio.v2 as imageio
import numpy as np
import pytest
from PIL import Image, ImageSequence

from chamberopt.chamber.build import TAG_PART, TAG_SONOTRODE
from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.output.resimulate.flight import face_displacement, rotation_angle, simulate_flight
from chamberopt.output.resimulate.rebuild import Replica, rebuild_replica
from chamberopt.output.results.load import Result
from chamberopt.output.viewer import missing_opengl, subprocess_drawing
from chamberopt.output.viewer.images import film
from chamberopt.output.viewer.images.film import film_path, write_film
from chamberopt.output.viewer.images.replay_film import draw_replay, rotation_matrix
from sim_core import Balls, Gravity, PartRotation, Physics, Scene, simulate
from sim_core.effects.part_rotation import angle_at, new_rotation_state, rotate_points
from tests.helpers.results.short_plate import plate_result

G = 9.80665
COLUMNS = ("time", "ball", "triangle", "position", "velocity", "normal_speed")
needs_opengl = pytest.mark.skipif(missing_opengl() is not None, reason="no OpenGL library")


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return plate_result(tmp_path_factory.mktemp("replay") / "plate")


@pytest.fixture(scope="module")
def replica(result: Result) -> Replica:
    return rebuild_replica(result, 1)


def test_a_ball_alone_is_where_the_closed_form_has_it(replica: Replica) -> None:
    """Dropped on a floor that gives all back, drifting sideways: z = r + h - g τ²/2, τ from the nearest apex."""
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


def test_what_is_shown_is_the_run_itself(replica: Replica) -> None:
    """The scene cut short where the film ends gives the same bits as the whole; at an impact the ball is on the part"""
    whole = simulate(replica.scene).impacts
    seen = simulate_flight(replica, 0.05, 0.1, 11)
    shown = (whole.time >= 0.05) & (whole.time <= seen.time[-1])
    assert shown.sum() > 100
    for column in COLUMNS:
        np.testing.assert_array_equal(getattr(seen.impacts, column), getattr(whole, column)[shown])
    np.testing.assert_array_equal(seen.part_triangle, replica.chamber.source[whole.triangle[shown]])
    for row in np.flatnonzero(np.diff(whole.time, append=np.inf) > 1e-9)[[5, 50, 100]]:
        at = simulate_flight(replica, float(whole.time[row]), 1e-3, 2)
        np.testing.assert_allclose(at.balls[0, whole.ball[row]], whole.position[row], atol=1e-12)


def test_the_sonotrode_is_where_the_shot_met_it(replica: Replica) -> None:
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
    matrix = rotation_matrix(np.array(point), np.array(axis), expected[1])
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
    replica: Replica, start: float, span: float, frames: int, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        simulate_flight(replica, start, span, frames)


def test_films_play_back_as_they_were_written(tmp_path: Path) -> None:
    """A bright spot of four pixels keeps its colour beside a large grey gradient."""
    grey = np.tile(np.linspace(100, 200, 64, dtype=np.uint8)[None, :, None], (48, 1, 3))
    frames = [grey.copy() for _ in range(7)]
    for k, frame in enumerate(frames):
        frame[10:12, 5 * k + 4 : 5 * k + 6] = (255, 46, 154)
    write_film(tmp_path / "spot.gif", frames, fps=20)
    with Image.open(tmp_path / "spot.gif") as image:
        pages = [
            (np.array(page.convert("RGB")), page.info["duration"])
            for page in ImageSequence.Iterator(image)
        ]
        assert image.info["loop"] == 0
    assert [duration for _, duration in pages] == [50] * 7
    for (page, _), frame in zip(pages, frames, strict=True):
        assert np.abs(page.astype(int) - frame).max() < 12
    pytest.importorskip("imageio_ffmpeg")
    write_film(tmp_path / "spot.mp4", frames, fps=20)
    again = imageio.mimread(tmp_path / "spot.mp4")
    assert len(again) == 7
    assert all(
        np.abs(page.astype(int) - frame).mean() < 8
        for page, frame in zip(again, frames, strict=True)
    )


def test_where_no_film_can_be_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(
        InputError, match=r"shot\.avi: films are written as \.gif or \.mp4; give such a name"
    ):
        film_path(tmp_path / "shot.avi")
    with pytest.raises(InputError, match="the folder does not exist"):
        film_path(tmp_path / "nowhere" / "shot.gif")
    (tmp_path / "shot.gif").mkdir()
    with pytest.raises(InputError, match=r"shot\.gif: is a folder"):
        film_path(tmp_path / "shot.gif")

    def refuse(**_: object) -> None:
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr(subprocess_drawing.tempfile, "TemporaryFile", refuse)
        with pytest.raises(InputError, match=r"a\.gif: cannot be written: Permission"):
            film_path(tmp_path / "a.gif")
    monkeypatch.setattr(film, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"pip install 'chamberopt\[mp4\]'"):
        film_path(tmp_path / "shot.mp4")
    for fps, size, frames, name, said in (
        (0, (64, 64), 9, "a.gif", "--fps"),
        (20, (10, 64), 9, "a.gif", "--size"),
        (20, (100, 64), 9, "a.mp4", "multiples of 16"),
        (
            20,
            (2000, 1500),
            101,
            "a.gif",
            "--frames: given 101; at most 100 are supported at 2000 x 1500 pixels",
        ),
    ):
        with pytest.raises(InputError, match=said):
            film.require_playable(fps, size, frames, Path(name))


@needs_opengl
def test_a_replay_shows_balls_that_move_and_hits(result: Result, tmp_path: Path) -> None:
    seen = simulate_flight(rebuild_replica(result), 0.02, 0.008, 6)
    assert len(seen.impacts) > 5
    assert draw_replay(result.folder, seen, tmp_path / "plate.gif", 20, (320, 240)) is None
    with Image.open(tmp_path / "plate.gif") as image:
        pages = [
            np.array(page.convert("RGB")).astype(int) for page in ImageSequence.Iterator(image)
        ]
    assert len(pages) == 6
    assert all((np.abs(one - other).max(axis=2) > 40).sum() > 200 for one, other in pairwise(pages))
    last = pages[-1]
    assert (np.abs(last - [0xE0, 0x8A, 0x2E]).max(axis=2) < 24).mean() > 0.03  # the sonotrode
    red, green, blue = last.transpose(2, 0, 1)
    assert (
        (red > 120) & (green < 0.55 * red) & (blue > 1.3 * green)
    ).sum() > 20  # magenta: balls that have just hit
    assert list(tmp_path.iterdir()) == [tmp_path / "plate.gif"]


def test_on_the_command_line(
    result: Result, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = str(result.folder)
    for arguments, said in (
        (["replay", folder, str(tmp_path / "a.avi")], ".gif or .mp4"),
        (["replay", str(tmp_path), str(tmp_path / "a.gif")], "not a results folder"),
        (["replay", folder, str(tmp_path / "a.gif"), "--span-ms", "1000"], "--span-ms: given 1000"),
        (["replay", folder, str(tmp_path / "a.gif"), "--replica", "9"], "--replica: given 9"),
        (["replay", folder, str(tmp_path / "a.gif"), "--fps", "99"], "--fps: given 99"),
    ):
        assert main(arguments) == 2
        said_there = capsys.readouterr().err.strip().splitlines()
        assert said in said_there[-1]
        assert not list(tmp_path.glob("a.*"))
