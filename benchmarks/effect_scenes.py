"""The gear's chamber with each effect on and off."""

from typing import NamedTuple

from benchmarks.scenes import PART, PHYSICS, scene
from sim_core import Physics, Rest, Scene, Turn

NAME = "gear-200-10k"


class Effect(NamedTuple):
    """``off`` and ``on``: the physics without it and with it; ``asked``: what compiled code calls it."""

    off: Physics
    on: Physics
    asked: tuple[str, ...]


LOSSLESS = PHYSICS._replace(restitution=None)  # between still walls, shot that loses energy would come to rest
EFFECTS = {
    "gravity": Effect(PHYSICS._replace(gravity=None), PHYSICS, ("gravity",)),
    "restitution": Effect(PHYSICS._replace(restitution=None), PHYSICS, ("restitution",)),
    "vibration": Effect(LOSSLESS._replace(vibration=None), LOSSLESS, ("wave",)),
    "rest": Effect(PHYSICS, PHYSICS._replace(rest=Rest()), ("footing",)),
    "turn": Effect(PHYSICS, PHYSICS._replace(turn=Turn(PART, rpm=30.0)), ("turning", "part")),
}


def effect_scene(effect: str, on: bool) -> Scene:
    """The chamber with the effect on, or all the same without it."""
    still = scene(NAME)
    return Scene(still.mesh, still.balls, EFFECTS[effect].on if on else EFFECTS[effect].off, still.duration)
