"""A function that only compiled functions call has no machine code, and is in its callers'."""

import numpy as np
import pytest
from numba.core.caching import NullCache
from numba.core.errors import NumbaWarning

from sim_core.numerics.jit import jit


def test_only_what_python_calls_has_machine_code() -> None:
    @jit
    def thrice(x: float) -> float:
        return 3.0 * x

    thrice._cache = NullCache()  # type: ignore[attr-defined]

    @jit
    def nine_times(x: float) -> float:
        return thrice(thrice(x))

    assert nine_times(1.0) == 9.0
    for function, runs in ((thrice, False), (nine_times.entry, True)):  # type: ignore[attr-defined]
        (code,) = function.overloads.values()  # type: ignore[attr-defined]
        assert (code.fndesc.mangled_name.encode() in code.library._get_compiled_object()) == runs


def test_a_step_with_an_address_of_this_process_is_not_kept_on_disk() -> None:
    large = np.arange(200_000.0)  # numba puts arrays up to a megabyte into the code

    @jit
    def at(row: int) -> float:
        return large[row]

    @jit
    def next_of(row: int) -> float:
        return at(row + 1)

    with pytest.warns(NumbaWarning, match="Cannot cache compiled function") as said:
        assert next_of(5) == 6.0
    assert ['"at"' in str(one.message) for one in said] == [True, False]
