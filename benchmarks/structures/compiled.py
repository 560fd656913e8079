"""How the structures are compiled: like the product, kept on disk, with one loop for all of them.

A structure is a NamedTuple. ``search(structure, *question)`` calls the function that is marked with
``@searches(ItsType)``.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.extending import overload

from sim_core.numerics import jit as sim_core_jit

_settings: Any = numba.config
_digest = hashlib.sha256(
    b"".join(source.read_bytes() for source in sorted(Path(__file__).parent.glob("*.py")))
)
_FOLDER = (
    sim_core_jit.CACHE_FOLDER / f"structures-{_digest.hexdigest()[:16]}"
)  # never stale, see sim_core/numerics/jit.py
_SEARCHES: dict[type, Any] = {}


def jit(function: Callable[..., Any], arrays: bool = False) -> Any:
    """Compiled as sim_core's code is; with ``arrays`` it may also make arrays."""
    before = _settings.CACHE_DIR
    _settings.CACHE_DIR = str(_FOLDER)
    try:
        return numba.njit(cache=sim_core_jit.CACHED, nogil=True, error_model="numpy", _nrt=arrays)(
            function
        )
    finally:
        _settings.CACHE_DIR = before


def searches(structure: type) -> Callable[..., Any]:
    """Decorator: this function is how such a structure is searched."""

    def name(function: Callable[..., Any]) -> Any:
        _SEARCHES[structure] = jit(function)
        return _SEARCHES[structure]

    return name


def search(structure: Any, *question: Any) -> Any:
    """The structure's own search."""
    return _SEARCHES[type(structure)](structure, *question)


@overload(search, strict=False, jit_options={"nogil": True, "error_model": "numpy"})
def _search(structure, *question):  # type: ignore[no-untyped-def]
    return _SEARCHES[structure.instance_class].py_func
