"""Find when a gap closes: the first time at which a function of time is at most 0 and falls.

A gap that opens again is never a contact, whatever rounding did to its sign: an overlapping pair
that approaches collides now, a pair that separates does not (Bannerman, Strobl, Formella & Pöschel,
Comp. Part. Mech. 1 (2014) 191).

Notation:
    s: time from now [s]
    a, b, c: coefficients of a quadratic gap c + b s + a s² [m/s², m/s, m]
    A, omega, theta: amplitude [m], angular frequency [rad/s] and phase now [rad] of the vibrating
        face, whose gap is c + b s + a s² - A sin(omega s + theta); ``WaveGap`` in the code
    rate, curvature: first and second derivative of the gap
    depth: an overlap deeper than this is no overlap but the far side of a one-sided surface, which
        can only be met after coming out in front of it [m]
    approach: a time at which the gap is at most 0 and falls
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.numerics.jit import jit

NEVER = math.inf

# Newton stops at a gap of this size [m], which is contact. Rounding of a 0.1 m coordinate is 1e-17
# m. A larger value makes contacts early, and a smaller value spends steps on rounding.
GAP_TOLERANCE = 1e-15
NEWTON_STEPS = 60  # quadratic convergence needs 6; a double root halves the error a step, so 50


@jit
def first_approach(c: float, b: float, a: float, depth: float) -> float:
    """Return the first s >= 0 at which c + b s + a s² is at most 0 and falls, or NEVER."""
    if c <= 0.0 and c > -depth and (b < 0.0 or (b == 0.0 and a < 0.0)):
        return 0.0
    if a >= 0.0 and (b >= 0.0 or c <= 0.0):
        return NEVER
    disc = b * b - 4.0 * a * c
    if c > 0.0:
        if disc <= 0.0:  # a tangent touch does not approach
            return NEVER
        if b < 0.0:
            # this form holds for either sign of a, without cancellation
            return float(2.0 * c / (np.sqrt(disc) - b))
        return float(-(b + np.sqrt(disc)) / (2.0 * a))
    if b <= 0.0:
        return NEVER
    if disc > 0.0:  # overlapping and receding: the gap opens, and closes again later
        return float(-(b + np.sqrt(disc)) / (2.0 * a))
    return -b / (2.0 * a) if c > -depth else NEVER  # the gap turns while it still overlaps


class WaveGap(NamedTuple):
    """Gap c + b s + a s² - A sin(omega s + theta) [m] of a flying ball from a vibrating face.

    s is the time from now [s], and A the amplitude [m].
    """

    c: float
    b: float
    a: float
    amplitude: float
    omega: float
    theta: float


@jit
def _gap(w: WaveGap, s: float) -> float:
    return w.c + s * (w.b + w.a * s) - w.amplitude * math.sin(w.omega * s + w.theta)


@jit
def _rate(w: WaveGap, s: float) -> float:
    return w.b + 2.0 * w.a * s - w.amplitude * w.omega * math.cos(w.omega * s + w.theta)


@jit
def _curvature(w: WaveGap, s: float) -> float:
    return 2.0 * w.a + w.amplitude * w.omega * w.omega * math.sin(w.omega * s + w.theta)


@jit
def _convex_approach(w: WaveGap, start: float, end: float) -> float:
    """Return the first time in [start, end] at which a convex gap closes; NEVER if there is none.

    Newton's method, started from the left, never oversteps a root of a convex function.
    """
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
def _time_of_largest_gap(w: WaveGap, start: float, end: float) -> float:
    """Return the time in [start, end] at which a concave gap is largest.

    Search by safeguarded Newton steps for the zero of the gap's rate.
    """
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
    """Return the first time in [start, end] at which a concave gap closes; NEVER if there is none.

    Newton's method starts from the right end.
    """
    gap = _gap(w, start)
    rate = _rate(w, start)
    if gap <= 0.0 and rate < 0.0:
        return start
    if _gap(w, end) > 0.0:
        return NEVER
    if gap <= 0.0:  # the gap overlaps by rounding, and recedes
        if _rate(w, end) >= 0.0:
            return NEVER
        top = _time_of_largest_gap(w, start, end)
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
def time_to_band(w: WaveGap, depth: float) -> float:
    """Return the earliest time [s] at which the ball reaches the band in which the face moves.

    Inside the band this is now, time 0, unless the ball leaves the band faster than the face ever
    moves. The face cannot catch such a ball before the ball falls back into the band. The ball's
    speed is least now or on leaving. A ball more than ``depth`` behind the band must first come out
    over the highest position of the face.
    """
    height = w.c - w.amplitude
    if height > 0.0 or w.c <= -w.amplitude - depth:
        return first_approach(height, w.b, w.a, 0.0)
    disc = w.b * w.b - 4.0 * w.a * height
    if w.b <= 0.0 or min(w.b * w.b, disc) <= w.amplitude * w.amplitude * w.omega * w.omega:
        return 0.0
    return -(w.b + math.sqrt(disc)) / (2.0 * w.a) if w.a < 0.0 else NEVER


@jit
def first_wave_approach(w: WaveGap, limit: float, depth: float) -> float:
    """Return the first s in [0, limit] at which a ball meets and approaches the vibrating face.

    The result is NEVER if there is no such time.

    The search starts where the ball reaches the band that the face moves in. Inside the band the
    gap is split where its curvature changes sign, sin(angle) = -2a / (A omega²). Each piece then
    has at most one approach, and Newton started from the safe side can neither miss it nor come
    early.
    """
    s = time_to_band(w, depth)
    if s >= limit:
        return NEVER
    strength = w.amplitude * w.omega * w.omega
    if abs(2.0 * w.a) >= strength:  # the curvature never changes sign: one piece
        if w.a <= 0.0:
            return _concave_approach(w, s, limit)
        return _convex_approach(w, s, limit)
    alpha = math.asin(-2.0 * w.a / strength)
    while s < limit:
        height = w.c + s * (w.b + w.a * s) - w.amplitude
        if height > 0.0:
            s += first_approach(height, w.b + 2.0 * w.a * s, w.a, 0.0)
            if s >= limit:
                return NEVER
        angle = w.omega * s + w.theta
        # pieces begin at half π ± alpha; even pieces are convex
        half = float(math.floor((angle - alpha) / math.pi))
        while _piece_start(half + 1.0, alpha) <= angle:
            half += 1.0
        while _piece_start(half, alpha) > angle:
            half -= 1.0
        next_piece = (_piece_start(half + 1.0, alpha) - w.theta) / w.omega
        end = min(next_piece, limit)
        hit = _convex_approach(w, s, end) if half % 2.0 == 0.0 else _concave_approach(w, s, end)
        if hit < NEVER:
            return hit
        if next_piece <= s:  # rounding at the end of a piece
            next_piece = s + 1e-9 / w.omega
        s = next_piece
    return NEVER


@jit
def next_wave_approach(w: WaveGap, s: float, limit: float, depth: float) -> float:
    """Return the next time before ``limit`` at which a ball meets and approaches a vibrating face.

    The ball has met the face at time s and passes through it. The result is NEVER if it does not
    come back in time.
    """
    # seen from behind the face, the ball comes out where the gap with its sign changed closes
    behind = WaveGap(-w.c, -w.b, -w.a, w.amplitude, w.omega, w.theta + math.pi)
    out = s + first_wave_approach(shifted(behind, s), limit - s, math.inf)
    if out >= limit:
        return NEVER
    return out + first_wave_approach(shifted(w, out), limit - out, depth)


@jit
def shifted(w: WaveGap, s: float) -> WaveGap:
    """Return the same gap as a function of the time since ``s``."""
    height, rate = w.c + s * (w.b + w.a * s), w.b + 2.0 * w.a * s
    return WaveGap(height, rate, w.a, w.amplitude, w.omega, w.theta + w.omega * s)


@jit
def _piece_start(half: float, alpha: float) -> float:
    """Return the angle omega s + theta [rad] at which the piece number ``half`` begins.

    A piece is a span without a change of sign of the gap's curvature. The gap is convex in even
    pieces and concave in odd pieces. ``alpha``: asin(-2 a / (A omega²)) [rad].
    """
    return half * math.pi + (alpha if half % 2.0 == 0.0 else -alpha)
