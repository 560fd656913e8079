"""Random arrival: each ball that comes to the vibrating face finds it at a random phase.

From the arrival to the contact the face's path is exact. Without this option a single ball that
loses energy can fall into step with the face and hit it at the same phase for ever. In a chamber,
collisions with other balls and slanted walls decorrelate the phase. Simulations with and without
the option then agree in mean speeds and impact rates (tests/sim_core/effects/test_random_phase.py).

A ball that arrives at any time finds a uniform phase at the edge of the band that the face moves
in. The phase at contact is not uniform, because a rising face is met more often. The phase stays
while the ball is within reach of the face, so that a second impact finds the face's motion
continued.

Draws are those of numerics/random_draws.py: the same scene gives the same bits on any thread.
"""

from typing import NamedTuple

import numpy as np

from sim_core.effects.vibration import Wave
from sim_core.errors import SceneError
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.random_draws import SEEDS, checked_seed, draw_word
from sim_core.numerics.roots import first_approach
from sim_core.numerics.vec3 import Flight, Vec3, dot

# A ball this far [m] above the band that the face moves in is out of reach. A smaller distance
# would be rounding in a chamber a kilometre wide.
CLEAR = 1e-9
TURN = 2.0 * np.pi


class RandomPhase(NamedTuple):
    """Option by which each ball meets the vibrating face at a random phase of its vibration.

    ``seed``: whole number from 0 to 2**32 - 1 from which the phases follow.
    """

    seed: int = 0


class RandomPhaseState(NamedTuple):
    """Phases at which n balls meet the vibrating face, as numbers for compiled code."""

    phase: np.ndarray  # phase of the face as each ball finds it [rad], shape (n,)
    draws: np.ndarray  # number of draws of each ball, shape (n,) int64
    # Distance along ``up`` [m] beyond which a ball's centre is out of the band that the face moves
    # in, shape (n,)
    top: np.ndarray
    up: Vec3  # unit vector along the vibration, towards the shot
    seed: int  # seed of the draws


def checked_random_phase(random_phase: RandomPhase | None, sonotrodes: int) -> RandomPhase | None:
    """Return the option with its seed as a plain int.

    ``sonotrodes``: number of sonotrodes of the scene.

    Raises:
        SceneError: for a bad seed, and for a scene that does not have just one sonotrode.
    """
    if random_phase is None:
        return None
    seed = checked_seed("random_phase.seed", random_phase.seed)
    if sonotrodes == 0:
        raise SceneError(
            "physics.random_phase is given without physics.vibration: nothing has a phase; "
            "give both"
        )
    if sonotrodes > 1:
        raise SceneError(
            f"physics.random_phase is given, and {sonotrodes} vibrating surfaces: not supported "
            "together yet; give one vibration, or leave random_phase out"
        )
    return RandomPhase(seed)


def new_random_phase_state(
    random_phase: RandomPhase | None, wave: Wave | None, face: np.ndarray, radii: np.ndarray
) -> RandomPhaseState | None:
    """Return the phases of all balls at the start, which are the phase of the vibration itself.

    Args:
        random_phase: the option. Without it the result is None.
        wave: wave of the sonotrode.
        face: corners of the vibrating triangles [m], shape (m, 3, 3), normals away from the shot.
        radii: radii of the balls [m], shape (n,).
    """
    if random_phase is None or wave is None:
        return None
    axis = np.array(wave.axis)
    downward = np.cross(face[:, 1] - face[:, 0], face[:, 2] - face[:, 0]).sum(axis=0)
    up = axis if downward @ axis <= 0.0 else -axis
    top = float((face @ up).max()) + wave.amplitude + np.array(radii, dtype=np.float64)
    phase, draws = np.full(len(radii), wave.phase), np.zeros(len(radii), dtype=np.int64)
    return RandomPhaseState(phase, draws, top, Vec3(*(float(x) for x in up)), random_phase.seed)


@jit
def draw_phase(seed: int, ball: int, draw: int) -> float:
    """Return a random phase [rad], uniform in [0, 2π), from seed, ball and number of the draw."""
    return TURN * (draw_word(seed, ball, draw) / SEEDS)


@inlined
def update_phase(
    random_phase: RandomPhaseState | None, flight: Flight, ball: int, length: float
) -> float:
    """Draw a new phase of the vibrating face for a ball that is out of the face's reach.

    A ball within reach keeps its phase until it gets out.

    Returns:
        Time for which the phase holds [s], at most ``length``.
    """
    if random_phase is None:
        return length
    up = random_phase.up
    height = dot(up, flight.position) - random_phase.top[ball]
    if height > 0.0:
        random_phase.draws[ball] += 1
        random_phase.phase[ball] = draw_phase(random_phase.seed, ball, random_phase.draws[ball])
        return length
    speed, bend = -dot(up, flight.velocity), -0.5 * dot(up, flight.acceleration)
    return min(length, first_approach(CLEAR - height, speed, bend, 0.0))


@inlined
def wave_of_ball(
    random_phase: RandomPhaseState | None, wave: Wave | None, ball: int
) -> Wave | None:
    """Return the vibration of the face with the phase at which this ball finds it."""
    if random_phase is None or wave is None:
        return wave
    return Wave(wave.amplitude, wave.omega, random_phase.phase[ball], wave.axis)
