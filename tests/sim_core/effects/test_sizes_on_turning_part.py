"""Balls of several sizes about a part that turns: each size meets it at its own radius.

All scenes have the combination of effects of test_several_sizes.py, so that nothing more is
compiled. Balls are weightless unless gravity matters.
"""

import numpy as np
import pytest

from sim_core import Balls, Gravity, PartRotation, Physics, Restitution, Scene, pack_balls, simulate
from sim_core.effects.contact_mode import ASLEEP
from sim_core.loop.simulate import Simulation
from sim_core.scene.invariants import clearance, narrowest_gap
from tests.helpers.scenes.cavities import box_around
from tests.helpers.scenes.turning_parts import BODIES, PART, Rotor
from tests.sim_core.contact import test_several_sizes as contact
from tests.sim_core.contact.test_pushed_by_part import HALF, WIDE, paddle
from tests.sim_core.contact.test_several_sizes import LARGE, SMALL, shot

# Their set of effects takes half a minute to compile.
pytestmark = pytest.mark.long

RADII = np.array([SMALL, LARGE])
BAR_HALF = 2e-3  # m: half the bar's width
TOUCH = 1e-12  # m


def effects(turn: PartRotation, e: float = 1.0, gravity: Gravity | None = None) -> Physics:
    """Smooth balls that keep their energy among themselves."""
    law = Restitution(((e, 1e3),) * 3, (1.0, 1e3), elastic_below=1e-12)
    weight = Gravity(0.0, 0.0, 0.0) if gravity is None else gravity
    return contact.physics(0.0)._replace(gravity=weight, restitution=law, part_rotation=turn)


@pytest.mark.parametrize("e", [1.0, 0.6])
def test_the_bar_throws_each_size_when_its_face_is_a_radius_away(e: float) -> None:
    """Face at rest on the ball's side: u = (1 + e) U along the normal, at angle and speed that
    follow from half the bar's width and the radius.
    """
    omega, places = 2.0 * np.pi * 2.0, np.array([[6e-3, 5.5e-3, 0.0], [-6e-3, -5.5e-3, 0.0]])
    far, reach = np.hypot(6e-3, 5.5e-3), BAR_HALF + RADII
    angle, speed = (
        np.arctan2(5.5e-3, 6e-3) - np.arcsin(reach / far),
        omega * np.sqrt(far**2 - reach**2),
    )
    physics = effects(PartRotation(PART, rpm=120.0), e)
    room, until = box_around(BODIES["bar"], 0.05), angle.max() / omega + 1e-4
    result = simulate(Scene(room, shot(places, RADII), physics, until))
    order = np.argsort(result.impacts.ball)
    assert result.impacts.ball[order].tolist() == [0, 1]
    np.testing.assert_allclose(result.impacts.time[order], angle / omega, rtol=1e-10)
    np.testing.assert_allclose(result.impacts.normal_speed[order], speed, rtol=1e-10)
    out = np.column_stack([-np.sin(angle), np.cos(angle), 0.0 * angle])
    out *= ((1.0 + e) * speed * [1.0, -1.0])[:, None]
    np.testing.assert_allclose(result.balls.velocities, out, atol=1e-10)


def ring(rng: np.random.Generator, speed: float, count: int = 24) -> Balls:
    """Balls of both sizes round the star, on their way to it at a speed [m/s]."""
    angle, radius = 2.0 * np.pi * np.arange(count) / count, 0.0165
    places = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle])
    speeds = -speed * places / radius + rng.normal(0.0, 0.1, places.shape)
    large = np.arange(count) % 3 == 0
    radii, densities = np.where(large, 1.8e-3, 1e-3), np.where(large, 3900.0, 7800.0)
    return shot(places, radii, speeds, 0.0, densities)


@pytest.mark.parametrize("rpm", [60.0, 2000.0])
def test_a_steady_rotor_keeps_the_jacobi_integral_of_two_sizes(rpm: float) -> None:
    """The energy less omega times the angular momentum, with every ball's mass (Goldstein, section
    3.12). Collisions of balls keep it too.
    """
    omega, start = 2.0 * np.pi * rpm / 60.0, ring(np.random.default_rng(8), 0.6)
    room = box_around(BODIES["star"], 0.3)
    result = simulate(Scene(room, start, effects(PartRotation(PART, rpm=rpm)), 0.06))
    assert len(result.impacts) > 15
    assert (room.tags[result.impacts.triangle] == PART).all()
    assert result.collisions.balls > 5

    def sums(balls: Balls) -> tuple[float, float]:
        """Energy [J], and the Jacobi integral [J]."""
        energy = 0.5 * float(balls.masses @ (balls.velocities**2).sum(axis=1))
        turn = np.cross(balls.positions, balls.velocities)[:, 2]
        return energy, energy - omega * float(balls.masses @ turn)

    before, after = sums(start), sums(result.balls)
    assert abs(after[0] - before[0]) > 1e-3 * before[0]  # which alone is not kept
    assert after[1] == pytest.approx(before[1], abs=1e-11 * max(before[0], after[0]))


def test_impacts_of_each_size_are_a_radius_off_the_part_and_nothing_overlaps() -> None:
    """In the part's frame, where impacts are logged."""
    turn = PartRotation(PART, amplitude=0.7, frequency=3.3, phase=0.5)
    room, rng = box_around(BODIES["star"], 0.025), np.random.default_rng(4)
    radii = np.where(np.arange(40) % 3, 0.8e-3, 1.5e-3)
    places = pack_balls(room, 40, 2.0 * radii, rng, part_rotation=turn)
    speeds, densities = rng.normal(0.0, 2.0, places.shape), np.full(40, 7800.0)
    start = shot(places, radii, speeds, 0.0, densities)
    result = simulate(Scene(room, start, effects(turn, 0.95, Gravity()), 0.5))
    log = result.impacts
    own = np.flatnonzero(room.tags[log.triangle] == PART)[-600:]
    assert len(own) > 100
    assert len(np.unique(radii[log.ball[own]])) == 2
    for k in own:
        gap = clearance(room.corners[[log.triangle[k]]], log.position[[k]], 0.01)[0]
        assert abs(gap - radii[log.ball[k]]) < 1e-9
    rotor = Rotor(BODIES["star"], turn)
    seen = rotor.seen(result.balls.positions, np.full(40, 0.5))
    assert (clearance(rotor.own, seen, 0.05) - radii).min() > -1e-9
    assert narrowest_gap(result.balls)[0] > -TOUCH


def test_a_paddle_wakes_each_size_when_it_arrives() -> None:
    """On the floor a ball of radius r lies still until the face is r away, and then gets (1 + e)
    times the face's speed, as on a ball in flight.
    """
    omega, e, place = 2.0 * np.pi * 10.0 / 60.0, 0.8, np.array([0.002, 0.012])
    places = np.array([[*place, SMALL - HALF], [*-place, LARGE - HALF]])
    turn = PartRotation(PART, rpm=10.0)
    physics = effects(turn, e, Gravity())
    run = Simulation(Scene(paddle(), shot(places, RADII), physics, 1.0))
    reach, far = WIDE + RADII, np.hypot(*place)
    angle = np.arctan2(place[1], place[0]) - np.arcsin(reach / far)
    when, speed = angle / omega, omega * np.sqrt(far**2 - reach**2)
    for ball in np.argsort(when):
        run.play(when[ball] * (1.0 - 1e-9), record=False)
        assert run.state.contact is not None
        assert run.state.contact.mode[ball] == ASLEEP
        np.testing.assert_allclose(run.balls().positions[ball], places[ball], atol=TOUCH)
        run.play(when[ball] * (1.0 + 1e-9), record=False)
        out = np.array([-np.sin(angle[ball]), np.cos(angle[ball]), 0.0]) * np.sign(places[ball, 1])
        expected = (1.0 + e) * speed[ball] * out
        np.testing.assert_allclose(run.balls().velocities[ball], expected, rtol=1e-6, atol=1e-9)


def test_a_mixed_pile_is_swept_without_overlaps() -> None:
    turn, rng = PartRotation(PART, rpm=10.0), np.random.default_rng(1)
    room, count = paddle(), 40
    radii = np.where(np.arange(count) % 3, SMALL, 1.5e-3)
    places = pack_balls(room, count, 2.0 * radii, rng, part_rotation=turn)
    speeds, densities = rng.normal(0.0, 0.1, places.shape), np.full(count, 7800.0)
    physics = contact.physics(0.3, 0.7, 0.01)._replace(part_rotation=turn)
    run = Simulation(Scene(room, shot(places, radii, speeds, 0.0, densities), physics, 2.0))
    for stop in np.linspace(0.0, 2.0, 41)[1:]:
        run.play(float(stop), record=False)
        balls, corners = run.balls(), run._corners()
        assert corners is not None
        assert (clearance(corners, balls.positions, 2.0 * LARGE) - radii).min() > -TOUCH
        assert narrowest_gap(balls)[0] > -TOUCH
    assert run.state.contact is not None
    assert (run.state.contact.mode >= ASLEEP).sum() > 15
    assert run.state.counts.sum() < 100_000
