"""Further effects of a hit on a surface: which there are, and the order in which they act.

This is the one place of the simulator that a new effect of the contact between a ball and a surface
changes. The effect itself, a NamedTuple of numbers and a compiled function, is a file beside this
one. Restitution, friction and contact mode have files of their own, because they keep state.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from sim_core.numerics.jit import inlined
from sim_core.numerics.vec3 import Touch, Vec3


class SurfaceEffects(NamedTuple):
    """The further effects of a scene, a field each; None is absent from the compiled code."""


# By the name of the field: makes the effect from its parameters, and raises SceneError if they are
# wrong.
MAKERS: dict[str, Callable[..., Any]] = {}


def surface_effects(**parameters: dict[str, float]) -> SurfaceEffects:
    """Make the effects of a scene from their parameters, by name of the effect."""
    return SurfaceEffects(**{name: MAKERS[name](**values) for name, values in parameters.items()})


@inlined
def apply_surface_effects(
    effects: SurfaceEffects, ball: int, time_since_start: float, touch: Touch, change: Vec3
) -> Vec3:
    """Apply the effects to a hit, after restitution and friction and in the frame of the room.

    The velocity after the hit, relative to the surface, is ``touch.relative`` plus the change.
    Effects act on hits that bounce: contact mode has decided before whether a ball lands.

    Args:
        effects: of the scene. Each field goes to its function, which begins with
            ``if effect is None: return change``.
        ball: number of the ball.
        time_since_start: of the hit [s].
        touch: what the ball touches.
        change: velocity change by restitution and friction [m/s].

    Returns:
        The velocity change [m/s].
    """
    return change
