"""Checks of a scene with an analytical cavity: exact surfaces in place of a mesh."""

import numpy as np

from sim_core.balls import Balls
from sim_core.effects.amplitude_profile import shares_at
from sim_core.effects.vibration import Vibration
from sim_core.errors import SceneError
from sim_core.geometry.analytic import CEILING, FLOOR, AnalyticCavity
from sim_core.scene.narrow_gaps import TIGHT
from sim_core.scene.physics import Physics

# Smallest side of a periodic box, in diameters of the largest ball. From two on, no ball can touch
# another on both sides. Near two, predictions look only a short time ahead.
MIN_DIAMETERS = 3.0


def require_supported(cavity: AnalyticCavity, physics: Physics) -> None:
    """Raise SceneError for effects that are not supported in an analytical cavity."""
    remedy = "leave it out, or give the cavity as a mesh"
    if physics.part_rotation is not None:
        raise SceneError(
            f"physics.part_rotation is not supported with an analytical cavity; {remedy}"
        )
    if physics.rest is not None and cavity.periodic:
        raise SceneError(
            "physics.rest is not supported in a periodic box; leave it out, or give the box walls"
        )
    gravity = physics.gravity
    tilted = gravity is not None and (gravity[0] != 0.0 or gravity[1] != 0.0)
    if cavity.radius is not None and gravity is not None and tilted:
        raise SceneError(
            f"physics.gravity is {tuple(gravity)}: not supported with an analytical cylinder "
            f"unless along z; {remedy}"
        )
    if len(physics.vibrations) > 1:
        raise SceneError(
            f"several vibrations are not supported with an analytical cavity; {remedy}"
        )
    for vibration in physics.vibrations:
        _require_floor(cavity, vibration, remedy)


def _require_floor(cavity: AnalyticCavity, vibration: Vibration, remedy: str) -> None:
    """Raise SceneError, with ``remedy`` in its message, unless only the floor vibrates, along z."""
    if not (vibration.axis[0] == 0.0 and vibration.axis[1] == 0.0):
        raise SceneError(
            f"vibration.axis is {vibration.axis}: not supported with an analytical cavity unless "
            f"along z; {remedy}"
        )
    vibrating = np.flatnonzero(cavity.tags == vibration.tag)
    if len(vibrating) and vibrating.tolist() != [FLOOR]:
        others = ", ".join(cavity.name(int(k)) for k in vibrating)
        raise SceneError(
            f"vibration.tag is {vibration.tag}, that of {others}: not supported; the floor "
            "alone of an analytical cavity can vibrate, give it a tag of its own"
        )


def require_clear(
    cavity: AnalyticCavity, balls: Balls, vibrations: tuple[Vibration, ...], touch: float
) -> None:
    """Raise SceneError for a ball that does not fit.

    Such a ball is outside the cavity, overlaps a surface by more than ``touch`` [m], or is wider
    than the cavity at its narrowest. The vibrating floor is taken where it is at the start.
    """
    _require_inside_periods(cavity, balls)
    gap, radii = cavity.gaps(balls.positions), 0.5 * balls.diameters
    amplitude = 0.0
    for vibration in vibrations:
        amplitude = vibration.amplitude
        swing = amplitude * np.sin(vibration.phase) * np.sign(vibration.axis[2])
        gap[:, FLOOR] -= swing * shares_at(vibration, balls.positions)
    over = gap - radii[:, None]
    ball, surface = (int(k) for k in np.unravel_index(over.argmin(), over.shape))
    where = f"ball {ball} at {balls.positions[ball].tolist()} m"
    if gap[ball, surface] <= 0.0:
        raise SceneError(f"{where} is outside the cavity, beyond {cavity.name(surface)}")
    if over[ball, surface] < -touch:
        moved = surface == FLOOR and amplitude > 0.0
        moving = " (displaced by its phase at the start)" if moved else ""
        raise SceneError(
            f"{where} overlaps {cavity.name(surface)}{moving} by {-over[ball, surface]:.3g} m; "
            "move it or make it smaller"
        )
    height = cavity.top - cavity.bottom - amplitude
    for room, one, two in (cavity.narrowest(), (height, FLOOR, CEILING)):
        if room < 2.0 * radii.max() - TIGHT:
            both = f"between {cavity.name(one)} and {cavity.name(two)}"
            between = both if one != two else "in the cylinder"
            raise SceneError(
                f"ball {int(radii.argmax())} does not fit {between}: the gap is narrower than the "
                f"ball by {2.0 * radii.max() - room:.3g} m; widen it or make the ball smaller"
            )


def _require_inside_periods(cavity: AnalyticCavity, balls: Balls) -> None:
    """Raise SceneError for a ball outside a periodic box, and for a box too small for the balls."""
    low, high = cavity.bounds
    for axis in cavity.periodic:
        name, side, least = "xyz"[axis], high[axis] - low[axis], MIN_DIAMETERS * 2.0 * balls.radius
        if side < least:
            raise SceneError(
                f"the periodic box is {side:.3g} m wide along {name}: give it {least:.3g} m or "
                f"more, {MIN_DIAMETERS:g} diameters of the largest ball, or make balls smaller"
            )
        place = balls.positions[:, axis]
        outside = np.flatnonzero((place < low[axis]) | (place > high[axis]))
        if len(outside):
            raise SceneError(
                f"ball {outside[0]} at {balls.positions[outside[0]].tolist()} m is outside the "
                f"periodic box along {name}: put it back by whole sides of {side:.6g} m"
            )
