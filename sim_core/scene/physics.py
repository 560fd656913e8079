"""Which effects a scene calls for: one optional field an effect; None is absent from memory and machine code."""

from typing import NamedTuple

from sim_core.effects.ball_collisions import BallCollisions
from sim_core.effects.contact_mode import Rest
from sim_core.effects.drag import Drag
from sim_core.effects.friction import Friction
from sim_core.effects.gravity import Gravity
from sim_core.effects.part_rotation import PartRotation
from sim_core.effects.random_phase import RandomPhase
from sim_core.effects.restitution import Restitution
from sim_core.effects.vibration import Vibration


class Physics(NamedTuple):
    """The scene's effects. With none given balls fly straight and collide elastically between still walls;

    ``ball_collisions=None`` lets them fly through each other; several sonotrodes are a tuple of Vibrations.
    """

    gravity: Gravity | None = None
    restitution: Restitution | None = None
    vibration: Vibration | tuple[Vibration, ...] | None = None
    rest: Rest | None = None
    part_rotation: PartRotation | None = None
    friction: Friction | None = None
    random_phase: RandomPhase | None = None
    ball_collisions: BallCollisions | None = BallCollisions()
    drag: Drag | None = None

    @property
    def vibrations(self) -> tuple[Vibration, ...]:
        """Of all surfaces that vibrate."""
        if self.vibration is None:
            return ()
        return (self.vibration,) if isinstance(self.vibration, Vibration) else self.vibration
