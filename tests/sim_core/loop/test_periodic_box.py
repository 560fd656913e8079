"""A box without sides: what leaves it on one side comes in on the other and meets what is there."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from sim_core import (
    AnalyticCavity,
    Balls,
    Drag,
    Friction,
    Gravity,
    PartRotation,
    Physics,
    RandomPhase,
    Rest,
    Restitution,
    Scene,
    SceneError,
    Vibration,
    pack_balls,
    periodic_box,
    simulate,
)
from sim_core.loop.neighbours import follow, new_neighbour_filter, next_meeting, refresh_neighbours
from sim_core.loop.simulate import Simulation
from sim_core.loop.spatial_blocks import MIN_BALLS
from sim_core.numerics.periodic_sides import horizon, new_periodic_sides, put_back
from sim_core.scene.invariants import energy, momentum, narrowest_gap
from tests.helpers.jit_on_and_off import with_and_without_jit
from tests.helpers.scenes.cavities import WEIGHTLESS, box

D = 1e-3
SIDES = np.array([0.012, 0.02, 0.03])
FREE = Physics(WEIGHTLESS)
BOX = periodic_box((0.0, 0.0, 0.0), SIDES, (0, 1))


def gas(room: AnalyticCavity, count: int, seed: int, diameter: float | np.ndarray = D) -> Balls:
    rng = np.random.default_rng(seed)
    return Balls(pack_balls(room, count, diameter, rng), rng.normal(size=(count, 3)), diameter)


def first_meeting(one: np.ndarray, two: np.ndarray, reach: float, images: int) -> float:
    """When two balls (6,) first meet, by the quadratic of every image."""
    closing, best = two[3:] - one[3:], math.inf
    speed = closing @ closing
    for x, y in itertools.product(range(-images, images + 1), repeat=2):
        apart = two[:3] - one[:3] + SIDES * (x, y, 0)
        rate = apart @ closing
        disc = rate**2 - speed * (apart @ apart - reach**2)
        if rate < 0.0 < disc:
            best = min(best, (apart @ apart - reach**2) / (math.sqrt(disc) - rate))
    return best


def test_two_balls_meet_across_the_corner() -> None:
    """Through both borders at once; place and normal are those of the nearest images."""
    apart = np.array([0.003, 0.004, 0.0])
    first = np.array([0.001, 0.002, 0.015])
    places = np.array([first, first + SIDES * (1, 1, 0) - apart])
    speed = 1.3
    balls = Balls(places, [[0, 0, 0], speed * apart / 0.005], D)
    result = simulate(Scene(BOX, balls, FREE, 0.02, record_collisions=True))
    log = result.ball_collisions
    assert log is not None
    np.testing.assert_allclose(log.time, [(0.005 - D) / speed], rtol=1e-12)
    np.testing.assert_allclose(result.balls.velocities, balls.velocities[::-1], atol=1e-14)
    towards = (1.0 if log.one[0] == 0 else -1.0) * -apart / 0.005
    np.testing.assert_allclose(log.normal[0], towards, atol=1e-12)
    touched = places[0] - 0.5 * D * apart / 0.005
    np.testing.assert_allclose(log.position[0], touched, atol=1e-12)


@pytest.mark.long
def test_fast_balls_meet_after_any_number_of_trips_round_the_box() -> None:
    """At up to 30 m/s a ball crosses the box fifty times in a window."""
    rng = np.random.default_rng(1)
    met, trips = 0, 0.0
    for _ in range(60):
        places = rng.uniform(0.5 * D, SIDES - 0.5 * D, (2, 3))
        velocities = np.where([True, True, False], rng.normal(0.0, 10.0, (2, 3)), 0.0)
        places[1, 2] = np.clip(places[0, 2] + rng.uniform(-D, D), 0.5 * D, SIDES[2] - 0.5 * D)
        if np.linalg.norm(places[0] - places[1]) < D:
            continue
        balls = Balls(places, velocities, D)
        result = simulate(Scene(BOX, balls, FREE, 0.05, record_collisions=True))
        log = result.ball_collisions
        assert log is not None
        both = np.concatenate([places, velocities], axis=1)
        expected = first_meeting(both[0], both[1], D, images=150)
        if expected > 0.05:
            assert len(log) == 0
            continue
        met += 1
        trips = max(trips, expected * np.abs(velocities[1] - velocities[0]).max() / SIDES[0])
        assert log.time[0] == pytest.approx(expected, rel=1e-10)
    assert met > 30
    assert trips > 10.0


@pytest.mark.parametrize("fast", [0, 1])
def test_a_ball_that_is_fast_along_one_side_alone_meets_after_many_trips(fast: int) -> None:
    """It goes round and round at 30 m/s, and the other comes near at 0.2 m/s across its path."""
    slow, x = 1 - fast, np.array([0.005, 0.01])
    places, velocities = np.full((2, 3), 0.015), np.zeros((2, 3))
    places[:, fast], places[:, slow] = x[::-1], x
    velocities[0, fast], velocities[1, slow] = 30.0, -0.2
    result = simulate(Scene(BOX, Balls(places, velocities, D), FREE, 0.03, record_collisions=True))
    expected = first_meeting(*np.concatenate([places, velocities], axis=1), D, images=90)
    assert expected * 30.0 > 30.0 * SIDES[fast]
    assert result.ball_collisions is not None
    assert result.ball_collisions.time[0] == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize(
    "count", [5, *(pytest.param(n, marks=pytest.mark.long) for n in (200, MIN_BALLS, 3000))]
)
def test_every_meeting_with_an_image_is_found(count: int) -> None:
    """Against the quadratic of every image; the filter takes sixteen balls at a time in float32."""
    rng, window = np.random.default_rng(count), 0.02
    sides = new_periodic_sides(np.array([*SIDES[:2], 0.0]))
    assert sides is not None
    half = 0.5 * SIDES
    motion = np.concatenate(
        [rng.uniform(-half, half, (count, 3)), rng.normal(size=(count, 3))], axis=1
    )
    motion[::7, 3:] = 0.0
    reach = 0.3 * float((SIDES.prod() / count) ** (1 / 3))
    fastest = 2.0 * float(np.abs(motion[:, 3:]).max())
    neighbours = new_neighbour_filter(motion, -half, half, reach, fastest, window, None, sides)
    met = 0
    for time in np.sort(rng.uniform(0.0, window, 400)):
        if neighbours.blocks is not None and time >= neighbours.blocks.until[0]:
            put_back(sides, motion, time)
            refresh_neighbours(neighbours, motion, time)
        ball = int(rng.integers(count))
        known = time + horizon(sides, motion, ball, reach)
        if neighbours.blocks is not None:
            known = min(known, neighbours.blocks.until[0])
        meeting, partner = next_meeting(neighbours, motion, ball, float(time), math.inf)
        assert meeting <= known
        now = motion[:, :3] + motion[:, 3:] * time
        expected, other = math.inf, count
        closing = motion[:, 3:] - motion[ball, 3:]
        speed = np.einsum("ij,ij->i", closing, closing)
        for x, y in itertools.product(range(-9, 10), repeat=2):
            apart = now - now[ball] + SIDES * (x, y, 0)
            rate, square = np.einsum("ij,ij->i", apart, closing), (apart**2).sum(axis=1)
            disc = rate**2 - speed * (square - reach**2)
            good = (rate < 0.0) & (disc > 0.0)
            good[ball] = False
            delay = np.where(good, np.maximum(square - reach**2, 0.0), np.inf)
            delay[good] /= np.sqrt(disc[good]) - rate[good]
            candidate = float(delay.min()), int(delay.argmin())
            if candidate < (expected, other):  # of balls that overlap, the lower one is first
                expected, other = candidate
        if time + expected < known:
            assert partner == other
            assert meeting == pytest.approx(time + expected, rel=1e-9)
            met += 1
        else:
            assert partner == -1
            assert meeting == known
        change = int(rng.integers(count))  # a new path, up to as fast as the filter allows
        motion[change, 3:] = rng.normal(0.0, 1.2, 3).clip(-fastest, fastest)
        motion[change, :3] = now[change] - motion[change, 3:] * time
        follow(neighbours, motion, change, float(time))
    assert met > 10


@pytest.mark.parametrize("count", [300, pytest.param(2 * MIN_BALLS, marks=pytest.mark.long)])
def test_where_the_box_is_cut_does_not_matter(count: int) -> None:
    """All balls moved by a vector, modulo the sides, meet at the same times: a hundred collisions,
    of which each magnifies rounding.
    """
    sides = SIDES * (count / 300) ** (1 / 3)
    room = periodic_box((0.0, 0.0, 0.0), sides, (0, 1))
    start = gas(room, count, seed=3)
    logs = []
    for shift in ((0.0, 0.0, 0.0), (0.0071, -0.0123, 0.0)):
        moved = room.put_back(start.positions + np.array(shift))
        moved_balls = replace(start, positions=moved)
        scene = Scene(room, moved_balls, Physics(Gravity()), 0.02, record_collisions=True)
        logs.append(simulate(scene).ball_collisions)
    one, two = logs
    assert one is not None
    assert two is not None
    assert len(one) > 150
    np.testing.assert_allclose(one.time[:100], two.time[:100], rtol=0.0, atol=1e-9)
    pairs = [np.sort(np.column_stack([log.one, log.two])[:100]) for log in (one, two)]
    np.testing.assert_array_equal(*pairs)
    off = two.position[:100] - one.position[:100] - np.array(shift)
    np.testing.assert_allclose(off - sides * np.rint(off / sides), 0.0, atol=1e-9)


@pytest.mark.parametrize("count", [200, pytest.param(2 * MIN_BALLS, marks=pytest.mark.long)])
def test_momentum_along_the_periodic_directions_is_kept(count: int) -> None:
    """And the centre of mass moves as if there were no balls, and energy is kept."""
    sides = SIDES * (count / 200) ** (1 / 3)
    room = periodic_box(-0.3 * sides, 0.7 * sides, (0, 1))
    start = gas(room, count, seed=4)
    result = simulate(Scene(room, start, Physics(Gravity()), 0.3, record_collisions=True))
    assert result.collisions.balls > 10 * count
    kept = momentum(result.balls)[:2] / momentum(start)[:2]
    np.testing.assert_allclose(kept, 1.0, rtol=1e-12)
    ratio = energy(result.balls, Gravity()) / energy(start, Gravity())
    assert ratio == pytest.approx(1.0, rel=1e-12)
    assert narrowest_gap(result.balls, room)[0] > -1e-12
    for places in (result.balls.positions, result.impacts.position):
        assert (places >= room.bounds[0]).all()
        assert (places <= room.bounds[1]).all()
    assert set(result.impacts.triangle.tolist()) == {0, 1}


@pytest.mark.parametrize("count", [200, pytest.param(2 * MIN_BALLS, marks=pytest.mark.long)])
def test_a_box_that_falls_sideways_is_the_box_at_rest(count: int) -> None:
    """Gravity along x alone adds g t to all velocities, whatever meets, and changes no collision;
    at 100 m/s a ball goes round the box a thousand times in ten windows.
    """
    sides = SIDES * (count / 200) ** (1 / 3)
    room = periodic_box((0.0, 0.0, 0.0), sides, (0, 1))
    scene = Scene(room, gas(room, count, seed=5), FREE, 0.2, record_collisions=True)
    rest = simulate(replace(scene, duration=0.02))
    fall = simulate(replace(scene, physics=Physics(Gravity(500.0, 0.0, 0.0))), frames=[0.02, 0.2])
    assert rest.ball_collisions is not None
    assert fall.ball_collisions is not None
    time, same = rest.ball_collisions.time[:100], fall.ball_collisions.time[:100]
    assert len(time) == 100
    np.testing.assert_allclose(same, time, rtol=0.0, atol=1e-9)
    mean = fall.frames.velocities[:, :, 0].mean(axis=1)
    expected = scene.balls.velocities[:, 0].mean() + 500.0 * fall.frames.time
    np.testing.assert_allclose(mean, expected, rtol=1e-12)
    assert narrowest_gap(fall.balls, room)[0] > -1e-12


def test_periodic_along_x_between_two_walls() -> None:
    room = periodic_box((0.0, 0.0, 0.0), SIDES, (0, 1, 2), periodic="x")
    start = gas(room, 150, seed=6)
    result = simulate(Scene(room, start, FREE, 0.2, record_collisions=True))
    assert momentum(result.balls)[0] == pytest.approx(momentum(start)[0], rel=1e-12)
    assert energy(result.balls) == pytest.approx(energy(start), rel=1e-12)
    assert set(result.impacts.triangle.tolist()) == {0, 1, 2, 3}
    assert (room.gaps(result.balls.positions) > 0.5 * D - 1e-12).all()
    low = result.impacts.position[result.impacts.triangle == 2]
    np.testing.assert_allclose(low[:, 1], 0.5 * D, atol=1e-12)
    assert room.volume == pytest.approx(SIDES.prod())


def everything(duration: float, count: int = 60) -> Scene:
    """Two sizes in still air over a shaken floor, whose losses the floor makes up for."""
    law = (0.9, 1e3)
    physics = Physics(
        Gravity(),
        Restitution((law, law), law),
        Vibration(0, 1e-4, 300.0),
        drag=Drag(density=20.0),
        random_phase=RandomPhase(3),
    )
    start = gas(BOX, count, seed=7, diameter=np.where(np.arange(count) % 2, D, 2.0 * D))
    places = start.positions + np.array([0.0, 0.0, 2e-4])
    return Scene(BOX, replace(start, positions=places), physics, duration, record_collisions=True)


@pytest.mark.long
def test_further_effects_work_together_with_it() -> None:
    result = simulate(everything(0.5))
    assert result.collisions.sonotrode > 100
    log = result.ball_collisions
    assert log is not None
    assert (log.position >= BOX.bounds[0] - 1e-4).all()
    assert (log.position <= BOX.bounds[1]).all()
    sizes = result.balls.diameters
    assert {sizes[one] + sizes[two] for one, two in zip(log.one, log.two, strict=True)} == {
        2.0 * D,
        3.0 * D,
        4.0 * D,
    }
    rough = Physics(friction=Friction(((0.3, 0.2),) * 2, (0.3, 0.2)))
    start = gas(BOX, 60, seed=8)
    end = simulate(Scene(BOX, start, rough, 0.2)).balls
    assert energy(end) < 0.9 * energy(start)


@pytest.mark.long
def test_the_jit_switched_off_gives_the_same_bits() -> None:
    code = (
        "from tests.sim_core.loop.test_determinism import fingerprint;"
        "from tests.sim_core.loop.test_periodic_box import everything;"
        "from sim_core import simulate;"
        "r = simulate(everything(0.02, 20)); print(r.collisions.balls, fingerprint(r))"
    )
    answers = with_and_without_jit(code)
    assert int(answers[0].split()[0]) > 10
    assert answers[0] == answers[1]


def test_packed_balls_do_not_overlap_across_the_border() -> None:
    placed = pack_balls(BOX, 1500, D, np.random.default_rng(9))
    balls = Balls(placed, np.zeros_like(placed), D)
    assert narrowest_gap(balls, BOX)[0] > 0.0
    assert (placed[:, :2] < 0.5 * D).any(axis=0).all()  # up to the border, and beyond it
    assert placed[:, 2].min() > 0.5 * D
    shifted = BOX.put_back(placed + np.array([0.3 * D, 0.0, 0.0]))
    assert narrowest_gap(Balls(shifted, 0.0 * placed, D))[0] > 0.0


def test_a_room_with_walls_keeps_nothing_of_it() -> None:
    one = Balls([[0.005, 0.005, 0.005]], np.zeros((1, 3)), D)
    state = Simulation(Scene(box((0.01, 0.01, 0.01)), one, Physics(), 1.0)).state
    assert state.sides is None
    assert state.neighbours is not None
    assert state.neighbours.sides is None


def test_what_is_not_supported_is_refused() -> None:
    one = Balls([[0.006, 0.01, 0.015]], np.zeros((1, 3)), D)
    with pytest.raises(SceneError, match=r"periodic_box: corners are .*: give x, y and z"):
        periodic_box((0, 0, 0), (1, -1, 1), (0, 1))
    with pytest.raises(SceneError, match="periodic is 'z': give"):
        periodic_box((0, 0, 0), (1, 1, 1), (0, 1), periodic="z")
    with pytest.raises(SceneError, match="tags are"):
        periodic_box((0, 0, 0), (1, 1, 1), (0, 1, 2))
    for physics in (Physics(Gravity(), rest=Rest()), Physics(part_rotation=PartRotation(1, rpm=1))):
        with pytest.raises(
            SceneError, match=r"not supported (with an analytical cavity|in a peri)"
        ):
            Scene(BOX, one, physics, 1.0)
    wide = Balls([[0.006, 0.01, 0.015]], np.zeros((1, 3)), 0.005)
    with pytest.raises(SceneError, match=r"0\.012 m wide along x: give it 0\.015 m or more"):
        Scene(BOX, wide, Physics(), 1.0)
    out = Balls([[0.006, 0.021, 0.015]], np.zeros((1, 3)), D)
    with pytest.raises(SceneError, match=r"ball 0 at .* is outside the periodic box along y"):
        Scene(BOX, out, Physics(), 1.0)
    both = Balls([[1e-4, 0.01, 0.01], [0.0118, 0.01, 0.01]], np.zeros((2, 3)), D)
    with pytest.raises(SceneError, match=r"balls 0 and 1 overlap by 0\.0007"):
        Scene(BOX, both, Physics(), 1.0)
