"""The default study's search against other optimisers, with the same number of evaluations for all.

    python benchmarks/optimizers.py
    python benchmarks/optimizers.py --only ours,random --seeds 3
    python benchmarks/optimizers.py --json

The first command runs 10 seeds of 40 evaluations and takes about five CPU minutes. --json prints
the rows as JSON on stdout instead of a table. Set OMP_NUM_THREADS=1: with such small matrices more
threads only cost time. The other optimisers need the extra "bench" (pip install chamberopt[bench]),
and Optuna's GP also needs torch. The problems are those of noisy_problems.py.

The figure is the true regret of what each optimiser recommends by its own rule: ours and CMA-ES
recommend by their model, the others the best point they saw. mean_regret_fit is the regret of what
our surrogate recommends from the same evaluations. The difference that remains comes from the
search.
"""

import argparse
import json
import time
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from benchmarks.noisy_problems import REPLICAS, Problem, chambers, functions
from benchmarks.table import print_table, write_csv
from chamberopt.optimize.search.acquisition import recommend_point
from chamberopt.optimize.search.gaussian_process import GaussianProcess, pool_variances
from chamberopt.optimize.search.maximise import maximise
from chamberopt.optimize.study import schema

EVALUATIONS, SEEDS = 40, 10


class Record:
    """A problem as measured with one seed; keeps what was asked and answered."""

    def __init__(self, problem: Problem, seed: int) -> None:
        self.problem, self.seed = problem, seed
        self.points: list[np.ndarray] = []
        self.scores: list[float] = []
        self.variances: list[float] = []
        self._measure = problem.measured(seed)

    def ask(self, point: np.ndarray) -> float:
        score, variance = self._measure(point)
        self.points.append(np.array(point, dtype=float))
        self.scores.append(score)
        self.variances.append(variance)
        return score

    @property
    def luckiest(self) -> np.ndarray:
        return self.points[int(np.argmax(self.scores))]

    @property
    def fitted(self) -> np.ndarray:
        """What our surrogate recommends from these evaluations."""
        return recommend_point(GaussianProcess(np.array(self.points), *self.seen()), self.seed)

    def seen(self) -> tuple[np.ndarray, np.ndarray]:
        """Scores and their pooled variances."""
        one = REPLICAS * np.array(self.variances)
        return np.array(self.scores), pool_variances(one, np.full(len(one), REPLICAS))


Optimizer = Callable[[Record, int], np.ndarray]
"""optimizer(record, evaluations) asks the record and returns the point it recommends."""


def ours_with(**settings: Any) -> Optimizer:
    def search(record: Record, evaluations: int) -> np.ndarray:
        maximise(
            lambda point: partial(record.ask, point),
            record.problem.begin(record.seed),
            schema.Optimizer(evaluations=evaluations, seed=record.seed, **settings),
            record.seen,
        )
        return record.fitted

    return search


def random(record: Record, evaluations: int) -> np.ndarray:
    rng = np.random.default_rng(record.seed)
    record.ask(record.problem.begin(record.seed))
    for _ in range(evaluations - 1):
        record.ask(rng.random(record.problem.parameters))
    return record.luckiest


def sobol(record: Record, evaluations: int) -> np.ndarray:
    from scipy.stats.qmc import Sobol

    record.ask(record.problem.begin(record.seed))
    for point in Sobol(record.problem.parameters, seed=record.seed).random_base2(
        evaluations.bit_length()
    )[: evaluations - 1]:
        record.ask(point)
    return record.luckiest


def cma_es(record: Record, evaluations: int) -> np.ndarray:
    import cma

    options = {"bounds": [0, 1], "seed": record.seed + 1, "verbose": -9, "maxfevals": evaluations}
    search = cma.CMAEvolutionStrategy(record.problem.begin(record.seed), 0.25, options)
    while len(record.points) < evaluations:
        asked = search.ask()
        left = evaluations - len(record.points)
        answers = [-record.ask(np.asarray(point)) for point in asked[:left]]
        if left < len(asked):  # the last generation is cut short by the budget
            break
        search.tell(asked, answers)
    return np.clip(search.result.xfavorite, 0.0, 1.0)


def optuna_with(sampler: str) -> Optimizer:
    def search(record: Record, evaluations: int) -> np.ndarray:
        import optuna

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        study = optuna.create_study(
            direction="maximize", sampler=getattr(optuna.samplers, sampler)(seed=record.seed)
        )
        names = [f"x{i}" for i in range(record.problem.parameters)]
        study.enqueue_trial(
            dict(zip(names, record.problem.begin(record.seed).tolist(), strict=True))
        )
        study.optimize(
            lambda trial: record.ask(
                np.array([trial.suggest_float(name, 0.0, 1.0) for name in names])
            ),
            evaluations,
        )
        return np.array([study.best_params[name] for name in names])

    return search


OPTIMIZERS: dict[str, Optimizer] = {
    "ours": ours_with(),
    "optuna-gp": optuna_with("GPSampler"),
    "optuna-tpe": optuna_with("TPESampler"),
    "cma-es": cma_es,
    "sobol": sobol,
    "random": random,
    # Ours too.
    "nlopt-mlsl": ours_with(algorithm="GN_MLSL_LDS"),
    **{f"batch-{count}": ours_with(batch=count) for count in (1, 2, 3, 4, 8)},
}


def row(
    problem: Problem, name: str, seeds: int, evaluations: int, first_seed: int = 0
) -> dict[str, Any]:
    """An optimiser's regret on a problem over so many seeds."""
    regrets, fitted, began = [], [], time.process_time()
    for seed in range(first_seed, first_seed + seeds):
        record = Record(problem, seed)
        recommended = OPTIMIZERS[name](record, evaluations)
        if len(record.points) > evaluations:
            raise RuntimeError(
                f"{name} asked {len(record.points)} times, {evaluations} are allowed"
            )
        regrets.append(problem.best - problem.truth(recommended))
        fitted.append(problem.best - problem.truth(record.fitted))
    return {
        "problem": problem.name,
        "optimizer": name,
        "evaluations": evaluations,
        "seeds": seeds,
        "mean_regret": round(float(np.mean(regrets)), 5),
        "standard_error": round(float(np.std(regrets, ddof=1) / np.sqrt(seeds)), 5)
        if seeds > 1
        else None,
        "median_regret": round(float(np.median(regrets)), 5),
        "mean_regret_fit": round(float(np.mean(fitted)), 5),
        "cpu_s": round((time.process_time() - began) / seeds, 2),
    }


def rows(
    problem_name: str, names: list[str], seeds: int, evaluations: int, first: int
) -> Iterator[dict[str, Any]]:
    for problem in [*functions(), *chambers()]:
        if problem.name.startswith(problem_name):
            for name in names:
                yield row(problem, name, seeds, evaluations, first)


def verdict(made: list[dict[str, Any]]) -> str:
    """Says on how many problems ours has the lowest mean regret, and how it does on the worst one.

    Our own other algorithms are left out of the comparison.
    """
    by_problem: dict[str, dict[str, float]] = {}
    for one in made:
        if one["optimizer"] != "nlopt-mlsl" and not one["optimizer"].startswith("batch-"):
            by_problem.setdefault(one["problem"], {})[one["optimizer"]] = one["mean_regret"]
    first = sum(regrets["ours"] <= min(regrets.values()) for regrets in by_problem.values())
    worst = max(
        regrets["ours"] / max(min(regrets.values()), 1e-9) for regrets in by_problem.values()
    )
    return (
        f"ours has the lowest mean regret on {first} of {len(by_problem)} problems; at worst "
        f"{worst:.2f} times the best"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", help=f"names with commas, of {', '.join(OPTIMIZERS)}")
    parser.add_argument(
        "--problem", default="", help="only those whose names begin so, e.g. hartmann or plate"
    )
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument(
        "--first-seed", type=int, default=0, help="tune on some seeds, report on others"
    )
    parser.add_argument("--evaluations", type=int, default=EVALUATIONS)
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    names = asked.only.split(",") if asked.only else list(OPTIMIZERS)
    if unknown := [name for name in names if name not in OPTIMIZERS]:
        parser.error(f"--only {', '.join(unknown)}: none of {', '.join(OPTIMIZERS)}")
    try:
        made = list(rows(asked.problem, names, asked.seeds, asked.evaluations, asked.first_seed))
    except ImportError as error:
        parser.error(
            f"{error}; pip install chamberopt[bench] (and torch for optuna-gp), or leave it out "
            "with --only"
        )
    if asked.json:
        print(json.dumps(made, indent=1))
        return
    print_table(made)
    if "ours" in names and len(names) > 1:
        print(verdict(made))
    print(f"written to {write_csv('optimizers.csv', made)}")


if __name__ == "__main__":
    main()
