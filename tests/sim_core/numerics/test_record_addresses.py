"""Large records arrive in compiled functions as they were, as one argument, their address."""

from typing import NamedTuple

import numpy as np

from sim_core.numerics.jit import Step, inlined, jit
from sim_core.numerics.record_addresses import RecordAddress, passed_by_address


@passed_by_address
class Numbers(NamedTuple):
    """A record as the event loop has them: arrays, numbers, and what may be absent."""

    first: np.ndarray
    second: np.ndarray | None
    scale: float
    flag: bool


class Pair(NamedTuple):
    """A small record, which is a value."""

    one: float
    two: int


@passed_by_address
class Both(NamedTuple):
    """A record with records of both kinds in it."""

    numbers: Numbers
    pair: Pair
    more: tuple[np.ndarray, float]


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


@jit
def _numbers_of(both: Both) -> Numbers:
    return both.numbers


@jit
def _of_both(both: Both) -> float:
    array, factor = both.more
    array[0] += both.pair.two
    return _scaled_sum(_numbers_of(both)) + factor * both.pair.one


ONE = Numbers(np.array([1.0, 2.0]), None, 3.0, False)
OTHER = Numbers(np.array([1.0, 2.0]), np.array([5.0]), 3.0, True)


def test_record_addresses_arrive_as_they_were() -> None:
    assert _twice(ONE) == 2.0 * 3.0 * (1.0 + 2.0)
    assert _twice(OTHER) == -2.0 * 3.0 * (1.0 + 2.0 - 5.0)
    assert _scaled_sum(ONE) == 9.0  # a step that Python calls too


def test_records_in_records_arrive_as_they_were() -> None:
    array = np.zeros(3)
    for numbers, total in ((ONE, 9.0), (OTHER, 6.0)):
        assert _of_both(Both(numbers, Pair(0.5, 7), (array, 10.0))) == total + 10.0 * 0.5
    assert array.tolist() == [2 * 7.0, 0.0, 0.0]


def test_an_address_is_one_argument_with_a_short_name() -> None:
    _twice(ONE)
    assert isinstance(_scaled_sum, Step)
    for code in _scaled_sum.overloads.values():
        (kind,) = code.signature.args
        assert isinstance(kind, RecordAddress)
        assert len(code.fndesc.mangled_name) < 300
