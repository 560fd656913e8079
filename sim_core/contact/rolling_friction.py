"""Resistance and friction of a ball on its supports: the ball rolls, slips, or lies still.

Notation, all per unit mass of the ball:

R      radius of the ball [m]                                       radius
b      unit normal of the plane or groove that bears the load       Stand.normal
h      distance of the centre from the points or line it touches    Stand.arm
v, w   velocity [m/s] and spin [rad/s]                              velocity, spin
u      slip of the touching points, v - h w x b [m/s]               slip
g      gravity projected onto the cone of the supports [m/s²]       acceleration
k      5 h²/(2 R²), the share of inertia that spins                 inertia
mu     coefficient of friction                                      friction_state.mu
f      friction force; at most mu times the load [m/s²]             rub; Stand.max_friction

If one support bears the load, it is a plane at h = R. If two supports bear it, they are a groove: b
lies between their normals, and h is the distance of the centre from the line through the two
touching points, about which the ball rolls. Friction then depends on the load of each support.

In both cases f changes u at the rate g + (1 + k) f. For f = -g/(1 + k) u stays zero: the ball rolls
with k/(1 + k) of g, which is 5/7 of g on a plane. It rolls as long as f is less than mu times the
load (Coulomb's law). While the ball slips, f is mu times the load and opposes u. The direction of u
is renewed from time to time, as path_end.py says.

Simplifications:

- The load is due to gravity alone. Neither a curved path nor friction on another support adds to
  it.
- A support that bears no load has no friction.
- Friction that would lift the ball off its supports does not act.
- Spin about b lasts on a plane. On two supports only the spin about the line through the touching
  points lasts.
- A slip that is slower than Rest.capture and that friction can stop is stopped at once. This takes
  less than capture²/7 of energy per mass.
- A ball that creeps at less than a hundredth of capture is stopped at its next event.

Source: the energy of a rolling ball is in Goldstein, Poole & Safko, Classical Mechanics, 3rd ed.,
section 5.7.
"""

import math
from typing import NamedTuple

from sim_core.contact.supports import ROUNDING, drop_supports_along, onto_cone, support_normal
from sim_core.effects.ball_sizes import radius_of_ball
from sim_core.effects.contact_mode import ASLEEP, FLYING, ON_BALL, SLIDING, ContactState
from sim_core.effects.friction import FrictionState, set_slip, set_spin, spin_at
from sim_core.motion import BallEvent
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, add_scaled, cross, dot, scaled, sub

LOAD_ROUNDING = 1e-9  # share of the load: one support or two bear the load up to this rounding
NO_SLIP = 1e-9  # m/s: rounding of a slip
STILL_BELOW = 1e-9  # share of gravity: an acceleration this small is rounding
ZERO = Vec3(0.0, 0.0, 0.0)


class Stand(NamedTuple):
    """The plane or groove that bears the load of a ball.

    normal: unit normal of the plane, or of the groove halfway between its two normals.
    arm: distance of the ball's centre from the points or the line that it touches [m].
    max_friction: largest friction force per mass [m/s²].
    axis: direction of the line through the two touching points of a groove, zero on a plane.
    """

    normal: Vec3
    arm: float
    max_friction: float
    axis: Vec3


@jit
def braked(
    friction_state: FrictionState | None,
    contact: ContactState,
    event: BallEvent,
    velocity: Vec3,
    acceleration: Vec3,
) -> tuple[Vec3, Vec3, int]:
    """Slow a ball in contact down by resistance and friction. With friction, also set its spin.

    Args:
        friction_state: friction and spins of all balls; None for smooth balls.
        contact: state of contact mode, with the planes (supports) on which the ball stands.
        event: the ball and the present time.
        velocity: velocity of the ball [m/s], without a part that would push it into a support.
        acceleration: acceleration of the ball [m/s²], without such a part.

    Returns:
        Velocity [m/s] and acceleration [m/s²] with which the ball goes on, and the way in which it
        moves then: FLYING, SLIDING or ASLEEP.
    """
    if friction_state is None:
        return _resisted(contact, event.ball, velocity, acceleration)
    return _rubbed(friction_state, contact, event, velocity, acceleration)


@jit
def _resisted(
    contact: ContactState, ball: int, velocity: Vec3, acceleration: Vec3
) -> tuple[Vec3, Vec3, int]:
    weight, size = _size(contact.gravity), _size(acceleration)
    drop_supports_along(contact.supports, ball, acceleration, STILL_BELOW * weight)
    if contact.supports.number[ball] == 0:
        return velocity, acceleration, FLYING
    speed = _size(velocity)
    brake = contact.resistance * _load(weight, size)
    if speed > ROUNDING:
        return velocity, add_scaled(acceleration, -brake / speed, velocity), SLIDING
    if size <= brake or size <= STILL_BELOW * weight:
        return ZERO, ZERO, ASLEEP
    return velocity, add_scaled(acceleration, -brake / size, acceleration), SLIDING


@jit
def _rubbed(
    friction_state: FrictionState,
    contact: ContactState,
    event: BallEvent,
    velocity: Vec3,
    acceleration: Vec3,
) -> tuple[Vec3, Vec3, int]:
    ball, time = event.ball, event.time
    weight, size = _size(contact.gravity), _size(acceleration)
    push = sub(acceleration, contact.gravity)  # force of all supports together
    stand = _find_stand(friction_state, contact, ball, push)
    b, h = stand.normal, stand.arm
    spin = spin_at(friction_state, ball, time)
    radius = radius_of_ball(contact.sizes, friction_state.radius, ball)
    if h < radius:
        spin = scaled(dot(spin, stand.axis), stand.axis)
    slip = add_scaled(velocity, -h, cross(spin, b))
    slip = add_scaled(slip, -dot(slip, b), b)
    slip_speed = _size(slip)
    inertia = 2.5 * (h / radius) ** 2
    needed = size / (1.0 + inertia)  # friction force that keeps the ball rolling
    if slip_speed < contact.capture and needed < stand.max_friction:
        # The ball rolls, or friction holds it.
        velocity = onto_cone(
            contact.supports, ball, add_scaled(velocity, -1.0 / (1.0 + inertia), slip)
        )
        rolling = scaled(inertia / (1.0 + inertia), acceleration)
        brake = min(contact.resistance * _load(weight, size), stand.max_friction - needed)
        speed = _size(velocity)
        if speed > ROUNDING:
            rolling = add_scaled(rolling, -brake / speed, velocity)
        elif inertia * needed <= brake or size <= STILL_BELOW * weight:
            drop_supports_along(contact.supports, ball, acceleration, STILL_BELOW * weight)
            return ZERO, ZERO, ASLEEP
        else:
            rolling = add_scaled(rolling, -brake / size, acceleration)
        spin = add_scaled(scaled(1.0 / h, cross(b, velocity)), 1.0, scaled(dot(spin, b), b))
        set_spin(friction_state, ball, time, spin, scaled(1.0 / h, cross(b, rolling)))
        return _with_supports_left(contact, ball, velocity, rolling)
    if _size(velocity) <= ROUNDING and stand.max_friction == 0.0 and size <= STILL_BELOW * weight:
        return ZERO, ZERO, ASLEEP
    rub = ZERO
    if slip_speed > NO_SLIP:
        rub = scaled(-stand.max_friction / slip_speed, slip)
    elif size > 0.0:
        slip = ZERO
        rub = scaled(-stand.max_friction / size, acceleration)
    slipping = onto_cone(contact.supports, ball, add_scaled(contact.gravity, 1.0, rub))
    if dot(b, slipping) > STILL_BELOW * weight:  # friction would lift the ball off
        rub, slipping = ZERO, acceleration
    twist = scaled(-inertia / h, cross(b, rub))
    set_spin(friction_state, ball, time, spin, twist)
    if stand.max_friction > 0.0:
        set_slip(friction_state, ball, time, slip, add_scaled(slipping, -h, cross(twist, b)))
    return _with_supports_left(contact, ball, velocity, slipping)


@jit
def _find_stand(
    friction_state: FrictionState, contact: ContactState, ball: int, push: Vec3
) -> Stand:
    """Find the plane or groove that bears a ball, from the force ``push`` of its supports [m/s²].

    A ball on three supports cannot move, so that there is no friction.
    """
    supports = contact.supports
    radius = radius_of_ball(contact.sizes, friction_state.radius, ball)
    count = supports.number[ball]
    load = _size(push)
    for one in range(count):
        n = support_normal(supports, ball, one)
        if _size(add_scaled(push, -dot(push, n), n)) <= LOAD_ROUNDING * load:
            return Stand(n, radius, load * _mu(friction_state, contact, ball, one), ZERO)
    for one in range(count):
        n = support_normal(supports, ball, one)
        for two in range(one + 1, count):
            m = support_normal(supports, ball, two)
            c = dot(n, m)
            square = 1.0 - c * c
            if square < LOAD_ROUNDING:
                continue
            # shares of the load on the two supports: push = a n + b m
            a = (dot(n, push) - c * dot(m, push)) / square
            b = (dot(m, push) - c * dot(n, push)) / square
            rest = add_scaled(add_scaled(push, -a, n), -b, m)
            if a < 0.0 or b < 0.0 or _size(rest) > LOAD_ROUNDING * load:
                continue
            middle, across = add_scaled(n, 1.0, m), sub(n, m)
            twice = _size(middle)
            max_friction = a * _mu(friction_state, contact, ball, one) + b * _mu(
                friction_state, contact, ball, two
            )
            return Stand(
                scaled(1.0 / twice, middle),
                0.5 * twice * radius,
                max_friction,
                scaled(1.0 / _size(across), across),
            )
    return Stand(support_normal(supports, ball, 0), radius, 0.0, ZERO)


@jit
def _mu(friction_state: FrictionState, contact: ContactState, ball: int, support: int) -> float:
    obstacle = contact.supports.obstacles[ball, support]
    return friction_state.mu if obstacle <= ON_BALL else friction_state.mu_of_rows[obstacle]


@jit
def stopped_if_creeping(
    friction_state: FrictionState | None,
    contact: ContactState,
    ball: int,
    velocity: Vec3,
    creeping: float,
) -> Vec3:
    """Return ``velocity`` [m/s], or zero for a slow ball on a support with friction.

    ``creeping``: speed [m/s] below which a ball is slow. Without this stop a spinning ball between
    two surfaces would go on in ever smaller hops.
    """
    if friction_state is None:
        return velocity
    mu = 0.0
    for support in range(contact.supports.number[ball]):
        mu = max(mu, _mu(friction_state, contact, ball, support))
    return ZERO if mu > 0.0 and _size(velocity) < creeping else velocity


@jit
def reset_spin(friction_state: FrictionState | None, ball: int, time: float, mode: int) -> None:
    """Make the spin of a ball constant if it flies now, and zero if it lies still now.

    ``mode``: FLYING, SLIDING, ASLEEP or JAMMED. A sliding ball keeps its spin as it is.
    """
    if friction_state is None:
        return
    if mode != SLIDING:
        spin = spin_at(friction_state, ball, time) if mode == FLYING else ZERO
        set_spin(friction_state, ball, time, spin, ZERO)


@jit
def _with_supports_left(
    contact: ContactState, ball: int, velocity: Vec3, acceleration: Vec3
) -> tuple[Vec3, Vec3, int]:
    """Remove the supports from which a ball with friction moves away.

    Returns: velocity [m/s], acceleration [m/s²] and mode (FLYING or SLIDING) of the ball then.

    The ball may meet these supports again as walls.
    """
    weight, supports = _size(contact.gravity), contact.supports
    drop_supports_along(supports, ball, velocity, ROUNDING * (1.0 + _size(velocity)))
    drop_supports_along(supports, ball, acceleration, STILL_BELOW * weight)
    if supports.number[ball] == 0:
        return velocity, contact.gravity, FLYING
    return velocity, acceleration, SLIDING


@jit
def _load(weight: float, size: float) -> float:
    """Return the load on a ball's supports per mass [m/s²].

    ``weight``: gravity [m/s²]. ``size``: part of gravity that still accelerates the ball [m/s²].
    This part and the load are perpendicular (Moreau's polar cones).
    """
    return math.sqrt(max(0.0, weight * weight - size * size))


@jit
def _size(a: Vec3) -> float:
    return math.sqrt(dot(a, a))
