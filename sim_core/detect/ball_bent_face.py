"""Time at which a ball on a parabola touches a vibrating face that bends.

Notation:
    s: time from now [s]
    f, grad f: share of the amplitude at the place under the ball's centre [-], and gradient [1/m]
    G = c + b s + a s² - A f sin(omega s + theta): gap [m], ``BentGap`` in the code
    F, F1, F2: bounds of |f| [-], |grad f| [1/m] and of second derivatives of f [1/m²]
    V: largest speed of the ball along the face during the search [m/s]
    U: acceleration of the ball along the face [m/s²]

G has no closed form of its convex and concave pieces, as the gap from a rigid face has. But its
second derivative is never below

    2 a - A (F omega² + 2 F1 V omega + F2 V² + F1 U)

A parabola with this curvature that starts with the value and rate of G at any time stays below G.
Each step goes to the first time at which this parabola closes, and starts a new parabola there. No
step passes a contact, and close to a contact the steps are those of Newton's method.
"""

import math
from typing import NamedTuple

from sim_core.effects.amplitude_profile import FaceProfiles, share_and_slope
from sim_core.numerics.jit import jit
from sim_core.numerics.roots import (
    GAP_TOLERANCE,
    NEVER,
    WaveGap,
    first_approach,
    first_wave_approach,
    shifted,
    time_to_band,
)
from sim_core.numerics.vec3 import Flight, Vec3, add_scaled, dot, position_after, velocity_after

# rad: phase by which a search goes on where a step is lost in rounding; the face moves by less
# than 1e-13 m meanwhile
SMALL_STEP = 1e-9


class BentGap(NamedTuple):
    """Gap of a flying ball from a vibrating face that bends, as a function of the time from now.

    rigid: gap from a rigid face of the amplitude at which the share is 1.
    profiles: profiles of all sonotrodes.
    face: obstacle number of the face.
    axis: unit vector along the vibration.
    ball: the ball's flight from now on.
    """

    rigid: WaveGap
    profiles: FaceProfiles
    face: int
    axis: Vec3
    ball: Flight


@jit
def _gap_and_rate(g: BentGap, s: float) -> tuple[float, float]:
    """Return the gap [m] and its rate [m/s] at the time s."""
    w = g.rigid
    at = position_after(g.ball, s)
    share, slope = share_and_slope(g.profiles, g.face, g.axis, at)
    change = dot(slope, velocity_after(g.ball, s))
    angle = w.omega * s + w.theta
    height, lift = share * math.sin(angle), share * w.omega * math.cos(angle)
    return (
        w.c + s * (w.b + w.a * s) - w.amplitude * height,
        w.b + 2.0 * w.a * s - w.amplitude * (lift + change * math.sin(angle)),
    )


@jit
def _length_across(vector: Vec3, axis: Vec3) -> float:
    across = add_scaled(vector, -dot(vector, axis), axis)
    return math.sqrt(dot(across, across))


@jit
def _rigid_approach(g: BentGap, start: float, limit: float, depth: float) -> float:
    """Return the first approach of a ball under whose way the share does not change."""
    w = g.rigid
    share, _ = share_and_slope(g.profiles, g.face, g.axis, g.ball.position)
    theta = w.theta if share >= 0.0 else w.theta + math.pi
    local = WaveGap(w.c, w.b, w.a, abs(share) * w.amplitude, w.omega, theta)
    return start + first_wave_approach(shifted(local, start), limit - start, depth)


@jit
def first_bent_approach(g: BentGap, start: float, limit: float, depth: float) -> float:
    """Return the first s in [start, limit] at which a ball meets and approaches a bent face.

    The result is NEVER if there is no such time. ``depth`` [m]: a ball that is further than this
    behind the band in which the face moves must first come out in front of it.
    """
    w, k = g.rigid, g.profiles.faces[g.face]
    largest, steep, bent = (
        g.profiles.bounds[k, 0],
        g.profiles.bounds[k, 1],
        g.profiles.bounds[k, 2],
    )
    pull = _length_across(g.ball.acceleration, g.axis)
    speed = _length_across(g.ball.velocity, g.axis) + pull * limit
    if steep * speed == 0.0:
        return _rigid_approach(g, start, limit, depth)
    # a rigid face that reaches as high, and is as fast as the bent face is where the ball is
    top = largest * w.amplitude
    fastest = w.omega + steep * speed / largest
    s = start + time_to_band(shifted(WaveGap(w.c, w.b, w.a, top, fastest, w.theta), start), depth)
    bound = largest * w.omega * w.omega + steep * (2.0 * speed * w.omega + pull)
    bend = w.a - 0.5 * w.amplitude * (bound + bent * speed * speed)
    while s < limit:
        height = w.c + s * (w.b + w.a * s) - top
        if height > 0.0:
            s += first_approach(height, w.b + 2.0 * w.a * s, w.a, 0.0)
            if s >= limit:
                return NEVER
        gap, rate = _gap_and_rate(g, s)
        if gap <= GAP_TOLERANCE and rate < 0.0:
            return s
        step = first_approach(gap, rate, bend, math.inf)
        if s + step == s:
            if rate <= 0.0:
                return s
            step = SMALL_STEP / w.omega
        s += step
    return NEVER


@jit
def next_bent_approach(g: BentGap, s: float, limit: float, depth: float) -> float:
    """Return the next time before ``limit`` at which a ball meets and approaches a bent face.

    The ball has met the face at time s and passes through it. The result is NEVER if it does not
    come back in time.
    """
    w = g.rigid
    turned = WaveGap(-w.c, -w.b, -w.a, w.amplitude, w.omega, w.theta + math.pi)
    behind = BentGap(turned, g.profiles, g.face, g.axis, g.ball)
    out = first_bent_approach(behind, s, limit, math.inf)
    if out >= limit:
        return NEVER
    return first_bent_approach(g, out, limit, depth)
