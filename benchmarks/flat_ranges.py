"""Does a parameter lose no more than the noise within the range that a study says of it?

    python benchmarks/flat_ranges.py --seeds 6

Each search of 20 evaluations on the problems of noisy_problems.py without a limit gets its ranges
(search/sensitivity.py). A range is kept if the true score loses no more than the noise anywhere in
it. Some minutes.
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.noisy_problems import Problem, problems
from benchmarks.optimizers import CONFIRM_REPLICAS, FRESH, Record, ours_with
from benchmarks.table import print_table
from chamberopt.common.estimate import estimate
from chamberopt.search.optimiser.search_model import SearchModel
from chamberopt.search.sensitivity import NORMAL_95, flat_range

EVALUATIONS, POINTS = 20, 41


def ranges_of(problem: Problem, seed: int) -> list[tuple[float, float]]:
    """Width of each parameter's range, as a share of its bounds, and its true loss over noise."""
    record = Record(problem, seed, EVALUATIONS)
    ours_with()(record)
    model = SearchModel(problem.domain, np.array(record.points), record.seen(), learns_bounds=True)
    best = record.answer()
    confirmed = problem.measure(best, (seed, FRESH), CONFIRM_REPLICAS).score
    least = NORMAL_95 * float(model.score(best[None])[1][0])
    noise = max(estimate(confirmed).half_width, least)
    found = []
    for i in range(len(best)):
        begin, end = flat_range(model, best, i, noise)
        line = np.repeat(best[None], POINTS, axis=0)
        line[:, i] = np.linspace(begin, end, POINTS)
        loss = max(problem.truth(best) - problem.truth(one) for one in problem.domain.snap(line))
        found.append((end - begin, loss / noise))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=6)
    seeds = parser.parse_args().seeds
    rows, everything = [], []
    for name, problem in problems().items():
        if problem.figure is not None:
            continue
        found = [one for seed in range(seeds) for one in ranges_of(problem, seed)]
        everything += found
        rows.append({"problem": name, **_summary(found)})
    print_table([*rows, {"problem": "all", **_summary(everything)}])


def _summary(found: list[tuple[float, float]]) -> dict[str, float]:
    width, loss = np.array(found).T
    kept = float((loss <= 1.0 + 1e-9).mean())
    return {"kept": round(kept, 3), "width": round(float(width.mean()), 2),
            "largest_loss": round(float(loss.max()), 1)}  # fmt: skip


if __name__ == "__main__":
    main()
