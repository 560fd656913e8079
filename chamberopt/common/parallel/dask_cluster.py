"""Replicas and candidates on a Dask cluster. The only file that imports distributed, the extra `dask`."""

from __future__ import annotations

import json
import pickle
import socket
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor, Future
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from chamberopt.common.errors import ClusterLostError, InputError, WorkerLostError

TIMEOUT_S = 20.0  # s, until a scheduler has answered, and until it has a worker


class DaskExecutor(Executor):
    """Runs tasks on the workers of a Dask scheduler.

    A task whose worker dies is run again elsewhere by the scheduler; one that takes several down
    (distributed.scheduler.allowed-failures) raises WorkerLostError.
    """

    def __init__(self, cluster: str, patience: float | None = None) -> None:
        """cluster: tcp://HOST:PORT or a scheduler file (.json). InputError when there is none, or it has no workers."""
        try:
            from distributed import Client
        except ImportError:
            text = "needs Dask, which is not installed; pip install 'chamberopt[dask]'"
            raise InputError(f"--cluster: {text}") from None
        address, patience = _address(cluster), TIMEOUT_S if patience is None else patience
        try:
            _knock(address, patience)
            self._client = Client(address, timeout=patience, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(
                f"--cluster: no scheduler answers at {address} within {patience:g} s ({error}); start one with "
                "`dask scheduler`, or correct the address"
            ) from None
        try:
            self._require_workers(address, patience)
        except BaseException:
            self._client.close()
            raise
        self._executor = self._client.get_executor(pure=False)

    def share(self, value: Any) -> Any:
        """A task's result rather than scattered data: should its workers be lost, the scheduler makes it again."""
        return self._client.submit(
            pickle.loads, pickle.dumps(value, pickle.HIGHEST_PROTOCOL), pure=False
        )

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        theirs = self._executor.submit(fn, *args, **kwargs)
        ours: Future[Any] = Future()

        def pass_on(_: Future[Any]) -> None:
            if not ours.cancelled():
                _copy_outcome(theirs, ours)

        theirs.add_done_callback(pass_on)
        ours.add_done_callback(lambda _: theirs.cancel() if ours.cancelled() else None)
        return ours

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leaves the cluster, which goes on."""
        self._executor.shutdown(wait and not cancel_futures)
        self._client.close()

    def _require_workers(self, address: str, patience: float) -> None:
        try:
            self._client.wait_for_workers(1, timeout=patience)
        except TimeoutError:
            text = f"the scheduler at {address} has no workers; start some with `dask worker {address}`"
            raise InputError(f"--cluster: {text}") from None
        mine = fingerprint()
        try:
            theirs = self._client.run(fingerprint)
        except Exception as error:
            text = f"a worker of {address} cannot import chamberopt ({error}); install the same version there"
            raise InputError(f"--cluster: {text}") from None
        for worker, found in theirs.items():
            if found != mine:
                differ = ", ".join(
                    f"{name} {found[name]} ({mine[name]} here)"
                    for name in mine
                    if found[name] != mine[name]
                )
                raise InputError(
                    f"--cluster: worker {worker} has {differ}: figures could differ; install the same there"
                )


def fingerprint() -> dict[str, str]:
    """What figures depend on, of this process: versions of packages."""
    found = {}
    for package in ("chamberopt", "numpy", "scipy", "numba", "manifold3d"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed as a package"
    return found


def _address(cluster: str) -> str:
    """Of the scheduler, as given or as its file says."""
    if "://" in cluster:
        return cluster
    path = Path(cluster)
    if not path.is_file():
        text = "neither an address nor a file; give tcp://HOST:PORT, or what `dask scheduler --scheduler-file FILE` wrote"
        raise InputError(f"--cluster: given {cluster!r}, {text}")
    try:
        return str(json.loads(path.read_text(encoding="utf-8"))["address"])
    except (OSError, ValueError, KeyError, TypeError):
        text = (
            "holds no scheduler's address; give what `dask scheduler --scheduler-file FILE` wrote"
        )
        raise InputError(f"--cluster: {cluster} {text}") from None


def _knock(address: str, patience: float) -> None:
    """OSError or ValueError where nobody is: a Client that finds nobody takes longer, and leaves with a traceback."""
    place = urlsplit(address)
    if place.scheme not in ("tcp", "tls") or not place.hostname or not place.port:
        raise ValueError("not of the form tcp://HOST:PORT")
    socket.create_connection((place.hostname, place.port), timeout=patience).close()


def _copy_outcome(theirs: Future[Any], ours: Future[Any]) -> None:
    from distributed import KilledWorker

    try:
        ours.set_result(theirs.result())
    except CancelledError:
        ours.set_exception(
            ClusterLostError("the cluster gave its tasks up: its scheduler has ended")
        )
    except KilledWorker as error:
        count = error.allowed_failures + 1
        where = error.last_worker.address
        ours.set_exception(
            WorkerLostError(
                f"{count} workers died of its task, the last at {where}; see their logs"
            )
        )
    except Exception as error:
        ours.set_exception(error)
