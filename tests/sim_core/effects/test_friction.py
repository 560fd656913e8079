"""Balls that rub and spin, hit by hit: Walton's collision against its closed form, and what it must
keep.
"""

import numpy as np
import pytest

from sim_core import (
    Balls,
    Friction,
    Gravity,
    PartRotation,
    Physics,
    Scene,
    SceneError,
    Vibration,
    pack_balls,
    simulate,
)
from sim_core.effects.friction import new_friction_state, set_slip, set_spin, shift_spins
from sim_core.numerics.vec3 import Vec3
from sim_core.scene.invariants import energy, momentum
from tests.helpers.scenes.cavities import FLOOR, WEIGHTLESS, box, uniform_restitution
from tests.helpers.scenes.turning_parts import BODIES, PART, box_around

DIAMETER = 3e-3
R = 0.5 * DIAMETER
INERTIA = 0.4 * R**2  # m², per mass, of a solid sphere
ROOM = box((0.05, 0.05, 0.05))
HUGE = 1e9  # mu: every hit sticks


# m/s: a hit with restitution 0 leaves about 1e-17 m/s of one sign or the other, by the processor
ROUNDING = 1e-9


def physics(mu: float, beta0: float, e: float = 1.0) -> Physics:
    """Without weight; the same law everywhere."""
    return Physics(
        WEIGHTLESS,
        uniform_restitution(e, 1e3, ROUNDING),
        friction=Friction(((mu, beta0),) * 3, (mu, beta0)),
    )


def shot(positions: object, velocities: object, spins: object = 0.0) -> Balls:
    places, speeds = (
        np.atleast_2d(np.array(positions, dtype=float)),
        np.atleast_2d(np.array(velocities, dtype=float)),
    )
    return Balls(
        places, speeds, DIAMETER, spins=np.broadcast_to(np.array(spins, dtype=float), places.shape)
    )


def walton(
    slip: np.ndarray, into: float, mass: float, mu: float, beta0: float, e: float
) -> np.ndarray:
    """The tangential impulse per ball mass [m/s] against the touching points' slip."""
    stick = 2.0 / 7.0 * (1.0 + beta0) * mass * np.linalg.norm(slip)
    return -min(mu * (1.0 + e) * mass * into, stick) * slip / np.linalg.norm(slip)


LAWS = [
    (0.05, 0.3, 0.9),
    (0.05, 1.0, 0.5),
    (2.0, 0.4, 0.9),
    (2.0, -0.6, 1.0),
    (HUGE, 1.0, 1.0),
    (HUGE, 0.0, 0.0),
]


@pytest.mark.parametrize(("mu", "beta0", "e"), LAWS)
def test_a_spinning_ball_bounces_off_the_floor_as_walton_says(
    mu: float, beta0: float, e: float
) -> None:
    v, w, n = (
        np.array([1.0, -0.4, -2.0]),
        np.array([300.0, 900.0, -200.0]),
        np.array([0.0, 0.0, 1.0]),
    )
    slip = v + np.cross(w, -R * n)
    slip -= slip @ n * n
    kick = walton(slip, 2.0, 1.0, mu, beta0, e)
    fall = 0.01
    end = simulate(
        Scene(
            ROOM,
            shot([0.025, 0.025, R + fall], v, w),
            physics(mu, beta0, e),
            fall / 2.0 + 1e-3,
            record=(),
        )
    ).balls
    assert end.spins is not None
    np.testing.assert_allclose(end.velocities[0], [*(v + kick)[:2], 2.0 * e], atol=1e-14)
    np.testing.assert_allclose(end.spins[0], w + np.cross(-R * n, kick) / INERTIA, atol=1e-11)
    # about the touched point nothing turns the ball: R n x v + I w is kept, normal parts of v aside
    about = [
        R * np.cross(n, u) + INERTIA * s for u, s in ((v, w), (end.velocities[0], end.spins[0]))
    ]
    np.testing.assert_allclose(about[1], about[0], atol=1e-16)
    if mu == HUGE:  # the touching points' velocity is turned round and multiplied by beta0
        after = end.velocities[0] + np.cross(end.spins[0], -R * n)
        np.testing.assert_allclose(after[:2], -beta0 * slip[:2], atol=1e-14)


@pytest.mark.parametrize(("mu", "beta0", "e"), LAWS)
def test_two_balls_keep_momentum_and_lose_what_the_closed_form_says(
    mu: float, beta0: float, e: float
) -> None:
    rng = np.random.default_rng(3)
    for _ in range(5):
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        closing = -1.5 * n + rng.normal(0.0, 0.5, 3)
        closing -= max(0.0, closing @ n + 0.5) * n
        mean, gap = rng.normal(0.0, 0.3, 3), 1e-3
        w = rng.normal(0.0, 500.0, (2, 3))
        v = np.stack([mean - 0.5 * closing, mean + 0.5 * closing])
        touch = np.array(
            [[0.025] * 3, 0.025 + DIAMETER * n]
        )  # where they are when they meet, after gap / speed
        when = gap / 2.0
        start = shot(touch - when * v, v, w)
        end = simulate(Scene(ROOM, start, physics(mu, beta0, e), 2.0 * when, record=())).balls
        assert end.spins is not None
        assert start.spins is not None
        into = -closing @ n
        slip = closing + np.cross(w.sum(axis=0), -R * n)
        slip -= slip @ n * n
        kick = walton(slip, into, 0.5, mu, beta0, e)
        np.testing.assert_allclose(
            end.velocities, v + np.outer([-1.0, 1.0], 0.5 * (1.0 + e) * into * n + kick), atol=1e-11
        )
        np.testing.assert_allclose(momentum(end), momentum(start), atol=1e-18)
        turning = [
            np.cross(b.positions, b.velocities).sum(axis=0) + INERTIA * b.spins.sum(axis=0)  # type: ignore[union-attr]
            for b in (start, end)
        ]
        np.testing.assert_allclose(turning[1], turning[0], atol=1e-14)
        rub, pass_by = np.linalg.norm(kick), np.linalg.norm(slip)
        lost = 0.25 * (1.0 - e**2) * into**2 + rub * pass_by - 3.5 * rub**2  # rub²/(2 · 2/7 · m/2)
        assert (energy(start) - energy(end)) / start.ball_mass == pytest.approx(lost, abs=1e-10)


def test_smooth_balls_fly_as_without_friction_to_the_last_bit() -> None:
    rng = np.random.default_rng(5)
    places = pack_balls(ROOM, 30, DIAMETER, rng)
    v, w = rng.normal(0.0, 2.0, places.shape), rng.normal(0.0, 500.0, places.shape)
    rough = physics(0.3, 0.2, 0.9)
    bare = simulate(Scene(ROOM, Balls(places, v, DIAMETER), rough._replace(friction=None), 0.3))
    for law in ((0.3, -1.0), (0.0, 0.2)):
        smooth = simulate(Scene(ROOM, shot(places, v, w), physics(*law, 0.9), 0.3))
        assert bare.collisions.total == smooth.collisions.total > 500
        for name in ("time", "position", "velocity"):
            np.testing.assert_array_equal(
                getattr(bare.impacts, name), getattr(smooth.impacts, name)
            )
        np.testing.assert_array_equal(bare.balls.velocities, smooth.balls.velocities)
        np.testing.assert_array_equal(smooth.balls.spins, w)
    assert bare.balls.spins is None
    rubbed = simulate(Scene(ROOM, shot(places, v, w), rough, 0.3)).balls
    assert np.abs(rubbed.velocities - bare.balls.velocities).max() > 0.1


def test_friction_never_raises_the_energy_of_spinning_balls() -> None:
    rng = np.random.default_rng(4)
    places = pack_balls(ROOM, 40, DIAMETER, rng)
    balls = shot(places, rng.normal(0.0, 2.0, places.shape), rng.normal(0.0, 2000.0, places.shape))
    before = first = energy(balls)
    for _ in range(50):
        balls = simulate(Scene(ROOM, balls, physics(0.2, 0.4), 2e-3, record=())).balls
        assert energy(balls) <= before * (1.0 + 1e-13)
        before = energy(balls)
    assert before < 0.7 * first


def test_perfectly_rough_elastic_balls_share_their_energy_with_their_spins() -> None:
    """Energy is kept, and half of it is in the spins: 3 N squares of 6 N, whose share is Beta(3N/2,
    3N/2) distributed.

    Equipartition in the microcanonical ensemble of Kac's sphere; walls as rough as balls take up
    all momenta.
    """
    rng = np.random.default_rng(6)
    room, count, looks = box((0.02, 0.02, 0.02)), 60, 250
    places = pack_balls(room, count, DIAMETER, rng)
    balls = shot(places, rng.normal(0.0, 1.0, places.shape))
    start, share, collisions = energy(balls), [], 0
    for look in range(looks + 10):
        result = simulate(Scene(room, balls, physics(HUGE, 1.0), 0.06, record=()))
        balls, collisions = result.balls, collisions + result.collisions.total
        assert balls.spins is not None
        if look >= 10:  # the first forget the start
            share.append(0.5 * INERTIA * float((balls.spins**2).sum()) * balls.ball_mass / start)
    assert collisions > 20 * count * looks
    assert energy(balls) == pytest.approx(start, rel=1e-11)
    spread = 1.0 / np.sqrt(4.0 * (3.0 * count + 1.0))
    assert np.mean(share) == pytest.approx(0.5, abs=4.5 * spread / np.sqrt(looks))
    assert np.std(share) == pytest.approx(spread, rel=4.5 / np.sqrt(2.0 * looks))


def test_the_sonotrode_rubs_with_its_own_speed_of_approach() -> None:
    mu, e = 0.1, 0.7
    rough = physics(mu, 0.2, e)._replace(vibration=Vibration(FLOOR, 50e-6, 20e3, 0.7))
    result = simulate(Scene(ROOM, shot([0.02, 0.02, R + 0.005], [1.5, 2.0, -1.0]), rough, 0.006))
    assert len(result.impacts) == 1
    kick = mu * (1.0 + e) * result.impacts.normal_speed[0]
    assert abs(result.impacts.normal_speed[0] - 1.0) > 0.1
    np.testing.assert_allclose(
        result.balls.velocities[0, :2], (2.5 - kick) * np.array([0.6, 0.8]), rtol=1e-13
    )


def turned(vectors: np.ndarray, angle: float) -> np.ndarray:
    """About the z axis."""
    c, s = np.cos(angle), np.sin(angle)
    return vectors @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.long
def test_a_part_seen_from_its_own_frame_spins_the_balls_as_it_does_in_the_rooms() -> None:
    """Standing still at an angle, against the scene turned back by that angle, where it is as the
    mesh has it.
    """
    angle, rng = 0.9, np.random.default_rng(2)
    room, rough = box_around(BODIES["star"], 0.3), physics(0.2, 0.3, 0.9)
    places = np.array(
        [[0.0165 * np.cos(a), 0.0165 * np.sin(a), 0.0] for a in np.linspace(0.0, 6.0, 12)]
    )
    v, w = -0.6 * places / 0.0165 + rng.normal(0.0, 0.1, (12, 3)), rng.normal(0.0, 200.0, (12, 3))
    one = simulate(
        Scene(
            room,
            shot(places, v, w),
            rough._replace(part_rotation=PartRotation(PART, rpm=0.0)),
            0.03,
        )
    )
    turned_corners = rough._replace(part_rotation=PartRotation(PART, rpm=0.0, phase=angle))
    two = simulate(
        Scene(room, shot(*(turned(x, angle) for x in (places, v, w))), turned_corners, 0.03)
    )
    assert one.collisions.total == two.collisions.total > 10
    assert np.abs(one.balls.spins - w).max() > 10.0  # type: ignore[operator]
    np.testing.assert_allclose(two.balls.spins, turned(one.balls.spins, angle), atol=1e-7)  # type: ignore[arg-type]
    np.testing.assert_allclose(
        two.balls.velocities, turned(one.balls.velocities, angle), atol=1e-10
    )


@pytest.mark.parametrize("rpm", [60.0, 2000.0])
def test_hits_on_a_rough_rotor_keep_the_jacobi_integral(rpm: float) -> None:
    """A perfectly rough elastic hit turns the touching points' relative velocity round: energy less
    omega times the angular momentum, spin counted, is kept, as on a smooth rotor
    (test_turning_part.py).
    """
    omega, rng = 2 * np.pi * rpm / 60, np.random.default_rng(8)
    angle, radius = 2 * np.pi * np.arange(24) / 24, 0.0165
    positions = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(24)])
    start = shot(
        positions,
        -0.6 * positions / radius + rng.normal(0.0, 0.1, (24, 3)),
        rng.normal(0.0, 99.0, (24, 3)),
    )
    rough = physics(HUGE, 1.0)._replace(part_rotation=PartRotation(PART, rpm=rpm))
    result = simulate(Scene(box_around(BODIES["star"], 0.3), start, rough, 0.06))
    assert (result.impacts.position[:, :2] ** 2).sum(axis=1).max() < 0.02**2
    assert len(result.impacts) > 15

    def jacobi(balls: Balls) -> float:
        assert balls.spins is not None
        around = (
            np.cross(balls.positions, balls.velocities)[:, 2].sum()
            + INERTIA * balls.spins[:, 2].sum()
        )
        return energy(balls) / balls.ball_mass - omega * float(around)

    sizes = energy(start) / start.ball_mass, energy(result.balls) / start.ball_mass
    assert abs(sizes[1] - sizes[0]) > 1e-3 * sizes[0]
    assert jacobi(result.balls) == pytest.approx(jacobi(start), abs=1e-11 * max(sizes))


@pytest.mark.parametrize(
    ("friction", "said"),
    [
        (
            Friction(((-0.1, 0.0),) * 3, (0.3, 0.2)),
            r"friction\.surfaces\[0\] is \(-0\.1, 0\.0\): mu must be 0 or more",
        ),
        (Friction(((0.3, 0.2),) * 3, (0.3, 1.2)), r"friction\.balls is .* beta0 lie in \[-1, 1\]"),
        (Friction(((np.inf, 0.2),) * 3, (0.3, 0.2)), "finite"),
        (Friction(((0.3, 0.2),) * 2, (0.3, 0.2)), r"for tags 0 to 2, not shape \(2, 2\)"),
        (Friction(((0.3, "x"),) * 3, (0.3, 0.2)), r"give \(mu, beta0\) for each tag"),  # type: ignore[arg-type]
        ((0.3, 0.2), r"physics\.friction is \(0\.3, 0\.2\): give a Friction"),
    ],
)
def test_a_wrong_friction_is_refused_in_words(friction: Friction, said: str) -> None:
    with pytest.raises(SceneError, match=said):
        Scene(ROOM, shot([0.02] * 3, [1.0, 0.0, 0.0]), Physics(friction=friction), 1.0)


def test_spins_are_checked() -> None:
    with pytest.raises(SceneError, match=r"balls\.spins are given without physics\.friction"):
        Scene(ROOM, shot([0.02] * 3, [1.0, 0.0, 0.0]), Physics(Gravity()), 1.0)
    places = np.full((1, 3), 0.02)
    with pytest.raises(
        SceneError, match=r"balls\.positions has 1 balls, balls\.spins 2: give one each"
    ):
        Balls(places, places, DIAMETER, spins=np.zeros((2, 3)))
    with pytest.raises(SceneError, match=r"balls\.spins: ball 0 has \[0\.0, nan, 0\.0\]"):
        Balls(places, places, DIAMETER, spins=np.array([[0.0, np.nan, 0.0]]))
    with pytest.raises(SceneError, match=r"balls\.spins: ball 0 has .* rad/s; at most"):
        Balls(places, places, DIAMETER, spins=np.array([[0.0, 1e12, 0.0]]))
    still = Scene(ROOM, Balls(places, np.zeros((1, 3)), DIAMETER), physics(0.3, 0.2), 1e-3)
    np.testing.assert_array_equal(simulate(still).balls.spins, np.zeros((1, 3)))


DIAMETERS, DENSITIES = np.array([2e-3, 5e-3]), np.array([15_000.0, 3_850.0])


@pytest.mark.parametrize(("mu", "beta0", "e"), LAWS)
def test_two_unequal_balls_keep_both_momenta_and_lose_what_the_closed_form_says(
    mu: float, beta0: float, e: float
) -> None:
    rng, radii = np.random.default_rng(3), 0.5 * DIAMETERS
    mass = DENSITIES * np.pi / 6.0 * DIAMETERS**3
    reduced, inertia = mass.prod() / mass.sum(), 0.4 * mass * radii**2
    for _ in range(5):
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        closing = -1.5 * n + rng.normal(0.0, 0.3, 3)
        w = rng.normal(0.0, 500.0, (2, 3))
        v = np.stack([np.zeros(3), closing]) + rng.normal(0.0, 0.3, 3)
        touch = np.array([[0.025] * 3, 0.025 + radii.sum() * n])
        when = 1e-4
        start = Balls(touch - when * v, v, DIAMETERS, DENSITIES, spins=w)
        end = simulate(Scene(ROOM, start, physics(mu, beta0, e), 2.0 * when, record=())).balls
        assert start.spins is not None
        assert end.spins is not None
        slip = closing - np.cross(radii @ w, n)
        slip -= slip @ n * n
        into = -closing @ n
        # Walton's impulse with the reduced mass: walton() gives it per mass
        rub = reduced * walton(slip, into, 1.0, mu, beta0, e)
        impulse = reduced * (1.0 + e) * into * n + rub
        np.testing.assert_allclose(
            end.velocities, v + np.outer([-1.0, 1.0], impulse) / mass[:, None], atol=1e-11
        )
        turned = -np.cross(n, rub) * (radii / inertia)[:, None]
        np.testing.assert_allclose(end.spins, w + turned, atol=1e-8)
        np.testing.assert_allclose(momentum(end), momentum(start), atol=1e-18)
        turning = [
            mass @ np.cross(b.positions, b.velocities) + inertia @ b.spins  # type: ignore[operator]
            for b in (start, end)
        ]
        np.testing.assert_allclose(turning[1], turning[0], atol=1e-16)
        size, pass_by = np.linalg.norm(rub), np.linalg.norm(slip)
        lost = 0.5 * reduced * (1.0 - e**2) * into**2 + size * pass_by - 1.75 * size**2 / reduced
        assert energy(start) - energy(end) == pytest.approx(lost, rel=1e-8)


def test_balls_of_two_sizes_spin_off_a_floor_as_walton_says() -> None:
    v, w, n = np.array([1.0, -0.4, -2.0]), np.array([300.0, 900.0, -200.0]), np.array([0, 0, 1.0])
    radii = 0.5 * DIAMETERS
    places = [[0.02, 0.02, radii[0] + 0.001], [0.03, 0.03, radii[1] + 0.001]]
    start = Balls(places, [v, v], DIAMETERS, DENSITIES, spins=[w, w])  # type: ignore[arg-type]
    end = simulate(Scene(ROOM, start, physics(0.05, 0.3, 0.9), 0.001, record=())).balls
    assert end.spins is not None
    for k, r in enumerate(radii):
        slip = v + np.cross(w, -r * n)
        slip -= slip @ n * n
        kick = walton(slip, 2.0, 1.0, 0.05, 0.3, 0.9)
        np.testing.assert_allclose(end.velocities[k], [*(v + kick)[:2], 1.8], atol=1e-12)
        np.testing.assert_allclose(
            end.spins[k], w + np.cross(-r * n, kick) / (0.4 * r**2), atol=1e-9
        )


def test_a_mixed_gas_of_perfectly_rough_balls_shares_energy_with_its_spins() -> None:
    """beta0 = 1 keeps the energy; every degree of freedom of every size has the same share."""
    rng, room = np.random.default_rng(8), box((0.03, 0.03, 0.03))
    sizes = np.repeat(DIAMETERS, [150, 20])
    density = np.repeat(DENSITIES, [150, 20])
    places = pack_balls(room, len(sizes), sizes, rng)
    start = Balls(places, rng.normal(0.0, 2.0, places.shape), sizes, density)
    frames = np.linspace(1.0, 8.0, 400)
    run = simulate(Scene(room, start, physics(HUGE, 1.0), 8.0, record=()), frames)
    assert energy(run.balls) == pytest.approx(energy(start), rel=1e-9)
    assert run.frames.spins is not None
    moving = 0.5 * start.masses[:, None] * run.frames.velocities**2
    inertia = 0.1 * start.masses * sizes**2
    spinning = 0.5 * inertia[:, None] * run.frames.spins**2
    share = energy(start) / (6 * len(sizes))
    for big in (False, True):
        own = (sizes == DIAMETERS[1]) == big
        for kind in (moving, spinning):
            assert kind[:, own].mean() == pytest.approx(share, rel=0.05)


def test_a_balls_spin_and_slip_are_those_that_were_set_and_change_evenly() -> None:
    """Set at 0.2 s; a spin takes the slip away, and each leaves the other balls alone."""
    law = Friction(((0.1, 0.2),) * 3, (0.1, 0.2))
    spins = np.arange(9.0).reshape(3, 3)
    state = new_friction_state(law, spins, R, np.zeros(1, dtype=np.int64))
    state.slips[:] = 8.0
    spin, twist = np.array([1.0, 2.0, 3.0]), np.array([10.0, -20.0, 30.0])
    slip, change = np.array([4.0, 5.0, 6.0]), np.array([-1.0, 7.0, 2.0])
    before = [column.copy() for column in (state.spins, state.twists, state.slips)]
    set_slip(state, 1, 0.2, Vec3(*slip), Vec3(*change))
    assert state.slips[1] == pytest.approx([*(slip - 0.2 * change), *change])
    np.testing.assert_array_equal(state.slips[[0, 2]], before[2][[0, 2]])
    shift_spins.py_func(state, 0.5)
    assert state.slips[1] == pytest.approx([*(slip + 0.3 * change), *change])
    set_spin(state, 1, 0.2, Vec3(*spin), Vec3(*twist))
    assert state.spins[1] == pytest.approx(spin - 0.2 * twist)
    assert state.twists[1] == pytest.approx(twist)
    assert not state.slips[1].any()
    np.testing.assert_array_equal(state.spins[[0, 2]], before[0][[0, 2]])
    np.testing.assert_array_equal(state.twists[[0, 2]], before[1][[0, 2]])
