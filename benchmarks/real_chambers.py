"""The search of shipped studies against Optuna's Gaussian process, through the same evaluations.

    python benchmarks/real_chambers.py --seeds 5
    python benchmarks/real_chambers.py studies/plate.toml --evaluations 20

Both have the study's budget, start, noise, geometry known before a simulation, and confirmation:
only where to look next is asked of another. A row has the confirmed objective of each. The first
command takes about 20 CPU minutes. Optuna's Gaussian process needs the extra "bench" and torch.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.table import print_table, write_csv
from chamberopt.common.executor import local_executor
from chamberopt.search import ask_and_tell, run_study
from chamberopt.search.optimiser.domain import Domain
from chamberopt.search.optimiser.point_search import PointSearch
from chamberopt.search.study import load_study
from chamberopt.search.study.schema import Optimizer
from chamberopt.search.study_folder import open_study_folder

ROOT = Path(__file__).parents[1]


class OptunaSearch:
    """Optuna in the place of PointSearch."""

    def __init__(self, start: np.ndarray, settings: Optimizer, _: Any, domain: Domain, *__: Any):
        import optuna

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        sampler = optuna.samplers.GPSampler(seed=settings.seed)
        self._study = optuna.create_study(direction="maximize", sampler=sampler)
        self._names = [f"x{k}" for k in range(len(domain))]
        self._study.enqueue_trial(dict(zip(self._names, start.tolist(), strict=True)))
        self._start, self._left, self._most = start, settings.evaluations, 4 * settings.evaluations
        self.points: list[np.ndarray] = []
        self.scores: list[float] = []
        self.phases, self.spent = ["optuna"], 0.0

    def ask(self) -> np.ndarray | None:
        running = len(self.points) > len(self.scores)
        if running or self._left < 1.0 or len(self.points) == self._most:
            return None
        self._trial = self._study.ask()
        point = np.array([self._trial.suggest_float(name, 0.0, 1.0) for name in self._names])
        self.points.append(np.round(point, 4) if self.points else self._start)
        return self.points[-1]

    def tell(self, score: float, cost: float) -> None:
        self._study.tell(self._trial, score)
        self.scores.append(score)
        self._left -= cost
        self.spent += cost


def confirmed(file: Path, seed: int, evaluations: int | None, search: Any) -> dict[str, Any]:
    """The answer of one search."""
    study = load_study(file)
    settings = {"seed": seed, "batch": 1, "evaluations": evaluations or study.optimizer.evaluations}
    study = study.model_copy(
        update={
            "design": study.design.changed({"process.seed": 100 + seed}),
            "optimizer": study.optimizer.model_copy(update=settings),
        }
    )
    began = time.perf_counter()
    with (
        tempfile.TemporaryDirectory() as folder,
        local_executor(None) as executor,
        patch.object(ask_and_tell, "PointSearch", search),
        open_study_folder(study, Path(folder) / "study") as opened,
    ):
        result = run_study.run_study(study, opened, executor)
    best = result.best.goals[0]
    spared = sum(not trial.goals for trial in result.trials if trial.stage == "search")
    return {
        "objective": round(best.value, 4),
        "half_width": round(best.half_width, 4),
        "not_simulated": spared,
        "seconds": round(time.perf_counter() - began, 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("study", nargs="?", type=Path, default=ROOT / "studies" / "quickstart.toml")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--evaluations", type=int)
    asked = parser.parse_args()
    rows = []
    for seed in range(asked.seeds):
        for name, search in (("ours", PointSearch), ("optuna-gp", OptunaSearch)):
            found = confirmed(asked.study, seed, asked.evaluations, search)
            rows.append({"study": asked.study.stem, "seed": seed, "search": name, **found})
            print(rows[-1], flush=True)
    print_table(rows)
    print(f"written to {write_csv(f'real_{asked.study.stem}.csv', rows)}")


if __name__ == "__main__":
    main()
