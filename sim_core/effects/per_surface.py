"""Two numbers of a law for each surface tag, and for ball on ball: what restitution and friction are given as."""

from typing import Any

import numpy as np

from sim_core.errors import SceneError


def surface_table(
    effect: str, form: str, surfaces: Any, balls: Any, tags: int
) -> tuple[np.ndarray, tuple[float, float]]:
    """``surfaces`` as an array (tags or more, 2) and ``balls`` as two floats; SceneError names what is wrong.

    ``form``: what the two numbers are, e.g. "(C0, v0)".
    """
    try:
        table = np.array(surfaces, dtype=np.float64)
        pair = (float(balls[0]), float(balls[1]))
    except (TypeError, ValueError, LookupError):
        given = f"{effect}.surfaces is {surfaces!r} and {effect}.balls {balls!r}"
        raise SceneError(f"{given}: give {form} for each tag and for the balls") from None
    if table.ndim != 2 or table.shape[1] != 2 or len(table) < tags:
        shape = f"not shape {table.shape}"
        raise SceneError(f"{effect}.surfaces must give {form} for tags 0 to {tags - 1}, {shape}")
    return table, pair
