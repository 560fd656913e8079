"""Scores of candidates, and the number of replicas that each candidate gets."""

from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.optimize.storage.trial_log import read_trials
from tests.helpers.known_optima import bowl, bowl_shares, run_bowl
from tests.helpers.synthetic import judged


def test_scores_suit_objectives_of_any_size(tmp_path: Path) -> None:
    """Seconds instead of shares: what fails must still look worse than what does not."""

    def simulator(design, stream, replicas):
        x = bowl_shares(design)
        if x[0] > 0.9:
            raise InputError("too high")
        seconds = 1000.0 - 800.0 * bowl(x)
        made = judged(np.full(3, -seconds), time_to_98_s=seconds)
        return made

    result = run_bowl(tmp_path, simulator, objective={"name": "minus_time_to_98_s"})
    failed = [trial.score for trial in result.trials if trial.objective is None]
    assert failed
    assert max(failed) < min(trial.score for trial in result.trials if trial.objective)
    assert bowl(bowl_shares(result.best.design)) > 0.79


def test_the_plainly_bad_get_few_replicas_and_close_calls_more(tmp_path: Path) -> None:
    asked: list[tuple[str, int | None]] = []

    def simulator(design, stream, replicas):
        asked.append((stream, replicas))
        count = replicas or design.process.accuracy.replicas
        rng = np.random.default_rng(np.frombuffer(bowl_shares(design).tobytes(), dtype=np.uint32))
        return judged(bowl(bowl_shares(design)) + rng.normal(0.0, 0.02, count))

    result = run_bowl(
        tmp_path, simulator, {"first_replicas": 4, "confirm_rounds": 3, "evaluations": 12}
    )
    rows = read_trials(tmp_path)
    assert {row["replicas"] for row in rows if row["stage"] == "search"} == {4, 8}
    bar = max(t.objective.low for t in result.trials if t.stage == "search")
    few = [row for row in rows if row["stage"] == "search" and row["replicas"] == 4]
    assert all(row["objective"] < bar for row in few)
    confirmed = [replicas for stream, replicas in asked if stream == "confirm"]
    assert confirmed[:3] == [4, 4, 4]
    assert 8 in confirmed
    best, start = (one.evaluation.objective.pseudovalues for one in (result.best, result.start))
    assert len(best) == len(start) == max(confirmed)  # pair by pair, as the gain needs
