"""Search the unit cube with an algorithm of NLopt. This is the only file that imports nlopt."""

from __future__ import annotations

from collections.abc import Callable, Generator
from queue import SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.errors import InputError

if TYPE_CHECKING:
    import nlopt

LOCAL = "LN_BOBYQA"


class NloptThread:
    """Runs NLopt in a thread of its own, where it can wait for a score while the search goes on.

    NLopt has one sequence of random numbers in each thread, so the seed is for all runs in the
    thread.
    """

    def __init__(self, seed: int) -> None:
        self._told: SimpleQueue[Any] = SimpleQueue()
        self._asked: SimpleQueue[Any] = SimpleQueue()
        Thread(target=self._work, args=(seed,), name="nlopt", daemon=True).start()

    def close(self) -> None:
        """End the thread."""
        self._told.put(None)

    def points(self, *run: Any) -> Generator[np.ndarray, float, None]:
        """Start a run of NLopt, and yield the points (d,) that it asks for.

        The caller sends the score of each point back. An error that ends the run is raised.

        Args:
            run: the arguments of `run_nlopt` after its function.
        """
        self._told.put(run)
        try:
            while isinstance(asked := self._asked.get(), np.ndarray):
                self._told.put((yield asked))
        except GeneratorExit:
            self._told.put(None)
            self._asked.get()
            raise
        if asked is not None:
            raise asked

    def _work(self, seed: int) -> None:
        import nlopt

        nlopt.srand(seed)
        for run in iter(self._told.get, None):
            try:
                run_nlopt(self._score, *run)
                self._asked.put(None)
            except BaseException as error:
                self._asked.put(error)

    def _score(self, point: np.ndarray) -> float:
        self._asked.put(point)
        score: float | None = self._told.get()
        if score is None:
            raise InterruptedError("nobody waits for this run any more")
        return score


def run_nlopt(
    function: Callable[[np.ndarray], float],
    start: np.ndarray,
    algorithm: str,
    step: float,
    tolerance: float,
    max_calls: int,
) -> None:
    """Maximise function(point (d,)) -> finite float over the unit cube, beginning at `start`.

    The function must keep its own record of points and values: NLopt's result is not used.

    Args:
        step: first step of local algorithms, as a share of the cube's side.
        tolerance: step below which local algorithms stop, as a share of the cube's side.
        max_calls: number of calls of the function after which the run ends.
    Raises:
        InputError: the algorithm cannot search this number of parameters. Errors of the function
            pass unchanged.
    """
    import nlopt

    errors: list[BaseException] = []

    def callback(x: np.ndarray, gradient: np.ndarray) -> float:
        # An exception that crosses NLopt can become a SystemError, so it is stored, the search is
        # stopped and the exception is raised outside. Some algorithms ask for a few more points
        # after force_stop; any finite answer will do.
        if errors:
            return 0.0
        try:
            # A copy, because x is a view that NLopt reuses; clipped, because BOBYQA can leave the
            # bounds by rounding.
            return -float(function(np.clip(np.array(x, dtype=float), 0.0, 1.0)))
        except BaseException as error:
            errors.append(error)
            optimizer.force_stop()
            return 0.0

    optimizer = _make_optimizer(algorithm, len(start), step, tolerance)
    optimizer.set_maxeval(max_calls)
    optimizer.set_min_objective(callback)
    try:
        optimizer.optimize(start)
    except (nlopt.ForcedStop, nlopt.RoundoffLimited):
        pass
    except Exception as error:  # NLopt's exceptions have no common base class across versions
        if not errors:
            raise InputError(
                f"optimizer.algorithm: NLopt's {algorithm} cannot search {len(start)} "
                f'parameter(s) ({error or type(error).__name__}); choose "auto"'
            ) from None
    if errors:
        raise errors[0]


def _make_optimizer(algorithm: str, count: int, step: float, tolerance: float) -> nlopt.opt:
    import nlopt

    # An MLSL algorithm accepts a local optimiser only under its name with G_.
    name = algorithm.replace("GN_MLSL", "G_MLSL")
    optimizer = nlopt.opt(getattr(nlopt, name), count)
    optimizer.set_lower_bounds(np.zeros(count))
    optimizer.set_upper_bounds(np.ones(count))
    is_global = name.startswith("G_MLSL")
    local = nlopt.opt(getattr(nlopt, LOCAL), count) if is_global else optimizer
    if is_global or name.startswith("LN_"):
        local.set_initial_step(step)
        local.set_xtol_abs(tolerance)
    if is_global:
        optimizer.set_local_optimizer(local)
    return optimizer
