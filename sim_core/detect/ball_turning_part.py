"""When a ball first touches a turning part, searched for in the part's frame.

There the part's tree stands still. The flight is cut into pieces so short that in the part's frame
each is a parabola up to a small share of a radius; the tree is searched along that parabola,
widened by its error. At an obstacle the true path is followed by conservative advancement (Mirtich,
PhD thesis, Berkeley 1996): within a piece the gap is never below a quadratic made of its value,
rate and curvature now and of the bound J on its third derivative. Go to where that closes, and
repeat. Each stop lies before the contact, so that none is missed, and near it the steps are
Newton's.
"""

import numpy as np

from sim_core.detect.ball_mesh import SLACK, Scratch, aim_ray, stack_children
from sim_core.detect.ball_triangle import (
    CONTACT,
    HALF,
    away_from_capsule,
    face_normal,
    within_borders,
)
from sim_core.effects.part_rotation import RotationState, jerk_bound, relative_flight
from sim_core.geometry.bvh import Tree
from sim_core.geometry.obstacles import CAPSULE
from sim_core.geometry.turning_part import PartTree
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER, first_approach
from sim_core.numerics.vec3 import Flight, Vec3, add_scaled, dot, flight_after, position_after, sub

# Of a radius: how far a piece of the path may be from its parabola, and the parabola from its
# chord. Boxes are widened by that; a fifth and four times of both measured within 4 %.
OFF_PARABOLA = 0.1
BULGE = 0.25
# A few are used; a path along a surface at a distance of CONTACT needs one every 1e-7 s or so.
MAX_STEPS = 1000
# A centre this far [m] behind a face and coming out was left there by rounding; ten times
# scene.TOUCH.
OVERLAP = 1e-8


@inlined
def first_part_contact(
    part: PartTree | None,
    rotation: RotationState | None,
    scratch: Scratch,
    ball: Flight,
    face_overlap: float,
    time: float,
    limit: float,
    known: int,
    first: int,
) -> tuple[float, int]:
    """The first contact with the part, if it is before a known one.

    Args:
        part: obstacles of the part.
        rotation: of the part.
        scratch: working space.
        ball: its flight in the room from now on.
        face_overlap: how far faces overlap [m].
        time: now, on the window's clock [s].
        limit: when the known contact is, or end of the search [s].
        known: obstacle of the known contact, negative for none.
        first: number of the part's first obstacle.

    Returns:
        Delay [s] and obstacle; (limit, known) if the part is not met before, and (how far it got,
        -1) if the search ran out of steps.
    """
    if part is None or rotation is None:
        return limit, known
    jerk = _jerk(part, rotation, ball, limit)
    if jerk < 0.0:
        return limit, known
    best = limit
    found = known
    begin = 0.0
    while begin < best:
        relative = relative_flight(rotation, flight_after(ball, begin), time + begin)
        length = _piece(relative, jerk, best - begin, part.tree.radius)
        last = begin + length >= best
        end = best if last else begin + length
        aim_ray(scratch.ray, relative, length, jerk * length * length * length / 6.0)
        scratch.nodes[0] = 0
        scratch.times[0] = np.float32(0.0)
        depth = 1
        while depth > 0:
            depth -= 1
            longest = np.float32(end - begin) * SLACK
            if scratch.times[depth] > longest:
                continue
            code = scratch.nodes[depth]
            if code >= 0:
                depth = stack_children(part.tree, scratch, code, depth, longest)
                continue
            row = -1 - code
            delay, sure = _obstacle_delay(
                part.tree, row, rotation, ball, relative, face_overlap, time, begin, end, jerk
            )
            if delay < end:
                end = delay
                best = delay
                found = first + row if sure else -1
        begin = end
        if last:
            break
    return best, found


@jit
def _jerk(part: PartTree, rotation: RotationState, ball: Flight, limit: float) -> float:
    """Bound J of the path in the part's frame; -1 if it stays clear of all that the part sweeps."""
    bulge = 0.125 * limit * limit
    start = sub(ball.position, rotation.point)
    halfway = add_scaled(ball.velocity, 0.5 * limit, ball.acceleration)
    way = add_scaled(Vec3(0.0, 0.0, 0.0), limit, halfway)
    # along the axis
    low = dot(rotation.axis, start)
    rise = dot(rotation.axis, way)
    drop = dot(rotation.axis, ball.acceleration)
    sag = bulge * abs(drop)
    if min(low, low + rise) - sag > part.high or max(low, low + rise) + sag < part.low:
        return -1.0
    # across the axis
    start = add_scaled(start, -low, rotation.axis)
    way = add_scaled(way, -rise, rotation.axis)
    pull = add_scaled(ball.acceleration, -drop, rotation.axis)
    force = np.sqrt(dot(pull, pull))
    square = dot(way, way)
    share = min(max(-dot(start, way) / square, 0.0), 1.0) if square > 0.0 else 0.0
    nearest = add_scaled(start, share, way)
    if np.sqrt(dot(nearest, nearest)) - bulge * force > part.reach:
        return -1.0
    across = add_scaled(ball.velocity, -dot(rotation.axis, ball.velocity), rotation.axis)
    speed = np.sqrt(dot(across, across)) + force * limit
    return jerk_bound(rotation, np.sqrt(dot(start, start)) + speed * limit, speed, force)


@jit
def _piece(relative: Flight, jerk: float, length: float, radius: float) -> float:
    """Length [s] of the next piece, at most ``length``."""
    bend = np.sqrt(dot(relative.acceleration, relative.acceleration))
    while jerk * length * length * length > 6.0 * OFF_PARABOLA * radius or (
        bend * length * length > 8.0 * BULGE * radius
    ):
        length *= 0.5
    return length


@jit
def _obstacle_delay(
    tree: Tree,
    row: int,
    rotation: RotationState,
    ball: Flight,
    relative: Flight,
    face_overlap: float,
    time: float,
    begin: float,
    end: float,
    jerk: float,
) -> tuple[float, bool]:
    """Delay [s] of the contact with one obstacle in a piece, and whether the search is complete.

    NEVER if there is none. Contact is a gap of at most CONTACT.

    Args:
        tree: of the part.
        row: the obstacle.
        rotation: of the part.
        ball: its flight in the room from now on.
        relative: its flight in the part's frame at ``begin``.
        face_overlap: how far faces overlap [m].
        time: now, on the window's clock [s].
        begin: of the piece [s].
        end: of the piece [s].
        jerk: J [m/s³].
    """
    radius = tree.radius
    round_edge = tree.kinds[row] == CAPSULE
    normal = face_normal(tree.numbers, row)
    delay = begin
    for _ in range(MAX_STEPS):
        if round_edge:
            away = away_from_capsule(tree.numbers, row, relative.position)
            distance = np.sqrt(dot(away, away))
            if distance <= HALF * radius:
                return NEVER, True
            normal = Vec3(away.x / distance, away.y / distance, away.z / distance)
            gap = distance - radius
        else:
            gap = dot(normal, relative.position) - tree.numbers[row, 3]
        rate = dot(normal, relative.velocity)
        bend = 0.5 * dot(normal, relative.acceleration)
        left = end - delay
        if (
            gap <= CONTACT
            and rate < 0.0
            and gap > -HALF * radius
            and (round_edge or within_borders(tree.numbers, row, relative.position, face_overlap))
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
                # the step ends in contact up to CONTACT, if the gap surely falls there
                at = position_after(relative, step)
                if rate + 2.0 * bend * step < -jerk * step * step and within_borders(
                    tree.numbers, row, at, face_overlap
                ):
                    return delay + step, True
        else:  # behind a plane beside its face: on until it could come out in front
            step = first_approach(max(-gap, 0.0), -rate, -(bend + jerk * left / 6.0), 0.0)
            if delay + step > end:
                return NEVER, True
        delay += max(step, 1e-16)
        relative = relative_flight(rotation, flight_after(ball, delay), time + delay)
    return delay, False
