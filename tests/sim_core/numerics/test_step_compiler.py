"""A function that only compiled functions call has no machine code, and is in its callers'."""

from typing import NamedTuple

import numpy as np
import pytest
from numba.core.caching import NullCache
from numba.core.errors import NumbaWarning

from sim_core.numerics.jit import Step, inlined, jit
from sim_core.numerics.whole_records import WholeRecord, passed_whole


@passed_whole
class Numbers(NamedTuple):
    """A record as the event loop has them: arrays, further records, and what may be absent."""

    first: np.ndarray
    second: np.ndarray | None
    scale: float
    flag: bool


@inlined
def _sum(second: np.ndarray | None, numbers: Numbers) -> float:
    total = 0.0
    for one in numbers.first:
        total += one
    if second is None:
        return total
    for one in second:
        total -= one
    return total


@jit
def _scaled_sum(numbers: Numbers) -> float:
    total = numbers.scale * _sum(numbers.second, numbers)
    return -total if numbers.flag else total


@jit
def _twice(numbers: Numbers) -> float:
    return 2.0 * _scaled_sum(numbers)


ONE = Numbers(np.array([1.0, 2.0]), None, 3.0, False)
OTHER = Numbers(np.array([1.0, 2.0]), np.array([5.0]), 3.0, True)


def test_whole_records_arrive_as_they_were() -> None:
    assert _twice(ONE) == 2.0 * 3.0 * (1.0 + 2.0)
    assert _twice(OTHER) == -2.0 * 3.0 * (1.0 + 2.0 - 5.0)
    assert _scaled_sum(ONE) == 9.0  # a step that Python calls too


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


def test_a_whole_record_is_one_argument_with_a_short_name() -> None:
    _twice(ONE)
    assert isinstance(_scaled_sum, Step)
    for code in _scaled_sum.overloads.values():
        (kind,) = code.signature.args
        assert isinstance(kind, WholeRecord)
        assert len(code.fndesc.mangled_name) < 300


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
