"""Results that threads share: the first thread that asks computes a result, and the others wait.

`functools.lru_cache` alone lets all threads that ask at once compute the same result. Several
simulations of one chamber would then each build the chamber's search tree. It also keeps what it
was asked about alive: the last meshes of a study, and all that was computed of them.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import wraps
from threading import RLock
from typing import Concatenate, ParamSpec, TypeVar
from weakref import finalize

S = TypeVar("S")
P = ParamSpec("P")
R = TypeVar("R")

Kept = OrderedDict[tuple[int, Hashable], R]
"""Results by the identity of the first argument and the other arguments, the latest last."""


def computed_once(
    maxsize: int,
) -> Callable[[Callable[Concatenate[S, P], R]], Callable[Concatenate[S, P], R]]:
    """Return a decorator that keeps the results of a function's last ``maxsize`` different calls.

    A result is kept no longer than the function's first argument, such as a mesh, is in use. That
    argument is compared by identity, the others by value. Only one thread at a time calls the
    function.
    """

    def decorate(function: Callable[Concatenate[S, P], R]) -> Callable[Concatenate[S, P], R]:
        kept: Kept[R] = OrderedDict()
        lock = RLock()

        @wraps(function)
        def locked(subject: S, /, *args: P.args, **kwargs: P.kwargs) -> R:
            key = id(subject), (args, tuple(sorted(kwargs.items())))
            with lock:
                if key in kept:
                    result = kept[key]
                else:
                    result = kept[key] = function(subject, *args, **kwargs)
                    # It takes no lock: the thread that frees a mesh may hold another one.
                    finalize(subject, kept.pop, key, None).atexit = False
                kept.move_to_end(key)
                while len(kept) > maxsize:
                    kept.popitem(last=False)
                return result

        return locked

    return decorate
