"""A study on functions with a known optimum must find it within its budget, even if interrupted."""

import json
from dataclasses import replace
from pathlib import Path
from weakref import ref

import numpy as np
import pytest

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.scene import require_ball_count
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import NOT_RESOLVED
from chamberopt.common.executor import SerialExecutor, local_executor
from chamberopt.common.files import make_output_folder
from chamberopt.coverage.metrics import metric_names
from chamberopt.design.load import load_design
from chamberopt.results.load import load_result
from chamberopt.search.ask_and_tell import most_evaluations
from chamberopt.search.judge import FAILURE_PENALTY
from chamberopt.search.run_study import ChamberSimulator, fixed_target, tolerance_notes
from chamberopt.search.study import Limits, Study, load_study
from chamberopt.search.trial_log import read_trials, trials_as_csv
from chamberopt.workflows.save_run import save_study
from tests.helpers.known_optima import OPTIMUM, PEAK, hill
from tests.helpers.studies import assert_total_never_grows, run_in_folder
from tests.helpers.synthetic import DESIGNS, judged, plate_design

GEAR = load_design(DESIGNS / "gear.toml")
BOUNDS = {
    "chamber.height_mm": (35.0, 60.0),
    "chamber.sonotrode_distance_mm": (5.0, 25.0),
    "shot.mass_g": (2.0, 10.0),
}


def shares(design) -> np.ndarray:
    low, high = np.array(list(BOUNDS.values())).T
    return (np.array([design.value(name) for name in BOUNDS]) - low) / (high - low)


def analytic(noise: float, calls: list | None = None, seed: int = 0):
    """A simulator whose replicas scatter around the hill.

    The same seeds always draw the same noise.
    """

    def simulator(design, stream, replicas):
        x = shares(design)
        if calls is not None:
            calls.append((stream, x))
        rng = np.random.default_rng([seed, int.from_bytes(x.tobytes(), "big") % 2**63, len(stream)])
        scatter = noise * np.sqrt(8) * rng.normal(size=replicas or 8)
        return judged(hill(x) + scatter, mean_coverage=float(x[2]))

    return simulator


def study(**optimizer) -> Study:
    # One call of the simulator a candidate, and one after another.
    plain = {"first_replicas": 0, "confirm_rounds": 1, "batch": 1}
    settings = {"evaluations": 40, "confirm": 3, "confirm_replicas": 16, **plain, **optimizer}
    return Study(design=GEAR, vary=BOUNDS, optimizer=settings)


def run(question: Study, folder: Path, simulator, progress=None):
    return run_in_folder(question, folder, SerialExecutor(), progress, simulator)


def test_finds_a_known_optimum(tmp_path: Path) -> None:
    result = run(study(), tmp_path, analytic(0.0))
    assert hill(shares(result.start.design)) < PEAK - 0.05
    assert hill(shares(result.best.design)) > PEAK - 0.005
    assert result.gain.value == pytest.approx(hill(shares(result.best.design)) - hill(shares(GEAR)))
    assert result.improved
    assert result.ended_by == "gain"  # without noise the model soon knows where the hill ends
    assert len([t for t in result.trials if t.stage == "search"]) < 40
    assert PEAK - max(t.objective.value for t in result.trials) < result.counts


@pytest.mark.long
def test_finds_a_known_optimum_in_noise(tmp_path: Path) -> None:
    # The noise is 0.02 on a hill that rises 0.1 from the start. The mean regret measured over 12
    # seeds is 0.01.
    regrets, held = [], 0
    for seed in range(6):
        result = run(study(seed=seed), tmp_path / str(seed), analytic(0.02, seed=seed))
        true_gain = hill(shares(result.best.design)) - hill(shares(GEAR))
        regrets.append(PEAK - hill(shares(result.best.design)))
        held += result.gain.low <= true_gain <= result.gain.high
    assert np.median(regrets) < 0.02
    assert held >= 5


def test_one_parameter(tmp_path: Path) -> None:
    question = Study(design=GEAR, vary={"shot.mass_g": (2.0, 10.0)}, optimizer={"evaluations": 20})
    result = run(
        question,
        tmp_path,
        lambda design, s, n: judged(-abs(np.full(3, design.value("shot.mass_g") - 7))),
    )
    assert result.best.design.value("shot.mass_g") == pytest.approx(7.0, abs=0.3)


def test_a_candidate_that_cannot_be_built_is_a_penalty_with_a_reason(tmp_path: Path) -> None:
    good = analytic(0.0)

    def simulator(design, stream, replicas):
        if shares(design)[0] > 0.75:
            raise InputError("chamber.height_mm: too high for this test")
        return good(design, stream, replicas)

    result = run(study(), tmp_path, simulator)
    failed = [trial for trial in result.trials if trial.objective is None]
    assert failed
    assert all(
        t.reason == "chamber.height_mm: too high for this test" and not t.feasible for t in failed
    )
    assert hill(shares(result.best.design)) > PEAK - 0.02
    trials_as_csv(read_trials(tmp_path), {})  # rows without metrics are rows


def test_constraints_hold_for_the_answer(tmp_path: Path) -> None:
    # The hill's top is at 0.55 of the mass bounds; the constraint cuts it off at 0.4.
    question = study().model_copy(update={"constraints": {"mean_coverage": Limits(max=0.4)}})
    result = run(question, tmp_path, analytic(0.0))
    x = shares(result.best.design)
    assert x[2] <= 0.4
    assert hill(x) > hill(np.array([*OPTIMUM[:2], 0.4])) - 0.04
    assert any("mean coverage of the target" in trial.reason for trial in result.trials)


def test_constraints_nobody_meets_are_the_users_to_loosen(tmp_path: Path) -> None:
    question = study(evaluations=6).model_copy(
        update={"constraints": {"mean_coverage": Limits(min=3.0)}}
    )
    with pytest.raises(InputError, match=r"mean coverage of the target .* < min 3.*history\.jsonl"):
        run(question, tmp_path, analytic(0.0))
    assert len(read_trials(tmp_path)) == 7  # the search and the start's confirmation


def test_an_unusable_start_is_said_at_once(tmp_path: Path) -> None:
    def simulator(design, stream, replicas):
        raise InputError("part.mesh: gone")

    with pytest.raises(InputError, match=r"part\.mesh: gone"):
        run(study(), tmp_path, simulator)


@pytest.mark.parametrize("algorithm", ["auto", "GN_DIRECT_L", "GN_CRS2_LM", "LN_COBYLA"])
def test_other_errors_and_ctrl_c_pass_through_nlopt_unchanged(
    tmp_path: Path, algorithm: str
) -> None:
    for error in (KeyboardInterrupt(), ZeroDivisionError("a bug")):
        calls: list = []
        good = analytic(0.0, calls)

        def simulator(design, stream, replicas, good=good, calls=calls, error=error):
            if len(calls) == 5:
                raise error
            return good(design, stream, replicas)

        folder = tmp_path / type(error).__name__
        with pytest.raises(type(error)):
            run(study(algorithm=algorithm), folder, simulator)
        assert len(read_trials(folder)) == 5  # what was finished is on disk


def test_the_start_is_confirmed_on_the_same_fresh_seeds(tmp_path: Path) -> None:
    calls: list = []
    progress: list = []
    result = run(
        study(evaluations=20), tmp_path, analytic(0.01, calls), lambda *args: progress.append(args)
    )
    assert [stream for stream, _ in calls[:20]] == ["search"] * 20
    assert [stream for stream, _ in calls[20:]] == ["confirm"] * 4
    np.testing.assert_array_equal(calls[0][1], calls[20][1])
    np.testing.assert_array_equal(calls[0][1], shares(GEAR))
    assert_total_never_grows(progress)
    assert progress[0][1] == most_evaluations(study(evaluations=20))
    assert result.best in result.confirmed
    goals = [c.evaluation.objective.value for c in result.confirmed]
    assert result.best.evaluation.objective.value == max(goals)


def test_a_flat_function_gains_nothing(tmp_path: Path) -> None:
    result = run(study(evaluations=12), tmp_path, lambda *_: judged(np.array([0.5, 0.4, 0.6])))
    assert not result.improved
    assert (result.gain.value, result.gain.half_width) == (0.0, 0.0)
    assert result.best is result.start


def test_history_is_whole_rows_as_they_end(tmp_path: Path) -> None:
    result = run(study(evaluations=8), tmp_path, analytic(0.01))
    rows = read_trials(tmp_path)
    assert [one.number for one in rows] == list(range(len(rows)))
    assert rows[0].parameters == {name: GEAR.value(name) for name in BOUNDS}
    assert set(rows[0].metrics) == set(metric_names(GEAR))
    assert rows[3].objective == result.trials[3].objective
    table = trials_as_csv(rows, {}).splitlines()
    assert len(table) == len(rows) + 1
    assert table[0].startswith("number,stage,chamber.height_mm,")
    # A torn last line, left by a crash, is not a row; damage before it is said.
    path = tmp_path / "history.jsonl"
    text = path.read_text()
    path.write_text(text + '{"number": 99, "par')
    assert read_trials(tmp_path) == rows
    path.write_text("garbage\n" + text)
    with pytest.raises(InputError, match=r"history\.jsonl:1"):
        read_trials(tmp_path)


def test_what_was_asked_is_in_the_folder_first(tmp_path: Path) -> None:
    question = study(evaluations=5).model_copy(
        update={"constraints": {"mean_coverage": Limits(min=0.1)}}
    )
    run(question, tmp_path, analytic(0.0))
    again = load_study(tmp_path / "study.toml")
    assert again == question


def test_a_folder_in_use_is_refused(tmp_path: Path) -> None:
    (tmp_path / "precious.txt").write_text("keep me")
    with pytest.raises(InputError, match=r"already holds files.*--out"):
        run(study(), tmp_path, analytic(0.0))
    assert [path.name for path in tmp_path.iterdir()] == ["precious.txt"]
    with pytest.raises(InputError, match="is a file"):
        make_output_folder(tmp_path / "precious.txt")
    (tmp_path / "link").symlink_to("nowhere")
    with pytest.raises(InputError, match="is a link that leads nowhere"):
        make_output_folder(tmp_path / "link")


@pytest.mark.long
def test_the_real_thing_end_to_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Twice the amplitude hits harder and more often: even a study of seconds must see that.
    monkeypatch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
    design = plate_design(
        sonotrode__amplitude_um=15, process__accuracy__simulated_time_s=0.3,
        process__accuracy__warmup_time_s=0.05, process__accuracy__replicas=3,
        process__treatment_time_s=5,
    )  # fmt: skip
    question = Study(
        design=design,
        vary={"sonotrode.amplitude_um": (10.0, 40.0), "shot.mass_g": (2.0, 5.0)},
        optimizer={"evaluations": 8, "confirm": 2, "confirm_replicas": 4},
    )
    results = []
    for workers in (1, 2):
        with local_executor(workers) as executor:
            results.append(run_in_folder(question, tmp_path / str(workers), executor))
        assert save_study(tmp_path / str(workers), results[-1]) == []
    one, two = results
    assert [t.score for t in one.trials] == [
        t.score for t in two.trials
    ]  # whatever the number of workers
    assert one.improved
    assert one.best.design.sonotrode.amplitude_um > 20
    again = load_result(tmp_path / "1")
    assert again.design == one.best.design
    assert load_result(tmp_path / "1" / "start").objective == one.start.evaluation.objective
    assert {"chamber", "simulate", "coverage"} <= set(again.record.timings_s)


def test_history_rows_are_plain_json(tmp_path: Path) -> None:
    run(study(evaluations=4), tmp_path, analytic(0.01))
    for line in (tmp_path / "history.jsonl").read_text().splitlines():
        json.loads(line, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))


def with_search_accuracy(search_accuracy: dict, design=GEAR, **vary) -> Study:
    return Study(
        design=design,
        vary={**BOUNDS, **vary},
        optimizer={"evaluations": 12, "confirm": 2},
        search_accuracy=search_accuracy,
    )


def test_a_study_searches_at_search_accuracy_and_confirms_at_the_designs_own_accuracy(
    tmp_path: Path,
) -> None:
    seen = set()

    def simulator(design, stream, replicas):
        accuracy = design.process.accuracy
        seen.add(
            (stream, replicas, accuracy.simulated_time_s, accuracy.replicas, design.chamber.facets)
        )
        return judged(hill(shares(design)) + np.linspace(-0.01, 0.01, replicas or 4))

    found = run(
        with_search_accuracy({"replicas": 3, "simulated_time_s": 0.25, "facets": 16}),
        tmp_path / "out",
        simulator,
    )
    fine = GEAR.process.accuracy
    assert seen == {
        ("search", None, 0.25, 3, 16),
        ("confirm", 4, fine.simulated_time_s, fine.replicas, GEAR.chamber.facets),  # a first look
        ("confirm", 16, fine.simulated_time_s, fine.replicas, GEAR.chamber.facets),
    }
    assert found.best.design.process == GEAR.process


def test_an_accuracy_asked_for_is_what_confirms(tmp_path: Path) -> None:
    asked = GEAR.changed({"process.accuracy.max_replicas": 60})
    accuracy = asked.process.accuracy.model_copy(update={"objective_half_width": 0.01})
    asked = asked.model_copy(
        update={"process": asked.process.model_copy(update={"accuracy": accuracy})}
    )
    seen = set()

    def simulator(design, stream, replicas):
        seen.add((stream, replicas, design.process.accuracy.objective_half_width))
        return judged(hill(shares(design)) + np.linspace(-0.01, 0.01, replicas or 4))

    run(with_search_accuracy({"objective_half_width": 0.05}, asked), tmp_path / "out", simulator)
    assert seen == {("search", None, 0.05), ("confirm", None, 0.01)}


@pytest.mark.parametrize(
    ("vary", "corner", "why"),
    [
        (
            {"chamber.height_mm": (16, 60), "chamber.sonotrode_distance_mm": (2, 44)},
            (0, 1),
            "part would be outside",
        ),
        (
            {"shot.diameter_mm": (1, 10), "chamber.sonotrode_distance_mm": (2, 25)},
            (1, 0),
            "no ball fits under",
        ),
        (
            {"sonotrode.amplitude_um": (20, 400), "chamber.sonotrode_distance_mm": (2, 25)},
            (1, 0),
            "ten amplitudes",
        ),
        (
            {"shot.mass_g": (1, 600), "chamber.height_mm": (16, 60)},
            (1, 0),
            "at most 50 % is allowed",
        ),
        (
            {"shot.mass_g": (1, 100), "shot.diameter_mm": (0.9, 3)},
            (1, 0),
            "more than the 20000 supported",
        ),
    ],
)
def test_a_corner_of_the_bounds_that_is_no_design_is_a_penalty_with_the_reason(
    tmp_path: Path, vary: dict, corner: tuple, why: str
) -> None:
    """Each bound alone is a design, not so both together: there the search is drawn to."""
    low, high = np.array(list(vary.values()), dtype=float).T

    def simulator(design, stream, replicas):
        require_ball_count(design)
        x = (np.array([design.value(name) for name in vary]) - low) / (high - low)
        # so steep that something is left to gain until the evaluations are spent
        return judged(PEAK - 100.0 * ((x - corner) ** 2).sum() + np.zeros(replicas or 8))

    settings = {"evaluations": 24, "confirm": 1, "confirm_replicas": 8, "first_replicas": 0}
    result = run(Study(design=GEAR, vary=vary, optimizer=settings), tmp_path, simulator)
    rows = read_trials(tmp_path)
    failed = [one for one in rows if one.objective is None]
    assert any(why in one.reason for one in failed)
    assert all(
        one.reason and not one.feasible and one.score == rows[0].score - FAILURE_PENALTY
        for one in failed
    )
    searched = [one for one in rows if one.stage == "search"]
    assert len(searched) - min(len(failed), 24) == 24  # so many failures cost nothing
    assert result.best.feasible


@pytest.mark.long
def test_every_candidate_has_the_target_that_the_start_can_reach(tmp_path: Path) -> None:
    """A larger ball would reach, and so have to cover, less of the gear's tooth flanks."""
    target = GEAR.part.target.model_copy(update={"reachable": True})
    design = GEAR.model_copy(update={"part": GEAR.part.model_copy(update={"target": target})})
    settings = {"evaluations": 6, "confirm": 1, "confirm_replicas": 8}
    question = Study(design=design, vary={"shot.diameter_mm": (1.5, 4.0)}, optimizer=settings)

    result = run(
        question, tmp_path, lambda design, stream, replicas: judged(0.5 + np.zeros(replicas or 8))
    )

    np.testing.assert_array_equal(result.target, build_chamber(design).part.target)
    larger = design.changed({"shot.diameter_mm": 4.0})
    assert build_chamber(larger).part.target.sum() < 0.8 * result.target.sum()
    np.testing.assert_array_equal(build_chamber(larger, result.target).part.target, result.target)
    assert fixed_target(study()) is None
    meshed = target.model_copy(update={"element_mm": 2.0})
    meshed = GEAR.model_copy(update={"part": GEAR.part.model_copy(update={"target": meshed})})
    with pytest.raises(ValueError, match=r"not supported with part\.target\.reachable"):
        Study(design=meshed, vary={"part.target.element_mm": (1.0, 3.0)})


def test_a_gain_over_what_is_not_resolved_is_not_known(tmp_path: Path) -> None:
    """Better by the numbers, but the start's is none."""

    def simulator(design, stream, replicas):
        x = shares(design)
        found = judged(hill(x) + 0.001 * np.arange(replicas or 8))
        is_start = np.allclose(x, shares(GEAR))
        words = found.objective.not_known(NOT_RESOLVED)
        return replace(found, objective=words) if is_start else found

    result = run(study(evaluations=8), tmp_path, simulator)
    assert result.best is not result.start
    assert result.gain.in_words == "not known"
    assert not result.improved


def test_a_cost_of_tolerances_is_only_said_where_a_model_knows_it() -> None:
    (only,) = tolerance_notes(0.0)
    assert "--tolerances" in only
    assert "it is 0.02 below the value" in tolerance_notes(0.02)[0]
    assert "it is 0.02 above the value" in tolerance_notes(-0.02)[0]


def test_a_second_round_adds_replicas_to_those_of_a_chamber_that_is_gone(monkeypatch) -> None:
    """Chambers of confirmed candidates would fill the memory; their replicas are small."""
    built = []

    def build(*args) -> Chamber:
        built.append(ref(chamber := build_chamber(*args)))
        return chamber

    monkeypatch.setattr("chamberopt.chamber.build.build_chamber", build)
    short = {"process__accuracy__simulated_time_s": 0.02, "process__accuracy__points": 1000}
    design = plate_design(**short)
    other = design.changed({"chamber.height_mm": design.value("chamber.height_mm") + 1})
    question = Study(design=design, vary={"chamber.height_mm": (19.0, 60.0)})
    anew = ChamberSimulator(question, SerialExecutor(), None)
    told: list = []
    simulator = ChamberSimulator(question, SerialExecutor(), None, lambda *now: told.append(now))
    simulator(design, "confirm", 2)
    assert told[-1] == (2, 2, None)  # replicas
    simulator(other, "confirm", 2)
    assert [one() is None for one in built] == [True, False]
    again, once = simulator(design, "confirm", 4), anew(design, "confirm", 4)
    assert len(built) == 4
    assert replace(again, timings={}, hits=()) == replace(once, timings={}, hits=())
