"""Faces that bend: local pistons, work and energy of each impact, and refusals."""

import math

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from sim_core import (
    AmplitudeProfile,
    Balls,
    Friction,
    Gravity,
    Physics,
    RandomPhase,
    Rest,
    Restitution,
    Roughness,
    Scene,
    SceneError,
    SimulationResult,
    Vibration,
    cylinder_cavity,
    pack_balls,
    periodic_box,
    simulate,
)
from sim_core.loop.compile_ahead import compile_simulator, is_compiled
from tests.helpers.scenes.cavities import CEILING, FLOOR, SIDES, box, cylinder

A, HZ, PHASE = 25e-6, 20e3, 0.3
OMEGA = math.tau * HZ
WIDE, HIGH, DIAMETER = 0.06, 0.03, 3e-3
ROOM = box((WIDE, WIDE, HIGH))
MIDDLE = (0.5 * WIDE, 0.5 * WIDE, 0.0)
# flat from 10 to 20 mm, and steep from there
POINTS = ((0.0, 1.0), (0.01, 0.8), (0.02, 0.8), (0.03, 0.5), (0.045, 0.4))
BENT = AmplitudeProfile(POINTS, MIDDLE)
FLOOR_WAVE = Vibration(FLOOR, A, HZ, PHASE, profile=BENT)
LAW = (0.8, 1.0, 0.0)
LAWS = Restitution((LAW,) * 3, LAW)


def share_and_slope(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Share (n,) and its gradient (n, 2) [1/m] at places (n, 3): scipy's cubic in r²."""
    distance, share = np.array(POINTS).T
    cubic = PchipInterpolator(distance**2, share)
    across = place[:, :2] - np.array(MIDDLE)[:2]
    q = (across**2).sum(axis=1)
    return cubic(q), 2.0 * cubic.derivative()(q)[:, None] * across


def shot(count: int, speed: float = 1.0, diameter: float | np.ndarray = DIAMETER) -> Balls:
    rng = np.random.default_rng(3)
    places = pack_balls(ROOM, count, diameter, rng, 2.0 * A)
    return Balls(places, rng.normal(0.0, speed, places.shape), diameter)


def played(
    wave: Vibration | tuple[Vibration, ...], balls: Balls, duration: float
) -> SimulationResult:
    return simulate(Scene(ROOM, balls, Physics(Gravity(), LAWS, wave), duration))


def require_same(one: SimulationResult, other: SimulationResult) -> None:
    for name in ("time", "ball", "position", "velocity"):
        np.testing.assert_array_equal(getattr(one.impacts, name), getattr(other.impacts, name))
    np.testing.assert_array_equal(one.balls.velocities, other.balls.velocities)


@pytest.mark.parametrize(("distance", "share"), [(0.0, 1.0), (0.013, 0.8), (0.019, 0.8)])
def test_a_ball_that_hops_upright_meets_a_piston(distance: float, share: float) -> None:
    """Bit for bit, where the face is level: in its middle, and on the ring from 10 to 20 mm."""
    ball = Balls(np.array([[MIDDLE[0] + distance, MIDDLE[1], 0.01]]), np.zeros((1, 3)), DIAMETER)
    one = played(FLOOR_WAVE, ball, 2.0)
    other = played(FLOOR_WAVE._replace(amplitude=share * A, profile=None), ball, 2.0)
    assert one.collisions.sonotrode > 30
    require_same(one, other)


def test_a_constant_profile_is_a_smaller_piston() -> None:
    even = AmplitudeProfile(((0.0, 0.7), (0.045, 0.7)), MIDDLE)
    one = played(FLOOR_WAVE._replace(profile=even), shot(40), 0.5)
    other = played(FLOOR_WAVE._replace(amplitude=0.7 * A, profile=None), shot(40), 0.5)
    assert one.collisions == other.collisions
    require_same(one, other)


@pytest.mark.long
def test_a_rigid_sonotrode_beside_one_that_bends_stays_rigid() -> None:
    lid = Vibration(CEILING, A, 0.9 * HZ, 1.0, (0.0, 0.0, -1.0))
    even = AmplitudeProfile(((0.0, 1.0), (0.045, 1.0)), MIDDLE)
    floor = FLOOR_WAVE._replace(profile=None)
    one = played((floor, lid._replace(profile=even)), shot(40), 0.2)
    require_same(one, played((floor, lid), shot(40), 0.2))


@pytest.mark.parametrize("seed", range(6))
def test_each_impact_has_the_work_and_the_loss_of_its_place(seed: int) -> None:
    """One ball flies freely from impact to impact, and at each the law holds in the frame of the
    face at that place: the ball's energy changes by the work of the face less (1 - e²) m v²/2, with
    the speed along the normal of the bent face.
    """
    velocity = np.random.default_rng(seed).normal(0.0, 5.0, (1, 3))
    ball = Balls(np.array([[0.02, 0.04, 0.01]]), velocity, DIAMETER)
    result = played(FLOOR_WAVE, ball, 2.0)
    log, fall = result.impacts, np.array(Gravity())
    floor = ROOM.tags[log.triangle] == FLOOR
    assert floor.sum() > 20
    corners = ROOM.corners[log.triangle]
    out = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = -out / np.linalg.norm(out, axis=1)[:, None]
    face = np.zeros_like(normal)
    share, slope = share_and_slope(log.position[floor])
    angle = OMEGA * log.time[floor] + PHASE
    normal[floor, :2] = -A * np.sin(angle)[:, None] * slope
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    face[floor, 2] = A * OMEGA * share * np.cos(angle)
    approach = -np.einsum("ij,ij->i", normal, log.velocity)
    np.testing.assert_allclose(log.normal_speed, approach, atol=1e-9)
    e = np.where(approach > LAWS.elastic_below, LAW[0], 1.0)
    change = ((1.0 + e) * approach)[:, None] * normal
    work = np.einsum("ij,ij->i", change, face)  # of the face, for a unit mass
    loss = 0.5 * (1.0 - e**2) * approach**2

    def energy(balls: Balls) -> float:
        return float(0.5 * (balls.velocities**2).sum() - balls.positions[0] @ fall)

    gained = energy(result.balls) - energy(ball)
    assert gained == pytest.approx((work - loss).sum(), abs=1e-8)
    assert np.abs(work).sum() > 1.0
    # and the law of each impact, from the velocity after it to that before the next one
    before = log.velocity + face
    flight = np.diff(log.time)[:, None] * fall
    np.testing.assert_allclose(before[1:], before[:-1] + change[:-1] + flight, atol=1e-9)


def least_gap(balls: Balls, physics: Physics) -> tuple[float, int]:
    """Least gap [m] of all balls from the face under them at 20,000 moments, and how many gaps are
    below one amplitude.
    """
    times = np.linspace(0.0, 0.5, 20_000)
    result = simulate(Scene(ROOM, balls, physics, 0.5), frames=times)
    positions = np.asarray(result.frames.positions)
    share, _ = share_and_slope(positions.reshape(-1, 3))
    height = A * share.reshape(positions.shape[:2]) * np.sin(OMEGA * times + PHASE)[:, None]
    gap = positions[:, :, 2] - 0.5 * balls.diameters - height
    return float(gap.min()), int((gap < A).sum())


def test_no_ball_is_ever_below_the_face_under_it() -> None:
    least, near = least_gap(shot(60), Physics(Gravity(), LAWS, FLOOR_WAVE))
    assert least > -1e-13
    assert near > 100


@pytest.mark.long
def test_balls_of_three_sizes_that_rub_on_rough_faces_are_never_below_them() -> None:
    diameters = np.tile([2e-3, 2.5e-3, 3e-3], 60)
    friction = Friction(((0.3, 0.2),) * 3, (0.3, 0.2))
    physics = Physics(Gravity(), LAWS, FLOOR_WAVE, friction=friction)
    physics = physics._replace(roughness=Roughness((0.05,) * 3, 1))
    least, near = least_gap(shot(180, 1.0, diameters), physics)
    assert least > -1e-13
    assert near > 1000


@pytest.mark.long
def test_random_phases_and_an_exact_cylinder_bend_too() -> None:
    wave = FLOOR_WAVE._replace(profile=AmplitudeProfile(((0.0, 1.0), (0.03, 0.5))))
    room = cylinder_cavity(0.03, 0.0, HIGH, (FLOOR, CEILING, SIDES))
    rng = np.random.default_rng(1)
    places = pack_balls(room, 20, DIAMETER, rng, A)
    balls = Balls(places, rng.normal(size=places.shape), DIAMETER)
    mesh = cylinder(0.03, HIGH)
    for cavity in (room, mesh):
        tags = (FLOOR, CEILING, SIDES)
        assert set(np.unique(cavity.tags)) == set(tags)
        physics = Physics(Gravity(), LAWS, wave, random_phase=RandomPhase(1))
        assert simulate(Scene(cavity, balls, physics, 0.1)).collisions.sonotrode > 0


def test_code_for_bent_faces_is_compiled_ahead() -> None:
    physics = Physics(Gravity(), LAWS, FLOOR_WAVE)
    compile_simulator(physics)
    assert is_compiled(physics, 1)


STEEP = AmplitudeProfile(((0.0, 1.0), (0.001, 0.5), (0.05, 0.5)), MIDDLE)


@pytest.mark.parametrize(
    ("profile", "message"),
    [
        (0.9, "give an AmplitudeProfile, or None"),
        (AmplitudeProfile(((0.0, 1.0), (0.02, 0.9)), MIDDLE), "goes on to 0.0424264 m: give a sha"),
        (AmplitudeProfile(POINTS, (0.0, 0.0, 0.0)), "goes on to 0.0848528 m"),
        (AmplitudeProfile(((0.0, 1.0),)), "give two or more, the first at 0"),
        (AmplitudeProfile(((0.01, 1.0), (0.05, 1.0))), "give two or more, the first at 0"),
        (AmplitudeProfile(((0.0, 1.0), (0.05, 1.0), (0.05, 0.9))), "give them in order"),
        (AmplitudeProfile(((0.0, 1.1), (0.05, 1.0))), r"share 1.1: it must lie in \[0, 1\]"),
        (AmplitudeProfile(((0.0, "a"), (0.05, 1.0))), r"points\[0\]"),  # type: ignore[arg-type]
        (STEEP, "would lean by up to"),
    ],
)
def test_wrong_profiles_are_refused(profile: AmplitudeProfile, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        played(FLOOR_WAVE._replace(profile=profile), shot(2), 0.1)


def test_what_cannot_bend_is_refused() -> None:
    with pytest.raises(SceneError, match="moves askew"):
        played(FLOOR_WAVE._replace(axis=(0.1, 0.0, 1.0)), shot(2), 0.1)
    rest = Physics(Gravity(), LAWS, FLOOR_WAVE, Rest(on_vibrating=True))
    with pytest.raises(SceneError, match="a vibration has a profile: not supported together"):
        Scene(ROOM, shot(2), rest, 0.1)
    cube = periodic_box((0.0, 0.0, 0.0), (WIDE, WIDE, HIGH), (FLOOR, CEILING))
    with pytest.raises(SceneError, match="not supported in a periodic box"):
        Scene(cube, shot(2), Physics(Gravity(), LAWS, FLOOR_WAVE), 0.1)


def test_a_ball_may_start_above_a_lowered_rim_but_not_in_it() -> None:
    """The rim is lowered by 0.4 A only, where a piston would leave room down to A."""
    lowered = FLOOR_WAVE._replace(phase=1.5 * math.pi)
    rim = np.array([[0.05, 0.05, 0.5 * DIAMETER]])  # 28 mm from the middle
    share = share_and_slope(rim)[0][0]
    for below, fits in ((0.99, True), (1.01, False)):
        place = rim - [0.0, 0.0, below * share * A]
        balls = Balls(place, np.zeros((1, 3)), DIAMETER)
        if fits:
            Scene(ROOM, balls, Physics(Gravity(), LAWS, lowered), 0.1)
            continue
        with pytest.raises(SceneError, match="inside the vibrating surface"):
            Scene(ROOM, balls, Physics(Gravity(), LAWS, lowered), 0.1)
