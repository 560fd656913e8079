"""A sweep gives the whole map, the same with every executor.

A candidate that fails becomes a row and does not end the sweep.
"""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import chamberopt
from chamberopt.cli import main
from chamberopt.cli.resume import resume_note, unfinished
from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor, local_executor
from chamberopt.design.load import load_design
from chamberopt.results.load import load_result
from chamberopt.search.run_study import save_inputs
from chamberopt.search.run_sweep import plan_sweep
from chamberopt.search.study import Study, load_study
from chamberopt.search.trial_log import read_trials
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.workflows.save_run import save_sweep
from tests.helpers import worker_jobs
from tests.helpers.studies import sweep_in_folder
from tests.helpers.synthetic import DESIGNS, plate_design

MASS = {"shot.mass_g": (2.0, 10.0)}
PAIR = {**MASS, "chamber.height_mm": (35.0, 60.0)}
THREE = {**PAIR, "chamber.sonotrode_distance_mm": (5.0, 25.0)}


def study(vary: dict = MASS, **more) -> Study:
    return Study(design=load_design(DESIGNS / "gear.toml"), vary=vary, **more)


def small_study() -> Study:
    """A real scene that takes moments."""
    design = plate_design(
        process__accuracy__simulated_time_s=0.05,
        process__accuracy__warmup_time_s=0.02,
        process__accuracy__replicas=3,
    )
    return Study(
        design=design, vary={"sonotrode.amplitude_um": (15.0, 40.0), "shot.mass_g": (2.0, 5.0)}
    )


def rows(folder: Path) -> list[dict]:
    return [trial.row() for trial in read_trials(folder)]


def test_a_grid_has_the_bounds_and_every_combination() -> None:
    plan = plan_sweep(study(PAIR), 3, None)
    assert plan.points.tolist() == [[x, y] for x in (0.0, 0.5, 1.0) for y in (0.0, 0.5, 1.0)]


def test_sobol_points_are_spread_and_their_seed_is_the_studys() -> None:
    plan = plan_sweep(study(PAIR, optimizer={"seed": 7}), None, 64)
    assert plan.seed == 7
    np.testing.assert_array_equal(plan.points, plan_sweep(study(PAIR), None, 64, 7).points)
    assert (plan.points != plan_sweep(study(PAIR), None, 64, 8).points).any()
    boxes = (plan.points * 8).astype(int)  # a (0, 6, 2) net: one point in each of 64 boxes
    assert len({tuple(box) for box in boxes.tolist()}) == 64


def test_candidates_that_are_alike_are_simulated_once() -> None:
    vary = {"shot.diameter_mm": {"choose": [1.5, 2.0, 3.0]}}
    assert sorted(plan_sweep(study(vary), None, 8).points.ravel().tolist()) == [0.0, 0.5, 1.0]
    assert plan_sweep(study(vary), 200_000, None).points.ravel().tolist() == [0.0, 0.5, 1.0]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((None, None), "--grid, --sobol: neither given"),
        ((2, 2), "--grid, --sobol: both given"),
        ((1, None), "--grid: given 1; give at least 2"),
        ((None, 0), "--sobol: given 0; give at least 1"),
        ((3, None, 1), "--seed: given 1, but a grid is not random"),
        ((None, 4, -1), "--seed: given -1; give 0 or more"),
        (
            (400, None),
            "--grid: 400 values of 2 parameters: 160,000 candidates, more than 100,000; give fewer",
        ),
    ],
)
def test_what_cannot_be_planned_is_said(arguments: tuple, said: str) -> None:
    with pytest.raises(InputError, match=said):
        plan_sweep(study(PAIR), *arguments)


def test_a_failed_candidate_is_a_row_and_the_best_is_the_best_feasible(tmp_path: Path) -> None:
    question = study(constraints={"mean_coverage": {"max": 0.55}})
    sweep = sweep_in_folder(
        question, plan_sweep(question, 9, None), tmp_path, SerialExecutor(), None, worker_jobs.hill
    )
    assert [trial.parameters["shot.mass_g"] for trial in sweep.trials] == [
        2,
        3,
        4,
        5,
        6,
        7,
        8,
        9,
        10,
    ]
    assert [trial.stage for trial in sweep.trials] == ["sweep"] * 9
    assert [trial.feasible for trial in sweep.trials] == [True] * 4 + [
        False
    ] * 5  # a constraint, at last the shot
    assert sweep.trials[8].reason == "shot: 10 g do not fit"
    assert sweep.best is sweep.trials[3]
    assert [one.number for one in read_trials(tmp_path)] == list(range(9))


def test_when_all_fail_the_reason_is_said(tmp_path: Path) -> None:
    question = study({"shot.mass_g": (5.0, 10.0)})
    plan = plan_sweep(question, 2, None)
    with pytest.raises(
        InputError, match=r"the first because: shot: .* do not fit; change \[vary\]"
    ):
        sweep_in_folder(
            question,
            type(plan)("grid", 2, plan.points[1:], None),
            tmp_path,
            SerialExecutor(),
            None,
            worker_jobs.hill,
        )


def test_a_candidate_that_takes_its_workers_down_is_a_row(tmp_path: Path) -> None:
    question = study()
    with local_executor(2, "processes") as executor:
        sweep = sweep_in_folder(
            question, plan_sweep(question, 9, None), tmp_path, executor, None, worker_jobs.deadly
        )
    assert [trial.feasible for trial in sweep.trials] == [True] * 4 + [False] + [True] * 3 + [False]
    assert "its worker process died 2 times (signal 9" in sweep.trials[4].reason
    assert sweep.trials[8].reason == "shot: 10 g do not fit"


@pytest.mark.parametrize("vary", [MASS, PAIR, THREE], ids=["line", "map", "pairs"])
@pytest.mark.parametrize("way", [(4, None), (None, 8)], ids=["grid", "sobol"])
def test_what_a_sweep_leaves(vary: dict, way: tuple, tmp_path: Path) -> None:
    question = study(vary)
    seen: list = []
    sweep = sweep_in_folder(
        question,
        plan_sweep(question, *way),
        tmp_path,
        SerialExecutor(),
        lambda *now: seen.append(now),
        worker_jobs.hill,
    )
    assert save_sweep(tmp_path, sweep) == []
    assert seen[-1][:2] == (len(sweep.trials), len(sweep.trials))
    assert (tmp_path / "map.png").stat().st_size > 10_000
    assert load_design(tmp_path / "best.toml").shot.mass_g == pytest.approx(
        sweep.best.parameters["shot.mass_g"]
    )
    assert len((tmp_path / "history.csv").read_text().splitlines()) == 1 + len(sweep.trials)
    varied = load_study(tmp_path / "study.toml").vary
    assert {name: one.bounds for name, one in varied.items()} == vary
    said = json.loads((tmp_path / "result.json").read_text())
    assert said["kind"] == "sweep"
    assert said["sweep"]["best"]["number"] == sweep.best.number
    assert "luckiest" in said["notes"][0]
    with pytest.raises(InputError, match=r"a sweep .*; simulate .* best\.toml"):
        load_result(tmp_path)


@pytest.mark.long
def test_the_same_rows_whatever_works_on_them(tmp_path: Path) -> None:
    question = small_study()
    plan = plan_sweep(question, None, 6)
    found = {}
    for name, executor in (
        ("serial", SerialExecutor()),
        ("threads", local_executor(3)),
        ("processes", local_executor(2, "processes")),
    ):
        with executor:
            sweep_in_folder(question, plan, tmp_path / name, executor)
        found[name] = rows(tmp_path / name)
    assert found["serial"] == found["threads"] == found["processes"]
    assert len({row["objective"] for row in found["serial"]}) == 6


def test_the_command_line_maps_a_study(tmp_path: Path, capsys) -> None:
    save_inputs(small_study(), tmp_path)
    command = [
        "sweep",
        str(tmp_path / "study.toml"),
        "--sobol",
        "2",
        "--workers",
        "1",
        "--out",
        str(tmp_path / "out"),
    ]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "2 candidates in" in said
    assert "also the luckiest" in said
    assert {"result.json", "history.csv", "map.png", "best.toml"} <= {
        path.name for path in (tmp_path / "out").iterdir()
    }
    assert main(["sweep", str(tmp_path / "study.toml")]) == 2
    assert "--grid, --sobol: neither given" in capsys.readouterr().err


@pytest.mark.long
def test_from_python_it_is_the_same(tmp_path: Path) -> None:
    """Times, dates and the digests of files with times apart."""

    def result_of(folder: str) -> dict:
        said = json.loads((tmp_path / folder / "result.json").read_text())
        del said["sweep"]["seconds"]
        return {name: said[name] for name in said.keys() - {"created", "files", "sha256"}}

    save_inputs(small_study(), tmp_path)
    question, seen = tmp_path / "study.toml", []
    asked = load_study(question), tmp_path / "python"
    found = chamberopt.sweep(*asked, sobol=2, workers=1, progress=lambda *now: seen.append(now))
    assert seen == [(1, 2, seen[0][2]), (2, 2, found.best.score)]
    assert main(["sweep", str(question), "--sobol", "2", "--out", str(tmp_path / "command")]) == 0
    assert tuple(read_trials(tmp_path / "python")) == found.trials
    history = [(tmp_path / name / "history.jsonl").read_bytes() for name in ("python", "command")]
    assert history[0] == history[1]
    assert result_of("python") == result_of("command")

    assert chamberopt.sweep(*asked, sobol=2).trials == found.trials  # it is finished
    with pytest.raises(InputError, match=r"sweep\.count: was 2, is 3"):
        chamberopt.sweep(*asked, sobol=3)
    (tmp_path / "python" / "history.jsonl").write_bytes(history[0].splitlines(keepends=True)[0])
    with pytest.raises(InputError, match=r"history\.jsonl: not the file that was written"):
        chamberopt.sweep(*asked, sobol=2)


@pytest.mark.parametrize("kept", [0, 1, 5, 8])
def test_a_sweep_that_was_stopped_goes_on(tmp_path: Path, kept: int) -> None:
    """The same bytes in the end, and only what is missing is judged again."""
    question, calls = study(), []

    def counted(*asked) -> Evaluation:
        calls.append(asked)
        return worker_jobs.hill(*asked)

    plan, whole, folder = plan_sweep(question, 9, None), tmp_path / "whole", tmp_path / "stopped"
    sweep_in_folder(question, plan, whole, SerialExecutor(), None, worker_jobs.hill)
    sweep_in_folder(question, plan, folder, SerialExecutor(), None, worker_jobs.hill)
    history = folder / "history.jsonl"
    history.write_bytes(b"".join(history.read_bytes().splitlines(keepends=True)[:kept]))
    sweep_in_folder(question, plan, folder, SerialExecutor(), None, counted)
    assert history.read_bytes() == (whole / "history.jsonl").read_bytes()
    assert len(calls) == 9 - kept
    with pytest.raises(InputError, match=r"sweep\.count: was 9, is 5"):
        sweep_in_folder(
            question,
            plan_sweep(question, 5, None),
            folder,
            SerialExecutor(),
            None,
            worker_jobs.hill,
        )


@pytest.mark.parametrize(("way", "option"), [((3, None), "--grid 3"), ((None, 2), "--sobol 2")])
def test_a_new_sweep_names_the_command_that_resumes_the_unfinished_one(
    way: tuple, option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    question, folder = study(), Path("results", "s-sweep")
    plan = plan_sweep(question, *way)
    sweep_in_folder(question, plan, folder, SerialExecutor(), None, worker_jobs.hill)
    seed = "" if plan.seed is None else f"--seed {plan.seed} "
    command = f"chamberopt sweep s.toml {option} {seed}--out {folder}"
    assert unfinished(Path("s.toml"), "s-sweep") == [
        f"{folder}: not finished; to resume it: {command}"
    ]
    begun = SimpleNamespace(begun=True)
    with pytest.raises(KeyboardInterrupt) as raised, resume_note(begun, command):
        raise KeyboardInterrupt
    assert raised.value.__notes__ == [f"to resume: {command}"]


def test_a_sweep_names_what_it_maximises(tmp_path: Path) -> None:
    """A sum or a pair has no name of its own: the first goal is what its figures are of."""
    question = study(objective={"sum": {"shot_count": 1.0}})
    sweep = sweep_in_folder(
        question, plan_sweep(question, 2, None), tmp_path, SerialExecutor(), None, worker_jobs.hill
    )
    save_sweep(tmp_path, sweep)
    assert (
        json.loads((tmp_path / "result.json").read_text())["sweep"]["objective"] == "1 shot_count"
    )


def test_another_plan_on_a_finished_sweep_is_refused_as_another(tmp_path: Path) -> None:
    question = study()
    folder = tmp_path / "map"
    save_sweep(
        folder,
        sweep_in_folder(
            question,
            plan_sweep(question, 3, None),
            folder,
            SerialExecutor(),
            None,
            worker_jobs.hill,
        ),
    )
    with pytest.raises(InputError, match=r"sweep\.count: was 3, is 2"):
        sweep_in_folder(
            question,
            plan_sweep(question, 2, None),
            folder,
            SerialExecutor(),
            None,
            worker_jobs.hill,
        )
