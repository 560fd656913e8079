"""How much of a study two cores can share, with one, two or more candidates at a time. Linux only.

    python benchmarks/study_cores.py [--batches 1 2 4] [--evaluations 10] [--rounds 2]

A search of the gear with short simulations, and its confirmation, run on two workers, while another
process looks every 15 ms how many threads could run and how many CPU seconds they took. `alone_s`
are the CPU seconds spent while one thread at most could run. On one core a study takes `cpu_s`, on
two free cores alone_s + (cpu_s - alone_s) / 2; `speed_up` is the ratio. Unlike times by the clock,
this is hardly changed by other programs. `history` is a digest: rounds must agree.
"""

import argparse
import hashlib
import multiprocessing
import os
import sys
import tempfile
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.scenes import ROOT
from benchmarks.table import print_table
from chamberopt.common.executor import local_executor
from chamberopt.search.run_study import run_study
from chamberopt.search.study import Study, load_study
from chamberopt.search.study_folder import open_study_folder
from chamberopt.search.trial_log import HISTORY

SIMULATED_S = 1.0
INTERVAL_S = 0.015


def look(pid: int) -> tuple[dict[str, float], int]:
    """CPU seconds of each thread of a process, and how many of them could run."""
    seconds, ready = {}, 0
    for thread in Path(f"/proc/{pid}/task").iterdir():
        try:
            seconds[thread.name] = int((thread / "schedstat").read_text().split()[0]) / 1e9
            ready += (thread / "stat").read_text().rpartition(")")[2].split()[0] == "R"
        except OSError:  # it has ended
            continue
    return seconds, ready


def watch(pid: int, pipe: Connection) -> None:
    """Until the pipe has a message; then send the CPU seconds spent alone, and all of them."""
    alone = total = 0.0
    before, were_ready = look(pid)
    while not pipe.poll(INTERVAL_S):
        now, ready = look(pid)
        spent = sum(seconds - before.get(name, 0.0) for name, seconds in now.items())
        alone += 0.5 * spent * ((ready < 2) + (were_ready < 2))
        total, before, were_ready = total + spent, now, ready
    pipe.send((alone, total))


def row(study: Study, batch: int) -> dict[str, Any]:
    study = study.model_copy(
        update={"optimizer": study.optimizer.model_copy(update={"batch": batch})}
    )
    ours, theirs = multiprocessing.get_context("spawn").Pipe()
    watcher = multiprocessing.get_context("spawn").Process(target=watch, args=(os.getpid(), theirs))
    watcher.start()
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "study"
        with open_study_folder(study, path) as folder, local_executor(2) as executor:
            began = time.perf_counter()
            run_study(study, folder, executor)
            wall = time.perf_counter() - began
        digest = hashlib.sha256((path / HISTORY).read_bytes()).hexdigest()[:8]
    ours.send(None)
    alone, cpu = ours.recv()
    watcher.join()
    return {
        "batch": batch,
        "wall_s": round(wall, 1),
        "cpu_s": round(cpu, 1),
        "alone_s": round(alone, 2),
        "speed_up": round(cpu / (alone + 0.5 * (cpu - alone)), 3),
        "history": digest,
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--batches", nargs="+", type=int, default=[1, 2, 4])
    parser.add_argument("--evaluations", type=int, default=10)
    parser.add_argument("--rounds", type=int, default=2)
    options = parser.parse_args()
    study = load_study(ROOT / "studies" / "quickstart.toml")
    short = {"process.accuracy.simulated_time_s": 2.0 * SIMULATED_S}
    study = study.model_copy(
        update={
            "design": study.design.changed(short),
            "search_accuracy": {"simulated_time_s": SIMULATED_S},
            "optimizer": study.optimizer.model_copy(update={"evaluations": options.evaluations}),
        }
    )
    row(study, 1)  # compiles, if need be
    print_table([row(study, batch) for _ in range(options.rounds) for batch in options.batches])


if __name__ == "__main__":
    main()
