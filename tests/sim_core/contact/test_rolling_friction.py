"""Slipping, rolling and lying still with friction, against the mechanics of a solid sphere.

Steel balls of 3 mm. They have rolling resistance only where it is given.
"""

import math

import numpy as np
import pytest

from sim_core import Balls, Friction, Physics, Scene, pack_balls, simulate
from sim_core.contact.path_end import MAX_TURN
from sim_core.effects.contact_mode import SLIDING
from sim_core.effects.gravity import STANDARD as G
from tests.helpers.jit_on_and_off import with_and_without_jit
from tests.helpers.scenes import contact_mode as contact_scenes
from tests.helpers.scenes.cavities import box
from tests.helpers.scenes.contact_mode import (
    CAPTURE,
    DIAMETER,
    TAGS,
    TOUCH,
    R,
    energies,
    film,
    mode,
    slope,
    supports,
)
from tests.helpers.scenes.terrain import profile, terrain
from tests.sim_core.loop.test_determinism import fingerprint

ALLEY = box((0.6, 0.1, 0.02))
ON_A_PLANE = 2.0 / 5.0  # moment of inertia of a solid sphere over m R²


def physics(mu: float, e: float = 0.8, resistance: float = 0.0, beta0: float = 0.2) -> Physics:
    """As for balls without friction, and the same friction everywhere."""
    return contact_scenes.physics(e, resistance)._replace(
        friction=Friction(((mu, beta0),) * TAGS, (mu, beta0))
    )


def shot(
    place: object, velocity: object = (0.0, 0.0, 0.0), spin: object = (0.0, 0.0, 0.0)
) -> Balls:
    rows = (np.array([row], dtype=float) for row in (place, velocity, spin))
    places, velocities, spins = rows
    return Balls(places, velocities, DIAMETER, spins=spins)


def spin(balls: Balls) -> np.ndarray:
    """Of the first ball."""
    assert balls.spins is not None
    return np.asarray(balls.spins[0])


def downhill(mu: float, degrees: float, inertia: float, load: float = 1.0) -> float:
    """Acceleration [m/s²] of a body that rolls, or slips if mu does not hold it.

    ``inertia`` is I/(m h²).

    ``load``: on its supports, over that on a plane.
    """
    push, press = (
        G * math.sin(math.radians(degrees)),
        mu * load * G * math.cos(math.radians(degrees)),
    )
    rolls = push / (1.0 + inertia)
    return rolls if push - rolls < press else push - press


@pytest.mark.parametrize("tags", [1, 6])  # one: the plane is merged; six: its triangles stay apart
@pytest.mark.parametrize(
    ("mu", "resistance"), [(0.0, 0.0), (0.05, 0.0), (0.1, 0.0), (10.0, 0.0), (10.0, 0.05)]
)
def test_down_a_ramp_of_many_triangles_it_rolls_or_slips(
    mu: float, resistance: float, tags: int
) -> None:
    """At 15 degrees it rolls from mu = 2/7 tan on, with 5/7 of the acceleration."""
    degrees, until = 15.0, 0.35
    rng = np.random.default_rng(3)
    x = np.sort(np.concatenate([[0.0, 0.3], rng.uniform(0.0, 0.3, 30)]))
    y = np.sort(np.concatenate([[-0.02, 0.02], rng.uniform(-0.02, 0.02, 6)]))
    ramp = terrain(
        x, y, np.tile(-math.tan(math.radians(degrees)) * x[:, None], len(y)), 0.05, rng, tags
    )
    normal, down = slope(degrees)
    start = 0.02 / down[0] * down + R * normal + np.array([0.0, 0.003, 0.0])
    run, frames = film(ramp, shot(start), physics(mu, resistance=resistance), until)
    push = downhill(mu, degrees, ON_A_PLANE) - resistance * G * math.cos(math.radians(degrees))
    rolls = mu > 2.0 / 7.0 * math.tan(math.radians(degrees))
    gone = frames[-1].positions[0] - start
    assert gone @ down == pytest.approx(0.5 * push * until**2, rel=1e-7)
    assert abs(gone @ normal) < TOUCH
    assert abs(gone[1]) < TOUCH
    assert frames[-1].velocities[0] @ down == pytest.approx(push * until, rel=1e-7)
    turns = push if rolls else 2.5 * mu * G * math.cos(math.radians(degrees))
    np.testing.assert_allclose(
        spin(frames[-1]), [0.0, turns * until / R, 0.0], rtol=1e-7, atol=1e-6
    )
    assert run.state.counts[0] == 1
    if resistance == 0.0:
        assert (np.diff(energies(frames)) < 1e-14).all()
        if mu in (0.0, 10.0):
            assert np.abs(np.diff(energies(frames))).max() < 1e-14


@pytest.mark.parametrize("mu", [0.1, 0.5])
def test_a_ball_thrown_along_the_floor_slips_until_it_rolls_with_five_sevenths(mu: float) -> None:
    """After 2 v/(7 mu g) and 12 v²/(49 mu g) [m]."""
    v = 0.5
    when, where = 2.0 * v / (7.0 * mu * G), 12.0 * v**2 / (49.0 * mu * G)
    start = shot([0.01, 0.05, R], [v, 0.0, 0.0])
    for until in (0.5 * when, when, when + 0.1):
        end = simulate(Scene(ALLEY, start, physics(mu), until)).balls
        slipping, rolling = min(until, when), max(until - when, 0.0)
        gone = v * slipping - 0.5 * mu * G * slipping**2 + 5.0 / 7.0 * v * rolling
        assert end.positions[0, 0] - 0.01 == pytest.approx(gone, rel=1e-9)
        assert end.velocities[0, 0] == pytest.approx(v - mu * G * slipping, rel=1e-9)
        np.testing.assert_allclose(
            spin(end), [0.0, 2.5 * mu * G * slipping / R, 0.0], rtol=1e-9, atol=1e-9
        )
    assert gone - 5.0 / 7.0 * v * rolling == pytest.approx(where, rel=1e-12)
    assert spin(end)[1] * R == pytest.approx(end.velocities[0, 0], rel=1e-12)


def test_a_ball_that_spins_askew_goes_along_a_parabola_and_then_straight_on() -> None:
    """The slip keeps its direction on the level; spin about the upright axis stays."""
    mu, v, w = 0.2, np.array([0.3, 0.0, 0.0]), np.array([-150.0, 100.0, 40.0])
    slip = v + np.cross(w, [0.0, 0.0, -R])
    pull = -mu * G * slip / np.linalg.norm(slip)
    when = 2.0 * np.linalg.norm(slip) / (7.0 * mu * G)
    start = np.array([0.05, 0.05, R])
    run, frames = film(ALLEY, shot(start, v, w), physics(mu), 2.0 * when, 10)
    for until, frame in zip(np.linspace(0.0, 2.0 * when, 11), frames, strict=True):
        slipping = min(until, when)
        here = start + v * until + pull * slipping * (until - 0.5 * slipping)
        np.testing.assert_allclose(frame.positions[0], here, atol=1e-12)
    np.testing.assert_allclose(frames[-1].velocities[0], v - 2.0 / 7.0 * slip, atol=1e-12)
    assert spin(frames[-1])[2] == pytest.approx(40.0, abs=1e-9)
    assert run.state.counts[0] == 1
    assert (np.diff(energies(frames)) < 1e-15).all()


@pytest.mark.parametrize(
    "speed", [0.4, 4.0]
)  # the faster turns by less than MAX_TURN while it is searched in one piece
def test_on_a_slope_a_slip_that_turns_is_followed(speed: float) -> None:
    """Against small steps of the equations of motion, v' = g + f and w' = -5/(2R) n x f."""
    mu, degrees, until = 0.15, 20.0, 0.25
    normal, down = slope(degrees)
    x = np.array([0.0, 0.5])
    ramp = profile(x, -math.tan(math.radians(degrees)) * x, 0.5 * speed, 0.05)
    pull = G * math.sin(math.radians(degrees)) * down
    start, v, w = (
        0.02 / down[0] * down + R * normal,
        np.array([0.0, speed, 0.0]),
        np.array([0.0, -60.0, 0.0]),
    )
    _, frames = film(ramp, shot(start, v, w), physics(mu), until, 10)
    step, place = 1e-5, start.copy()
    for _ in range(round(until / step)):
        slip = v + np.cross(w, -R * normal)
        size = np.linalg.norm(slip)
        rub = (
            -mu * G * math.cos(math.radians(degrees)) * slip / size
            if size > 1e-3
            else -2.0 / 7.0 * pull
        )
        place += step * v
        v = v + step * (pull + rub)
        w = w - step * 2.5 / R * np.cross(normal, rub)
    lag = (
        0.5 * MAX_TURN * mu * G * math.cos(math.radians(degrees))
    )  # the force's direction is old by MAX_TURN at most
    np.testing.assert_allclose(frames[-1].positions[0], place, atol=0.5 * lag * until**2)
    np.testing.assert_allclose(frames[-1].velocities[0], v, atol=lag * until)
    assert (np.diff(energies(frames)) < 1e-14).all()


@pytest.mark.parametrize("mu", [0.0, 0.02, 10.0])
def test_down_a_valley_it_rolls_on_both_faces(mu: float) -> None:
    """It rolls about the line through its two touching points, h below the centre.

    Along the crease it gains g sin / (1 + 2/5 R²/h²).
    """
    lift, fall, until = math.tan(math.radians(40.0)), 0.1, 0.5
    y, x = np.array([-0.02, 0.0, 0.02]), np.linspace(0.0, 0.3, 31)
    valley = terrain(
        x, y, np.abs(y)[None, :] * lift - fall * x[:, None], 0.05, np.random.default_rng(1), tags=4
    )
    one = np.array([fall, -lift, 1.0]) / math.sqrt(fall**2 + lift**2 + 1.0)
    start = np.array([0.02, 0.0, -0.002 + R / one[2]])
    run, frames = film(valley, shot(start), physics(mu), until)
    crease = np.array([1.0, 0.0, -fall]) / math.hypot(1.0, fall)
    up = np.array([fall, 0.0, 1.0]) / math.hypot(1.0, fall)
    height = R * (one @ up)
    push = downhill(mu, math.degrees(math.atan(fall)), 0.4 * (R / height) ** 2, 1.0 / (one @ up))
    gone = frames[-1].positions[0] - start
    assert gone @ crease == pytest.approx(0.5 * push * until**2, rel=1e-6)
    assert abs(gone[1]) < 1e-12
    assert supports(run) == 2
    if mu == 10.0:
        assert spin(frames[-1])[1] == pytest.approx(push * until / height, rel=1e-6)
    assert (np.diff(energies(frames)) < 1e-14).all()


@pytest.mark.parametrize("speed", [0.002, 0.05, 0.1])
def test_slowly_over_an_edge_it_rolls_until_it_leaves_it(speed: float) -> None:
    """A rolling ball leaves an edge where cos a = (10 + 7 v²/(g R))/17, at v = sqrt(g R cos a).

    The arc is taken in steps of 0.004 rad and in hops, longer as the load gets less, that do not
    spin it up.
    """
    x = np.array([0.0, 0.1, 0.1 + 1e-6, 0.4])
    cliff = profile(x, np.array([0.0, 0.0, -0.05, -0.05]), 0.02, 0.05)
    start = shot([0.0999, 0.0, R], [speed, 0.0, 0.0], [0.0, speed / R, 0.0])
    _, frames = film(cliff, start, physics(1e3), 1e-4 / speed + 0.09, 60)
    leaves = min(1.0, (10.0 + 7.0 * speed**2 / (G * R)) / 17.0)
    assert (np.diff(energies(frames)) < 1e-12).all()
    end = frames[-1]
    if end.positions[0, 2] > -0.05 + R + 1e-3:  # in flight, not down yet
        assert end.velocities[0, 0] == pytest.approx(math.sqrt(G * R) * leaves**1.5, rel=0.03)
        assert spin(end)[1] * R == pytest.approx(math.sqrt(G * R * leaves), rel=0.06)


def test_a_trough_of_facets_is_a_rolling_pendulum() -> None:
    """T = 2 pi sqrt(7 L/(5 g)) for small swings, and hardly any energy is lost."""
    radius = 0.05
    angle = np.radians(np.arange(-60.25, 60.5, 0.5))
    trough = profile(radius * np.sin(angle), -radius * np.cos(angle), 0.01, 0.02)
    length, swing = radius - R, math.radians(8.0)
    start = shot([0.999 * length * math.sin(swing), 0.0, -0.999 * length * math.cos(swing)])
    run, frames = film(trough, start, physics(5.0, 0.5), 4.0, 800)
    x, time = np.array([f.positions[0, 0] for f in frames]), np.linspace(0.0, 4.0, 801)
    up = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    crossings = time[up] - x[up] * (time[up + 1] - time[up]) / (x[up + 1] - x[up])
    period = 2.0 * math.pi * math.sqrt(1.4 * length / G) * (1.0 + swing**2 / 16.0)
    assert np.diff(crossings)[2:].mean() == pytest.approx(period, rel=5e-3)
    spent = energies(frames)
    assert (np.diff(spent) < 1e-12).all()
    assert spent[100] - spent[-1] < 0.05 * (spent[100] + G * length)
    assert run.state.counts[3] < 20_000


@pytest.mark.parametrize(
    ("mu", "resistance", "still"), [(0.37, 0.27, True), (0.36, 0.27, False), (0.37, 0.25, False)]
)
def test_on_a_slope_it_lies_still_where_neither_slip_nor_roll_moves_it(
    mu: float, resistance: float, still: bool
) -> None:
    """At 20 degrees: tan is 0.364, and 5/7 of it, what rolling takes, 0.260."""
    normal, down = slope(20.0)
    x = np.array([0.0, 0.1])
    ramp = profile(x, -math.tan(math.radians(20.0)) * x, 0.01, 0.05)
    result = simulate(
        Scene(
            ramp, shot(0.05 * down + (R + 1e-9) * normal), physics(mu, resistance=resistance), 0.2
        )
    )
    assert (len(result.resting) == 1) is still
    if still:
        assert (spin(result.balls) == 0.0).all()


def test_resistance_stops_a_rolling_ball_and_takes_its_spin() -> None:
    """It rolls v²/(2 resistance g), as without friction: resistance is the deceleration."""
    v, resistance = 0.2, 0.1
    start = shot([0.01, 0.05, R], [v, 0.0, 0.0], [0.0, v / R, 0.0])
    result = simulate(Scene(ALLEY, start, physics(0.5, resistance=resistance), 1.0))
    assert result.balls.positions[0, 0] - 0.01 == pytest.approx(
        v**2 / (2.0 * resistance * G), rel=1e-6
    )
    assert result.resting.since[0] == pytest.approx(v / (resistance * G), rel=1e-6)
    assert (spin(result.balls) == 0.0).all()


@pytest.mark.parametrize("mu", [0.01, 0.3, 10.0])
def test_landing_it_rolls_in_the_end_with_what_the_floor_leaves_it(mu: float) -> None:
    """Its angular momentum about a line in the floor stays: v = (5 v0 + 2 R w0)/7 when it rolls."""
    v, w = 0.15, -60.0
    start = shot([0.01, 0.05, R + 0.002], [v, 0.0, 0.0], [0.0, w, 0.0])
    run, frames = film(ALLEY, start, physics(mu, 0.5), 2.0, 400)
    rolls = (5.0 * v + 2.0 * R * w) / 7.0
    assert frames[-1].velocities[0, 0] == pytest.approx(rolls, rel=1e-9)
    np.testing.assert_allclose(spin(frames[-1]), [0.0, rolls / R, 0.0], rtol=1e-9, atol=1e-9)
    assert mode(run) == SLIDING
    assert (np.diff(energies(frames)) < 1e-14).all()
    if mu == 10.0:  # at once: after the first bounce, which leaves it in the air for 20 ms
        after = frames[8]
        assert abs(after.velocities[0, 0] - rolls) < 0.2 * abs(v - rolls)


def test_without_grip_it_moves_as_without_friction_to_the_last_bit() -> None:
    scene = contact_scenes.small_scene()
    smooth = scene.physics._replace(
        rest=scene.physics.rest._replace(resistance=0.0),  # type: ignore[union-attr]
        friction=Friction(((0.0, 0.2),) * TAGS, (0.0, 0.2)),
    )
    one, two = (
        simulate(Scene(scene.mesh, scene.balls, what, 0.3))
        for what in (smooth, smooth._replace(friction=None))
    )
    assert one.collisions == two.collisions
    assert fingerprint(one) == fingerprint(two)


@pytest.mark.parametrize("mu", [0.05, 0.5, 10.0])
@pytest.mark.parametrize(("floor", "seed"), [("flat", 7), ("rough", 3)])
def test_in_a_settling_pile_of_rough_balls_nothing_overlaps_and_no_energy_comes_in(
    floor: str, seed: int, mu: float
) -> None:
    rng = np.random.default_rng(seed)
    room = box((0.012, 0.012, 0.06)) if floor == "flat" else contact_scenes.rough_floor(rng)
    places = pack_balls(room, 50, DIAMETER, rng)
    balls = Balls(
        places,
        rng.normal(0.0, 0.5, places.shape),
        DIAMETER,
        spins=rng.normal(0.0, 300.0, places.shape),
    )
    for _ in range(5):
        run, frames = film(room, balls, physics(mu, 0.7, 0.005), 0.1)
        balls = frames[-1]
        assert run.state.counts[:3].sum() < 200_000
        assert (np.diff(energies(frames)) < 50 * CAPTURE**2).all()
    assert np.abs(balls.velocities).max() < 0.1


def small_scene() -> Scene:
    """The six balls of small_scene, which come down spinning."""
    scene = contact_scenes.small_scene()
    spins = np.random.default_rng(9).normal(0.0, 200.0, scene.balls.positions.shape)
    balls = Balls(scene.balls.positions, scene.balls.velocities, DIAMETER, spins=spins)
    return Scene(scene.mesh, balls, physics(0.2, 0.5, 0.05), 0.15)


def test_rolling_balls_give_the_same_bits_with_the_jit_off() -> None:
    code = (
        "from tests.sim_core.contact.test_rolling_friction import small_scene;"
        "from sim_core import simulate;"
        "from tests.sim_core.loop.test_determinism import fingerprint;"
        "r = simulate(small_scene());"
        "print(r.collisions.total, fingerprint(r), r.balls.spins.tobytes().hex())"
    )
    answers = with_and_without_jit(code)
    assert int(answers[0].split()[0]) > 50
    assert answers[0] == answers[1]


def test_a_ball_that_spins_itself_against_a_wall_uphill_stays_there_until_it_slips_no_more() -> (
    None
):
    """Friction holds it at the wall while its slip u = R w falls at 5/2 mu g cos.

    Then it rolls down with 5/7 of g sin. The wall, which bears only what friction presses, does not
    rub.
    """
    mu, degrees, w = 0.3, 5.0, 150.0
    normal, down = slope(degrees)
    x = np.array([0.0, 0.3])
    ramp = profile(x, -math.tan(math.radians(degrees)) * x, 0.02, 0.05)
    away = R * (1.0 + normal[0]) / down[0]  # of the wall at x = 0, along the slope
    start = R * normal + (R - R * normal[0]) / down[0] * down
    assert start[0] == pytest.approx(R, abs=1e-15)
    assert away > 0.0
    held = R * w / (2.5 * mu * G * math.cos(math.radians(degrees)))
    until = held + 0.2
    run, frames = film(
        ramp,
        shot(start + 1e-12 * down, [0.0, 0.0, 0.0], [0.0, -w, 0.0]),
        physics(mu, 0.5),
        until,
        50,
    )
    push = 5.0 / 7.0 * G * math.sin(math.radians(degrees))
    gone = (frames[-1].positions[0] - start) @ down
    assert gone == pytest.approx(0.5 * push * 0.2**2, rel=1e-2)
    assert run.state.counts[:3].sum() < 100
    assert (np.diff(energies(frames)) < 1e-12).all()
