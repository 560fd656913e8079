"""Frames: the balls at chosen times, and their energies.

Notation: m: mass of a ball [kg]. R: its radius [m]. v: velocity [m/s]. w: spin [rad/s]. g: gravity
[m/s²]. x: position [m]. A ball has ½ m v² of translational, ½ (2/5 m R²) w² of rotational and
-m g x of potential energy [J].
"""

from dataclasses import dataclass

import numpy as np

from sim_core.balls import Balls
from sim_core.effects.gravity import Gravity, gravity_acceleration


@dataclass(frozen=True)
class Frames:
    """State of all n balls at each of f times.

    time: [s] since the end of the warm-up, (f,).
    positions: positions of the centres [m], (f, n, 3).
    velocities: velocities [m/s], (f, n, 3). At the time of an impact they are the velocities before
        it.
    spins: angular velocities [rad/s], (f, n, 3); None without Physics.friction.
    """

    time: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    spins: np.ndarray | None

    def __len__(self) -> int:
        return len(self.time)


def frames_of(time: np.ndarray, noted: list[Balls], balls: Balls) -> Frames:
    """Return the balls that were ``noted`` at each of the times ``time`` (f,) [s], as Frames.

    ``balls``: the balls at any time, which tell whether they have spins.
    """

    def column(name: str) -> np.ndarray:
        each = [getattr(one, name) for one in noted]
        return np.array(each, dtype=float).reshape(len(noted), len(balls), 3)

    spins = None if balls.spins is None else column("spins")
    return Frames(time, column("positions"), column("velocities"), spins)


@dataclass(frozen=True)
class Energies:
    """Energies of all balls together [J], one number a frame, (f,) each.

    The potential energy is 0 where all centres are at the origin.
    """

    translational: np.ndarray
    rotational: np.ndarray
    potential: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """Sum of translational, rotational and potential energy [J], (f,)."""
        return np.asarray(self.translational + self.rotational + self.potential)


def energies(frames: Frames, balls: Balls, gravity: Gravity | None = None) -> Energies:
    """Return the energies [J] of all balls together in each frame.

    Args:
        frames: frames of a simulation.
        balls: balls of the same simulation, for diameters and densities.
        gravity: gravity of the scene. Without it the potential energy is 0.
    """
    # moment of inertia of a solid sphere
    moment = 0.4 * balls.masses * (0.5 * balls.diameters) ** 2
    rotational, potential = np.zeros(len(frames)), np.zeros(len(frames))
    if frames.spins is not None:
        rotational = 0.5 * np.square(frames.spins).sum(axis=2) @ moment
    if gravity is not None:
        potential = -(frames.positions @ np.array(gravity_acceleration(gravity))) @ balls.masses
    translational = 0.5 * np.square(frames.velocities).sum(axis=2) @ balls.masses
    return Energies(translational, rotational, potential)
