"""Threads that ask for the same at once get the one result."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from time import sleep

from sim_core.numerics.computed_once import computed_once


def test_threads_that_ask_at_once_compute_once() -> None:
    calls, ready = [], Barrier(4)

    @computed_once(2)
    def slow(number: int) -> object:
        calls.append(number)
        sleep(0.05)
        return object()

    def ask(number: int) -> object:
        ready.wait()
        return slow(number)

    with ThreadPoolExecutor(4) as workers:
        found = list(workers.map(ask, [1, 1, 1, 2]))
    assert sorted(calls) == [1, 2]
    assert found[0] is found[1] is found[2]


def test_the_last_results_are_kept() -> None:
    calls = []

    @computed_once(1)
    def noted(number: int) -> int:
        calls.append(number)
        return number

    assert [noted(1), noted(1), noted(2), noted(1)] == [1, 1, 2, 1]
    assert calls == [1, 2, 1]
