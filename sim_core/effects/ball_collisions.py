"""Balls collide with one another. Unlike every other effect this one is there unless it is taken away.

Without it balls fly through each other: a single ball, or shot so thin that its balls hardly ever meet, spends nothing
on looking for pairs. Nothing is kept of them: no crowd, no partner on the calendar; overlaps are not checked.
"""

from typing import NamedTuple


class BallCollisions(NamedTuple):
    """Present or not; what a collision of two balls does is said by the other effects."""
