"""Errors of this package, and checks of input that raise them."""

from typing import Any

import numpy as np

# Python takes True for 1.0 and "0.9" for 0.9. In a scene both are mistakes.
NOT_NUMBERS = (bool, np.bool_, str, bytes)


class SceneError(ValueError):
    """Error for an impossible scene. The message names the ball, triangle or field and a remedy."""


class SimulationError(RuntimeError):
    """Error of a simulation gone wrong, as by a lost ball. The message says what to try."""


def number(name: str, value: object) -> float:
    """Return ``value`` as a float. Raise SceneError, with ``name``, if it is not a number."""
    try:
        if isinstance(value, NOT_NUMBERS):
            raise TypeError
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise SceneError(f"{name} is {value!r}: give a number") from None


def surface_table(
    effect: str, form: str, surfaces: Any, balls: Any, tags: int
) -> tuple[np.ndarray, tuple[float, float]]:
    """Check the two coefficients that an effect has for each surface, and for ball on ball.

    An effect is, for example, friction. A tag is the number of a surface.

    Args:
        effect: name of the effect in messages.
        form: names of the two numbers, e.g. "(C0, v0)".
        surfaces: user input with one pair for each tag.
        balls: user input with one pair.
        tags: number of tags that need a pair.

    Returns:
        ``surfaces`` as an array of shape (tags or more, 2), and ``balls`` as two floats.

    Raises:
        SceneError: for a missing tag, or input that is not a number.
    """
    try:
        given = (*np.array(surfaces, dtype=object).ravel(), *balls)
        if any(isinstance(value, NOT_NUMBERS) for value in given):
            raise TypeError
        table = np.array(surfaces, dtype=np.float64)
        pair = (float(balls[0]), float(balls[1]))
    except (TypeError, ValueError, LookupError):
        text = f"{effect}.surfaces is {surfaces!r} and {effect}.balls {balls!r}"
        raise SceneError(f"{text}: give {form} for each tag and for the balls") from None
    if table.ndim != 2 or table.shape[1] != 2 or len(table) < tags:
        raise SceneError(
            f"{effect}.surfaces must give {form} for tags 0 to {tags - 1}, not shape {table.shape}"
        )
    return table, pair
