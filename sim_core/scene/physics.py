"""The effects of a scene, one optional field an effect.

An effect that is None is absent from memory and machine code.
"""

import math
from fractions import Fraction
from typing import NamedTuple

from sim_core.effects.contact_mode import Rest
from sim_core.effects.drag import Drag
from sim_core.effects.flexure import Flexure
from sim_core.effects.friction import Friction
from sim_core.effects.gravity import Gravity
from sim_core.effects.part_rotation import PartRotation
from sim_core.effects.random_phase import RandomPhase
from sim_core.effects.restitution import Restitution
from sim_core.effects.roughness import Roughness
from sim_core.effects.surface.surface_effects import SurfaceEffects
from sim_core.effects.vibration import Vibration


class BallCollisions(NamedTuple):
    """Collisions of balls with one another.

    Restitution and friction decide the result of a collision. Without this effect balls fly through
    each other, overlaps are not checked, and no time is spent on pairs. This suits a single ball,
    and shot so thin that its balls hardly ever meet.
    """


class Physics(NamedTuple):
    """Effects of a scene. With the defaults balls fly straight and collide elastically.

    Args:
        gravity: uniform gravity.
        restitution: restitution of surfaces and balls.
        vibration: vibration of one surface, or a tuple for several surfaces.
        rest: contact mode, in which balls roll and come to rest.
        part_rotation: rotation of one part.
        friction: friction of surfaces and balls, with spin.
        random_phase: random phase of the vibration, for each ball.
        ball_collisions: collisions of balls. With None, balls fly through each other.
        drag: drag of still air.
        roughness: slopes of rough surfaces, at which balls bounce off facets.
        flexure: flexure of thin parts, which lowers restitution.
        surface: further effects of hits on surfaces.

    Example:
        >>> shaken_floor = Vibration(tag=0, amplitude=50e-6, frequency=20e3)
        >>> Physics(gravity=Gravity(), vibration=shaken_floor).vibrations == (shaken_floor,)
        True
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
    roughness: Roughness | None = None
    flexure: Flexure | None = None
    surface: SurfaceEffects = SurfaceEffects()

    @property
    def vibrations(self) -> tuple[Vibration, ...]:
        """The vibrations as a tuple, which is empty if nothing vibrates."""
        if self.vibration is None:
            return ()
        return (self.vibration,) if isinstance(self.vibration, Vibration) else self.vibration

    def begun_at(self, time: float) -> "Physics":
        """Return these effects on a clock that begins ``time`` [s] later.

        Vibrations and the turning part have gone on. Turns are counted as exact fractions, so that
        a large number of turns takes no digits from the phase.
        """
        if time == 0.0:
            return self
        vibrations = tuple(
            one._replace(phase=_phase_after(one.phase, one.frequency, time))
            for one in self.vibrations
        )
        turn = self.part_rotation
        if turn is not None:
            rate = Fraction(float(turn.rpm)) / 60 if turn.rpm is not None else turn.frequency
            assert rate is not None
            turn = turn._replace(phase=_phase_after(turn.phase, rate, time))
        return self._replace(vibration=vibrations or None, part_rotation=turn)


def _phase_after(phase: float, rate: float | Fraction, time: float) -> float:
    """Return a phase [rad] after ``time`` [s], in which it grows by ``rate`` turns a second."""
    return phase + 2.0 * math.pi * float(Fraction(rate) * Fraction(float(time)) % 1)
