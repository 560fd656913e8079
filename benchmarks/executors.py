"""What workers cost and how busy they are: threads, processes, and a Dask scheduler with workers.

    python benchmarks/executors.py [--quick] [--rounds 3] [--kinds threads processes dask]

Efficiency is measured on a sweep of the gear, by one worker and by two in turns. It is the time of
one worker over twice the time of two, the median of the rounds. Workers are started and their code
is loaded beforehand, which takes `start_s`. The machine must have two cores to spare.
`others_cores` is the number of cores that other programs took meanwhile, which the workers cannot
help. `busy` is the seconds inside candidates over twice the clock's seconds: how long two workers
had work, whatever other programs did. `cpu_ratio` is the CPU seconds of one worker over those of
two for the same candidates.

Overhead is the time of tasks that do nothing, divided by their number. Bytes are what goes to a
worker with a task and what comes back. The last lines scale these figures to 1,000 workers. Rows go
to benchmarks/results/executors.csv with the name of the machine. With --quick the candidates are
short, there is one round, and no row is written.
"""

import argparse
import math
import os
import pickle
import statistics
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from chamberopt.common.executor import SerialExecutor, local_executor, share  # noqa: E402
from chamberopt.search.run_sweep import evaluate_point, plan_sweep  # noqa: E402
from chamberopt.search.study import Study, load_study  # noqa: E402

CANDIDATES, NOTHINGS = 24, 1000
ASKED = 0.9
MANY_WORKERS = 1000


@contextmanager
def workers(kind: str, count: int) -> Iterator[Executor]:
    """So many workers of a kind."""
    with ExitStack() as stack:
        if kind == "dask":
            from distributed import LocalCluster

            from chamberopt.common.dask_cluster import DaskExecutor

            local = LocalCluster(
                n_workers=count, threads_per_worker=1, processes=True, dashboard_address=":0"
            )
            address = stack.enter_context(local).scheduler_address
            yield stack.enter_context(DaskExecutor(address))
        else:
            yield stack.enter_context(local_executor(count, kind))  # type: ignore[arg-type]


def candidates(study: Study, count: int) -> list[tuple[int, np.ndarray]]:
    """Numbers and points of a sweep."""
    return list(enumerate(plan_sweep(study, None, count).points))


def nothing(number: int) -> int:
    return number


def timed(study: Study, number: int, point: np.ndarray) -> tuple[float, float]:
    """A candidate's seconds by the clock, and of CPU time."""
    clock, cpu = time.perf_counter(), time.thread_time()
    evaluate_point(study, number, point)
    return time.perf_counter() - clock, time.thread_time() - cpu


@dataclass(frozen=True)
class Played:
    """A sweep: its seconds by the clock, those inside its candidates, and their CPU seconds.

    ``others`` is the number of cores that other programs took.
    """

    wall: float
    inside: float
    cpu: float
    others: float


@dataclass(frozen=True)
class Contest:
    """One kind, with one worker and with two, ready to work; what was played, a pair a round."""

    kind: str
    one: Executor
    two: Executor
    start_s: float
    played: list[tuple[Played, Played]]


def play(executor: Executor, study: Study, tasks: list[tuple[int, np.ndarray]]) -> Played:
    busy, begin = busy_cores(), time.perf_counter()
    futures = [executor.submit(timed, study, number, point) for number, point in tasks]
    inside, cpu = np.sum([future.result() for future in futures], axis=0)
    wall = time.perf_counter() - begin
    return Played(wall, inside, cpu, (busy_cores() - busy - cpu) / wall)


def ready(executor: Executor, count: int, study: Study, task: tuple[int, np.ndarray]) -> float:
    """Seconds until each worker has done its first candidate."""
    begin = time.perf_counter()
    for future in [executor.submit(evaluate_point, study, *task) for _ in range(count)]:
        future.result()
    return time.perf_counter() - begin


def busy_cores() -> float:
    """CPU seconds that this machine has worked, all programs together; NaN where nobody counts."""
    try:
        fields = Path("/proc/stat").read_text(encoding="utf-8").splitlines()[0].split()[1:]
    except OSError:
        return math.nan
    ticks = [int(field) for field in fields]
    return (sum(ticks[:3]) + sum(ticks[5:8])) / os.sysconf("SC_CLK_TCK")


def compete(kinds: list[str], study: Study, count: int, rounds: int) -> list[dict[str, Any]]:
    """Rows of efficiency: all kinds in turns, so that a machine that slows down slows them all."""
    tasks = candidates(study, count)
    with ExitStack() as stack:
        contests = []
        for kind in kinds:
            one, two = (stack.enter_context(workers(kind, n)) for n in (1, 2))
            ready(one, 1, study, tasks[0])
            start = ready(two, 2, study, tasks[0])
            contests.append(Contest(kind, one, two, start, []))
        for _ in range(rounds):
            for contest in contests:
                contest.played.append(
                    (play(contest.one, study, tasks), play(contest.two, study, tasks))
                )
        return [_row(contest, count) for contest in contests]


def _row(contest: Contest, count: int) -> dict[str, Any]:
    one, two = zip(*contest.played, strict=True)
    each = [a.wall / (2.0 * b.wall) for a, b in contest.played]
    middle = statistics.median
    return {
        "kind": contest.kind,
        "candidates": count,
        "rounds": len(each),
        "one_worker_s": round(middle(a.wall for a in one), 2),
        "two_workers_s": round(middle(b.wall for b in two), 2),
        "efficiency": round(middle(each), 3),
        "lowest": round(min(each), 3),
        "highest": round(max(each), 3),
        "busy": round(middle(b.inside / (2.0 * b.wall) for b in two), 3),
        "cpu_ratio": round(middle(a.cpu / b.cpu for a, b in contest.played), 3),
        "others_cores": round(
            middle(played.others for pair in contest.played for played in pair), 2
        ),
        "start_s": round(contest.start_s, 2),
        "candidate_cpu_s": round(middle(a.cpu for a in one) / count, 3),
        "overhead_ms": round(1e3 * overhead(contest.two), 3),
    }


def overhead(executor: Executor) -> float:
    """Seconds a task takes that does nothing, when many are there at once."""
    begin = time.perf_counter()
    for future in [executor.submit(nothing, i) for i in range(NOTHINGS)]:
        future.result()
    return (time.perf_counter() - begin) / NOTHINGS


def sizes(study: Study) -> dict[str, int]:
    """Bytes of a task and of its answer, for a candidate of a sweep and for a replica.

    The chamber of a replica is shared between tasks.
    """
    from chamberopt.chamber.build import build_chamber
    from chamberopt.chamber.scene import chamber_mesh
    from chamberopt.simulation.replicas import ReplicaSetting, simulate_replica

    design = study.at_search_accuracy(study.design)
    chamber = build_chamber(design)
    setting = ReplicaSetting(design, chamber, chamber_mesh(chamber))
    row = evaluate_point(study, *candidates(study, 1)[0])
    with local_executor(1, "processes") as executor:
        parcel = share(executor, setting)
        replica = len(pickle.dumps((simulate_replica, (parcel, 2**127), {})))
    return {
        "candidate": len(pickle.dumps((evaluate_point, (study, *candidates(study, 1)[0]), {}))),
        "row": len(pickle.dumps(row)),
        "replica": replica,
        "replica_unshared": len(pickle.dumps((simulate_replica, (setting, 2**127), {}))),
        "shared_once": len(pickle.dumps(setting)),
        "replica_left": len(pickle.dumps(simulate_replica(setting, 1))),
    }


def on_paper(overhead_s: float, candidate_s: float, size: dict[str, int]) -> list[str]:
    """What 1,000 workers ask for, if one scheduler hands out the tasks."""
    ends = round(ASKED / (1.0 - ASKED))
    traffic = MANY_WORKERS / candidate_s * (size["candidate"] + size["row"]) / 1e6
    replicas = MANY_WORKERS / candidate_s * 8 * (size["replica"] + size["replica_left"]) / 1e6
    return [
        f"on paper, {MANY_WORKERS:,} workers: {1.0 / overhead_s:,.0f} tasks a second can be "
        f"handed out, so that all have work if a candidate takes {MANY_WORKERS * overhead_s:.2g} "
        f"s; one of {candidate_s:.2g} s, as here, is enough for {candidate_s / overhead_s:,.0f} "
        "workers",
        f"the last tasks leave workers idle: {ASKED:.0%} of the time busy takes {ends} candidates "
        f"a worker, {ends * MANY_WORKERS:,} in all (fewer the more alike they are)",
        f"a candidate's {size['candidate']:,} bytes out and {size['row']:,} back make "
        f"{traffic:.2g} MB/s; replicas as tasks would make {replicas:,.0f} MB/s, "
        f"{size['replica_left']:,} bytes back each",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="short candidates, one round, no CSV")
    parser.add_argument(
        "--rounds", type=int, default=3, help="of every kind with one and with two workers"
    )
    parser.add_argument(
        "--kinds",
        nargs="+",
        default=["threads", "processes", "dask"],
        help="threads processes dask",
    )
    options = parser.parse_args()
    study = load_study(ROOT / "studies" / "quickstart.toml")
    count, rounds = CANDIDATES, options.rounds
    if options.quick:
        study, rounds = (
            study.model_copy(update={"search_accuracy": {"replicas": 3, "simulated_time_s": 0.2}}),
            1,
        )
    play(SerialExecutor(), study, candidates(study, 1))  # compiles, if need be, for all
    from benchmarks.table import print_table, write_csv

    rows = compete(options.kinds, study, count, rounds)
    print_table(rows)
    print(f"asked of two workers on a sweep: efficiency {ASKED}")
    size = sizes(study)
    print("bytes:", ", ".join(f"{name} {value:,}" for name, value in size.items()))
    last = rows[-1]
    print("\n".join(on_paper(last["overhead_ms"] / 1e3, last["candidate_cpu_s"], size)))
    if not options.quick:
        write_csv("executors.csv", rows)


if __name__ == "__main__":
    from benchmarks import executors  # a worker can import its functions, but none of __main__

    executors.main()
