"""Run replicas and candidates on a Dask cluster.

Only this file imports the package `distributed`; pip install chamberopt[cluster] installs it.
"""

from __future__ import annotations

import asyncio
import json
import logging
import pickle
import socket
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor, Future
from pathlib import Path
from typing import Any, ParamSpec, TypeVar
from urllib.parse import urlsplit

from chamberopt.common.errors import ClusterLostError, InputError, WorkerLostError
from chamberopt.common.limits import MAX_TEXT_BYTES, read_limited
from chamberopt.common.versions import simulation_versions

P = ParamSpec("P")
T = TypeVar("T")

TIMEOUT_S = 4.0  # wait for the scheduler to answer, and again for it to accept a client
WORKER_TIMEOUT_S = 20.0  # wait for its first worker
MAX_GREETING = 100_000  # bytes; the first message of Dask has some hundred
SCHEDULER_FILE = "what `dask scheduler --scheduler-file FILE` wrote"


class DaskExecutor(Executor):
    """Executor that runs tasks on the workers of a Dask scheduler.

    If a worker dies, the scheduler runs its task again on another worker. A task that takes several
    workers down (more than Dask's setting distributed.scheduler.allowed-failures) raises
    WorkerLostError. An exception that leaves the `with` block cancels the tasks.
    """

    def __init__(self, cluster: str, timeout: float | None = None) -> None:
        """Connect to a scheduler.

        Args:
            cluster: tcp://HOST:PORT, or a scheduler file (.json).
            timeout: longest wait for a worker [s]; None for WORKER_TIMEOUT_S.

        Raises:
            InputError: if Dask is not installed, no scheduler answers, the scheduler has no
                workers, or its workers run another version of this program.
        """
        try:
            import distributed
        except ImportError:
            text = "needs Dask, which is not installed; pip install 'chamberopt[cluster]'"
            raise InputError(f"--cluster: {text}") from None
        quiet = "distributed", "distributed.client", "tornado", "tornado.application", "asyncio"
        for name in quiet:
            logging.getLogger(name).setLevel(logging.CRITICAL)  # the InputError tells it once
        address = _scheduler_address(cluster)
        try:
            _require_scheduler(address)
            dask: Any = distributed  # whose functions state no types
            self._client = dask.Client(address, timeout=TIMEOUT_S, set_as_default=False)
            self._client.futures = _Futures()
        except (OSError, ValueError) as error:
            raise InputError(
                f"--cluster: no scheduler answers at {address} within {2 * TIMEOUT_S:g} s "
                f"({error}); start one with `dask scheduler`, or correct the address"
            ) from None
        try:
            self._require_workers(address, WORKER_TIMEOUT_S if timeout is None else timeout)
        except BaseException:
            self._client.close()
            raise
        self._executor = self._client.get_executor(pure=False)

    def share(self, value: object) -> object:
        # The value is sent as a task's result and not as scattered data, because the scheduler can
        # compute a result again if the workers that hold it die.
        pickled = pickle.dumps(value, pickle.HIGHEST_PROTOCOL)
        return self._client.submit(pickle.loads, pickled, pure=False)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Queue a call of `fn`, and return its future.

        The future raises ClusterLostError or WorkerLostError in place of Dask's own errors.
        """
        dask_future = self._executor.submit(fn, *args, **kwargs)
        future: Future[T] = Future()

        def copy_outcome(_: Future[object]) -> None:
            if future.set_running_or_notify_cancel():  # a future that runs cannot be cancelled
                _copy_outcome(dask_future, future)

        dask_future.add_done_callback(copy_outcome)
        future.add_done_callback(lambda _: dask_future.cancel() if future.cancelled() else None)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Disconnect from the cluster, which keeps running."""
        self._executor.shutdown(wait and not cancel_futures)
        self._client.close()

    def __exit__(self, *error: Any) -> None:
        self.shutdown(cancel_futures=error[0] is not None)

    def _require_workers(self, address: str, timeout: float) -> None:
        """Raise InputError unless the scheduler has workers, and all run this same program."""
        try:
            self._client.wait_for_workers(1, timeout=timeout)
        except TimeoutError:
            text = f"has no workers; start some with `dask worker {address}`"
            raise InputError(f"--cluster: the scheduler at {address} {text}") from None
        here = simulation_versions()
        of_workers = self._client.run(simulation_versions, on_error="return")
        for worker, there in of_workers.items():
            if isinstance(there, Exception):
                text = f"cannot run chamberopt ({there}); install the same version there"
                raise InputError(f"--cluster: worker {worker} {text}")
            names = [name for name in here if there.get(name) != here[name]]
            if names:
                different = ", ".join(
                    f"{name} {there.get(name)} ({here[name]} here)" for name in names
                )
                remedy = "figures could differ; install the same there and start it again"
                raise InputError(f"--cluster: worker {worker} has {different}: {remedy}")


class _Futures(dict[str, Any]):
    """The futures of a Dask client by their names, which one thread reads while another submits.

    Dask cancels the futures of a scheduler that has ended in a loop over `values`. In a plain
    dict a future that is submitted meanwhile ends that loop with a RuntimeError, before all are
    cancelled.
    """

    def values(self) -> Any:
        return list(super().values())


def _scheduler_address(cluster: str) -> str:
    """Return the scheduler's address: `cluster` itself, or the address in the scheduler file."""
    if "://" in cluster:
        return cluster
    try:
        content = read_limited(Path(cluster), MAX_TEXT_BYTES, "scheduler file", follow=True)
    except FileNotFoundError:
        text = f"neither an address nor a file; give tcp://HOST:PORT, or {SCHEDULER_FILE}"
        raise InputError(f"--cluster: given {cluster!r}, {text}") from None
    try:
        return str(json.loads(content)["address"])
    except (ValueError, KeyError, TypeError, RecursionError):
        text = f"holds no scheduler's address; give {SCHEDULER_FILE}"
        raise InputError(f"--cluster: {cluster} {text}") from None


def _require_scheduler(address: str) -> None:
    """Raise OSError or ValueError unless a Dask scheduler answers at the address.

    A Dask client that meets another program waits for minutes, or takes the program's first bytes
    for a length and allocates that much memory.
    """
    place = urlsplit(address)
    if place.scheme not in ("tcp", "tls") or not place.hostname or not place.port:
        raise ValueError("not of the form tcp://HOST:PORT")
    with socket.create_connection((place.hostname, place.port), TIMEOUT_S) as connection:
        if place.scheme == "tcp":  # with TLS the client speaks first
            greeting = connection.recv(8)
            if not 0 < int.from_bytes(greeting, "little") < MAX_GREETING:
                raise ValueError("another program listens there")
    kind = asyncio.run(asyncio.wait_for(_kind_of_server(address), TIMEOUT_S))
    if kind != "Scheduler":
        raise ValueError(f"a Dask {kind.lower()} listens there")


async def _kind_of_server(address: str) -> str:
    """Ask a Dask server for its kind, "Scheduler", "Worker" or "Nanny", and return it."""
    import distributed.core
    import distributed.security

    dask: Any = distributed
    security = dask.security.Security().get_connection_args("client")
    async with dask.core.rpc(address, connection_args=security) as server:
        return str((await server.identity())["type"])


def _copy_outcome(dask_future: Future[T], future: Future[T]) -> None:
    """Copy the result or error of Dask's finished future to `future`.

    Dask's errors for a cancelled task and a killed worker become ClusterLostError and
    WorkerLostError.
    """
    from distributed import KilledWorker

    try:
        future.set_result(dask_future.result())
    except CancelledError:
        text = "the cluster cancelled its tasks: its scheduler has ended"
        future.set_exception(ClusterLostError(text))
    except KilledWorker as error:
        text = f"{error.allowed_failures + 1} workers died of its task, the last at"
        where = error.last_worker.address
        future.set_exception(WorkerLostError(f"{text} {where}; see their logs"))
    except Exception as error:
        future.set_exception(error)
