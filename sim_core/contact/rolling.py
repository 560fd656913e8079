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
    FEET,
    FLYING,
    KISS,
    ON_BALL,
    ROUNDING,
    SLIDING,
    STILL_BELOW,
    Footing,
    drop_foot,
    foot_normal,
    onto_cone,
)
from sim_core.effects.friction import Grip, set_slip, set_spin, spin_at
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, along, cross, dot, sub, times

BEARS = 1e-9  # of the load: what a foot or two leave of it is rounding
NO_SLIP = 1e-9  # m/s: rounding of a slip
NOTHING = Vec3(0.0, 0.0, 0.0)


@jit
def braked(
    grip: Grip | None, footing: Footing, ball: int, time: float, velocity: Vec3, pull: Vec3
) -> tuple[Vec3, Vec3, int]:
    """Velocity [m/s], acceleration [m/s²] and mode of a ball on its feet, which leave it ``velocity`` and ``pull`` of
    what it had. ``time`` [s]: on the window's clock.
    """
    if grip is None:
        return _resisted(footing, ball, velocity, pull)
    return _rubbed(grip, footing, ball, time, velocity, pull)


@jit
def _resisted(footing: Footing, ball: int, velocity: Vec3, pull: Vec3) -> tuple[Vec3, Vec3, int]:
    _lift_feet(footing, ball, pull)
    if footing.marks[ball, FEET] == 0:
        return velocity, pull, FLYING
    weight, size = _size(footing.gravity), _size(pull)
    speed = _size(velocity)
    brake = footing.resistance * _load(weight, size)
    if speed > ROUNDING:
        return velocity, along(pull, -brake / speed, velocity), SLIDING
    if size <= brake or size <= STILL_BELOW * weight:
        return NOTHING, NOTHING, ASLEEP
    return velocity, along(pull, -brake / size, pull), SLIDING


@jit
def _rubbed(
    grip: Grip, footing: Footing, ball: int, time: float, velocity: Vec3, pull: Vec3
) -> tuple[Vec3, Vec3, int]:
    weight, size = _size(footing.gravity), _size(pull)
    load = _load(weight, size)
    up, arm, hold, axis = _stand(grip, footing, ball, sub(pull, footing.gravity))
    spin = spin_at(grip, ball, time)
    if arm < grip.radius:
        spin = times(dot(spin, axis), axis)
    slip = along(velocity, -arm, cross(spin, up))
    slip = along(slip, -dot(slip, up), up)
    slipping = _size(slip)
    inertia = 2.5 * (arm / grip.radius) ** 2  # k
    need = size / (1.0 + inertia)
    if slipping < footing.capture and need < hold:  # it rolls, or friction holds it
        velocity = onto_cone(footing, ball, along(velocity, -1.0 / (1.0 + inertia), slip))
        drift = times(inertia / (1.0 + inertia), pull)
        brake = min(footing.resistance * load, hold - need)
        speed = _size(velocity)
        if speed > ROUNDING:
            drift = along(drift, -brake / speed, velocity)
        elif inertia * need <= brake or size <= STILL_BELOW * weight:
            _lift_feet(footing, ball, pull)
            return NOTHING, NOTHING, ASLEEP
        else:
            drift = along(drift, -brake / size, pull)
        drilling = times(dot(spin, up), up)
        rolling = times(1.0 / arm, cross(up, velocity))
        set_spin(
            grip, ball, time, along(rolling, 1.0, drilling), times(1.0 / arm, cross(up, drift))
        )
        return _kept_to(footing, ball, velocity, drift)
    if _size(velocity) <= ROUNDING and hold == 0.0 and size <= STILL_BELOW * weight:
        return NOTHING, NOTHING, ASLEEP
    rub = NOTHING
    if slipping > NO_SLIP:
        rub = times(-hold / slipping, slip)
    elif size > 0.0:
        slip = NOTHING
        rub = times(-hold / size, pull)
    drift = onto_cone(footing, ball, along(footing.gravity, 1.0, rub))
    if dot(up, drift) > STILL_BELOW * weight:
        rub, drift = NOTHING, pull
    twist = times(-inertia / arm, cross(up, rub))
    set_spin(grip, ball, time, spin, twist)
    if hold > 0.0:
        set_slip(grip, ball, time, slip, along(drift, -arm, cross(twist, up)))
    return _kept_to(footing, ball, velocity, drift)


@jit
def _stand(grip: Grip, footing: Footing, ball: int, push: Vec3) -> tuple[Vec3, float, float, Vec3]:
    """What bears the load: the normal b, h [m], the largest friction force per mass [m/s²], and in a groove the
    direction of the line through the two touching points.

    ``push`` [m/s²]: the force per mass of all feet together. Three feet leave nothing to move: then no friction.
    """
    feet = footing.marks[ball, FEET]
    load = _size(push)
    for one in range(feet):
        n = foot_normal(footing, ball, one)
        if _size(along(push, -dot(push, n), n)) <= BEARS * load:
            return n, grip.radius, load * _mu(grip, footing, ball, one), NOTHING
    for one in range(feet):
        n = foot_normal(footing, ball, one)
        for two in range(one + 1, feet):
            m = foot_normal(footing, ball, two)
            c = dot(n, m)
            square = 1.0 - c * c
            if square < BEARS:
                continue
            a, b = (
                (dot(n, push) - c * dot(m, push)) / square,
                (dot(m, push) - c * dot(n, push)) / square,
            )
            if a < 0.0 or b < 0.0 or _size(along(along(push, -a, n), -b, m)) > BEARS * load:
                continue
            middle, across = along(n, 1.0, m), sub(n, m)
            twice = _size(middle)
            hold = a * _mu(grip, footing, ball, one) + b * _mu(grip, footing, ball, two)
            up, axis = times(1.0 / twice, middle), times(1.0 / _size(across), across)
            return up, 0.5 * twice * grip.radius, hold, axis
    return foot_normal(footing, ball, 0), grip.radius, 0.0, NOTHING


@jit
def _mu(grip: Grip, footing: Footing, ball: int, foot: int) -> float:
    row = footing.rows[ball, foot]
    return grip.mu if row <= ON_BALL else grip.mu_of_rows[row]


@jit
def crept(grip: Grip | None, footing: Footing, ball: int, velocity: Vec3) -> Vec3:
    """The velocity [m/s] of a ball on its feet, none if it only creeps: friction holds it, where between two surfaces
    it would go on in ever smaller hops that its slip keeps up.
    """
    if grip is None:
        return velocity
    mu = 0.0
    for foot in range(footing.marks[ball, FEET]):
        mu = max(mu, _mu(grip, footing, ball, foot))
    return NOTHING if mu > 0.0 and _size(velocity) < KISS * footing.capture else velocity


@jit
def off_its_feet(grip: Grip | None, ball: int, time: float, mode: int) -> None:
    """A ball that comes into flight keeps its spin; one that comes to lie still has none."""
    if grip is None:
        return
    if mode != SLIDING:
        set_spin(
            grip, ball, time, spin_at(grip, ball, time) if mode == FLYING else NOTHING, NOTHING
        )


@jit
def _kept_to(footing: Footing, ball: int, velocity: Vec3, pull: Vec3) -> tuple[Vec3, Vec3, int]:
    """Take away the feet that friction leads the ball away from: it may come back to them as to walls."""
    foot = 0
    while foot < footing.marks[ball, FEET]:
        if dot(foot_normal(footing, ball, foot), velocity) > ROUNDING * (1.0 + _size(velocity)):
            drop_foot(footing, ball, foot)
        else:
            foot += 1
    _lift_feet(footing, ball, pull)
    if footing.marks[ball, FEET] == 0:
        return velocity, footing.gravity, FLYING
    return velocity, pull, SLIDING


@jit
def _lift_feet(footing: Footing, ball: int, pull: Vec3) -> None:
    """Take away the feet that the acceleration leads the ball away from."""
    weight = _size(footing.gravity)
    foot = 0
    while foot < footing.marks[ball, FEET]:
        if dot(foot_normal(footing, ball, foot), pull) > STILL_BELOW * weight:
            drop_foot(footing, ball, foot)
        else:
            foot += 1


@jit
def _load(weight: float, size: float) -> float:
    """Of the feet, per mass [m/s²], where they leave ``size`` of the ``weight``: see Moreau's cones."""
    return math.sqrt(max(0.0, weight * weight - size * size))


@jit
def _size(a: Vec3) -> float:
    return math.sqrt(dot(a, a))
