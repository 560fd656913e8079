"""How friction moves a ball that stands on its feet: it rolls, slips, or lies still (Coulomb's law).

One foot that bears the load, with unit normal b, is a plane at h = R from the centre; two are a groove: b between
their normals, h the distance of the centre from the line through the two touching points, about which it rolls, and
the load of each foot counts. Either way the touching points pass the surface with the slip u = v - h w x b, a friction
force f (per mass) changes it at the rate g + (1 + k) f with k = 5 h²/(2 R²), g being what the feet leave of gravity,
and u stays zero for f = -g/(1 + k): the ball rolls with k/(1 + k) of g, 5/7 of it on a plane (Goldstein, Poole &
Safko, Classical Mechanics, 3rd ed., section 5.7, gives the energy), as long as f is less than mu times the load.
While it slips, f is mu times the load against u, whose direction is read anew as in detect/ball_footing.py.

What is simplified: the load is that of gravity on the feet (a curved path's is not added, nor what friction presses
onto another foot); a foot that bears none does not rub; friction that would lift the ball off its feet does not act;
spin about b lasts on a plane, while on two feet all spin goes that is not about the line through them; a slip slower
than Rest.capture that friction can stop is stopped at once, which takes less than capture²/7 of energy per mass; and
who creeps at less than a hundredth of capture is held where an event finds it.
"""

import math

from sim_core.effects.contact_mode import (
    ASLEEP,
    DETACH_TOLERANCE,
    FLYING,
    ON_BALL,
    ROUNDING,
    SLIDING,
    STILL_BELOW,
    SUPPORTS,
    ContactState,
    drop_support,
    onto_cone,
    support_normal,
)
from sim_core.effects.friction import FrictionState, set_slip, set_spin, spin_at
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, add_scaled, cross, dot, scaled, sub

BEARS = 1e-9  # of the load: what a foot or two leave of it is rounding
NO_SLIP = 1e-9  # m/s: rounding of a slip
NOTHING = Vec3(0.0, 0.0, 0.0)


@jit
def braked(
    friction_state: FrictionState | None,
    contact: ContactState,
    ball: int,
    time: float,
    velocity: Vec3,
    acceleration: Vec3,
) -> tuple[Vec3, Vec3, int]:
    """Velocity [m/s], acceleration [m/s²] and mode of a ball on its feet, which leave it ``velocity`` and ``acceleration`` of
    what it had. ``time`` [s]: on the window's clock.
    """
    if friction_state is None:
        return _resisted(contact, ball, velocity, acceleration)
    return _rubbed(friction_state, contact, ball, time, velocity, acceleration)


@jit
def _resisted(
    contact: ContactState, ball: int, velocity: Vec3, acceleration: Vec3
) -> tuple[Vec3, Vec3, int]:
    _drop_left_supports(contact, ball, acceleration)
    if contact.marks[ball, SUPPORTS] == 0:
        return velocity, acceleration, FLYING
    weight, size = _size(contact.gravity), _size(acceleration)
    speed = _size(velocity)
    brake = contact.resistance * _load(weight, size)
    if speed > ROUNDING:
        return velocity, add_scaled(acceleration, -brake / speed, velocity), SLIDING
    if size <= brake or size <= STILL_BELOW * weight:
        return NOTHING, NOTHING, ASLEEP
    return velocity, add_scaled(acceleration, -brake / size, acceleration), SLIDING


@jit
def _rubbed(
    friction_state: FrictionState,
    contact: ContactState,
    ball: int,
    time: float,
    velocity: Vec3,
    acceleration: Vec3,
) -> tuple[Vec3, Vec3, int]:
    weight, size = _size(contact.gravity), _size(acceleration)
    load = _load(weight, size)
    up, arm, hold, axis = _stand(friction_state, contact, ball, sub(acceleration, contact.gravity))
    spin = spin_at(friction_state, ball, time)
    if arm < friction_state.radius:
        spin = scaled(dot(spin, axis), axis)
    slip = add_scaled(velocity, -arm, cross(spin, up))
    slip = add_scaled(slip, -dot(slip, up), up)
    slipping = _size(slip)
    inertia = 2.5 * (arm / friction_state.radius) ** 2  # k
    need = size / (1.0 + inertia)
    if slipping < contact.capture and need < hold:  # it rolls, or friction holds it
        velocity = onto_cone(contact, ball, add_scaled(velocity, -1.0 / (1.0 + inertia), slip))
        drift = scaled(inertia / (1.0 + inertia), acceleration)
        brake = min(contact.resistance * load, hold - need)
        speed = _size(velocity)
        if speed > ROUNDING:
            drift = add_scaled(drift, -brake / speed, velocity)
        elif inertia * need <= brake or size <= STILL_BELOW * weight:
            _drop_left_supports(contact, ball, acceleration)
            return NOTHING, NOTHING, ASLEEP
        else:
            drift = add_scaled(drift, -brake / size, acceleration)
        drilling = scaled(dot(spin, up), up)
        rolling = scaled(1.0 / arm, cross(up, velocity))
        set_spin(
            friction_state,
            ball,
            time,
            add_scaled(rolling, 1.0, drilling),
            scaled(1.0 / arm, cross(up, drift)),
        )
        return _kept_to(contact, ball, velocity, drift)
    if _size(velocity) <= ROUNDING and hold == 0.0 and size <= STILL_BELOW * weight:
        return NOTHING, NOTHING, ASLEEP
    rub = NOTHING
    if slipping > NO_SLIP:
        rub = scaled(-hold / slipping, slip)
    elif size > 0.0:
        slip = NOTHING
        rub = scaled(-hold / size, acceleration)
    drift = onto_cone(contact, ball, add_scaled(contact.gravity, 1.0, rub))
    if dot(up, drift) > STILL_BELOW * weight:
        rub, drift = NOTHING, acceleration
    twist = scaled(-inertia / arm, cross(up, rub))
    set_spin(friction_state, ball, time, spin, twist)
    if hold > 0.0:
        set_slip(friction_state, ball, time, slip, add_scaled(drift, -arm, cross(twist, up)))
    return _kept_to(contact, ball, velocity, drift)


@jit
def _stand(
    friction_state: FrictionState, contact: ContactState, ball: int, push: Vec3
) -> tuple[Vec3, float, float, Vec3]:
    """What bears the load: the normal b, h [m], the largest friction force per mass [m/s²], and in a groove the
    direction of the line through the two touching points.

    ``push`` [m/s²]: the force per mass of all feet together. Three feet leave nothing to move: then no friction.
    """
    supports = contact.marks[ball, SUPPORTS]
    load = _size(push)
    for one in range(supports):
        n = support_normal(contact, ball, one)
        if _size(add_scaled(push, -dot(push, n), n)) <= BEARS * load:
            return n, friction_state.radius, load * _mu(friction_state, contact, ball, one), NOTHING
    for one in range(supports):
        n = support_normal(contact, ball, one)
        for two in range(one + 1, supports):
            m = support_normal(contact, ball, two)
            c = dot(n, m)
            square = 1.0 - c * c
            if square < BEARS:
                continue
            a, b = (
                (dot(n, push) - c * dot(m, push)) / square,
                (dot(m, push) - c * dot(n, push)) / square,
            )
            if (
                a < 0.0
                or b < 0.0
                or _size(add_scaled(add_scaled(push, -a, n), -b, m)) > BEARS * load
            ):
                continue
            middle, across = add_scaled(n, 1.0, m), sub(n, m)
            twice = _size(middle)
            hold = a * _mu(friction_state, contact, ball, one) + b * _mu(
                friction_state, contact, ball, two
            )
            up, axis = scaled(1.0 / twice, middle), scaled(1.0 / _size(across), across)
            return up, 0.5 * twice * friction_state.radius, hold, axis
    return support_normal(contact, ball, 0), friction_state.radius, 0.0, NOTHING


@jit
def _mu(friction_state: FrictionState, contact: ContactState, ball: int, support: int) -> float:
    row = contact.rows[ball, support]
    return friction_state.mu if row <= ON_BALL else friction_state.mu_of_rows[row]


@jit
def crept(
    friction_state: FrictionState | None, contact: ContactState, ball: int, velocity: Vec3
) -> Vec3:
    """The velocity [m/s] of a ball on its feet, none if it only creeps: friction holds it, where between two surfaces
    it would go on in ever smaller hops that its slip keeps up.
    """
    if friction_state is None:
        return velocity
    mu = 0.0
    for support in range(contact.marks[ball, SUPPORTS]):
        mu = max(mu, _mu(friction_state, contact, ball, support))
    return (
        NOTHING if mu > 0.0 and _size(velocity) < DETACH_TOLERANCE * contact.capture else velocity
    )


@jit
def reset_spin(friction_state: FrictionState | None, ball: int, time: float, mode: int) -> None:
    """A ball that comes into flight keeps its spin; one that comes to lie still has none."""
    if friction_state is None:
        return
    if mode != SLIDING:
        set_spin(
            friction_state,
            ball,
            time,
            spin_at(friction_state, ball, time) if mode == FLYING else NOTHING,
            NOTHING,
        )


@jit
def _kept_to(
    contact: ContactState, ball: int, velocity: Vec3, acceleration: Vec3
) -> tuple[Vec3, Vec3, int]:
    """Take away the feet that friction leads the ball away from: it may come back to them as to walls."""
    support = 0
    while support < contact.marks[ball, SUPPORTS]:
        if dot(support_normal(contact, ball, support), velocity) > ROUNDING * (
            1.0 + _size(velocity)
        ):
            drop_support(contact, ball, support)
        else:
            support += 1
    _drop_left_supports(contact, ball, acceleration)
    if contact.marks[ball, SUPPORTS] == 0:
        return velocity, contact.gravity, FLYING
    return velocity, acceleration, SLIDING


@jit
def _drop_left_supports(contact: ContactState, ball: int, acceleration: Vec3) -> None:
    """Take away the feet that the acceleration leads the ball away from."""
    weight = _size(contact.gravity)
    support = 0
    while support < contact.marks[ball, SUPPORTS]:
        if dot(support_normal(contact, ball, support), acceleration) > STILL_BELOW * weight:
            drop_support(contact, ball, support)
        else:
            support += 1


@jit
def _load(weight: float, size: float) -> float:
    """Of the feet, per mass [m/s²], where they leave ``size`` of the ``weight``: see Moreau's cones."""
    return math.sqrt(max(0.0, weight * weight - size * size))


@jit
def _size(a: Vec3) -> float:
    return math.sqrt(dot(a, a))
