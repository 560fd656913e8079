"""Time at which a ball first touches a turning part, searched in the part's frame.

The part's tree stands still in this frame. The flight is cut into short pieces. Each piece is a
parabola in the part's frame, up to an error of a small share of a radius. The tree is searched
along this parabola, widened by the error.

At each obstacle found, the true path is followed by conservative advancement (Mirtich, PhD thesis,
Berkeley 1996). Within a piece the gap is never below a quadratic made of its present value, rate
and curvature and of the bound J on its third derivative. Each step goes to the time at which the
quadratic becomes 0. Each stop lies before the contact, so that no contact is missed, and near the
contact the steps are Newton's.
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
from sim_core.effects.ball_sizes import BallSizes, part_root_of_ball, radius_of_ball
from sim_core.effects.part_rotation import RotationState, jerk_bound, relative_flight
from sim_core.geometry.bvh import Tree
from sim_core.geometry.obstacles import CAPSULE
from sim_core.geometry.turning_part import PartTree
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER, first_approach
from sim_core.numerics.vec3 import Flight, Vec3, add_scaled, dot, flight_after, position_after, sub

# Share of a radius: largest distance of a piece of the path from its parabola, and of the parabola
# from its chord. Boxes are widened by it. A fifth and four times of both measured within 4 %.
OFF_PARABOLA = 0.1
BULGE = 0.25
# Most contacts take a few steps. A path along a surface at a distance of CONTACT needs one step
# every 1e-7 s or so.
MAX_STEPS = 1000
# A centre this far [m] behind a face that moves outwards was left there by rounding. The value is
# ten times scene.TOUCH.
OVERLAP = 1e-8


@inlined
def first_part_contact(
    part: PartTree | None,
    rotation: RotationState | None,
    sizes: BallSizes | None,
    number: int,
    scratch: Scratch,
    ball: Flight,
    face_overlap: float,
    time: float,
    limit: float,
    known: int,
    first: int,
) -> tuple[float, int]:
    """Find the first hit of a ball on the turning part, up to the time of a hit already known.

    Args:
        part: obstacles of the part.
        rotation: rotation of the part.
        sizes: sizes of balls that are not all alike. Each size has its own obstacles.
        number: number of the ball. It is unused if ``sizes`` is None.
        scratch: working arrays.
        ball: the ball's flight in the room from now on.
        face_overlap: overlap of neighbouring faces [m].
        time: time since the start of the present time window [s].
        limit: delay of the known contact, or end of the search [s].
        known: obstacle of the known contact, negative for none.
        first: number of the part's first obstacle.

    Returns:
        Delay [s] and obstacle of the contact. The result is (limit, known) if the ball does not
        meet the part before. It is (searched time, -1) if the search ran out of steps.
    """
    if part is None or rotation is None:
        return limit, known
    jerk = _jerk(part, rotation, ball, limit)
    if jerk < 0.0:
        return limit, known
    radius = radius_of_ball(sizes, part.tree.radius, number)
    best = limit
    found = known
    begin = 0.0
    while begin < best:
        relative = relative_flight(rotation, flight_after(ball, begin), time + begin)
        length = _piece(relative, jerk, best - begin, radius)
        last = begin + length >= best
        end = best if last else begin + length
        aim_ray(scratch.ray, relative, length, jerk * length * length * length / 6.0)
        scratch.nodes[0] = part_root_of_ball(sizes, number)
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
                part.tree,
                row,
                rotation,
                ball,
                radius,
                relative,
                face_overlap,
                time,
                begin,
                end,
                jerk,
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
    """Return a bound on the third derivative of a ball's path as seen from the part [m/s³].

    It is -1 if the ball cannot touch the part within ``limit`` [s].
    """
    bulge = 0.125 * limit * limit
    start = sub(ball.position, rotation.point)
    halfway = add_scaled(ball.velocity, 0.5 * limit, ball.acceleration)
    way = add_scaled(Vec3(0.0, 0.0, 0.0), limit, halfway)
    # component along the axis
    low = dot(rotation.axis, start)
    rise = dot(rotation.axis, way)
    drop = dot(rotation.axis, ball.acceleration)
    sag = bulge * abs(drop)
    if min(low, low + rise) - sag > part.high or max(low, low + rise) + sag < part.low:
        return -1.0
    # component across the axis
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
    """Return the duration [s] of the next piece of a path, short enough to count as a parabola.

    It is at most ``length``.
    """
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
    radius: float,
    relative: Flight,
    face_overlap: float,
    time: float,
    begin: float,
    end: float,
    jerk: float,
) -> tuple[float, bool]:
    """Return when a ball touches one obstacle of the part within a piece of its path.

    Returns: (delay, sure). The delay [s] counts from now. It is NEVER if the ball does not touch
    the obstacle. If ``sure`` is False, the search ran out of steps, and a contact can only come
    later.
    A gap of at most CONTACT counts as contact.

    Args:
        tree: tree of the part.
        row: number of the obstacle.
        rotation: rotation of the part.
        ball: the ball's flight in the room from now on.
        radius: radius of the ball [m].
        relative: the ball's flight in the part's frame at ``begin``.
        face_overlap: overlap of neighbouring faces [m].
        time: time since the start of the present time window [s].
        begin: start of the piece [s].
        end: end of the piece [s].
        jerk: bound on the third derivative of the path in the part's frame [m/s³].
    """
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
            # The ball is in front of the obstacle: go on until it could touch.
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
        else:  # the ball is behind a plane beside its face: go on until it could come out in front
            step = first_approach(max(-gap, 0.0), -rate, -(bend + jerk * left / 6.0), 0.0)
            if delay + step > end:
                return NEVER, True
        delay += max(step, 1e-16)
        relative = relative_flight(rotation, flight_after(ball, delay), time + delay)
    return delay, False
