"""All kinds of workers give the same results; a task is repeated once if its worker dies."""

import os
import pickle
import signal
import sys
import threading
import time
from collections import Counter
from concurrent.futures import Executor
from pathlib import Path

import pytest

from chamberopt.chamber.replica_seed import replica_seed
from chamberopt.cli import main
from chamberopt.common.errors import InputError, WorkerLostError
from chamberopt.common.executor import (
    SerialExecutor,
    core_count,
    local_executor,
    open_executor,
    result_of,
    share,
)
from chamberopt.design import load
from chamberopt.simulation.replicas import run_in_order
from tests.helpers import worker_jobs


@pytest.fixture(scope="module")
def processes():
    with local_executor(2, "processes") as executor:
        yield executor


def test_processes_answer_in_order_and_share_the_work(processes: Executor) -> None:
    assert [
        future.result() for future in [processes.submit(worker_jobs.square, n) for n in range(20)]
    ] == [n * n for n in range(20)]
    busy = Counter(processes.map(worker_jobs.pid_of, range(8)))
    assert set(busy) == set(processes.pids)  # type: ignore[attr-defined]
    assert min(busy.values()) >= 3


def test_replicas_come_in_order_and_no_more_are_begun_than_asked_for() -> None:
    begun: list[int] = []

    def task(setting: str, seed: int) -> str:
        begun.append(seed)
        return f"{setting} {seed}"

    seeds = [replica_seed(7, number, "confirm") for number in range(6)]
    for ahead in (0, 2, 6):
        begun.clear()
        came = []
        for one in run_in_order(task, "this", 7, SerialExecutor(), "confirm", range(6), ahead):
            came.append(one)
            assert len(begun) == min(6, len(came) + ahead)
        assert came == [f"this {seed}" for seed in seeds]
        assert begun == seeds


def test_an_error_arrives_as_it_was_raised(processes: Executor) -> None:
    with pytest.raises(InputError, match=r"^shot: too many$"):
        processes.submit(worker_jobs.refuse, "shot: too many").result()


def test_an_error_of_the_system_is_the_tasks_own_and_no_lost_worker(
    processes: Executor, tmp_path: Path
) -> None:
    with pytest.raises(FileNotFoundError):
        processes.submit(worker_jobs.open_nothing, tmp_path).result()
    assert worker_jobs.marks(tmp_path) == {"tried": 1}


@pytest.mark.parametrize(
    ("kind", "as_kind", "text"),
    [
        (worker_jobs.AwkwardInputError, InputError, "^open edges$"),
        (worker_jobs.AwkwardError, RuntimeError, "^AwkwardError: open edges$"),
    ],
)
def test_an_error_that_cannot_be_pickled_arrives_as_text(
    kind: type, as_kind: type[Exception], text: str, processes: Executor
) -> None:
    with pytest.raises(as_kind, match=text) as raised:
        processes.submit(worker_jobs.refuse_awkwardly, kind).result()
    assert type(raised.value) is as_kind


def test_a_lost_process_costs_its_task_alone(processes: Executor, tmp_path: Path) -> None:
    before = set(processes.pids)  # type: ignore[attr-defined]
    futures = [processes.submit(worker_jobs.square, n, tmp_path, 0.02) for n in range(6)]
    lost = processes.submit(worker_jobs.die, tmp_path)
    futures += [processes.submit(worker_jobs.square, n, tmp_path, 0.02) for n in range(6, 12)]
    assert [future.result() for future in futures] == [n * n for n in range(12)]
    assert lost.result() == "alive"
    assert worker_jobs.marks(tmp_path) == {**{str(n): 1 for n in range(12)}, "die": 2}
    assert len(before & set(processes.pids)) == 1  # type: ignore[attr-defined]


def test_a_task_that_kills_two_processes_fails_with_the_reason(
    processes: Executor, tmp_path: Path
) -> None:
    with pytest.raises(
        WorkerLostError,
        match=r"died 2 times \(signal 9, as when memory runs out\); give fewer --workers",
    ):
        processes.submit(worker_jobs.die, tmp_path, 99).result()
    assert worker_jobs.marks(tmp_path) == {"die": 2}
    assert processes.submit(worker_jobs.square, 3).result() == 9


def test_what_is_shared_travels_once_a_worker(processes: Executor, tmp_path: Path) -> None:
    shared = share(processes, worker_jobs.Counted(tmp_path, 100_000))
    assert len(pickle.dumps((worker_jobs.size_of, (shared, 1), {}))) < 300
    assert set(processes.map(worker_jobs.size_of, [shared] * 20, range(20))) == {100_000}
    assert worker_jobs.marks(tmp_path) == {str(pid): 1 for pid in processes.pids}  # type: ignore[attr-defined]
    file = Path(shared.path)
    assert file.exists()
    del shared
    assert not file.exists()


@pytest.mark.parametrize(
    "executor", [SerialExecutor(), local_executor(1)], ids=["serial", "threads"]
)
def test_where_memory_is_shared_nothing_travels(executor: Executor) -> None:
    value = object()
    assert share(executor, value) is value


def test_leaving_by_an_exception_does_not_wait_for_the_tasks(tmp_path: Path) -> None:
    executor = local_executor(1, "processes")

    def interrupted() -> None:
        with executor:
            assert executor.submit(worker_jobs.square, 2).result() == 4
            executor.submit(worker_jobs.square, 3, None, 60.0)
            executor.submit(worker_jobs.square, 4, tmp_path)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert executor.pids == []  # type: ignore[attr-defined]
    assert worker_jobs.marks(tmp_path) == {}


@pytest.mark.parametrize(
    ("workers", "cluster", "message"),
    [
        (0, None, "--workers: given 0; give at least 1"),
        (2, "tcp://127.0.0.1:8786", "--workers: given 2, but --cluster has workers of its own"),
        (None, "no-such-file.json", "neither an address nor a file; give tcp://HOST:PORT"),
        (None, __file__, "holds no scheduler's address"),
        (
            None,
            "http://127.0.0.1",
            r"no scheduler answers at http://127.0.0.1 .*not of the form tcp://HOST:PORT",
        ),
    ],
)
def test_invalid_workers_are_refused(
    workers: int | None, cluster: str | None, message: str
) -> None:
    if cluster and not workers:
        pytest.importorskip("distributed", reason="Dask is not installed")
    with pytest.raises(InputError, match=message):
        open_executor(workers, cluster)


def test_without_dask_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'chamberopt\[cluster\]'"):
        open_executor(None, "tcp://127.0.0.1:8786")


def test_lost_workers_are_one_message_and_status_1(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    def lose(_: Path) -> None:
        raise WorkerLostError("replica 3: its worker process died 2 times (signal 9)")

    monkeypatch.setattr(load, "load_design", lose)
    assert main(["simulate", "any.toml"]) == 1
    assert capsys.readouterr().err.startswith(
        "replica 3: its worker process died 2 times (signal 9) (killed"
    )


@pytest.mark.parametrize(
    ("workers", "kind"), [(1, "ThreadExecutor"), (8, "ThreadExecutor"), (9, "ProcessExecutor")]
)
def test_too_many_cores_for_threads_are_given_processes(workers: int, kind: str) -> None:
    with open_executor(workers, None) as executor:  # processes start with their first task
        assert type(executor).__name__ == kind


def test_an_error_cancels_the_tasks_that_wait() -> None:
    running, ended, futures = threading.Event(), threading.Event(), []

    def task() -> None:
        running.set()
        ended.wait(20)

    def fail_while_it_runs() -> None:
        with local_executor(1) as executor:
            futures.extend(executor.submit(task) for _ in range(2))
            assert running.wait(20)
            threading.Timer(0.1, ended.set).start()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_while_it_runs()
    assert [future.cancelled() for future in futures] == [False, True]


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
def test_ctrl_c_ends_a_wait_also_where_another_thread_is_given_it() -> None:
    ended = threading.Event()

    def task() -> None:
        time.sleep(0.1)
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)
        ended.wait(20)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with local_executor(1) as executor:
            waiting = executor.submit(task)
            with pytest.raises(KeyboardInterrupt):
                result_of(waiting)
            assert not waiting.done()
            ended.set()
    finally:
        signal.signal(signal.SIGINT, before)


def test_there_is_a_worker_for_each_core_that_may_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {1, 5, 6}, raising=False)
    assert core_count() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    for told, count in ((4, 4), (None, 1)):
        monkeypatch.setattr(os, "cpu_count", lambda told=told: told)
        assert core_count() == count
    with local_executor(1) as one:
        assert one.submit(abs, -2).result() == 2
    for workers in (0, -1):
        with pytest.raises(InputError, match=f"--workers: given {workers}; give at least 1"):
            local_executor(workers)
