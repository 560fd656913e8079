"""Threads that ask for the same at once get the one result, while what they ask about is in use."""

import gc
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from time import sleep
from weakref import ref

from sim_core.numerics.computed_once import computed_once


class _Mesh:
    """Something that results are computed of, compared by identity."""


class _Result:
    """Something large."""


def test_threads_that_ask_at_once_compute_once() -> None:
    calls, ready, one, other = [], Barrier(4), _Mesh(), _Mesh()

    @computed_once(2)
    def slow(mesh: _Mesh) -> object:
        calls.append(mesh)
        sleep(0.05)
        return object()

    def ask(mesh: _Mesh) -> object:
        ready.wait()
        return slow(mesh)

    with ThreadPoolExecutor(4) as workers:
        found = list(workers.map(ask, [one, one, one, other]))
    assert len(calls) == 2
    assert set(calls) == {one, other}
    assert found[0] is found[1] is found[2]


def test_the_last_results_are_kept() -> None:
    calls, mesh = [], _Mesh()

    @computed_once(1)
    def noted(_: _Mesh, number: int) -> int:
        calls.append(number)
        return number

    assert [noted(mesh, 1), noted(mesh, 1), noted(mesh, 2), noted(mesh, 1)] == [1, 1, 2, 1]
    assert calls == [1, 2, 1]


def test_a_result_goes_with_what_it_was_computed_of() -> None:
    """Not even the next mesh, which may lie at the same place in memory, gets an old result."""

    @computed_once(8)
    def of(_: _Mesh) -> _Result:
        return _Result()

    for _ in range(100):
        mesh = _Mesh()
        result = ref(of(mesh))
        assert of(mesh) is result()
        del mesh
        gc.collect(0)
        assert result() is None
