"""When a gap closes: the first time a function of time is at or below zero *and* falling.

A gap that opens again is never a hit, whatever rounding did to its sign: an overlapping pair that approaches
collides now, one that separates does not (Bannerman, Strobl, Formella & Pöschel, Comp. Part. Mech. 1 (2014) 191).
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.numerics.jit import jit

NEVER = math.inf

# Newton stops here [m]: a gap of this size is contact. Rounding of a 0.1 m coordinate is 1e-17 m; a looser
# value would hit early, a tighter one would spend steps on noise.
GAP_TOLERANCE = 1e-15
NEWTON_STEPS = 60  # quadratic convergence needs about 6; a double root halves the error a step: 50


@jit
def first_approach(c: float, b: float, a: float, depth: float) -> float:
    """Smallest s >= 0 with gap c + b s + a s² <= 0 and falling; NEVER if there is none.

    ``depth`` [unit of c]: an overlap deeper than this is no overlap but the far side of a one-sided surface, which
    can only be met after coming out in front of it.
    """
    if c <= 0.0 and c > -depth and (b < 0.0 or (b == 0.0 and a < 0.0)):
        return 0.0
    if a >= 0.0 and (b >= 0.0 or c <= 0.0):
        return NEVER
    disc = b * b - 4.0 * a * c
    if c > 0.0:
        if disc <= 0.0:  # a tangent touch does not approach
            return NEVER
        if b < 0.0:
            return 2.0 * c / (np.sqrt(disc) - b)  # for either sign of a, and without cancellation
        return -(b + np.sqrt(disc)) / (2.0 * a)
    if b <= 0.0:
        return NEVER
    if disc > 0.0:  # overlapping and receding: out, up, and back down
        return -(b + np.sqrt(disc)) / (2.0 * a)
    return -b / (2.0 * a) if c > -depth else NEVER  # turns back while still overlapping


class WaveGap(NamedTuple):
    """Gap of a ballistic ball above a vibrating face: c + b s + a s² - swing sin(omega s + theta) [m], swing >= 0."""

    c: float
    b: float
    a: float
    swing: float
    omega: float
    theta: float


@jit
def _gap(w: WaveGap, s: float) -> float:
    return w.c + s * (w.b + w.a * s) - w.swing * math.sin(w.omega * s + w.theta)


@jit
def _rate(w: WaveGap, s: float) -> float:
    return w.b + 2.0 * w.a * s - w.swing * w.omega * math.cos(w.omega * s + w.theta)


@jit
def _curvature(w: WaveGap, s: float) -> float:
    return 2.0 * w.a + w.swing * w.omega * w.omega * math.sin(w.omega * s + w.theta)


@jit
def _convex_approach(w: WaveGap, start: float, end: float) -> float:
    """First approach in [start, end], where the gap is convex: Newton from the left never oversteps."""
    s = start
    for _ in range(NEWTON_STEPS):
        gap = _gap(w, s)
        rate = _rate(w, s)
        if rate >= 0.0:
            return NEVER
        if gap <= GAP_TOLERANCE:
            return s
        step = s - gap / rate
        if step > end:
            return NEVER
        if step == s:
            return s
        s = step
    return s


@jit
def _crest(w: WaveGap, start: float, end: float) -> float:
    """Where a concave gap is largest in [start, end]: safeguarded Newton on its rate."""
    low = start
    high = end
    s = 0.5 * (low + high)
    for _ in range(NEWTON_STEPS):
        rate = _rate(w, s)
        if rate > 0.0:
            low = s
        else:
            high = s
        curvature = _curvature(w, s)
        step = s - rate / curvature if curvature < 0.0 else low
        if not (low < step < high):
            step = 0.5 * (low + high)
        if step == s or high - low <= 1e-16 * high:
            break
        s = step
    return s


@jit
def _concave_approach(w: WaveGap, start: float, end: float) -> float:
    """First approach in [start, end], where the gap is concave: Newton from the right, where it is negative."""
    gap = _gap(w, start)
    rate = _rate(w, start)
    if gap <= 0.0 and rate < 0.0:
        return start
    if _gap(w, end) > 0.0:
        return NEVER
    if gap <= 0.0:  # overlapping by rounding, and receding
        if _rate(w, end) >= 0.0:
            return NEVER
        top = _crest(w, start, end)
        if _gap(w, top) <= 0.0:
            return top
    s = end
    for _ in range(NEWTON_STEPS):
        gap = _gap(w, s)
        if gap >= -GAP_TOLERANCE:
            return s
        rate = _rate(w, s)
        step = max(start, s - gap / rate)
        if not step < s:
            return s
        s = step
    return s


@jit
def _reaches_envelope(w: WaveGap, depth: float) -> float:
    """A time [s] before which there is no approach: when the ball comes to the swing's envelope, or comes back to it.

    Inside the envelope that is now, unless the ball is faster than the face ever moves all the way out: its speed is
    least now or on leaving. Behind the face, ``depth`` [m] below its swing, it must come out over the crests.
    """
    height = w.c - w.swing
    if height > 0.0 or w.c <= -w.swing - depth:
        return first_approach(height, w.b, w.a, 0.0)
    disc = w.b * w.b - 4.0 * w.a * height
    if w.b <= 0.0 or min(w.b * w.b, disc) <= w.swing * w.swing * w.omega * w.omega:
        return 0.0
    return -(w.b + math.sqrt(disc)) / (2.0 * w.a) if w.a < 0.0 else NEVER


@jit
def first_wave_approach(w: WaveGap, limit: float, depth: float) -> float:
    """First s in [0, limit] at which the ball meets the vibrating face, approaching it; NEVER if none.

    The ball is carried to the swing's envelope first; inside it the gap is split where its curvature changes sign,
    sin(angle) = -2a / (swing omega²), so that each piece has at most one approach and Newton started from the safe
    side cannot miss it nor come early. ``depth`` as in first_approach.
    """
    s = _reaches_envelope(w, depth)
    if s >= limit:
        return NEVER
    strength = w.swing * w.omega * w.omega
    if abs(2.0 * w.a) >= strength:  # too gentle to bend the gap the other way: one piece
        if w.a <= 0.0:
            return _concave_approach(w, s, limit)
        return _convex_approach(w, s, limit)
    alpha = math.asin(-2.0 * w.a / strength)
    while s < limit:
        height = w.c + s * (w.b + w.a * s) - w.swing
        if height > 0.0:
            s += first_approach(height, w.b + 2.0 * w.a * s, w.a, 0.0)
            if s >= limit:
                return NEVER
        angle = w.omega * s + w.theta
        half = float(
            math.floor((angle - alpha) / math.pi)
        )  # pieces begin at half π ± alpha; even ones are convex
        while _piece_start(half + 1.0, alpha) <= angle:
            half += 1.0
        while _piece_start(half, alpha) > angle:
            half -= 1.0
        next_piece = (_piece_start(half + 1.0, alpha) - w.theta) / w.omega
        end = min(next_piece, limit)
        hit = _convex_approach(w, s, end) if half % 2.0 == 0.0 else _concave_approach(w, s, end)
        if hit < NEVER:
            return hit
        if next_piece <= s:  # rounding at a piece's very end
            next_piece = s + 1e-9 / w.omega
        s = next_piece
    return NEVER


@jit
def next_wave_approach(w: WaveGap, s: float, limit: float, depth: float) -> float:
    """First approach within ``limit`` [s] after the one at s, as if the ball had passed through the face there."""
    out = s + first_wave_approach(
        _later(WaveGap(-w.c, -w.b, -w.a, w.swing, w.omega, w.theta + math.pi), s),
        limit - s,
        math.inf,
    )
    if out >= limit:
        return NEVER
    return out + first_wave_approach(_later(w, out), limit - out, depth)


@jit
def _later(w: WaveGap, s: float) -> WaveGap:
    return WaveGap(
        w.c + s * (w.b + w.a * s), w.b + 2.0 * w.a * s, w.a, w.swing, w.omega, w.theta + w.omega * s
    )


@jit
def _piece_start(half: float, alpha: float) -> float:
    """Wave angle at which half-cycle piece number ``half`` begins."""
    return half * math.pi + (alpha if half % 2.0 == 0.0 else -alpha)
