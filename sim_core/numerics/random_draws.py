"""Random numbers for compiled code: a draw is a hash of seed, ball and number of the draw.

No state is shared, so the same scene gives the same bits on any thread.

Source: C. Wellons, "Prospecting for hash functions" (2018), 32 bits, multipliers below 2^31.
"""

import numpy as np

from sim_core.errors import SceneError
from sim_core.numerics.jit import jit

SEEDS = 2**32
WORD = SEEDS - 1


def checked_seed(name: str, seed: object) -> int:
    """Return the seed of random draws as a plain int.

    ``name``: name of the field in messages.

    Raises:
        SceneError: unless the seed is a whole number from 0 to 2**32 - 1.
    """
    if not isinstance(seed, (int, np.integer)) or not 0 <= seed < SEEDS:
        raise SceneError(f"{name} is {seed!r}: give a whole number from 0 to {SEEDS - 1}")
    return int(seed)


@jit
def _hash_word(x: int) -> int:
    """Return a 32-bit number that looks random, always the same for the same 32-bit number ``x``.

    Every product fits in an int64.
    """
    x = ((x ^ (x >> 15)) * 0x2C1B3C6D) & WORD
    x = ((x ^ (x >> 12)) * 0x297A2D39) & WORD
    return x ^ (x >> 15)


@jit
def draw_word(seed: int, ball: int, draw: int) -> int:
    """Return a random whole number from 0 to 2**32 - 1, from seed, ball and number of the draw."""
    return _hash_word(_hash_word(_hash_word(seed) ^ int(ball)) ^ (int(draw) & WORD))


@jit
def uniform(seed: int, ball: int, draw: int) -> float:
    """Return a random number, uniform in (0, 1), from seed, ball and number of the draw."""
    return (draw_word(seed, ball, draw) + 0.5) / SEEDS
