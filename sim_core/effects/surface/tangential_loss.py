"""Tangential loss: each hit on a surface takes a constant share of the tangential velocity.

Notation:
    v_t: tangential velocity of the ball relative to the surface [m/s]
    s: ``share`` that a hit takes [-]; v_t turns into (1 - s) v_t, the normal velocity is kept

After n hits on still parallel surfaces (1 - s)^n of v_t is left. The spin is not changed: the
effect stands for what a ball loses otherwise than by friction, for instance to a film of oil.

Source: phenomenological; 1 - s is the coefficient of tangential restitution of Brilliantov &
Pöschel, Kinetic Theory of Granular Gases (Oxford 2004), section 2.1, taken as constant and without
spin.
"""

from typing import NamedTuple

from sim_core.errors import SceneError, number
from sim_core.numerics.jit import inlined
from sim_core.numerics.vec3 import Touch, Vec3, add_scaled, dot


class TangentialLoss(NamedTuple):
    """The share of the tangential velocity that each hit on a surface takes, in [0, 1]."""

    share: float


def tangential_loss(share: float) -> TangentialLoss:
    """Make the effect; raises SceneError for a share out of range."""
    plain = number("tangential_loss.share", share)
    if not 0.0 <= plain <= 1.0:
        raise SceneError(f"tangential_loss.share is {plain}: it must lie in [0, 1]")
    return TangentialLoss(plain)


@inlined
def lose_tangential(effect: TangentialLoss | None, touch: Touch, change: Vec3) -> Vec3:
    """Velocity change [m/s] of a hit with the loss; a ball that separates loses nothing."""
    if effect is None:
        return change
    away, relative = touch.away, touch.relative
    if dot(away, relative) >= 0.0:
        return change
    after = add_scaled(relative, 1.0, change)
    tangential = add_scaled(after, -dot(away, after) / dot(away, away), away)
    return add_scaled(change, -effect.share, tangential)
