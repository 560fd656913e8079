"""Effects of a hit on a surface besides restitution and friction, in the order in which they act.

A new effect of the contact between ball and surface is added to the lists in this file. The effect
itself, a NamedTuple of numbers and a compiled function, is a file beside this one.
Restitution, friction and contact mode have their own files, because they keep state.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from sim_core.numerics.jit import inlined
from sim_core.numerics.vec3 import Touch, Vec3


class SurfaceEffects(NamedTuple):
    """Further effects of a scene's hits, besides restitution and friction: one field an effect.

    A field that is None takes no machine code.
    """


# Functions that make an effect from its parameters, by the name of its field. They raise SceneError
# for wrong parameters.
MAKERS: dict[str, Callable[..., Any]] = {}


def surface_effects(**parameters: dict[str, float]) -> SurfaceEffects:
    """Return the effects of a scene. Each keyword is an effect's name with its parameters."""
    return SurfaceEffects(**{name: MAKERS[name](**values) for name, values in parameters.items()})


@inlined
def apply_surface_effects(
    effects: SurfaceEffects, ball: int, time_since_start: float, touch: Touch, change: Vec3
) -> Vec3:
    """Return ``change``, the velocity change of a ball by a hit, with the further effects added.

    They act after restitution and friction. Vectors are in the frame of the room.

    The velocity after the hit, relative to the surface, is ``touch.relative`` plus the change.
    Effects act on hits that bounce: contact mode has already decided if the ball lands.

    Args:
        effects: effects of the scene. Each field goes to its function, which begins with ``if
            effect is None: return change``.
        ball: number of the ball.
        time_since_start: time of the hit [s].
        touch: the contact between ball and surface.
        change: velocity change by restitution and friction [m/s].

    Returns:
        The velocity change [m/s].
    """
    return change
