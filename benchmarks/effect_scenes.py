"""The gear's chamber with each effect on and off."""

from typing import NamedTuple

import numpy as np

from benchmarks.scenes import PART, PHYSICS, scene
from sim_core import (
    Balls,
    Drag,
    Flexure,
    Friction,
    PartRotation,
    Physics,
    RandomPhase,
    Rest,
    Roughness,
    Scene,
)

NAME = "gear-200-10k"
STEEL = (0.3, 0.2)  # mu and beta0, of every surface


class Effect(NamedTuple):
    """An effect to be measured.

    Args:
        off: the physics without it.
        on: the physics with it.
        variables: its names in compiled code.
    """

    off: Physics
    on: Physics
    variables: tuple[str, ...]


# between still walls, shot that loses energy would come to rest
LOSSLESS = PHYSICS._replace(restitution=None)
EFFECTS = {
    "gravity": Effect(PHYSICS._replace(gravity=None), PHYSICS, ("gravity",)),
    "restitution": Effect(PHYSICS._replace(restitution=None), PHYSICS, ("restitution",)),
    "vibration": Effect(LOSSLESS._replace(vibration=None), LOSSLESS, ("wave",)),
    "random_phase": Effect(
        PHYSICS, PHYSICS._replace(random_phase=RandomPhase(1)), ("random_phase",)
    ),
    "ball_collisions": Effect(
        PHYSICS._replace(ball_collisions=None), PHYSICS, ("neighbours", "meetings")
    ),
    "friction": Effect(
        PHYSICS,
        PHYSICS._replace(friction=Friction((STEEL,) * 3, STEEL)),
        ("friction", "friction_state"),
    ),
    "roughness": Effect(
        PHYSICS, PHYSICS._replace(roughness=Roughness((0.05,) * 3)), ("roughness",)
    ),
    "flexure": Effect(
        PHYSICS,
        PHYSICS._replace(flexure=Flexure(np.full(len(scene(NAME).mesh.triangles), 0.01), 1e11)),
        ("flexure",),
    ),
    "drag": Effect(PHYSICS, PHYSICS._replace(drag=Drag()), ("drag",)),
    "rest": Effect(PHYSICS, PHYSICS._replace(rest=Rest()), ("contact",)),
    "part_rotation": Effect(
        PHYSICS, PHYSICS._replace(part_rotation=PartRotation(PART, rpm=30.0)), ("rotation", "part")
    ),
    "sizes": Effect(PHYSICS, PHYSICS, ("sizes",)),
}


def effect_scene(effect: str, on: bool) -> Scene:
    """The chamber with the effect on or off; with several sizes, every second ball is smaller."""
    still = scene(NAME)
    balls = still.balls
    if effect == "sizes" and on:
        diameters = np.where(np.arange(len(balls)) % 2, balls.diameter, 0.75 * balls.diameters)
        balls = Balls(balls.positions, balls.velocities, diameters, balls.density)
    return Scene(
        still.mesh, balls, EFFECTS[effect].on if on else EFFECTS[effect].off, still.duration
    )
