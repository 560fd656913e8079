"""A real Dask scheduler with two worker processes: same bits, and a killed worker is survived."""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.cli import main
from chamberopt.common import dask_cluster, versions
from chamberopt.common.dask_cluster import DaskExecutor, _require_scheduler
from chamberopt.common.errors import ClusterLostError, InputError, WorkerLostError
from chamberopt.common.executor import SerialExecutor, share
from chamberopt.design.load import load_design, save_design
from chamberopt.search.run_sweep import plan_sweep
from chamberopt.search.study import Study
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate
from tests.chamberopt.search.test_run_sweep import rows, small_study
from tests.helpers import worker_jobs
from tests.helpers.studies import sweep_in_folder
from tests.helpers.synthetic import plate_design

distributed = pytest.importorskip(
    "distributed", reason="Dask is not installed: pip install 'chamberopt[cluster]'"
)

ROOT = Path(__file__).parents[3]


@dataclass
class Dask:
    """The processes of a Dask cluster."""

    folder: Path
    programs: list[subprocess.Popen]
    sources: Path = ROOT

    @property
    def scheduler_file(self) -> Path:
        return self.folder / "scheduler.json"

    def start(self, *words: str) -> subprocess.Popen:
        log = open(self.folder / f"{words[0]}-{len(self.programs)}.log", "wb")  # noqa: SIM115
        command = [
            sys.executable,
            "-m",
            "dask",
            *words,
            "--scheduler-file",
            str(self.scheduler_file),
            "--no-dashboard",
        ]
        setting = {**os.environ, "PYTHONPATH": os.pathsep.join([str(self.sources), str(ROOT)])}
        program = subprocess.Popen(command, stdout=log, stderr=log, env=setting, cwd=self.folder)
        log.close()
        self.programs.append(program)
        return program

    def start_worker(self) -> subprocess.Popen:
        return self.start("worker", "--nthreads", "1", "--no-nanny")

    def kill_a_worker(self) -> None:
        """Kill a running worker."""
        next(program for program in self.programs[1:] if program.poll() is None).kill()

    def end(self) -> None:
        for program in self.programs:
            program.kill()
            program.wait()


@pytest.fixture(scope="module")
def dask(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Dask]:
    started = Dask(tmp_path_factory.mktemp("dask"), [])
    try:
        started.start("scheduler", "--host", "127.0.0.1", "--port", "0")
        started.start_worker()
        started.start_worker()
        until = time.monotonic() + 60
        while not started.scheduler_file.exists() and time.monotonic() < until:
            time.sleep(0.1)
        with DaskExecutor(str(started.scheduler_file), 60) as executor:
            executor._client.wait_for_workers(2, timeout=60)
        yield started
    finally:
        started.end()


def test_a_scheduler_file_and_its_address_lead_to_the_same_workers(dask: Dask) -> None:
    address = dask_cluster._scheduler_address(str(dask.scheduler_file))
    assert address.startswith("tcp://")
    for where in (str(dask.scheduler_file), address):
        with DaskExecutor(where) as executor:
            assert list(executor.map(worker_jobs.square, range(8))) == [n * n for n in range(8)]
            assert len(set(executor.map(worker_jobs.pid_of, range(8)))) == 2
            with pytest.raises(InputError, match=r"^shot: too many$"):
                executor.submit(worker_jobs.refuse, "shot: too many").result()


def test_what_is_shared_travels_once_a_worker(dask: Dask, tmp_path: Path) -> None:
    with DaskExecutor(str(dask.scheduler_file)) as executor:
        shared = share(executor, worker_jobs.Counted(tmp_path, 1000))
        assert set(executor.map(worker_jobs.size_of, [shared] * 20, range(20))) == {1000}
    counts = worker_jobs.marks(tmp_path)
    assert len(counts) == 2
    assert sum(counts.values()) <= 3  # loaded by one worker, passed on to the other


def test_a_killed_worker_costs_its_task_only(dask: Dask, tmp_path: Path) -> None:
    with DaskExecutor(str(dask.scheduler_file)) as executor:
        shared = share(executor, worker_jobs.Counted(tmp_path, 1000))
        assert executor.submit(worker_jobs.size_of, shared, -1).result() == 1000
        victim, heir = (int(name) for name in (*worker_jobs.marks(tmp_path), "0")[:2])
        futures = [executor.submit(worker_jobs.size_of, shared, n) for n in range(40)]
        futures[5].result()
        os.kill(victim, signal.SIGKILL)  # the worker that had loaded the shared value
        assert [future.result(60) for future in futures] == [1000] * 40
        assert victim != heir
        dask.start_worker()
        executor._client.wait_for_workers(2, timeout=60)


def test_a_sweep_goes_on_when_a_worker_is_killed(dask: Dask, tmp_path: Path) -> None:
    study = Study(
        design=load_design(ROOT / "designs" / "gear.toml"), vary={"shot.mass_g": (2.0, 10.0)}
    )
    plan = plan_sweep(study, 40, None)
    sweep_in_folder(study, plan, tmp_path / "serial", SerialExecutor(), None, worker_jobs.hill)
    done = []

    def progress(count: int, total: int, best: float | None) -> None:
        done.append(count)
        if count == 5:
            dask.kill_a_worker()

    with DaskExecutor(str(dask.scheduler_file)) as executor:
        sweep_in_folder(study, plan, tmp_path / "cluster", executor, progress, worker_jobs.hill)
        dask.start_worker()
        executor._client.wait_for_workers(2, timeout=60)
    assert done == list(range(1, 41))
    assert rows(tmp_path / "cluster") == rows(tmp_path / "serial")


def test_the_same_bits_as_on_this_machine(dask: Dask, tmp_path: Path) -> None:
    """Tasks are candidates, which build their own chamber, and replicas, which receive one."""
    study = small_study()
    plan = plan_sweep(study, None, 4)
    chamber = build_chamber(study.design)
    evaluations = []
    for name, executor in (
        ("serial", SerialExecutor()),
        ("cluster", DaskExecutor(str(dask.scheduler_file))),
    ):
        with executor:
            sweep_in_folder(study, plan, tmp_path / name, executor)
            evaluations.append(evaluate(study.design, chamber, executor, plan=ReplicaPlan(5)))
    assert rows(tmp_path / "cluster") == rows(tmp_path / "serial")
    one, other = evaluations
    assert one.metrics == other.metrics
    for here, there in zip(one.hits, other.hits, strict=True):
        np.testing.assert_array_equal(here.speed, there.speed)
        np.testing.assert_array_equal(here.place, there.place)


def test_a_scheduler_that_is_not_there_is_status_2(tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.setattr(dask_cluster, "TIMEOUT_S", 0.5)
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{closed.getsockname()[1]}"
        command = [
            "simulate",
            str(ROOT / "designs" / "plate.toml"),
            "--cluster",
            address,
            "--out",
            str(tmp_path / "o"),
        ]
        assert main(command) == 2
    message = capsys.readouterr().err
    assert f"--cluster: no scheduler answers at {address} within 1 s" in message
    assert "start one with `dask scheduler`" in message
    assert not (tmp_path / "o").exists()


def test_a_scheduler_without_workers_is_refused(tmp_path: Path) -> None:
    alone = Dask(tmp_path, [])
    try:
        alone.start("scheduler", "--host", "127.0.0.1", "--port", "0")
        while not alone.scheduler_file.exists():
            time.sleep(0.1)
        with pytest.raises(InputError, match="has no workers; start some with `dask worker tcp://"):
            DaskExecutor(str(alone.scheduler_file), 1.0)
    finally:
        alone.end()


@pytest.mark.parametrize("greeting", [b"", b"SSH-2.0-OpenSSH_9.6\r\n", b"\0" * 8])
def test_another_program_at_the_port_is_refused_in_time(greeting: bytes) -> None:
    """One that says nothing, as a web server does; one whose first bytes would be a length."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        accepted = []

        def answer() -> None:
            accepted.append(server.accept()[0])
            accepted[0].sendall(greeting)

        threading.Thread(target=answer, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        began = time.monotonic()
        with pytest.raises(InputError, match=f"no scheduler answers at {address} within 8 s"):
            DaskExecutor(address)
        assert time.monotonic() - began < 10.0
        accepted[0].close()


def test_the_address_of_a_worker_is_refused(dask: Dask) -> None:
    with DaskExecutor(str(dask.scheduler_file)) as executor:
        worker = next(iter(executor._client.scheduler_info()["workers"]))
    with pytest.raises(InputError, match="a Dask worker listens there"):
        DaskExecutor(worker)


@pytest.mark.parametrize("name", ["numba", "sources", "NUMBA_OPT"])
def test_a_worker_that_runs_another_program_is_refused(
    name: str, dask: Dask, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = versions.simulation_versions()
    real = versions.version
    monkeypatch.setattr(versions, "version", lambda one: "other" if one == name else real(one))
    if name == "sources":
        monkeypatch.setattr(versions, "sources_digest", lambda: "other")
    if name == "NUMBA_OPT":
        monkeypatch.setenv(name, "other")
    text = rf"worker tcp://\S+ has {name} {re.escape(there[name])} \(other here\): figures could"
    with pytest.raises(InputError, match=text):
        DaskExecutor(str(dask.scheduler_file))


def test_a_worker_with_edited_sources_is_refused(dask: Dask, tmp_path: Path) -> None:
    """The same versions, another file: a scheduler of its own, whose worker imports a copy."""
    copy = tmp_path / "copy"
    for package in ("chamberopt", "sim_core"):
        shutil.copytree(ROOT / package, copy / package)
    with (copy / "sim_core" / "motion.py").open("a") as file:
        file.write("# edited\n")
    other = Dask(tmp_path, [], copy)
    try:
        other.start("scheduler", "--host", "127.0.0.1", "--port", "0")
        other.start_worker()
        while not other.scheduler_file.exists():
            time.sleep(0.1)
        with pytest.raises(InputError, match=r"worker tcp://\S+ has sources \w+ \(\w+ here\): fig"):
            DaskExecutor(str(other.scheduler_file), 60)
    finally:
        other.end()


@pytest.mark.parametrize("command", ["simulate", pytest.param("sweep", marks=pytest.mark.long)])
def test_a_scheduler_that_dies_is_one_message(command: str, tmp_path: Path) -> None:
    own = Dask(tmp_path, [])
    save_design(plate_design(process__accuracy__replicas=400), tmp_path / "plate.toml")
    (tmp_path / "s.toml").write_text('design = "plate.toml"\n[vary]\n"shot.mass_g" = [2.0, 6.0]\n')
    words = {"simulate": ["simulate", "plate.toml"], "sweep": ["sweep", "s.toml", "--grid", "50"]}
    try:
        own.start("scheduler", "--host", "127.0.0.1", "--port", "0")
        own.start_worker()
        while not own.scheduler_file.exists():
            time.sleep(0.1)
        program = subprocess.Popen(
            [sys.executable, "-m", "chamberopt", *words[command], "--out", "out", "--cluster",
             str(own.scheduler_file)],
            cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, stderr=subprocess.PIPE,
            text=True,
        )  # fmt: skip
        with DaskExecutor(str(own.scheduler_file)) as other:
            while not any(other._client.processing().values()):
                assert program.poll() is None
                time.sleep(0.1)
        own.programs[0].kill()
        _, err = program.communicate(timeout=120)
    finally:
        own.end()
    assert program.returncode == 1
    lines = [line for line in err.splitlines() if "replicas" not in line and "candid" not in line]
    assert [line for line in lines if "its scheduler has ended" in line] == lines[-1:], err
    assert "Traceback" not in err


def test_a_task_may_be_submitted_while_those_of_a_lost_scheduler_are_cancelled(dask: Dask) -> None:
    with DaskExecutor(str(dask.scheduler_file)) as executor:
        submitted = [executor.submit(worker_jobs.square, number) for number in range(3)]
        states = executor._client.futures.values()
        for number, _ in enumerate(states):  # as Client._reconnect does it
            submitted.append(executor.submit(worker_jobs.square, number))
        assert [future.result() for future in submitted] == [0, 1, 4, 0, 1, 4]


def test_tasks_that_the_cluster_cancels_give_the_reason() -> None:
    killed: Future = Future()
    worker = type("Worker", (), {"address": "tcp://10.0.0.7:1"})()
    killed.set_exception(distributed.KilledWorker("task", worker, 3))
    gone: Future = Future()
    gone.set_exception(CancelledError())
    for dask_future, kind, message in (
        (killed, WorkerLostError, "4 workers died .* tcp://10.0.0.7"),
        (gone, ClusterLostError, "ended"),
    ):
        future: Future = Future()
        dask_cluster._copy_outcome(dask_future, future)
        with pytest.raises(kind, match=message):
            future.result()


@pytest.mark.parametrize("address", ["tcp://127.0.0.1", "tcp://:8786", "http://127.0.0.1:8786", ""])
def test_an_address_without_scheme_host_or_port_is_not_looked_up(address: str) -> None:
    with pytest.raises(ValueError, match="not of the form tcp://HOST:PORT"):
        _require_scheduler(address)
