"""The neighbour filter loses no meeting: it finds what all pairs in float64 give."""

import numpy as np
import pytest

from sim_core.loop.neighbours import (
    NeighbourFilter,
    follow,
    new_neighbour_filter,
    next_meeting,
    refresh_neighbours,
    sort_is_due,
)
from sim_core.loop.spatial_blocks import BITS, CHANGES, MIN_BALLS, _place_on_curve

REACH = 3e-3  # m
WINDOW = 0.02  # s


def all_pairs(motion: np.ndarray, ball: int, time: float, before: float) -> tuple[float, int]:
    """Time and partner of the first meeting, by the quadratic."""
    apart = motion[:, :3] + motion[:, 3:] * time - motion[ball, :3] - motion[ball, 3:] * time
    closing = motion[:, 3:] - motion[ball, 3:]
    rate = (apart * closing).sum(axis=1)
    speed = (closing * closing).sum(axis=1)
    excess = (apart * apart).sum(axis=1) - REACH**2
    disc = rate**2 - speed * excess
    with np.errstate(invalid="ignore", divide="ignore"):
        delay = np.where(
            (rate < 0.0) & (disc > 0.0), np.maximum(excess, 0.0) / (np.sqrt(disc) - rate), np.inf
        )
    delay[ball] = np.inf
    partner = int(delay.argmin())
    return (time + delay[partner], partner) if time + delay[partner] < before else (np.inf, -1)


def gas(balls: int, half: float, rng: np.random.Generator) -> np.ndarray:
    """Bases [m] and velocities [m/s] (n, 6) of fast, slow and resting balls."""
    motion = np.concatenate(
        [rng.uniform(-half, half, (balls, 3)), rng.normal(0.0, 3.0, (balls, 3))], axis=1
    )
    motion[::7, 3:] = 0.0
    motion[1::7, 3:] *= 1e-4
    pairs = len(motion[3::7])
    motion[2::7, 3:][:pairs] = motion[3::7, 3:] + rng.normal(0.0, 1e-6, (pairs, 3))
    return motion


def filter_of(motion: np.ndarray, half: float) -> NeighbourFilter:
    fastest = 2.0 * float(np.abs(motion[:, 3:]).max())
    return new_neighbour_filter(motion, np.full(3, -half), np.full(3, half), REACH, fastest, WINDOW)


@pytest.mark.parametrize(
    ("balls", "half"),
    [(4, 0.005), (200, 0.03), (MIN_BALLS - 1, 0.07), (MIN_BALLS, 0.07), (3000, 0.2)],
)
def test_every_meeting_is_found(balls: int, half: float) -> None:
    rng = np.random.default_rng(balls)
    motion = gas(balls, half, rng)
    neighbours = filter_of(motion, half)
    met = 0
    for _ in range(400):
        ball, time = int(rng.integers(balls)), float(rng.uniform(0.0, WINDOW))
        before = float(time + rng.uniform(0.0, 0.03))
        known = min(before, WINDOW) if neighbours.blocks is not None else before
        expected, partner = all_pairs(motion, ball, time, known)
        meeting, found = next_meeting(neighbours, motion, ball, time, before)
        assert found == partner
        assert found < 0 or meeting == pytest.approx(expected, rel=1e-9, abs=1e-15)
        met += found >= 0
        change = rng.integers(
            balls
        )  # a ball gets a new path, and the filter follows it as in the loop
        motion[change, 3:] = rng.normal(0.0, 3.0, 3)
        motion[change, :3] = rng.uniform(-half, half, 3) - motion[change, 3:] * time
        follow(neighbours, motion, int(change), time)
    assert met > 5


def test_balls_hit_often_are_sorted_often_and_none_is_lost() -> None:
    """So many changes of path that the blocks are worn before the window ends, several times."""
    rng = np.random.default_rng(9)
    balls, half = 2000, 0.06
    motion = gas(balls, half, rng)
    neighbours = filter_of(motion, half)
    blocks = neighbours.blocks
    assert blocks is not None
    sorts = 0
    for time in np.linspace(0.0, 0.3 * WINDOW, 8 * CHANGES * balls):
        if sort_is_due(neighbours, time):
            refresh_neighbours(neighbours, motion, time)
            sorts += 1
            assert time < blocks.until[0] <= WINDOW
        ball = int(rng.integers(balls))
        if rng.random() < 0.005:
            expected, partner = all_pairs(motion, ball, time, blocks.until[0])
            meeting, found = next_meeting(neighbours, motion, ball, time, np.inf)
            assert found == partner
            assert meeting == pytest.approx(expected if found >= 0 else blocks.until[0], rel=1e-9)
        here = motion[ball, :3] + motion[ball, 3:] * time
        motion[ball, 3:] = rng.normal(0.0, 3.0, 3)
        motion[ball, :3] = here - motion[ball, 3:] * time
        follow(neighbours, motion, ball, time)
    assert sorts > 4
    assert blocks.interval[0] < 0.1 * WINDOW


def test_the_curve_passes_every_cell_and_goes_from_neighbour_to_neighbour() -> None:
    side = range(1 << BITS)
    cells = np.array([(x, y, z) for x in side for y in side for z in side])
    places = np.array([_place_on_curve(*(int(k) for k in cell)) for cell in cells])
    assert sorted(places) == list(range(len(cells)))
    assert (np.abs(np.diff(cells[places.argsort()], axis=0)).sum(axis=1) == 1).all()


@pytest.mark.parametrize("balls", [40, 1000])
def test_a_graze_within_the_filters_rounding_is_not_lost(balls: int) -> None:
    """Pairs that miss or touch by less than float32 can tell: float64 decides, not the filter."""
    rng = np.random.default_rng(5)
    motion = np.concatenate([rng.uniform(-0.3, 0.3, (balls, 3)), np.zeros((balls, 3))], axis=1)
    for margin in 10.0 ** rng.uniform(-12.0, -7.0, 300) * rng.choice([-1.0, 1.0], 300):
        direction, side = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
        motion[0, 3:] = 5.0 * direction
        motion[1, :3] = motion[0, :3] + 0.05 * direction + (REACH + margin) * side
        motion[1, 3:] = 0.0
        neighbours = filter_of(motion, 0.4)
        expected = all_pairs(motion, 0, 0.0, WINDOW)
        assert next_meeting(neighbours, motion, 0, 0.0, WINDOW)[1] == expected[1]


def test_sorting_into_blocks_keeps_every_ball() -> None:
    rng = np.random.default_rng(6)
    count = MIN_BALLS + 9
    motion = gas(count, 0.1, rng)
    neighbours = filter_of(motion, 0.1)
    assert neighbours.blocks is not None
    for _ in range(3):
        motion[:, :3] = rng.uniform(
            -0.12, 0.12, (count, 3)
        )  # some outside the room, as bases may be
        refresh_neighbours(neighbours, motion, 0.0)
        slots = neighbours.blocks.column
        assert sorted(slots) == list(range(count))
        assert (neighbours.blocks.ball[slots] == np.arange(count)).all()
        assert (neighbours.paths[:, slots] == motion.T.astype(np.float32)).all()
