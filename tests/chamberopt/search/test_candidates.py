"""Scores of candidates, and the number of replicas that each candidate gets."""

import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import estimate
from chamberopt.search.trial_log import read_trials
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
    searched = [one for one in read_trials(tmp_path) if one.stage == "search"]
    assert {one.replicas for one in searched} == {4, 8}
    bar = max(t.objective.low for t in result.trials if t.stage == "search")
    assert all(one.objective.value < bar for one in searched if one.replicas == 4)
    confirmed = [replicas for stream, replicas in asked if stream == "confirm"]
    assert confirmed[:3] == [4, 4, 4]
    assert 8 in confirmed
    best, start = (one.evaluation.objective.pseudovalues for one in (result.best, result.start))
    assert len(best) == len(start) == max(confirmed)  # pair by pair, as the gain needs


def test_candidates_end_early_where_more_replicas_would_tell_nothing(tmp_path: Path) -> None:
    """Above half of the bounds nearly all of the interval is in all replicas, below nothing."""
    asked: list[tuple[str, int, bool]] = []

    def simulator(design, stream, replicas):
        count, high = replicas or design.process.accuracy.replicas, bowl_shares(design)[0] > 0.5
        asked.append((stream, count, high))
        made = judged(bowl(bowl_shares(design)) + 0.001 * np.resize([-1.0, 1.0], count))
        shared = [0.01] if high else []
        return replace(made, objective=estimate(made.objective.pseudovalues, shared=shared))

    settings = {"first_replicas": 4, "confirm_replicas": 16, "evaluations": 12}
    result = run_bowl(tmp_path, simulator, settings)
    assert {count for stream, count, high in asked if high and stream == "confirm"} <= {4}
    searched = [one for one in result.trials if one.stage == "search"][1:]  # the start gets all
    early = [one for one in searched if one.replicas == 4]
    assert result.ended_early == len(early) > 0
    assert len(searched) > 11  # they cost less than a whole evaluation
    assert all(one.replicas == 4 for one in searched if one.point[0] > 0.5)
    assert any(one.replicas == 8 for one in searched)


def test_a_study_says_that_nothing_is_left_to_gain(tmp_path: Path) -> None:
    def simulator(design, stream, replicas):
        return judged(np.full(3, slope * bowl(bowl_shares(design))), time_to_98_s=30.0)

    slope = 0.02  # no candidate is better by more
    (note,) = run_bowl(tmp_path / "flat", simulator, {"evaluations": 6}).notes
    assert note.startswith("nothing left to gain here: no confirmed candidate is better")
    assert note.endswith("(study.toml of chamberopt new): it has full coverage after 30 of 120 s")
    slope = 1.0
    steep = run_bowl(tmp_path / "steep", simulator, {"evaluations": 6})
    assert not any("nothing left" in note for note in steep.notes)


def test_a_batch_gives_the_same_trials_whichever_ends_first(tmp_path: Path) -> None:
    """Three at a time, delayed at random: proposals and replicas follow from the record alone."""

    def run_with_delays(name: str, seed: int, at_once: int | None = None) -> tuple[bytes, int]:
        delays, lock = np.random.default_rng(seed), threading.Lock()
        now, most = [0], [0]

        def simulator(design, stream, replicas):
            with lock:
                now[0] += 1
                most[0] = max(most[0], now[0])
                delay = delays.uniform(0.0, 0.02)
            time.sleep(delay)
            x, count = bowl_shares(design), replicas or design.process.accuracy.replicas
            rng = np.random.default_rng(np.frombuffer(x.tobytes(), dtype=np.uint32))
            made = judged(bowl(x) + rng.normal(0.0, 0.02, count))
            with lock:
                now[0] -= 1
            if x[0] > 0.95:
                raise InputError("too high")
            return made

        settings = {"batch": 3, "first_replicas": 4, "confirm_rounds": 3, "evaluations": 18}
        run_bowl(tmp_path / name, simulator, settings, at_once=at_once)
        return (tmp_path / name / "history.jsonl").read_bytes(), most[0]

    first, at_a_time = run_with_delays("first", 1)
    assert at_a_time == 3
    assert run_with_delays("second", 2) == (first, 3)
    assert run_with_delays("third", 3, at_once=1) == (first, 1)  # less memory: the others wait


def test_reach_alone_spares_simulations_and_costs_no_evaluation(tmp_path: Path) -> None:
    """Above half of the bounds a third of the target is out of reach: at most 0.667 - 0.471."""

    class Simulator:
        simulated = 0

        def reachable(self, design) -> float:
            return 1.0 if bowl_shares(design)[0] < 0.5 else 2.0 / 3.0

        def __call__(self, design, stream, replicas):
            assert stream == "confirm" or not self.simulated or self.reachable(design) == 1.0
            self.simulated += stream == "search"
            return judged(np.full(3, bowl(bowl_shares(design))))

    simulator = Simulator()
    result = run_bowl(tmp_path, simulator)
    spared = [trial for trial in result.trials if trial.highest is not None]
    assert simulator.simulated == 16
    assert spared
    assert all(t.highest == t.score == pytest.approx(2 / 3 - np.sqrt(2) / 3) for t in spared)
    assert "out of reach of the balls" in spared[0].reason
    assert bowl_shares(result.best.design)[0] < 0.5
    assert bowl(bowl_shares(result.best.design)) > 0.73  # 0.76 is the best there


def test_designs_to_begin_with_come_after_the_start(tmp_path: Path) -> None:
    values = {"chamber.height_mm": 52.0, "shot.mass_g": 4.5}

    def simulator(design, stream, replicas):
        return judged(np.full(3, bowl(bowl_shares(design))))

    result = run_bowl(tmp_path, simulator, {"evaluations": 6}, begin_with=[values])
    assert result.trials[1].parameters == values
    assert len([trial for trial in result.trials if trial.stage == "search"]) == 6
