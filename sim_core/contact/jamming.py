"""Jams: balls that make many slow hits without leaving their place are held still.

Such a ball is caught between its neighbours. Each further jam at the same place holds it about
twice as long.
"""

import numpy as np

from sim_core.contact.landing_and_lift_off import move_on
from sim_core.contact.pushed_by_part import TOUCHING
from sim_core.contact.supports import forget_left_support
from sim_core.effects.ball_sizes import radius_of_ball
from sim_core.effects.contact_mode import (
    ASLEEP,
    JAMMED,
    PRESSED,
    TOUCHED,
    UNTOUCHED,
    ContactState,
    rides,
)
from sim_core.motion import BallEvent, BallState, state_under
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, dot, set_vec3, sub, vec3_at

# Number of successive slow hits at one place that count as a jam. A ball that slides off another
# ball has moved on after a few hits.
JAM_HITS = 64
SAME_PLACE = 0.01  # distance within which a ball counts as in place, as a share of its radius
# s. JAM_HITS hits in a shorter time are not hops under weight (see SHORTEST_HOP). They mean that a
# turning part closes the gap.
PRESS_TIME = 1e-4
# s. A ball that is held a second time at one place is not woken for this time. The time doubles
# with each further jam.
HOLD_TIME = 1e-3
MAX_REPEATS = 40  # a ball with more jams at one place is held for ever


@jit
def hold_still(contact: ContactState, motion: np.ndarray, event: BallEvent, position: Vec3) -> None:
    """Hold a jammed ball still at ``position`` [m], longer each time it jams there again."""
    ball, jams = event.ball, contact.jams
    if _is_elsewhere(contact, jams.position, ball, position):
        set_vec3(jams.position, ball, position)
        jams.repeats[ball] = 0
    else:
        jams.repeats[ball] = min(jams.repeats[ball] + 1, MAX_REPEATS)
    zero = Vec3(0.0, 0.0, 0.0)
    move_on(contact, motion, event, BallState(position, zero), zero, JAMMED)
    wait = HOLD_TIME * (2.0 ** jams.repeats[ball] - 1.0)
    contact.stays_until[ball] = event.time_since_start + wait


@jit
def count_slow_hit(
    contact: ContactState, motion: np.ndarray, event: BallEvent, position: Vec3, slow: bool
) -> None:
    """Count a ball's slow hits at one place, and hold the ball still after JAM_HITS hits.

    ``slow``: True if this hit is slower than ContactState.elastic_below.
    """
    ball, now, hits = event.ball, event.time_since_start, contact.slow_hits
    forget_left_support(contact, ball)
    fast = not slow and hits.part_contact[ball] == UNTOUCHED
    if _is_elsewhere(contact, hits.position, ball, position) or fast:
        set_vec3(hits.position, ball, position)
        hits.number[ball] = 0
        hits.part_contact[ball] = UNTOUCHED
        hits.began[ball] = now
        return
    hits.number[ball] += 1
    if hits.number[ball] < JAM_HITS:
        return
    if hits.part_contact[ball] != UNTOUCHED:
        if now - hits.began[ball] < PRESS_TIME:
            hits.part_contact[ball] = PRESSED
        else:
            recent = now - hits.touched_at[ball] < TOUCHING
            hits.part_contact[ball] = TOUCHED if recent else UNTOUCHED
        hits.number[ball] = 0
        hits.began[ball] = now
        return
    if contact.mode[ball] >= ASLEEP or rides(contact.ride, ball):
        return
    acceleration = vec3_at(contact.acceleration, ball)
    velocity = state_under(motion, ball, event.time, acceleration).velocity
    if dot(velocity, velocity) < contact.elastic_below * contact.elastic_below:
        hits.number[ball] = 0
        hold_still(contact, motion, event, position)


@jit
def _is_elsewhere(contact: ContactState, places: np.ndarray, ball: int, position: Vec3) -> bool:
    """Return True if a ball has left the position noted for it in ``places`` (n, 3) [m].

    It has left if ``position`` is further from the noted position than a hundredth of its radius.
    """
    gone = sub(position, vec3_at(places, ball))
    radius = radius_of_ball(contact.sizes, contact.radius, ball)
    return dot(gone, gone) > (SAME_PLACE * radius) ** 2
