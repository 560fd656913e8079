"""What a run leaves on disk reads back as what was computed."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor
from chamberopt.design.load import load_design
from chamberopt.documents.coverage import summary
from chamberopt.documents.report import report
from chamberopt.results.arrays_file import load_result_arrays
from chamberopt.results.compare.comparison import compare
from chamberopt.results.load import load_result
from chamberopt.search.candidate import evaluation_cost
from chamberopt.search.study import Study
from chamberopt.viewer.opened_result import OpenedResult, result_info
from chamberopt.viewer.view_state import ViewState
from chamberopt.workflows import save_run
from chamberopt.workflows.save_run import save_simulation, save_study
from tests.helpers.studies import run_in_folder
from tests.helpers.synthetic import plate_design, plate_evaluation, poisson_evaluation

DESIGN = plate_design()
DOWN = {"direction": [0, 0, -1], "angle_deg": [0, 10]}


@pytest.fixture
def no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        save_run, "draw_coverage", lambda *_: "coverage.png skipped: no OpenGL library found"
    )


@pytest.mark.usefixtures("no_pictures")
def test_zones_read_back_and_are_shown_from_the_folder_alone(tmp_path: Path) -> None:
    box = [[-100.0, -100.0, -100.0], [0.0, 100.0, 100.0]]
    zone = {"name": "left", "target": {"box_mm": box, **DOWN}, "coverage_min": 0.999}
    design = DESIGN.changed({"zones": (zone,)})
    chamber = build_chamber(design)
    save_simulation(tmp_path / "a", design, chamber, poisson_evaluation(design, chamber))
    assert load_design(tmp_path / "a" / "design.toml") == design
    moved = (tmp_path / "a").rename(tmp_path / "b")
    result = load_result(moved)
    assert result.design.zones == design.zones
    assert result.metrics["left.p05_coverage"].in_words == ""
    (found,) = result.record.zones
    assert found.name == "left"
    assert 0.4 < found.reachable_share < 0.6  # of what is a lid too, outside the chamber
    assert found.limits[0].standing == "not met"
    arrays = load_result_arrays(result)
    assert arrays.chamber.part.zones["left"].sum() == found.triangles
    part = arrays.elements
    assert part["zone"].sum() == part["zone_left"].sum() == found.triangles
    document = report(load_result(moved))
    tables = {one.title: one.content for one in document.sections}
    judged = tables["Zones"][0].rows[0]
    assert judged[2].startswith("coverage that 95 % of the area exceeds: ")
    (line,) = [one for one in document.answer_lines if one.about == "zone"]
    assert line.text.startswith("Zone left: coverage ≥ 99.9 % is not met (")
    assert line.warns
    assert not [row for row in tables["Coverage"][0].rows if "left." in row[0]]
    seen = OpenedResult(result_info(result))
    assert "zones" in seen.quantities
    assert set(seen.part.zones) == {0, 1}
    inside = int(np.flatnonzero(part["zone_left"] * part["exposed_area_mm2"])[0])
    assert "zone left" in seen.describe_triangle(inside, ViewState())


@pytest.mark.usefixtures("no_pictures")
def test_simulation_reads_back(tmp_path: Path) -> None:
    folder = tmp_path / "plate"
    chamber, evaluation = plate_evaluation()
    _, remarks = save_simulation(folder, DESIGN, chamber, evaluation)
    assert remarks == ["coverage.png skipped: no OpenGL library found"]
    names = {path.name for path in folder.iterdir()}
    assert names == {
        "design.toml",
        "result.json",
        "coverage.vtp",
        "part.vtp",
        "hits.npz",
        "arrays.npz",
        "chamber.stl",
        "chamber.vtp",
    }
    result = load_result(folder)
    assert result == load_result(folder / "result.json")
    assert result.record.kind == "simulation"
    assert result.design == DESIGN
    assert load_design(folder / "design.toml") == DESIGN
    assert result.objective == evaluation.objective
    assert result.metrics == evaluation.metrics
    assert (
        result.record.part_sha256 == hashlib.sha256(DESIGN.part.mesh_path.read_bytes()).hexdigest()
    )
    assert result.seeds == (DESIGN.process.seed, "search")
    assert list(chamber.notes) == result.record.notes
    for name in ("python", "chamberopt", "numpy", "numba", "manifold3d", "nlopt"):
        assert result.record.versions[name][0].isdigit()
    assert result.record.timings_s["simulate"] == 1.0
    assert summary(result) == summary(evaluation)


@pytest.mark.usefixtures("no_pictures")
def test_results_are_never_overwritten(tmp_path: Path) -> None:
    save_simulation(tmp_path / "plate", DESIGN, *plate_evaluation())
    before = {path.name: path.read_bytes() for path in (tmp_path / "plate").iterdir()}
    with pytest.raises(InputError, match="never overwritten"):
        save_simulation(tmp_path / "plate", DESIGN, *plate_evaluation())
    assert {path.name: path.read_bytes() for path in (tmp_path / "plate").iterdir()} == before


@pytest.mark.usefixtures("no_pictures")
def test_a_study_leaves_everything_and_its_best_design_can_be_used(tmp_path: Path) -> None:
    question = Study(
        design=DESIGN,
        vary={"shot.mass_g": (1.5, 8.0), "chamber.sonotrode_distance_mm": (8.0, 19.0)},
        optimizer={"evaluations": 12, "confirm": 2, "confirm_replicas": 4},
    )

    chamber, _ = plate_evaluation()

    def simulator(design, stream, replicas):
        if design.chamber.sonotrode_distance_mm > 17:
            raise InputError("not this one")
        # More shot, more dents: the best is at the upper bound.
        return poisson_evaluation(
            design, chamber, 4.0 * design.shot.mass_g, replicas or 4, seed=len(stream)
        )

    folder = tmp_path / "study"
    outcome = run_in_folder(question, folder, SerialExecutor(), simulator=simulator)
    save_study(folder, outcome)
    names = {path.name for path in folder.iterdir()}
    assert names == {
        "design.toml", "study.toml", "history.jsonl", "history.csv", "best.toml", "result.json",
        "coverage.vtp", "part.vtp", "chamber.stl", "chamber.vtp", "convergence.png", "slices.png",
        "arrays.npz", "start", "inputs.json", "timings.jsonl", "confirm", "hits.npz",
    }  # fmt: skip
    result = load_result(folder)
    assert result.record.kind == "study"
    assert result.design == outcome.best.design == load_design(folder / "best.toml")
    assert load_design(folder / "design.toml") == DESIGN
    assert result.seeds == (DESIGN.process.seed, outcome.best.evaluation.stream)
    # The start stands beside it, judged on the same seeds: comparing the two gives the gain again.
    both = compare([folder / "start", folder])
    (gain,) = both.differences["uniform_coverage"]
    assert (gain.value, gain.half_width) == pytest.approx(
        (outcome.gain.value, outcome.gain.half_width)
    )
    about = result.study
    assert about is not None
    assert about.improved
    assert about.gain == outcome.gain
    assert about.ended_by == "gain"
    saved = about.ended_early * (1.0 - evaluation_cost(3, 8))
    assert about.evaluations - about.failed - saved < 12  # what is not simulated costs nothing
    assert about.evaluations == sum(trial.stage == "search" for trial in outcome.trials)
    assert about.failed == sum(trial.objective is None for trial in outcome.trials)
    assert (folder / "convergence.png").stat().st_size > 20_000
    assert len((folder / "history.csv").read_text().splitlines()) == len(outcome.trials) + 1
    json.loads((folder / "result.json").read_text(), parse_constant=lambda name: pytest.fail(name))
