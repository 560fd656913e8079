"""NLopt: one algorithm over the unit cube, its quirks dealt with. The only file that imports nlopt."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError

LOCAL = "LN_BOBYQA"


def seed_nlopt(seed: int) -> None:
    """Seeds NLopt's random numbers. They are the whole process's: once, before the first algorithm draws."""
    import nlopt

    nlopt.srand(seed)


def run_nlopt(
    function: Callable[[np.ndarray], float],
    start: np.ndarray,
    algorithm: str,
    *,
    step: float,
    tolerance: float,
    most: int,
) -> None:
    """Maximise function(point (d,) in [0, 1]) -> finite float from `start`, with at most `most` calls or so.

    step, tolerance: first step and least step of local algorithms, in shares of the bounds. The function keeps its own
    record: what NLopt returns is never looked at. Raises what the function raises, unchanged, and InputError for an
    algorithm that cannot search so many parameters.
    """
    import nlopt

    kept: list[BaseException] = []

    def callback(x: np.ndarray, gradient: np.ndarray) -> float:
        # An exception that crosses NLopt can turn into SystemError: keep it, stop, raise it outside.
        # After force_stop some algorithms still ask for a few points; any finite answer does.
        if kept:
            return 0.0
        try:
            # A copy, for x is NLopt's own reused view; clipped, for BOBYQA can leave the bounds by rounding.
            return -float(function(np.clip(np.array(x, dtype=float), 0.0, 1.0)))
        except BaseException as error:
            kept.append(error)
            optimizer.force_stop()
            return 0.0

    optimizer = _optimizer(algorithm, len(start), step, tolerance, most)
    optimizer.set_min_objective(callback)
    try:
        optimizer.optimize(start)
    except (nlopt.ForcedStop, nlopt.RoundoffLimited):
        pass
    except (
        Exception
    ) as error:  # NLopt's own exceptions share no base class from one version to the next
        if not kept:
            raise InputError(
                f"optimizer.algorithm: NLopt's {algorithm} cannot search {len(start)} parameter(s) "
                f'({error or type(error).__name__}); choose "auto"'
            ) from None
    if kept:
        raise kept[0]


def _optimizer(algorithm: str, count: int, step: float, tolerance: float, most: int) -> Any:
    import nlopt

    # Any MLSL name takes the local search it is given only under the G_ name.
    name = algorithm.replace("GN_MLSL", "G_MLSL")
    optimizer = nlopt.opt(getattr(nlopt, name), count)
    optimizer.set_lower_bounds(np.zeros(count))
    optimizer.set_upper_bounds(np.ones(count))
    optimizer.set_maxeval(most)
    if name.startswith("G_MLSL"):
        inner = nlopt.opt(getattr(nlopt, LOCAL), count)
        inner.set_initial_step(step)
        inner.set_xtol_abs(tolerance)
        optimizer.set_local_optimizer(inner)
    elif name.startswith("LN_"):
        optimizer.set_initial_step(step)
        optimizer.set_xtol_abs(tolerance)
    return optimizer
