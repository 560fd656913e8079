"""The default study's search against other optimisers, with the same rules for all.

    python benchmarks/optimizers.py
    python benchmarks/optimizers.py --only ours,optuna-gp --problem cliff --seeds 3
    python benchmarks/optimizers.py --aside
    python benchmarks/optimizers.py --drawn 10 --seeds 12

The first command runs 20 seeds of 20, 40 and 80 evaluations on the problems of noisy_problems.py
and takes about two CPU hours; --aside those problems that the search was not developed with;
--drawn so many problems of drawn_problems.py. The other optimisers need the extra "bench" (pip
install chamberopt[bench]), and Optuna's GP also torch.

Every optimiser has the same start, the same noise and the same budget: so many evaluations of eight
replicas. Ours gives each candidate but the start three replicas, as studies do, and pays for three
and the set-up; `ours-sure` and `optuna-raced` give all to a candidate that is not clearly worse
than the best after three, `ours-whole` and the others to each. Ours also knows what geometry tells
without an evaluation, which only the gear has. What a search saw is then judged in the same way:
the start, the best that it saw, and the two points that our model recommends from its evaluations,
one of them seen, are measured again with fresh noise and four times the replicas. The answer is the
best of them by our rule: its whole interval must be within the limit, or, if there is none such,
may be. The regret is the best true score within the limit less that of the answer; an answer that
truly is not within the limit counts as the start. Limits are told to those that take them (ours,
Optuna); the others get the score less the expected violation.
"""

from __future__ import annotations

import argparse
import os
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from benchmarks.drawn_problems import drawn_problem
from benchmarks.noisy_problems import ASIDE, REPLICAS, Problem, problems
from benchmarks.table import print_table, write_csv
from chamberopt.common.estimate import Estimate, estimate
from chamberopt.search.candidate import evaluation_cost
from chamberopt.search.optimiser.acquisition import recommend_points
from chamberopt.search.optimiser.gaussian_process import moderate_variances
from chamberopt.search.optimiser.point_search import PointSearch
from chamberopt.search.optimiser.search_model import LimitedFigure, Observations, SearchModel
from chamberopt.search.study import Limits, schema
from chamberopt.search.study.constraints import (
    FEASIBLE,
    INFEASIBLE,
    assess_feasibility,
    expected_violation,
)

EVALUATIONS, SEEDS = (20, 40, 80), 20
FRESH, CONFIRM_REPLICAS = 1, 32  # seeds of the confirmation
LIMIT = {"figure": Limits(max=0.0)}
OTHERS = (
    "ours-sure",
    "ours-whole",
    "optuna-gp",
    "optuna-raced",
    "optuna-tpe",
    "cma-es",
    "sobol",
    "egobox",
    "nlopt-mlsl",
)


class Record:
    """A problem as measured with one seed; keeps what was asked and answered."""

    def __init__(self, problem: Problem, seed: int, evaluations: int) -> None:
        self.problem, self.seed, self.evaluations = problem, seed, evaluations
        self.points: list[np.ndarray] = []
        self.scores: list[Estimate] = []
        self.figures: list[Estimate] = []
        self.spared: list[bool] = []
        self.start = problem.begin(seed)
        self.left = float(evaluations)

    def ask(self, point: np.ndarray, first_replicas: int = 0, is_sure: bool = True) -> float:
        """The measured score of a point, less the expected violation of the limit.

        It gets no more than its first replicas, if not 0: always, or, if the search is to be sure,
        where they show that it is worse than the best.
        """
        point = self.problem.domain.snap(np.asarray(point, dtype=float)[None])[0]
        score, figure = self.problem.measure(point, (self.seed,), REPLICAS)
        is_raced = self.scores and 0 < first_replicas < REPLICAS
        if is_raced and (not is_sure or estimate(score[:first_replicas]).high < self._best_low):
            score = score[:first_replicas]
            figure = None if figure is None else figure[:first_replicas]
        self.left -= evaluation_cost(len(score), REPLICAS)
        if self.left < -1e-9:
            raise RuntimeError(f"asked for more than {self.evaluations} evaluations")
        self._keep(point, estimate(score), spared=False)
        if figure is not None:
            self.figures.append(estimate(figure))
        return self.penalised(-1)

    def ask_geometry_first(
        self, point: np.ndarray, first_replicas: int, is_sure: bool = False
    ) -> tuple[float, float]:
        """As `ask`, unless geometry alone shows that the point is no better than the best."""
        bound = self.problem.bound(point) if self.problem.bound and self.scores else np.inf
        if bound < self._best_low:
            self._keep(point, Estimate(bound, 0.0), spared=True)
            return bound, 0.0
        before = self.left
        return self.ask(point, first_replicas, is_sure), before - self.left

    @property
    def _best_low(self) -> float:
        """The highest lower end of the intervals of what is within the limit, as in studies."""
        lows = (
            one.low
            for k, one in enumerate(self.scores)
            if not self.figures or self.figures[k].value <= 0.0
        )
        return max(lows, default=-np.inf)

    def _keep(self, point: np.ndarray, score: Estimate, spared: bool) -> None:
        self.points.append(point)
        self.scores.append(score)
        self.spared.append(spared)

    def penalised(self, k: int) -> float:
        penalty = expected_violation(self.figures[k], LIMIT["figure"]) if self.figures else 0.0
        return self.scores[k].value - penalty

    def seen(self) -> Observations:
        """What a model learns from."""
        figures = ()
        if self.figures:
            figures = (LimitedFigure(*_values(self.figures), -np.inf, 0.0),)
        spared = np.array(self.spared)
        return Observations(*_values(self.scores), ~spared, figures, spared)

    def answer(self) -> np.ndarray:
        """The best of the confirmed candidates, or the start."""
        penalised = [self.penalised(k) for k in range(len(self.points))]
        luckiest = self.points[int(np.argmax(penalised))]
        model = SearchModel(self.problem.domain, np.array(self.points), self.seen())
        found = []
        for point in (self.start, luckiest, *recommend_points(model, self.seed)):
            measured = self.problem.measure(point, (self.seed, FRESH), CONFIRM_REPLICAS)
            figures = {} if measured.figure is None else {"figure": estimate(measured.figure)}
            standing, _ = assess_feasibility(LIMIT if figures else {}, figures)
            found.append((standing, estimate(measured.score), point))
        allowed = [one for one in found if one[0] != INFEASIBLE]
        best = max(allowed, key=lambda one: (one[0] == FEASIBLE, one[1].value), default=found[0])
        return best[2]


def _values(estimates: Sequence[Estimate]) -> tuple[np.ndarray, np.ndarray]:
    """Values (n,) and their squared standard errors (n,)."""
    samples = [one.pseudovalues for one in estimates]
    spreads = np.array([np.var(one, ddof=1) if one else np.nan for one in samples])
    replicas = np.array([max(1, len(one)) for one in samples])
    return np.array([one.value for one in estimates]), moderate_variances(spreads, replicas)


Optimizer = Callable[[Record], None]
"""optimizer(record) asks the record."""


def ours_with(is_sure: bool = False, **settings: Any) -> Optimizer:
    def search(record: Record) -> None:
        optimizer = schema.Optimizer(evaluations=record.evaluations, seed=record.seed, **settings)
        points = PointSearch(record.start, optimizer, record.seen, record.problem.domain)
        running: deque[np.ndarray] = deque()
        while (point := points.ask()) is not None or running:
            if point is not None:
                running.append(point)
                continue
            few = optimizer.first_replicas
            told = record.ask_geometry_first(running.popleft(), few, is_sure)
            points.tell(*told)

    return search


def sobol(record: Record) -> None:
    from scipy.stats.qmc import Sobol

    record.ask(record.start)
    spread = Sobol(len(record.start), seed=record.seed)
    for point in spread.random_base2(record.evaluations.bit_length())[: record.evaluations - 1]:
        record.ask(point)


def cma_es(record: Record) -> None:
    import cma

    options = {"bounds": [0, 1], "seed": record.seed + 1, "verbose": -9}
    search = cma.CMAEvolutionStrategy(record.start, 0.25, options)
    while (left := record.evaluations - len(record.points)) > 0:
        asked = search.ask()
        answers = [-record.ask(np.asarray(point)) for point in asked[:left]]
        if left < len(asked):  # the last generation is cut short by the budget
            break
        search.tell(asked, answers)


def optuna_with(sampler: str, first_replicas: int = 0) -> Optimizer:
    def search(record: Record) -> None:
        import optuna

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        warnings.simplefilter("ignore", FutureWarning)
        axes = record.problem.axes

        def suggest(trial: Any) -> np.ndarray:
            point = np.empty(len(axes))
            for k, (levels, ordered, *_) in enumerate(axes):
                if not levels:
                    point[k] = trial.suggest_float(f"x{k}", 0.0, 1.0)
                elif ordered:
                    point[k] = trial.suggest_int(f"x{k}", 0, levels - 1) / (levels - 1)
                else:
                    choice = trial.suggest_categorical(f"x{k}", list(range(levels)))
                    point[k] = choice / (levels - 1)
            return point

        has_limit = record.problem.figure is not None
        limits = {"constraints_func": lambda one: (one.user_attrs["figure"],)} if has_limit else {}
        study = optuna.create_study(
            direction="maximize",
            sampler=getattr(optuna.samplers, sampler)(seed=record.seed, **limits),
        )
        levels = [axis.levels for axis in axes]
        first = [
            round(x * (n - 1)) if n else float(x) for x, n in zip(record.start, levels, strict=True)
        ]
        study.enqueue_trial({f"x{k}": x for k, x in enumerate(first)})
        while record.left > 1.0 - 1e-9:
            trial = study.ask()
            record.ask(suggest(trial), first_replicas)
            if record.figures:
                trial.set_user_attr("figure", record.figures[-1].value)
            study.tell(trial, record.scores[-1].value)

    return search


def egobox(record: Record) -> None:
    import egobox as egx

    axes, has_limit = record.problem.axes, record.problem.figure is not None
    kinds = [
        egx.XSpec(egx.XType.FLOAT, [0.0, 1.0])
        if not levels
        else egx.XSpec(egx.XType.INT, [0, levels - 1])
        if ordered
        else egx.XSpec(egx.XType.ENUM, [levels])
        for levels, ordered, *_ in axes
    ]
    scale = np.array([max(1, axis.levels - 1) for axis in axes], dtype=float)

    def ask(at: np.ndarray) -> list[float]:
        record.ask(at / scale)
        limited = [record.figures[-1].value] if has_limit else []
        return [-record.scores[-1].value, *limited]

    count = max(5, round(0.3 * record.evaluations))
    spread = egx.sampling(kinds, count, seed=record.seed)
    asked = [record.start * scale, *spread]
    answers = [ask(np.asarray(one)) for one in asked]
    egor = egx.Egor(kinds, n_cstr=int(has_limit), seed=record.seed)
    while len(record.points) < record.evaluations:
        for one in egor.suggest(np.array(asked), np.array(answers)):
            asked.append(np.asarray(one))
            answers.append(ask(np.asarray(one)))


OPTIMIZERS: dict[str, Optimizer] = {
    "ours": ours_with(),
    "ours-sure": ours_with(is_sure=True),
    "ours-whole": ours_with(first_replicas=0),
    "optuna-gp": optuna_with("GPSampler"),
    "optuna-raced": optuna_with("GPSampler", schema.Optimizer().first_replicas),
    "optuna-tpe": optuna_with("TPESampler"),
    "cma-es": cma_es,
    "sobol": sobol,
    "egobox": egobox,
    # Ours too.
    "nlopt-mlsl": ours_with(algorithm="GN_MLSL_LDS", first_replicas=0),
    **{f"batch-{count}": ours_with(batch=count) for count in (1, 2, 4, 8)},
}


@cache
def find_problem(name: str) -> Problem:
    kind, _, seed = name.partition(" ")
    return drawn_problem(int(seed)) if kind == "drawn" else problems()[name]


def run(problem_name: str, name: str, evaluations: int, seed: int) -> dict[str, Any]:
    """One search and the regret of its answer."""
    from threadpoolctl import threadpool_limits

    began, problem = time.process_time(), find_problem(problem_name)
    record = Record(problem, seed, evaluations)
    with threadpool_limits(limits=1):
        OPTIMIZERS[name](record)
        answer = record.answer()
    feasible = problem.is_feasible(answer)
    truth = problem.truth(answer if feasible else record.start)
    return {
        "problem": problem_name,
        "optimizer": name,
        "evaluations": evaluations,
        "seed": seed,
        "regret": problem.best - truth,
        "feasible": feasible,
        "cpu_s": time.process_time() - began,
    }


def table(runs: Sequence[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Mean regret of each optimiser on each problem with each budget."""
    groups: dict[tuple[str, int, str], list[dict[str, Any]]] = {}
    for one in runs:
        key = one["problem"], one["evaluations"], one["optimizer"]
        groups.setdefault(key, []).append(one)
    for (problem, evaluations, optimizer), some in groups.items():
        regret = np.array([one["regret"] for one in some])
        error = regret.std(ddof=1) / np.sqrt(len(some)) if len(some) > 1 else np.nan
        yield {
            "problem": problem,
            "optimizer": optimizer,
            "evaluations": evaluations,
            "seeds": len(some),
            "mean_regret": round(float(regret.mean()), 5),
            "standard_error": round(float(error), 5),
            "feasible": round(float(np.mean([one["feasible"] for one in some])), 3),
            "cpu_s": round(float(np.mean([one["cpu_s"] for one in some])), 2),
        }


def ratios(runs: Sequence[dict[str, Any]], ours: str = "ours") -> Iterator[dict[str, Any]]:
    """Regret of ours over that of each other, over all problems, with 95 % bootstrap intervals.

    The ratio of the mean regrets on each problem; their geometric mean over the problems. Seeds are
    drawn again, the same for both, as they have the same starts and the same noise.
    """
    names = sorted({one["optimizer"] for one in runs})
    known = {
        (one["problem"], one["evaluations"], one["optimizer"], one["seed"]): one["regret"]
        for one in runs
    }
    budgets, seeds = (sorted({one[key] for one in runs}) for key in ("evaluations", "seed"))
    places = list(dict.fromkeys(one["problem"] for one in runs))
    rng = np.random.default_rng(0)
    for budget, other in product(budgets, names):
        if other == ours or ours not in names:
            continue
        both = np.array(
            [[[known[p, budget, o, s] for s in seeds] for o in (ours, other)] for p in places]
        )
        drawn = rng.integers(0, len(seeds), (2_000, len(places), len(seeds)))
        logs = _log_ratio(both.mean(axis=2)).mean()
        again = np.stack(
            [both[k][:, drawn[:, k]].mean(axis=2) for k in range(len(places))], axis=0
        )  # (problem, 2, draw)
        spread = _log_ratio(again).mean(axis=0)
        low, high = np.quantile(spread, (0.025, 0.975))
        lowest = sum(bool(one[0] <= one[1]) for one in both.mean(axis=2))
        yield {
            "evaluations": budget,
            "against": other,
            "ratio": round(float(np.exp(logs)), 3),
            "low": round(float(np.exp(low)), 3),
            "high": round(float(np.exp(high)), 3),
            "ours_lower_on": f"{lowest} of {len(places)}",
        }


def _log_ratio(pairs: np.ndarray) -> np.ndarray:
    """log of ours over the other's, of (problem, 2, ...); regrets below 1e-3 count as 1e-3."""
    ratio: np.ndarray = np.diff(-np.log(np.maximum(pairs, 1e-3)), axis=1)[:, 0]
    return ratio


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", help=f"names with commas, of {', '.join(OPTIMIZERS)}")
    parser.add_argument("--problem", default="", help="only those whose names begin so")
    parser.add_argument("--aside", action="store_true", help="only the problems kept aside")
    parser.add_argument("--drawn", type=int, default=0, help="so many drawn problems instead")
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument(
        "--first-seed", type=int, default=0, help="develop on some seeds, report on others"
    )
    parser.add_argument("--evaluations", default=",".join(map(str, EVALUATIONS)))
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--write", help="name of the tables in results/; else only shown")
    asked = parser.parse_args()
    names = asked.only.split(",") if asked.only else ["ours", *OTHERS]
    if unknown := [name for name in names if name not in OPTIMIZERS]:
        parser.error(f"--only {', '.join(unknown)}: none of {', '.join(OPTIMIZERS)}")
    known = [name for name in problems() if asked.aside == (name in ASIDE)]
    if asked.drawn:
        known = [f"drawn {seed}" for seed in range(asked.drawn)]
    chosen = [name for name in known if name.startswith(asked.problem)]
    budgets = [int(one) for one in asked.evaluations.split(",")]
    seeds = range(asked.first_seed, asked.first_seed + asked.seeds)
    with ProcessPoolExecutor(asked.workers) as pool:
        runs = list(pool.map(run, *zip(*product(chosen, names, budgets, seeds), strict=True)))
    rows = list(table(runs))
    print_table(rows)
    if asked.write:
        print(f"written to {write_csv(f'{asked.write}.csv', rows)}")
    if "ours" in names and len(names) > 1:
        against = list(ratios(runs))
        print_table(against)
        if asked.write:
            print(f"written to {write_csv(f'{asked.write}_ratios.csv', against)}")


if __name__ == "__main__":
    main()
