"""Balls of several sizes and densities that roll, lean on one another and lie still.

All scenes have one combination of effects, so that it is compiled once: friction is there with
coefficients of 0 where balls are smooth, and the ceiling is a part that turns by an angle of 0.
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
    pack_balls,
    simulate,
)
from sim_core.effects.contact_mode import ASLEEP, ON_BALL
from sim_core.effects.gravity import STANDARD as G
from tests.helpers.scenes.contact_mode import (
    CAPTURE,
    TAGS,
    TOUCH,
    energies,
    film,
    rough_floor,
    slope,
)
from tests.helpers.scenes.terrain import CEILING, profile, terrain

# Their set of effects takes half a minute to compile.
pytestmark = pytest.mark.long

SMALL, LARGE = 1e-3, 2.5e-3  # m, radii


def physics(mu: float, e: float = 0.8, resistance: float = 0.0, tilt: float = 0.0) -> Physics:
    """The floor falls towards -x by ``tilt`` [rad], which is done by gravity."""
    law, rub = (e, 1e3), (mu, 0.0)
    return Physics(
        Gravity(-G * math.sin(tilt), 0.0, -G * math.cos(tilt)),
        Restitution((law,) * TAGS, law),
        rest=Rest(CAPTURE, resistance),
        friction=Friction((rub,) * TAGS, rub),
        part_rotation=PartRotation(CEILING, amplitude=0.0, frequency=1.0),
    )


def shot(
    places: object,
    radii: object,
    velocities: object = 0.0,
    spins: object = 0.0,
    densities: object = (7800.0, 3900.0),
) -> Balls:
    places = np.array(places, dtype=float)
    speeds, turns = (
        np.broadcast_to(np.array(rows, dtype=float), places.shape) for rows in (velocities, spins)
    )
    return Balls(places, speeds, 2.0 * np.array(radii), np.array(densities), turns)


@pytest.mark.parametrize("mu", [0.0, 0.05, 10.0])
def test_each_size_rolls_down_a_ramp_with_five_sevenths_whatever_its_radius(mu: float) -> None:
    """Smooth balls have g sin, rolling balls 5/7 of it, and a ball that slips is pushed by mu g
    cos against it. Each ball turns by its own radius.
    """
    degrees, until = 15.0, 0.2
    normal, down = slope(degrees)
    x = np.array([0.0, 0.3])
    ramp = profile(x, -math.tan(math.radians(degrees)) * x, 0.02, 0.05)
    radii, side = np.array([SMALL, LARGE]), np.array([[0.0, -0.01, 0.0], [0.0, 0.01, 0.0]])
    start = 0.02 / down[0] * down + radii[:, None] * normal + side
    _, frames = film(ramp, shot(start, radii), physics(mu), until, 10)
    push, press = G * math.sin(math.radians(degrees)), mu * G * math.cos(math.radians(degrees))
    rolls = 2.0 / 7.0 * push < press
    gain = 5.0 / 7.0 * push if rolls else push - press
    gone = (frames[-1].positions - start) @ down
    np.testing.assert_allclose(gone, 0.5 * gain * until**2, rtol=1e-9)
    turns = gain if rolls else 2.5 * press
    assert frames[-1].spins is not None
    np.testing.assert_allclose(frames[-1].spins[:, 1] * radii, turns * until, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("mu", [0.0, 10.0])
@pytest.mark.parametrize("radii", [(SMALL, LARGE), (LARGE, SMALL)])
def test_two_balls_come_to_rest_in_a_groove_as_their_radii_say(
    radii: tuple[float, float], mu: float
) -> None:
    """A ball of radius r lies r √2 above the crease of a groove of 90°. The first ball leans on
    the groove's end, the second on the first: they are r1 + r2 apart.
    """
    x, y = np.array([0.0, 0.1]), np.array([-0.02, 0.0, 0.02])
    groove = terrain(x, y, np.tile(np.abs(y), (2, 1)), 0.05)
    start = [[2.0 * LARGE, 0.0, 0.012], [8.0 * LARGE, 0.0, 0.012]]
    effects = physics(mu, 0.3, 0.01, tilt=0.2)
    result = simulate(Scene(groove, shot(start, radii), effects, 2.0))
    first, second = radii
    high = math.sqrt(2.0) * np.array(radii)
    along = math.sqrt((first + second) ** 2 - (high[1] - high[0]) ** 2)
    expected = [[first, 0.0, high[0]], [first + along, 0.0, high[1]]]
    np.testing.assert_allclose(result.balls.positions, expected, atol=1e-9)
    assert result.resting.ball.tolist() == [0, 1]
    assert not result.resting.jammed.any()
    assert (result.balls.velocities == 0.0).all()
    other_way_round = shot(start[::-1], radii[::-1], densities=(3900.0, 7800.0))
    swapped = simulate(Scene(groove, other_way_round, effects, 2.0))
    np.testing.assert_allclose(swapped.balls.positions[::-1], expected, atol=1e-9)


GAP = 1e-4  # m, before they meet
STEP = LARGE - SMALL  # the large ball rolls below the step, the small one lies upon it: level
STAIRS = profile(np.array([-0.1, 0.0, 1e-6, 0.2]), np.array([0.0, 0.0, STEP, STEP]), 0.02, 0.05)


def on_stairs(large: float, small: float) -> Balls:
    """With these speeds [m/s]; the two meet before the large ball comes to the step."""
    place = 0.3 * SMALL
    places = [[place - LARGE - SMALL - GAP, 0.0, LARGE], [place, 0.0, STEP + SMALL]]
    return shot(places, [LARGE, SMALL], [[large, 0.0, 0.0], [small, 0.0, 0.0]])


@pytest.mark.parametrize(("large", "small", "e"), [(0.5, 0.0, 0.8), (0.012, 0.004, 1.0)])
def test_a_large_ball_pushes_a_small_one_along_as_their_masses_say(
    large: float, small: float, e: float
) -> None:
    """Head on: v1' = v1 - (1 + e) m2 (v1 - v2)/(m1 + m2), and v2' by the momentum.

    The first is a fast hit on a ball that lies still. The second is slower than elastic_below, and
    both move on their supports: such a hit keeps the energy.
    """
    balls = on_stairs(large, small)
    until = 1.1 * GAP / (large - small)
    after = simulate(Scene(STAIRS, balls, physics(0.0, e), until)).balls
    m1, m2 = balls.masses
    given = (1.0 + e) * (large - small) / (m1 + m2)
    np.testing.assert_allclose(
        after.velocities[:, 0], [large - given * m2, small + given * m1], rtol=1e-6
    )
    np.testing.assert_allclose(after.positions[:, 2], balls.positions[:, 2], atol=TOUCH)


def test_a_small_ball_rolls_off_a_large_one_at_rest() -> None:
    """It leaves at cos a = (10 + 7 v²/(g (R + r)))/17, and its speed is then sqrt(g (R + r) cos a).

    Energy as for a ball that rolls over an edge, with the arc R + r of its centre.
    """
    speed, arc = 0.05, SMALL + LARGE
    floor = profile(np.array([-0.05, 0.05]), np.zeros(2), 0.02, 0.05)
    places, turn = [[0.0, 0.0, LARGE + arc], [0.0, 0.0, LARGE]], speed / SMALL
    start = shot(places, [SMALL, LARGE], [[speed, 0, 0], [0, 0, 0]], [[0, turn, 0], [0, 0, 0]])
    _, frames = film(floor, start, physics(1e3, resistance=1e-9), 0.05, 50)
    leaves = (10.0 + 7.0 * speed**2 / (G * arc)) / 17.0
    assert (np.diff(energies(frames)) < 1e-12).all()
    end = frames[-1]
    assert end.spins is not None
    assert end.positions[0, 2] > SMALL + 1e-3  # in flight, not down yet
    assert end.velocities[0, 0] == pytest.approx(math.sqrt(G * arc) * leaves**1.5, rel=0.03)
    assert end.spins[0, 1] * SMALL == pytest.approx(math.sqrt(G * arc * leaves), rel=0.06)
    assert (end.velocities[1] == 0.0).all()


def test_a_mixed_pile_settles_without_overlap_or_energy() -> None:
    """film checks gaps; a ball that is stood on lies still."""
    rng = np.random.default_rng(3)
    room, count = rough_floor(rng), 30
    radii = np.where(np.arange(count) % 3, SMALL, 1.6 * SMALL)
    places = pack_balls(room, count, 2.0 * radii, rng)
    speeds, densities = rng.normal(0.0, 0.5, places.shape), np.where(radii == SMALL, 7800.0, 3900.0)
    balls = shot(places, radii, speeds, 0.0, densities)
    run, frames = film(room, balls, physics(0.3, 0.6, 0.005), 0.8, 40)
    assert run.state.contact is not None
    modes, rows = run.state.contact.mode, run.state.contact.supports.obstacles
    assert (modes >= ASLEEP).sum() > 20
    assert (modes[ON_BALL - rows[rows <= ON_BALL]] >= ASLEEP).all()
    assert (np.diff(energies(frames)) < 50 * CAPTURE**2).all()


def test_balls_that_never_meet_roll_and_rest_as_each_does_alone() -> None:
    """To the last bit: radius, obstacles and range of supports are those of the ball's own size."""
    rng = np.random.default_rng(5)
    room = rough_floor(rng)
    radii = np.array([SMALL, 1.5 * SMALL, SMALL, 1.5 * SMALL])
    places = np.array([[0.005, 0.005], [0.015, 0.005], [0.005, 0.015], [0.015, 0.015]])
    places = np.column_stack([places, np.full(4, 0.006)])
    effects = physics(0.3, 0.5, 0.01)
    together = simulate(Scene(room, shot(places, radii, 0.0, 0.0, (7800.0,) * 4), effects, 1.0))
    for ball in range(4):
        one = Balls(places[[ball]], np.zeros((1, 3)), 2.0 * radii[ball])
        alone = simulate(Scene(room, one, effects._replace(part_rotation=None), 1.0))
        assert len(alone.resting) == (ball in together.resting.ball)
        for name in ("positions", "velocities", "spins"):
            np.testing.assert_array_equal(
                getattr(together.balls, name)[ball], getattr(alone.balls, name)[0]
            )
