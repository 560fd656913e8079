"""Is nothing left to gain where a search ends because it says so?

    python benchmarks/stopping.py --seeds 5

Searches of 40 evaluations on the problems of noisy_problems.py, without what geometry tells, and
with scores and noise made smaller, so that a gain of 0.01 soon is all there is. Where the search
ends by itself, the best true score of all that it evaluated is compared with the highest there is.
Some minutes.
"""

from __future__ import annotations

import argparse
from collections import deque
from dataclasses import replace

import numpy as np

from benchmarks.noisy_problems import Problem, problems
from benchmarks.optimizers import Record
from benchmarks.table import print_table
from chamberopt.search.judge import COUNTS
from chamberopt.search.optimiser.point_search import PointSearch
from chamberopt.search.study import schema

EVALUATIONS, SCALES = 40, (0.05, 0.1, 0.2, 1.0)


def scaled(problem: Problem, scale: float) -> Problem:
    noise = problem.noise
    return replace(
        problem,
        truth=lambda x: scale * problem.truth(x),
        best=scale * problem.best,
        noise=(lambda x: scale * noise(x)) if callable(noise) else scale * noise,
        bound=None,
    )


def ended(problem: Problem, seed: int) -> tuple[bool, int, float]:
    """Whether the search ended by itself, after how many candidates, and what was left to gain."""
    record = Record(problem, seed, EVALUATIONS)
    optimizer = schema.Optimizer(evaluations=EVALUATIONS, seed=seed)
    search = PointSearch(
        record.start, optimizer, lambda: replace(record.seen(), counts=COUNTS), problem.domain
    )
    running: deque[np.ndarray] = deque()
    while (point := search.ask()) is not None or running:
        if point is not None:
            running.append(point)
            continue
        search.tell(*record.ask_geometry_first(running.popleft(), optimizer.first_replicas))
    reached = [problem.truth(x) for x in record.points if problem.is_feasible(x)]
    left = problem.best - max(reached, default=problem.truth(record.start))
    return search.ended_by == "gain", len(record.points), left


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=5)
    seeds, rows = parser.parse_args().seeds, []
    for scale in SCALES:
        of_all = [
            ended(scaled(problem, scale), seed)
            for problem in problems().values()
            for seed in range(seeds)
        ]
        by_itself = [one for one in of_all if one[0]]
        rows.append(
            {
                "scores times": scale,
                "searches": len(of_all),
                "ended by themselves": len(by_itself),
                "after candidates": np.mean([one[1] for one in by_itself]) if by_itself else "-",
                "more was left": sum(one[2] > COUNTS for one in by_itself),
            }
        )
    print_table(rows)


if __name__ == "__main__":
    main()
