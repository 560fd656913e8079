"""A gas of balls at one moment, in a flat cylindrical chamber as wide as their number asks for."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.scenes import DIAMETER

HEIGHT = 0.04  # m
PER_BALL = (
    np.pi * 0.035**2 * HEIGHT / 200
)  # m³ of chamber: 200 balls in the benchmark cylinder, 1.8 % of it steel
SPREAD = 2.0  # m/s, standard deviation of each velocity component


class Gas(NamedTuple):
    """The balls of a gas at one moment.

    ``motion`` (n, 6) is in the free-fall frame with time 0 being now, ``reach`` [m] is the distance
    of the centres of two balls that touch, and ``width`` [m] is that of the chamber. ``limit`` [s]
    is how far ahead a search looks: the median ball's time to the wall.
    """

    motion: np.ndarray
    reach: float
    width: float
    limit: float


def sample_gas(balls: int, rng: np.random.Generator) -> Gas:
    """So many balls anywhere in the chamber, none overlapping."""
    radius = np.sqrt(balls * PER_BALL / (np.pi * HEIGHT))
    positions = np.zeros((0, 3))
    while len(positions) < balls:
        way = np.sqrt(rng.random(2 * balls)) * (radius - 0.5 * DIAMETER)
        angle = rng.uniform(0.0, 2.0 * np.pi, 2 * balls)
        z = rng.uniform(0.5 * DIAMETER, HEIGHT - 0.5 * DIAMETER, 2 * balls)
        positions = np.concatenate(
            [positions, np.stack([way * np.cos(angle), way * np.sin(angle), z], axis=1)]
        )
        later = (
            cKDTree(positions).query_pairs(DIAMETER, output_type="ndarray").max(axis=1, initial=0)
        )
        positions = np.delete(positions, later[later > 0], axis=0)[:balls]
    velocities = rng.normal(0.0, SPREAD, (balls, 3))
    limit = float(np.median(_time_to_wall(positions, velocities, radius - 0.5 * DIAMETER)))
    return Gas(np.concatenate([positions, velocities], axis=1), DIAMETER, 2.0 * radius, limit)


def _time_to_wall(positions: np.ndarray, velocities: np.ndarray, radius: float) -> np.ndarray:
    """Time [s] of straight flights to the side, the floor or the ceiling."""
    (x, y, z), (u, v, w) = positions.T, velocities.T
    half, square = x * u + y * v, u * u + v * v
    side = (np.sqrt(half * half + square * (radius * radius - x * x - y * y)) - half) / square
    end = np.where(w > 0.0, HEIGHT - 0.5 * DIAMETER - z, z - 0.5 * DIAMETER) / np.abs(w)
    return np.minimum(side, end)
