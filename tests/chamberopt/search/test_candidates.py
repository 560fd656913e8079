"""Scores of candidates, and the number of replicas that each candidate gets."""

import shutil
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import estimate
from chamberopt.common.executor import SerialExecutor
from chamberopt.search.study import Study
from chamberopt.search.trial_log import read_trials
from tests.helpers.known_optima import GEAR, NO_FRILLS, VARY, bowl, bowl_shares, run_bowl
from tests.helpers.studies import assert_total_never_grows, run_in_folder
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


def test_a_search_takes_few_replicas_and_a_confirmation_more_for_close_calls(
    tmp_path: Path,
) -> None:
    asked: list[tuple[str, int | None]] = []
    progress: list[tuple[int, int, float | None]] = []

    def simulator(design, stream, replicas):
        asked.append((stream, replicas))
        count = replicas or design.process.accuracy.replicas
        rng = np.random.default_rng(np.frombuffer(bowl_shares(design).tobytes(), dtype=np.uint32))
        return judged(bowl(bowl_shares(design)) + rng.normal(0.0, 0.02, count))

    settings = {"first_replicas": 4, "confirm_rounds": 3, "evaluations": 12}
    told = lambda *now: progress.append(now)  # noqa: E731
    result = run_bowl(tmp_path, simulator, settings, progress=told)
    assert_total_never_grows(progress)
    searched = [one for one in read_trials(tmp_path) if one.stage == "search"]
    assert [one.replicas for one in searched] == [8, *[4] * (len(searched) - 1)]
    assert len(searched) > 12  # they cost less than a whole evaluation
    confirmed = [replicas for stream, replicas in asked if stream == "confirm"]
    assert confirmed[:3] == [4, 4, 4]
    assert 8 in confirmed
    best, start = (one.evaluation.objective.pseudovalues for one in (result.best, result.start))
    assert len(best) == len(start) == max(confirmed)  # pair by pair, as the gain needs


def test_confirmations_end_early_where_more_replicas_would_tell_nothing(tmp_path: Path) -> None:
    """Above half of the bounds nearly all of the interval is in all replicas, below nothing."""
    asked: list[tuple[str, int, bool]] = []

    def simulator(design, stream, replicas):
        count, high = replicas or design.process.accuracy.replicas, bowl_shares(design)[0] > 0.5
        asked.append((stream, count, high))
        made = judged(bowl(bowl_shares(design)) + 0.001 * np.resize([-1.0, 1.0], count))
        shared = [0.01] if high else []
        return replace(made, objective=estimate(made.objective.pseudovalues, shared=shared))

    settings = {"first_replicas": 4, "confirm_replicas": 16, "evaluations": 12}
    run_bowl(tmp_path, simulator, settings)
    assert {count for stream, count, high in asked if high and stream == "confirm"} <= {4}
    assert {count for stream, count, high in asked if not high and stream == "confirm"} == {4, 16}


def test_what_few_replicas_do_not_tell_gets_all(tmp_path: Path) -> None:
    """Above half of the bounds four replicas tell no number, and eight do."""

    def simulator(design, stream, replicas):
        count, high = replicas or design.process.accuracy.replicas, bowl_shares(design)[0] > 0.5
        made = judged(bowl(bowl_shares(design)) + 0.001 * np.resize([-1.0, 1.0], count))
        if high and count < 8:
            made = replace(made, objective=made.objective.not_known("not resolved"))
        return made

    result = run_bowl(tmp_path, simulator, {"first_replicas": 4, "evaluations": 12})
    searched = [one for one in result.trials if one.stage == "search"][1:]  # the start gets all
    assert all(one.replicas == (8 if one.point[0] > 0.5 else 4) for one in searched)
    assert result.ended_early == sum(one.replicas == 4 for one in searched) > 0


def test_a_search_ends_where_nothing_is_left_to_gain(tmp_path: Path) -> None:
    """The bowl is 0.98 high. Flat enough, its model tells; in the steep one all is spent."""

    def simulator(design, stream, replicas):
        noise = 1e-4 * np.array([-1.0, 0.0, 1.0])
        return judged(slope * bowl(bowl_shares(design)) + noise, time_to_98_s=30.0)

    slope = 0.005
    flat = run_bowl(tmp_path / "flat", simulator, {"evaluations": 40})
    searched = [one for one in flat.trials if one.stage == "search"]
    assert flat.ended_by == "gain"
    assert 8 <= len(searched) < 20  # four for each parameter are there before a model tells
    assert 0.0 < flat.possible_gain < flat.counts == 0.01
    (note,) = flat.notes
    assert note.startswith(
        f"nothing left to gain here: the search ended after {len(searched)} candidates, as nothing "
    )
    assert "less than 0.01 does not count" in note
    assert "full coverage after 30 of 120 s: ask for the shortest time" in note
    slope = 1.0
    steep = run_bowl(tmp_path / "steep", simulator, {"evaluations": 12})
    assert steep.ended_by == "budget"
    assert steep.notes == ()
    # resumed, it ends where it ended
    history = (tmp_path / "flat" / "history.jsonl").read_text().splitlines(keepends=True)
    slope, cut = 0.005, tmp_path / "cut"
    shutil.copytree(tmp_path / "flat", cut)
    for left in (len(searched), 5):
        (cut / "history.jsonl").write_text("".join(history[:left]))
        again = run_bowl(cut, simulator, {"evaluations": 40})
        assert (again.trials, again.notes) == (flat.trials, flat.notes)


def test_the_unit_of_the_objective_decides_what_counts(tmp_path: Path) -> None:
    """Ten times the objective, ten times the gain: the search ends after the same candidates."""

    def ended_after(weight: float) -> int:
        def simulator(design, stream, replicas):
            return judged(weight * (0.02 * bowl(bowl_shares(design)) + np.array([0.0, 1e-4, 2e-4])))

        tables = {"objective": {"sum": {"mean_coverage": weight}}}
        done = run_bowl(tmp_path / f"{weight:g}", simulator, {"evaluations": 30}, **tables)
        assert done.ended_by == "gain"
        return sum(one.stage == "search" for one in done.trials)

    assert ended_after(1.0) == ended_after(10.0)


def test_a_start_as_good_as_can_be_ends_the_search_at_once(tmp_path: Path) -> None:
    def simulator(design, stream, replicas):
        return judged(np.full(3, 0.995), time_to_98_s=500.0)

    for batch in (1, 3):
        done = run_bowl(tmp_path / f"{batch}", simulator, {"batch": batch})
        assert done.ended_by == "gain"
        assert sum(one.stage == "search" for one in done.trials) == batch
        assert done.possible_gain == pytest.approx(0.005)
        assert done.notes[0].endswith("vary other parameters, or widen [vary]")


@pytest.mark.parametrize("size", [1.0, 60.0])
def test_the_shortest_time_that_meets_a_limit(tmp_path: Path, size: float) -> None:
    """By Avrami's law the mean is 1 - exp(-k T): 0.95 takes ln 20 / k, the least at the bowl's end.

    With the time in another unit it is the same search.
    """
    vary = VARY | {"process.treatment_time_s": (40.0 * size, 200.0 * size)}
    rate = 0.05 / size  # 1/s where the bowl is 0.8: 74.9 s

    def simulator(design, stream, replicas):
        time = design.process.treatment_time
        mean = -np.expm1(-rate * bowl(bowl_shares(design)) * time)
        made = judged(np.full(3, -time), mean_coverage=mean)
        near = mean + 1e-4 * np.array([-1.0, 0.0, 1.0])
        return replace(made, metrics={**made.metrics, "mean_coverage": estimate(near)})

    study = Study(
        design=GEAR.changed({"process.treatment_time_s": 120.0 * size}),
        vary=vary,
        objective={"name": "minus_treatment_time_s"},
        constraints={"mean_coverage": {"min": 0.95}},
        optimizer={"evaluations": 30, "confirm": 4, "confirm_replicas": 4, **NO_FRILLS},
    )
    result = run_in_folder(study, tmp_path, SerialExecutor(), None, simulator)
    least = np.log(20.0) / (0.8 * rate)
    assert result.best.feasible
    assert least < result.best.design.process.treatment_time < 1.1 * least
    assert result.gain.value == pytest.approx(
        120.0 * size - result.best.design.process.treatment_time
    )


def test_nothing_gained_by_a_spent_budget_is_said(tmp_path: Path) -> None:
    def simulator(design, stream, replicas):
        return judged(np.full(3, 0.005 * bowl(bowl_shares(design))))

    done = run_bowl(tmp_path, simulator, {"evaluations": 6})
    assert done.ended_by == "budget"
    (note,) = done.notes
    assert note.startswith("nothing left to gain here: no confirmed candidate is better than the")


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
