"""How much sooner a study ends on more cores than this machine has.

    python benchmarks/study_workers.py [--cores 1 2 4 8 16] [--batches 1 2 4 8]

Search, order of evaluations and threads are the real ones; what takes cores is slept. An evaluation
of the gear is measured first: building the chamber with its target, a replica, and the figures. In
the study each of these holds one of so many made-up cores for as long, so that it shows what waits
for what, not what cores take from each other. The score is a noisy hill. `one_core_over` is the
time on one core over this; it can be no more than the number of cores.
"""

import argparse
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from threading import Semaphore
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.scenes import ROOT
from benchmarks.table import print_table, write_csv
from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.estimate import estimate
from chamberopt.common.executor import SerialExecutor
from chamberopt.design.load import Design
from chamberopt.search.run_study import run_study
from chamberopt.search.study import Study, load_study
from chamberopt.search.study_folder import open_study_folder
from chamberopt.simulation.evaluate import evaluate, prepare_target
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.simulation.replicas import ReplicaSet

EVALUATIONS = 40
NOISE = 0.03  # of one replica


class Sleeper:
    """A simulator that takes what an evaluation takes, and gives a noisy hill."""

    def __init__(self, study: Study, like: Evaluation, seconds: tuple[float, ...]) -> None:
        self._study, self._like, self._seconds = study, like, seconds
        self._done: dict[str, int] = {}  # replicas of each candidate
        self.cores, self.workers = Semaphore(), ThreadPoolExecutor()

    def on_cores(self, count: int) -> "Sleeper":
        self._done.clear()
        self.cores, self.workers = Semaphore(count), ThreadPoolExecutor(count)
        return self

    def _hold_a_core(self, seconds: float) -> None:
        with self.cores:
            time.sleep(seconds)

    def __call__(self, design: Design, stream: str, replicas: int | None) -> Evaluation:
        build, replica, figures = self._seconds
        key, count = design.model_dump_json() + stream, replicas or self._like.replicas
        if key not in self._done:
            self._hold_a_core(build)
        new = count - self._done.get(key, 0)
        list(self.workers.map(self._hold_a_core, [replica] * new))
        self._done[key] = count
        self._hold_a_core(figures)
        vary = self._study.vary
        x = [(design.value(k) - v.bounds[0]) / np.ptp(v.bounds) for k, v in vary.items()]
        rng = np.random.default_rng([int(1e9 * one) for one in x])
        height = 0.8 - float(((np.array(x) - [0.7, 0.3, 0.55]) ** 2 * [0.6, 1.5, 0.8]).sum())
        return replace(
            self._like, objective=estimate(height + NOISE * rng.normal(size=count)), replicas=count
        )


def measured(design: Design) -> tuple[Evaluation, tuple[float, ...]]:
    """An evaluation of a design, and the seconds of set-up, one replica, and figures on a core."""
    evaluate(design, build_chamber(design), SerialExecutor())  # loads compiled code
    began = time.perf_counter()
    chamber = build_chamber(design)
    target = prepare_target(design, chamber, chamber_mesh(chamber))
    built = time.perf_counter() - began
    began = time.process_time()
    found = evaluate(design, chamber, SerialExecutor(), known=ReplicaSet(target=target))
    figures = found.timings["coverage"]
    return found, (built, (time.process_time() - began - figures) / found.replicas, figures)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cores", nargs="+", type=int, default=[1, 2, 4, 8, 16])
    parser.add_argument("--batches", nargs="+", type=int, default=[1, 2, 4, 8])
    parser.add_argument("--evaluations", type=int, default=EVALUATIONS)
    options = parser.parse_args()
    study = load_study(ROOT / "studies" / "quickstart.toml")
    like, seconds = measured(study.at_search_accuracy(study.design))
    print("s on a core: set-up {:.2f}, replica {:.2f}, figures {:.2f}".format(*seconds))
    sleeper, rows = Sleeper(study, like, seconds), []
    for batch in options.batches:
        for cores in options.cores:
            settings = {"batch": batch, "evaluations": options.evaluations}
            asked = study.model_copy(
                update={"optimizer": study.optimizer.model_copy(update=settings)}
            )
            with (
                tempfile.TemporaryDirectory() as folder,
                open_study_folder(asked, Path(folder) / "study") as opened,
            ):
                began = time.perf_counter()
                run_study(asked, opened, SerialExecutor(), simulator=sleeper.on_cores(cores))
                spent = time.perf_counter() - began
            rows.append(
                {"batch": batch, "cores": cores, "s": round(spent, 1), **_ratio(rows, spent)}
            )
            print(rows[-1], flush=True)
    print_table(rows)
    print(f"written to {write_csv('study_workers.csv', rows)}")


def _ratio(rows: list[dict[str, Any]], spent: float) -> dict[str, Any]:
    alone = rows[0]["s"] if rows and rows[0]["cores"] == 1 else spent
    return {"one_core_over": round(alone / spent, 2)}


if __name__ == "__main__":
    main()
