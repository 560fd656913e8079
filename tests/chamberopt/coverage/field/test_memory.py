"""The memory of an evaluation: foretold within a factor of 2, bounded, refused in time."""

import tracemalloc
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.cli import main
from chamberopt.cli.teller import TerminalTeller
from chamberopt.common import memory
from chamberopt.common.executor import SerialExecutor
from chamberopt.common.memory import MEMORY, MemoryBudget
from chamberopt.coverage.coverage_from_impacts import MAX_BATCHES
from chamberopt.coverage.field.memory import (
    BATCHES,
    PROCESS,
    evaluation_bytes,
    how_many_fit,
    time_within,
)
from chamberopt.design.design import Design
from chamberopt.design.load import save_design
from chamberopt.search.study import load_study
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate
from chamberopt.workflows import optimise
from tests.helpers.synthetic import plate_design

GIGA = 1e9


@pytest.fixture
def no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """No memory for what can be computed again."""
    monkeypatch.setattr(MEMORY, "_left", 0.0)


def design_with(points: int, replicas: int) -> Design:
    return plate_design(
        process__accuracy__points=points,
        process__accuracy__replicas=replicas,
        process__accuracy__simulated_time_s=0.4,
        process__accuracy__warmup_time_s=0.01,
    )


@pytest.mark.parametrize(("points", "replicas"), [(20_000, 8), (80_000, 8), (20_000, 50)])
def test_what_an_evaluation_takes_is_foretold(points: int, replicas: int, no_room: None) -> None:
    design = design_with(points, replicas)
    chamber = build_chamber(design)
    evaluate(design_with(1_000, 3), chamber, SerialExecutor())  # what is compiled is not measured
    tracemalloc.start()
    try:
        evaluate(design, chamber, SerialExecutor())
        taken = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert 0.5 < evaluation_bytes(design, chamber, replicas) / taken < 2.0


@pytest.mark.parametrize(("replicas", "most"), [(10, 2e9), (24, 2e9), (24, 9e9), (100, 2e9)])
def test_the_time_that_a_memory_has_room_for_takes_all_of_it(replicas: int, most: float) -> None:
    design = design_with(20_000, 8)
    chamber = build_chamber(design)
    time = time_within(most, design, chamber, replicas)
    longest = design.changed({"process.accuracy.simulated_time_s": time / replicas})
    assert PROCESS + evaluation_bytes(longest, chamber, replicas) == pytest.approx(most)
    assert time_within(PROCESS, design, chamber, replicas) == 0.0


def test_more_of_anything_takes_as_much_more_as_it_is() -> None:
    """Impacts come as in a gas of balls, n V A / 4 a second; the chamber of the plate is a drum."""
    design = design_with(20_000, 8)
    chamber = build_chamber(design)

    def taken(replicas: int, more: Mapping[str, Any] | None = None) -> float:
        return evaluation_bytes(design.changed(more or {}), chamber, replicas)

    base, seconds, points = taken(8), 0.4, 20_000
    gas = design.shot.count / chamber.volume * design.sonotrode.peak_speed / 4.0
    on_part = 150.0 * gas * float(chamber.exposed_area.sum())
    sides = chamber.vertices[chamber.triangles]
    cross = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    logged = 100.0 * gas * 0.5 * float(np.linalg.norm(cross, axis=1).sum())
    assert taken(10) - base == pytest.approx(2 * (110.0 * points + on_part * seconds))
    assert taken(60) - taken(50) == pytest.approx(10 * on_part * seconds)  # batches are full
    longer = taken(8, {"process.accuracy.simulated_time_s": 1.4}) - base
    assert longer == pytest.approx(8 * on_part + logged)
    finer = taken(8, {"process.accuracy.points": 2 * points}) - base
    assert finer == pytest.approx((550.0 + 8 * 110.0) * points)
    # Smaller windows: more pieces, until there are as many as are made.
    gauge, area = design.process.accuracy.gauge_mm2, chamber.part.area[chamber.part.target].sum()
    smaller = taken(8, {"process.accuracy.gauge_mm2": 0.5 * gauge}) - base
    assert smaller == pytest.approx(120.0 * 6 * 1e6 * area / gauge)
    zone = {"name": "a", "target": {"direction": [0, 0, -1], "angle_deg": [0, 30]}}
    first, second = (taken(8, {"zones": [zone, zone | {"name": "b"}][:k]}) - base for k in (1, 2))
    assert first == pytest.approx(250.0 * points + 120.0 * 6 * 1e6 * area / gauge)
    assert second == pytest.approx(2 * first)


def test_figures_are_the_same_where_pairs_are_found_again(monkeypatch: pytest.MonkeyPatch) -> None:
    design = design_with(2_000, 45)  # more replicas than batches
    chamber, executor = build_chamber(design), SerialExecutor()
    kept = evaluate(design, chamber, executor, plan=ReplicaPlan(45))
    monkeypatch.setattr(MEMORY, "_left", 100_000.0)  # some are kept
    again = evaluate(design, chamber, executor, plan=ReplicaPlan(45))
    assert again.metrics == kept.metrics
    assert again.metrics_of_wide == kept.metrics_of_wide
    assert again.resolution == kept.resolution


def test_what_is_freed_can_be_kept_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "free_memory", lambda: 4000.0)
    budget = MemoryBudget()
    one, two = np.zeros(150), np.zeros(150)
    assert budget.keeps(one)
    assert not budget.keeps(two)  # half of what is free
    del one
    assert budget.keeps(two)


def test_of_what_is_free_half_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "free_memory", lambda: 4.0 * GIGA)
    assert how_many_fit(8, 0.5 * GIGA, 0.4 * GIGA) == 3
    assert how_many_fit(2, 0.5 * GIGA, 0.4 * GIGA) == 2
    monkeypatch.setattr(memory, "free_memory", lambda: float("inf"))  # a machine that does not tell
    assert how_many_fit(8, 1e15) == 8


def test_batches_are_those_of_the_figures() -> None:
    assert BATCHES == MAX_BATCHES


def test_this_machine_tells_what_is_free() -> None:
    assert memory.free_memory() > 1e8


@pytest.mark.parametrize("command", ["simulate", "accuracy", "run", "sweep"])
def test_a_job_larger_than_the_machine_is_refused(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    save_design(design_with(1_000_000, 40), tmp_path / "large.toml")
    (tmp_path / "study.toml").write_text(
        'design = "large.toml"\n[vary]\n"shot.mass_g" = [2, 4]\n[optimizer]\nevaluations = 5\n'
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(memory, "free_memory", lambda: GIGA)
    words = [command, "study.toml" if command in ("run", "sweep") else "large.toml", "--out", "new"]
    assert main([*words, *(["--sobol", "2"] if command == "sweep" else [])]) == 2
    message = capsys.readouterr().err
    assert "process.accuracy.points: this takes about" in message
    assert "0.5 GB, half of what is free" in message
    assert not (tmp_path / "new").exists()


def test_fewer_run_at_a_time_where_not_all_fit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    save_design(design_with(20_000, 8), tmp_path / "plate.toml")
    (tmp_path / "study.toml").write_text(
        'design = "plate.toml"\n[vary]\n"shot.mass_g" = [2, 4]\n[optimizer]\nbatch = 8\n'
    )
    study = load_study(tmp_path / "study.toml")
    chamber = build_chamber(study.design)
    for gigabytes, workers, all_candidates in ((1.6, 1, False), (3.0, 3, True), (100.0, 8, True)):
        monkeypatch.setattr(memory, "free_memory", lambda free=gigabytes: free * GIGA)
        assert optimise._workers_that_fit(study, chamber, 8, TerminalTeller()) == workers
        told = capsys.readouterr().err
        assert (f"memory for {workers} of 8 worker processes" in told) == (workers < 8)
        found = optimise._candidates_at_once(study, chamber, TerminalTeller())
        assert (found == 8) == all_candidates
        assert ("candidates of optimizer.batch at a time" in capsys.readouterr().err) == (found < 8)
