"""Large records arrive in compiled functions as they were, as one argument."""

from typing import NamedTuple

import numpy as np

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


def test_a_whole_record_is_one_argument_with_a_short_name() -> None:
    _twice(ONE)
    assert isinstance(_scaled_sum, Step)
    for code in _scaled_sum.overloads.values():
        (kind,) = code.signature.args
        assert isinstance(kind, WholeRecord)
        assert len(code.fndesc.mangled_name) < 300
