"""Search for balls that can meet: sixteen at a time through a float32 filter, then exactly.

Notation: in the free-fall frame the paths of two balls are straight lines, whatever gravity is.
A base position is where such a line is at time 0 of the clock. b: difference of the base positions
of two balls [m]. w: difference of their velocities [m/s]. The square of the distance at which they
pass each other is b² - (b w)² / w², at any time. They still approach each other at time t while
b w + t w² < 0.

The filter keeps every pair whose paths could come within reach, rounding included. The pairs that
pass the filter are decided in float64, so that results do not depend on the filter.
"""

from typing import NamedTuple

import numpy as np

from sim_core.detect.ball_ball import pair_delay
from sim_core.loop.spatial_blocks import (
    MIN_BALLS,
    Blocks,
    ball_in_column,
    blocks_are_worn,
    column_of,
    new_blocks,
    shift_blocks,
    sort_blocks,
    widen,
)
from sim_core.motion import free_fall_position
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.periodic_sides import (
    PeriodicSides,
    horizon,
    images,
    nearest_image,
    note_all_speeds,
    note_speed,
)
from sim_core.numerics.simd import (
    BOXES,
    LANES,
    balls_near,
    balls_near_until,
    boxes_hit,
    images_near,
    images_near_until,
    lowest_bit,
)
from sim_core.numerics.vec3 import Vec3, sub

# share of distance²: float32 loses 2e-7 of it in the miss distance
FAR_SHARE = np.float32(1.0 - 1e-6)
SLACK = np.float32(1.000001)  # factor on float32 times: ten times their rounding
# share of the largest number in a sum of three products, with a reserve
ROUNDINGS = 16.0 * float(np.finfo(np.float32).eps)
# Share of the square of the largest number in a distance². The distance² is a sum of three squares,
# each up to (3.5 + 3.5)² times as large, with a dozen roundings.
SQUARE_ROUNDINGS = 16.0 * ROUNDINGS
# m/s: no shot comes near it. A ball that does gains speed without end, and its contacts are found
# ever less exactly.
MAX_SPEED = 1e6
TINY = 1e-30  # replaces a velocity component of zero, whose inverse would be infinite


class NeighbourFilter(NamedTuple):
    """Float32 copies of the paths of all balls, and the data with which a search filters them.

    paths: base position and velocity, one column a ball, (6, m) float32, padded with NaN, which
        meets nothing.
    probe: data of the present search, (17,) float32: the column of the ball, the present time, the
        allowances for rounding, the end of the search, and the square of a distance within reach.
        simd.py describes the entries for periodic sides.
    reach: distance of two centres at which balls touch [m]; with several sizes, the largest one.
    max_speed: speed up to which the margins for rounding hold [m/s].
    window: length of a time window [s]. The clock restarts from 0 at the start of each window.
    blocks: the balls sorted into blocks of neighbours; None unless there are many balls.
    radii: radii of balls of several sizes [m], (n,); None for one size.
    sides: the sides of a periodic box; None in any other chamber.
    """

    paths: np.ndarray
    probe: np.ndarray
    reach: float
    max_speed: float
    window: float
    blocks: Blocks | None
    radii: np.ndarray | None = None
    sides: PeriodicSides | None = None


def new_neighbour_filter(
    motion: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    reach: float,
    max_speed: float,
    window: float,
    radii: np.ndarray | None = None,
    sides: PeriodicSides | None = None,
) -> NeighbourFilter:
    """Return a filter for the paths ``motion`` (n, 6) in a room from ``low`` to ``high`` [m]."""
    # A base position lies up to one window's flight outside the room, and up to two where the ball
    # may be outside the room.
    flights = 1.0 if sides is None else 2.0
    farthest = float(np.max(high - low)) + flights * max_speed * window
    margin = ROUNDINGS * farthest
    probe = np.zeros(17, dtype=np.float32)
    # the last entry: largest b w + t w² of a ball that still approaches
    probe[7:10] = (FAR_SHARE, -((reach + margin) ** 2), margin * max_speed)
    if sides is not None:
        probe[13:17] = sides[:4]
    probe[11] = (reach + margin) ** 2 + SQUARE_ROUNDINGS * farthest**2
    paths = np.full((6, -(-len(motion) // LANES) * LANES), np.nan, dtype=np.float32)
    blocks = (
        new_blocks(len(motion), low, high, reach + 2.0 * margin, window, sides)
        if len(motion) >= MIN_BALLS
        else None
    )
    neighbours = NeighbourFilter(paths, probe, reach, max_speed, window, blocks, radii, sides)
    refresh_neighbours(neighbours, motion, 0.0)
    return neighbours


@jit
def refresh_neighbours(neighbours: NeighbourFilter | None, motion: np.ndarray, time: float) -> None:
    """Copy all paths into the filter anew. If there are many balls, sort them into blocks first."""
    if neighbours is None:
        return
    note_all_speeds(neighbours.sides, motion)
    sort_blocks(neighbours.blocks, motion, time, neighbours.window)
    for ball in range(len(motion)):
        _write_path(neighbours, motion, ball)


@inlined
def sort_is_due(neighbours: NeighbourFilter | None, time: float) -> bool:
    """Return True if the balls must be sorted into blocks anew before the event at ``time``."""
    if neighbours is None:
        return False
    return blocks_are_worn(neighbours.blocks, time)


@inlined
def shift_sorting(neighbours: NeighbourFilter | None) -> None:
    """Subtract a window's length from the time of the last sorting, as a new window begins."""
    if neighbours is None:
        return
    shift_blocks(neighbours.blocks, neighbours.window)


@inlined
def follow(neighbours: NeighbourFilter | None, motion: np.ndarray, ball: int, time: float) -> None:
    """Copy the new path of a ball that was hit at ``time`` [s] into the filter."""
    if neighbours is None:
        return
    _write_path(neighbours, motion, ball)
    note_speed(neighbours.sides, motion, ball)
    widen(neighbours.blocks, motion, ball, time)


@inlined
def speed_limit(neighbours: NeighbourFilter | None) -> float:
    """Return the speed [m/s] up to which the filter's allowance for rounding holds.

    Without a filter return MAX_SPEED.
    """
    if neighbours is None:
        return MAX_SPEED
    return neighbours.max_speed


@inlined
def _pair_reach(radii: np.ndarray | None, reach: float, one: int, two: int) -> float:
    """Return the distance [m] between the centres of balls ``one`` and ``two`` when they touch."""
    if radii is None:
        return reach
    return float(radii[one] + radii[two])


@inlined
def _write_path(neighbours: NeighbourFilter, motion: np.ndarray, ball: int) -> None:
    column = column_of(neighbours.blocks, ball)
    paths = neighbours.paths
    paths[0, column] = np.float32(motion[ball, 0])
    paths[1, column] = np.float32(motion[ball, 1])
    paths[2, column] = np.float32(motion[ball, 2])
    paths[3, column] = np.float32(motion[ball, 3])
    paths[4, column] = np.float32(motion[ball, 4])
    paths[5, column] = np.float32(motion[ball, 5])


@inlined
def next_meeting(
    neighbours: NeighbourFilter, motion: np.ndarray, ball: int, time: float, before: float
) -> tuple[float, int]:
    """Find the ball's first meeting with another ball after ``time`` and before ``before`` [s].

    Returns:
        The time of the meeting [s] and the number of the other ball. Without a meeting the number
        is -1, and the time is the time up to which this is certain. That is NEVER for few balls,
        and for many balls the time until which the boxes of the blocks hold. In a periodic box it
        is no later than the time until which only the present nearest images can meet.
    """
    probe = neighbours.probe
    column = column_of(neighbours.blocks, ball)
    for k in range(6):
        probe[k] = neighbours.paths[k, column]
    probe[6] = np.float32(time)
    _aim_at_images(neighbours.sides, probe)
    known = time + horizon(neighbours.sides, motion, ball, neighbours.reach)
    return _search(neighbours.blocks, neighbours, motion, ball, time, before, known)


@inlined
def _aim_at_images(sides: PeriodicSides | None, probe: np.ndarray) -> None:
    """Set ``probe`` so that the filter of a periodic box counts time from now.

    The filter then compares the images of two balls that are nearest to each other now.
    """
    if sides is None:
        return
    probe[12] = probe[6]
    probe[6] = np.float32(0.0)


@inlined
def _near(sides: PeriodicSides | None, paths: np.ndarray, first: int, probe: np.ndarray) -> int:
    if sides is None:
        return balls_near(paths, first, probe)
    return images_near(paths, first, probe)


@inlined
def _near_until(
    sides: PeriodicSides | None,
    paths: np.ndarray,
    first: int,
    probe: np.ndarray,
    time: float,
    delay: float,
) -> int:
    if sides is None:
        probe[10] = np.float32(time + delay) * SLACK
        return balls_near_until(paths, first, probe)
    probe[10] = np.float32(delay) * SLACK
    return images_near_until(paths, first, probe)


@inlined
def _search(
    blocks: Blocks | None,
    neighbours: NeighbourFilter,
    motion: np.ndarray,
    ball: int,
    time: float,
    before: float,
    known: float,
) -> tuple[float, int]:
    """Find the ball's first meeting: search all balls, or only the blocks that its path enters.

    Args:
        known: time up to which the answer "no meeting" can be certain [s].

    Returns:
        The time of the meeting [s] and the number of the other ball, or the time [s] up to which
        there is certainly no meeting, and -1.
    """
    if blocks is None:
        here = free_fall_position(motion, ball, time)
        velocity = Vec3(motion[ball, 3], motion[ball, 4], motion[ball, 5])
        best = min(before, known) - time
        partner = -1
        for first in range(0, len(motion), LANES):
            near = _near(neighbours.sides, neighbours.paths, first, neighbours.probe)
            near = _without(near, ball - first)
            while near != 0:
                other = first + lowest_bit(near)
                near &= near - 1
                closing = sub(Vec3(motion[other, 3], motion[other, 4], motion[other, 5]), velocity)
                reach = _pair_reach(neighbours.radii, neighbours.reach, ball, other)
                apart = sub(free_fall_position(motion, other, time), here)
                delay = pair_delay(nearest_image(neighbours.sides, apart), closing, reach)
                if delay < best:
                    best = delay
                    partner = other
        if partner < 0:
            return known, -1
        return time + best, partner
    known = min(known, blocks.until[0])
    best, partner = min(before, known) - time, -1
    _aim(blocks.ray, motion, ball, time)
    column = column_of(blocks, ball)
    # searched first, because a meeting there leaves a shorter path to look along
    own = column // LANES
    best, partner = _best_in_block(neighbours, motion, ball, time, own, best, partner)
    x, last_x, first_y, last_y = images(neighbours.sides, motion, ball, time, time + best)
    while x <= last_x:
        y = first_y
        while y <= last_y:
            _aim_from_image(neighbours.sides, blocks.ray, motion, ball, time, x, y)
            for group in range(len(blocks.groups)):
                longest = np.float32(best) * SLACK
                nodes = boxes_hit(blocks.groups, group, blocks.ray, longest, blocks.enter)
                while nodes != 0:
                    node = BOXES * group + lowest_bit(nodes)
                    nodes &= nodes - 1
                    longest = np.float32(best) * SLACK
                    entered = boxes_hit(blocks.boxes, node, blocks.ray, longest, blocks.enter)
                    while entered != 0:
                        block = BOXES * node + lowest_bit(entered)
                        entered &= entered - 1
                        if block != own:
                            best, partner = _best_in_block(
                                neighbours, motion, ball, time, block, best, partner
                            )
            y += 1
        x += 1
    return (time + best, partner) if partner >= 0 else (known, -1)


@jit
def _best_in_block(
    neighbours: NeighbourFilter,
    motion: np.ndarray,
    ball: int,
    time: float,
    block: int,
    best: float,
    partner: int,
) -> tuple[float, int]:
    """Return delay [s] and other ball of the first meeting, so far or in one more block.

    ``best``, ``partner``: delay [s] and other ball of the first meeting found so far. ``block``:
    number of the block of balls that is searched now.
    """
    first = LANES * block
    near = _near_until(neighbours.sides, neighbours.paths, first, neighbours.probe, time, best)
    near = _without(near, column_of(neighbours.blocks, ball) - first)
    if near != 0:
        best, partner = _nearest(neighbours, motion, ball, time, first, near, best, partner)
    return best, partner


@inlined
def _without(near: int, lane: int) -> int:
    """Return the bit mask ``near`` of balls without the bit ``lane`` of the searching ball."""
    return near & ~(1 << lane) if 0 <= lane < LANES else near


@inlined
def _aim(ray: np.ndarray, motion: np.ndarray, ball: int, time: float) -> None:
    """Write a ball's path from ``time`` on into ``ray``: position twice, then 1 / velocity."""
    here = free_fall_position(motion, ball, time)
    for axis in range(3):
        speed = motion[ball, 3 + axis]
        ray[axis] = ray[3 + axis] = np.float32(here[axis])
        ray[6 + axis] = np.float32(1.0 / (speed if abs(speed) >= TINY else TINY))


@inlined
def _aim_from_image(
    sides: PeriodicSides | None,
    ray: np.ndarray,
    motion: np.ndarray,
    ball: int,
    time: float,
    x: int,
    y: int,
) -> None:
    """Move the origin of ``ray`` to the ball's image ``x`` and ``y`` sides of the box away."""
    if sides is None:
        return
    here = free_fall_position(motion, ball, time)
    ray[0] = ray[3] = np.float32(here.x + x * sides.x)
    ray[1] = ray[4] = np.float32(here.y + y * sides.y)


@inlined
def _nearest(
    neighbours: NeighbourFilter,
    motion: np.ndarray,
    ball: int,
    time: float,
    first: int,
    near: int,
    best: float,
    partner: int,
) -> tuple[float, int]:
    """Return delay [s] and other ball of the first meeting, so far or with the balls ``near``.

    ``near`` has a bit for each column of the filter to examine, counted from column ``first``.
    ``best``, ``partner``: delay [s] and other ball of the first meeting found so far.

    The lower ball number wins a tie, so that the order of the columns does not matter.
    """
    here = free_fall_position(motion, ball, time)
    velocity = Vec3(motion[ball, 3], motion[ball, 4], motion[ball, 5])
    while near != 0:
        other = ball_in_column(neighbours.blocks, first + lowest_bit(near))
        near &= near - 1
        closing = sub(Vec3(motion[other, 3], motion[other, 4], motion[other, 5]), velocity)
        reach = _pair_reach(neighbours.radii, neighbours.reach, ball, other)
        apart = sub(free_fall_position(motion, other, time), here)
        delay = pair_delay(nearest_image(neighbours.sides, apart), closing, reach)
        if delay < best or (delay == best and other < partner):
            best = delay
            partner = other
    return best, partner
