"""Same scene, same bits: run twice, on threads, with the JIT off, stopped and resumed."""

import hashlib
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from sim_core import (
    Balls,
    Drag,
    Gravity,
    Physics,
    RandomPhase,
    Restitution,
    Scene,
    SceneError,
    SimulationResult,
    Vibration,
    pack_balls,
    simulate,
)
from tests.helpers.jit_on_and_off import with_and_without_jit
from tests.helpers.scenes.cavities import FLOOR, cylinder

PHYSICS = Physics(
    Gravity(),
    Restitution(((0.9, 0.7), (0.9, 0.7), (0.8, 0.5)), (0.9, 0.7)),
    Vibration(FLOOR, 25e-6, 20e3, 0.3),
)


def small_scene(duration: float, count: int = 20) -> Scene:
    room = cylinder(0.012, 0.02, sections=12)
    rng = np.random.default_rng(5)
    balls = Balls(pack_balls(room, count, 3e-3, rng), rng.normal(0.0, 3.0, (count, 3)), 3e-3)
    return Scene(room, balls, PHYSICS, duration)


def scene_with_everything_else(duration: float, count: int = 6) -> Scene:
    """Two sizes in still air over a floor that each meets at a phase of its own."""
    scene = small_scene(duration, count)
    physics = PHYSICS._replace(random_phase=RandomPhase(4), drag=Drag(density=50.0))
    diameter = np.where(np.arange(count) % 2 == 0, 3e-3, 2e-3)
    return Scene(
        scene.mesh,
        Balls(scene.balls.positions, scene.balls.velocities, diameter),
        physics,
        duration,
    )


def fingerprint(result: SimulationResult) -> str:
    digest = hashlib.sha256()
    log = result.impacts
    for column in (log.time, log.ball, log.triangle, log.position, log.velocity, log.normal_speed):
        digest.update(np.ascontiguousarray(column).tobytes())
    digest.update(result.balls.positions.tobytes() + result.balls.velocities.tobytes())
    return digest.hexdigest()


def test_the_same_scene_gives_the_same_bits_alone_and_on_threads() -> None:
    scene = small_scene(1.0)
    once = fingerprint(simulate(scene))
    with ThreadPoolExecutor(4) as pool:
        assert {fingerprint(r) for r in pool.map(simulate, [scene] * 4)} == {once}


@pytest.mark.parametrize("scene", ["small_scene", "scene_with_everything_else"])
def test_the_jit_switched_off_gives_the_same_bits(scene: str) -> None:
    code = (
        f"from tests.sim_core.loop.test_determinism import fingerprint, {scene};"
        "from sim_core import simulate;"
        f"r = simulate({scene}(0.03, 6)); print(r.collisions.total, fingerprint(r))"
    )
    answers = with_and_without_jit(code)
    assert int(answers[0].split()[0]) > 50
    assert answers[0] == answers[1]


def test_stopping_and_going_on_changes_nothing() -> None:
    """A full impact buffer, a check and a stop change no trajectory."""
    whole = simulate(small_scene(0.5))
    warm = small_scene(0.3)
    warm = simulate(Scene(warm.mesh, warm.balls, PHYSICS, duration=0.3, warmup=0.2))
    assert (whole.balls.positions == warm.balls.positions).all()
    late = whole.impacts.time > 0.2
    np.testing.assert_array_equal(whole.impacts.triangle[late], warm.impacts.triangle)
    np.testing.assert_allclose(whole.impacts.time[late] - 0.2, warm.impacts.time, atol=1e-15)


def test_frames_show_the_balls_on_their_flights_and_change_nothing() -> None:
    """Frames change no bit of the impacts, and show each ball on its flight."""
    scene = small_scene(0.2)
    times = np.linspace(0.0, scene.duration, 301)
    plain, watched = simulate(scene), simulate(scene, frames=times)
    for column in ("time", "ball", "triangle", "position", "velocity", "normal_speed"):
        np.testing.assert_array_equal(
            getattr(plain.impacts, column), getattr(watched.impacts, column)
        )
    np.testing.assert_array_equal(plain.balls.positions, watched.balls.positions)
    assert plain.frames.positions.shape == plain.frames.velocities.shape == (0, len(scene.balls), 3)
    assert plain.frames.spins is None
    np.testing.assert_array_equal(watched.frames.time, times)
    np.testing.assert_array_equal(watched.frames.positions[-1], watched.balls.positions)
    np.testing.assert_array_equal(watched.frames.velocities[-1], watched.balls.velocities)

    # The frame at an impact has the ball where the log has it.
    rows = np.flatnonzero(np.diff(plain.impacts.time, append=np.inf) > 1e-9)[10:20]
    at = simulate(scene, frames=plain.impacts.time[rows]).frames.positions
    there = at[np.arange(len(rows)), plain.impacts.ball[rows]]
    np.testing.assert_allclose(there, plain.impacts.position[rows], atol=1e-12)


@pytest.mark.parametrize("frames", [[-1e-9], [0.0, 0.0], [2.0, 1.0], [1e9], [np.nan]])
def test_frames_outside_the_duration_or_out_of_order_are_refused(frames: list[float]) -> None:
    with pytest.raises(SceneError, match="frames"):
        simulate(small_scene(0.2), frames=frames)
