"""Flights to ask the structures about, started by a gas of balls on the very mesh that is asked."""

import numpy as np

from benchmarks.structures import simulator_tree
from benchmarks.structures.mesh_obstacles import FALL, PIECE, Shell, ask
from sim_core.numerics.vec3 import Vec3, add_scaled

SPEEDS = (1.5, 8.5)  # m/s, evenly
AT_ONCE = 1e-7  # s: a flight this short leads into the wall it starts from


def sample(shell: Shell, start: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Positions [m] about the shell's centre and velocities [m/s], shape (count, 6).

    A lone ball from ``start`` (3,) [m] flies in every direction. Half of the flights begin where it
    met the wall, the other half somewhere on the way, as after meeting another ball.
    """
    tree = simulator_tree.build(shell)
    here = Vec3(*(start - shell.mesh.middle).tolist())
    flights: list[list[float]] = []
    delays, obstacles = np.empty(1), np.empty(1, dtype=np.int64)
    while len(flights) < count:
        direction = rng.normal(size=3)
        velocity = Vec3(*(rng.uniform(*SPEEDS) * direction / np.linalg.norm(direction)).tolist())
        ask(tree, np.array([[*here, *velocity]]), delays, obstacles)
        delay = min(delays[0], PIECE)
        if delay <= AT_ONCE:
            continue
        flights.append([*here, *velocity])
        if rng.random() < 0.5:
            delay *= rng.random()
        here = add_scaled(add_scaled(here, delay, velocity), 0.5 * delay * delay, FALL)
    return np.array(flights)
