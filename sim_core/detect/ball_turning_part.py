"""When a ball first touches a turning part: looked for in the part's frame, where its tree stands still.

The flight is cut into pieces so short that in the part's frame each is a parabola but for a small share of a radius:
that parabola, with its error, is what the tree is asked about. At an obstacle the true path is followed by
conservative advancement (Mirtich, PhD thesis, Berkeley 1996): within a piece the gap is never below a quadratic, made
of its value, rate and curvature now and of the bound on its third derivative; go to where that closes, and look
again. Every stop lies before the contact, so nothing is stepped over, and near it the steps are Newton's.
"""

import numpy as np

from sim_core.detect.ball_mesh import SLACK, TINY, Scratch, stack_children
from sim_core.detect.ball_triangle import (
    CONTACT,
    HALF,
    away_from_capsule,
    face_normal,
    within_borders,
)
from sim_core.effects.part_rotation import Seen, Turning, jerk_bound, seen_from_part
from sim_core.geometry.bvh import Tree
from sim_core.geometry.obstacles import CAPSULE
from sim_core.geometry.turning_part import PartTree
from sim_core.motion import Point
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER, first_approach
from sim_core.numerics.vec3 import Vec3, along, dot, sub

# Of a radius: how far a piece of the path may be from its parabola, and the parabola from its chord. Boxes are asked
# about with that margin; a fifth and four times of both measured within 4 %.
OFF_PARABOLA = 0.1
BULGE = 0.25
STEPS = 1000  # a few are used; a path that runs along a surface at a distance of CONTACT needs one each 1e-7 s or so
OVERLAP = 1e-8  # m: a centre this far behind a face and coming out was left there by rounding; ten times scene.TOUCH


@inlined
def first_part_contact(
    part: PartTree | None,
    turning: Turning | None,
    scratch: Scratch,
    ball: Point,
    acceleration: Vec3,
    seam: float,
    time: float,
    limit: float,
    known: int,
    first: int,
) -> tuple[float, int]:
    """Delay [s] and obstacle of the first contact with the part before ``limit`` [s]; (limit, known) if there is none.

    ``acceleration`` [m/s²]: the ball's acceleration; ``time`` [s]: now, on the window's clock. The part's obstacles are
    numbered from ``first`` on. A search that runs out of steps answers (how far it got, -1).
    """
    if part is None or turning is None:
        return limit, known
    jerk = _jerk(part, turning, ball, acceleration, limit)
    if jerk < 0.0:
        return limit, known
    best = limit
    found = known
    begin = 0.0
    while begin < best:
        at = along(along(ball.position, begin, ball.velocity), 0.5 * begin * begin, acceleration)
        seen = seen_from_part(
            turning, at, along(ball.velocity, begin, acceleration), acceleration, time + begin
        )
        length = _piece(seen, jerk, best - begin, part.tree.radius)
        last = begin + length >= best
        end = best if last else begin + length
        _aim(scratch.ray, seen, length, jerk * length * length * length / 6.0)
        scratch.nodes[0] = 0
        scratch.times[0] = np.float32(0.0)
        depth = 1
        while depth > 0:
            depth -= 1
            longest = np.float32(end - begin) * SLACK
            if scratch.times[depth] > longest:
                continue
            code = scratch.nodes[depth]
            if code < 0:
                row = -1 - code
                delay, sure = _delay(
                    part.tree, row, turning, ball, acceleration, seen, seam, time, begin, end, jerk
                )
                if delay < end:
                    end = delay
                    best = delay
                    found = first + row if sure else -1
                continue
            depth = stack_children(part.tree, scratch, code, depth, longest)
        begin = end
        if last:
            break
    return best, found


@jit
def _jerk(part: PartTree, turning: Turning, ball: Point, acceleration: Vec3, limit: float) -> float:
    """Bound on the third derivative of the path in the part's frame [m/s³]; -1 if the path stays clear of all that
    the part sweeps.
    """
    bulge = 0.125 * limit * limit
    start = sub(ball.position, turning.point)
    way = along(Vec3(0.0, 0.0, 0.0), limit, along(ball.velocity, 0.5 * limit, acceleration))
    low = dot(turning.axis, start)
    rise = dot(turning.axis, way)
    drop = dot(turning.axis, acceleration)
    sag = bulge * abs(drop)
    if min(low, low + rise) - sag > part.high or max(low, low + rise) + sag < part.low:
        return -1.0
    start = along(start, -low, turning.axis)
    way = along(way, -rise, turning.axis)
    across = along(acceleration, -drop, turning.axis)
    force = np.sqrt(dot(across, across))
    square = dot(way, way)
    share = min(max(-dot(start, way) / square, 0.0), 1.0) if square > 0.0 else 0.0
    nearest = along(start, share, way)
    if np.sqrt(dot(nearest, nearest)) - bulge * force > part.reach:
        return -1.0
    forward = dot(turning.axis, ball.velocity)
    across = along(ball.velocity, -forward, turning.axis)
    speed = np.sqrt(dot(across, across)) + force * limit
    return jerk_bound(turning, np.sqrt(dot(start, start)) + speed * limit, speed, force)


@jit
def _piece(seen: Seen, jerk: float, length: float, radius: float) -> float:
    """How far [s] to go at once, at most ``length``."""
    bend = np.sqrt(dot(seen.acceleration, seen.acceleration))
    while jerk * length * length * length > 6.0 * OFF_PARABOLA * radius or (
        bend * length * length > 8.0 * BULGE * radius
    ):
        length *= 0.5
    return length


@jit
def _aim(ray: np.ndarray, seen: Seen, length: float, error: float) -> None:
    """Chord of the piece as in ball_mesh; both origins are ``error`` [m] further out."""
    bulge = -0.125 * length * length
    for axis in range(3):
        origin = seen.position[axis]
        shift = bulge * seen.acceleration[axis]
        speed = seen.velocity[axis] + 0.5 * length * seen.acceleration[axis]
        if abs(speed) < TINY:
            speed = TINY
        ray[axis] = np.float32(origin + max(shift, 0.0) + error)
        ray[3 + axis] = np.float32(origin + min(shift, 0.0) - error)
        ray[6 + axis] = np.float32(1.0 / speed)


@jit
def _delay(
    tree: Tree,
    row: int,
    turning: Turning,
    ball: Point,
    acceleration: Vec3,
    seen: Seen,
    seam: float,
    time: float,
    begin: float,
    end: float,
    jerk: float,
) -> tuple[float, bool]:
    """Delay [s] of the contact with one obstacle between ``begin`` and ``end``, NEVER if there is none; False when
    the steps ran out there.

    ``seen``: the ball at ``begin``. Contact is a gap of at most CONTACT.
    """
    radius = tree.radius
    round_edge = tree.kinds[row] == CAPSULE
    normal = face_normal(tree.numbers, row)
    delay = begin
    for _ in range(STEPS):
        if round_edge:
            away = away_from_capsule(tree.numbers, row, seen.position)
            distance = np.sqrt(dot(away, away))
            if distance <= HALF * radius:
                return NEVER, True
            normal = Vec3(away.x / distance, away.y / distance, away.z / distance)
            gap = distance - radius
        else:
            gap = dot(normal, seen.position) - tree.numbers[row, 3]
        rate = dot(normal, seen.velocity)
        bend = 0.5 * dot(normal, seen.acceleration)
        left = end - delay
        if (
            gap <= CONTACT
            and rate < 0.0
            and gap > -HALF * radius
            and (round_edge or within_borders(tree.numbers, row, seen.position, seam))
        ):
            return delay, True
        if gap > CONTACT or (gap > -OVERLAP and rate >= 0.0) or round_edge:
            # in front of it: on until it could be touched
            height = max(gap, CONTACT)
            near = min(left, -2.0 * height / rate) if rate < 0.0 else left
            step = first_approach(height, rate, bend - jerk * near / 6.0, 0.0)
            if step > near:
                near = left
                step = first_approach(height, rate, bend - jerk * left / 6.0, 0.0)
            if delay + step > end:
                return NEVER, True
            if not round_edge and gap > CONTACT and jerk * near * step * step <= 3.0 * CONTACT:
                at = along(
                    along(seen.position, step, seen.velocity), 0.5 * step * step, seen.acceleration
                )
                if rate + 2.0 * bend * step < -jerk * step * step and within_borders(
                    tree.numbers, row, at, seam
                ):
                    return delay + step, True
        else:  # behind a plane beside its face: on until it could come out in front
            step = first_approach(max(-gap, 0.0), -rate, -(bend + jerk * left / 6.0), 0.0)
            if delay + step > end:
                return NEVER, True
        delay += max(step, 1e-16)
        at = along(along(ball.position, delay, ball.velocity), 0.5 * delay * delay, acceleration)
        seen = seen_from_part(
            turning, at, along(ball.velocity, delay, acceleration), acceleration, time + delay
        )
    return delay, False
