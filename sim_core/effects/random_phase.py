"""Random arrival: a ball that comes to the vibrating face finds it at a phase of its own, drawn anew each time; from
there to contact the face's path is exact.

With the plain sinusoid a single ball that loses energy can fall into step with the face and hit it at the same phase
for ever; in a chamber its collisions with others and with slanted walls decorrelate it. Where that is so the two agree
in mean speeds and impact rates (tests/analytic/test_random_phase.py). A uniform phase at the swing's envelope is what a
ball sees that arrives at any time; the phase at contact is not uniform, for a rising face is met more often.

The phase stays while the ball is within reach of the face, so that a second hit before it gets away sees the face go on
as it did. The draws are a hash of seed, ball and number of the draw: no state is shared, the same scene gives the same
bits on any thread. Mixing: C. Wellons, "Prospecting for hash functions" (2018), 32 bits, multipliers below 2^31.
"""

from typing import NamedTuple

import numpy as np

from sim_core.effects.vibration import Wave
from sim_core.errors import SceneError
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import first_approach
from sim_core.numerics.vec3 import Vec3, dot

CLEAR = 1e-9  # m: a ball this far above the swing is out of it; less would be rounding in a chamber a kilometre wide
SEEDS = 2**32
WORD = SEEDS - 1
TURN = 2.0 * np.pi


class RandomPhase(NamedTuple):
    """Drawn arrival phases for the Vibration it stands beside; ``seed``: a whole number from 0 to 2**32 - 1."""

    seed: int = 0


class Phases(NamedTuple):
    """RandomPhase as compiled code wants it.

    ``phase`` (n,) [rad]: the face's, as each ball sees it; ``draws`` (n,) int64: how often it was drawn; ``top`` (n,)
    [m]: no centre farther along the unit vector ``up`` is within the swing; ``seed``.
    """

    phase: np.ndarray
    draws: np.ndarray
    top: np.ndarray
    up: Vec3
    seed: int


def checked_random_phase(random_phase: RandomPhase | None, vibrating: int) -> RandomPhase | None:
    """Raises SceneError for a seed out of range, or unless one surface is ``vibrating``, to draw the phases of."""
    if random_phase is None:
        return None
    seed = random_phase.seed
    if not isinstance(seed, (int, np.integer)) or not 0 <= seed < SEEDS:
        raise SceneError(f"random_phase.seed is {seed!r}: give a whole number from 0 to {WORD}")
    if vibrating == 0:
        raise SceneError(
            "physics.random_phase is given without physics.vibration: nothing has a phase; give both"
        )
    if vibrating > 1:
        raise SceneError(
            f"physics.random_phase is given, and {vibrating} vibrating surfaces: not supported together yet; give one "
            "vibration, or leave random_phase out"
        )
    return RandomPhase(int(seed))


def new_phases(
    random_phase: RandomPhase | None, wave: Wave | None, face: np.ndarray, radii: np.ndarray
) -> Phases | None:
    """Every ball at the wave's own phase; ``face`` (m, 3, 3) [m]: corners of the triangles that vibrate, normals away
    from the shot; ``radii`` (n,) [m].
    """
    if random_phase is None or wave is None:
        return None
    axis = np.array(wave.axis)
    downward = np.cross(face[:, 1] - face[:, 0], face[:, 2] - face[:, 0]).sum(axis=0)
    up = axis if downward @ axis <= 0.0 else -axis
    top = float((face @ up).max()) + wave.swing + np.array(radii, dtype=np.float64)
    return Phases(
        np.full(len(radii), wave.phase),
        np.zeros(len(radii), dtype=np.int64),
        top,
        Vec3(*(float(x) for x in up)),
        random_phase.seed,
    )


@jit
def mixed(x: int) -> int:
    """A hash of 32 bits; int64 holds every product."""
    x = ((x ^ (x >> 15)) * 0x2C1B3C6D) & WORD
    x = ((x ^ (x >> 12)) * 0x297A2D39) & WORD
    return x ^ (x >> 15)


@jit
def drawn(seed: int, ball: int, draw: int) -> float:
    """A phase [rad], uniform in [0, 2π)."""
    return TURN * (mixed(mixed(mixed(seed) ^ int(ball)) ^ (int(draw) & WORD)) / SEEDS)


@inlined
def arrival(
    phases: Phases | None,
    position: Vec3,
    velocity: Vec3,
    acceleration: Vec3,
    ball: int,
    length: float,
) -> float:
    """Draw the phase anew for a ball that is out of the swing; one within it keeps it, and is to be looked at again
    when it gets out, if that is within ``length`` [s]: returns for how long [s] the phase is good.
    """
    if phases is None:
        return length
    height = dot(phases.up, position) - phases.top[ball]
    if height > 0.0:
        phases.draws[ball] += 1
        phases.phase[ball] = drawn(phases.seed, ball, phases.draws[ball])
        return length
    return min(
        length,
        first_approach(
            CLEAR - height, -dot(phases.up, velocity), -0.5 * dot(phases.up, acceleration), 0.0
        ),
    )


@inlined
def own_wave(phases: Phases | None, wave: Wave | None, ball: int) -> Wave | None:
    """The face's motion as the ball sees it."""
    if phases is None or wave is None:
        return wave
    return Wave(wave.swing, wave.omega, phases.phase[ball], wave.axis)
