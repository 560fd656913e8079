"""Results that threads share: the first thread that asks computes a result, and the others wait.

`functools.lru_cache` alone lets all threads that ask at once compute the same result. Several
simulations of one chamber would then each build the chamber's search tree.
"""

from collections.abc import Callable
from functools import lru_cache, wraps
from threading import RLock
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


def computed_once(maxsize: int) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that keeps the results of a function's last ``maxsize`` different calls.

    It works as `functools.lru_cache` does, but lets only one thread at a time call the function.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        cached, lock = lru_cache(maxsize=maxsize)(function), RLock()

        @wraps(function)
        def locked(*args: P.args, **kwargs: P.kwargs) -> R:
            with lock:
                return cached(*args, **kwargs)  # type: ignore[arg-type]  # lists raise TypeError

        return locked

    return decorate
