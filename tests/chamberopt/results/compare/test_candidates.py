"""Designs and results are compared together.

What is missing is simulated with the random draws of the first candidate. What cannot be compared
is refused before anything is simulated.
"""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor
from chamberopt.design.design import Design, validate
from chamberopt.design.load import load_design, save_design
from chamberopt.results.compare.comparison import comparison_of
from chamberopt.results.load import load_result
from chamberopt.workflows import simulate
from chamberopt.workflows.compared_candidates import read_candidates, simulate_missing
from chamberopt.workflows.save_run import save_simulation
from chamberopt.workflows.simulate import Teller
from tests.helpers.synthetic import DESIGNS, plate_design, poisson_evaluation

plate = partial(plate_design, process__accuracy__points=1000)
PLATE = plate()
CHAMBER = build_chamber(PLATE)


@dataclass
class Simulations:
    """What was simulated in place of the real thing: (design, keywords) each."""

    done: list[tuple[Design, dict[str, Any]]] = field(default_factory=list)

    def evaluate(
        self,
        design: Design,
        chamber: Any,
        executor: Any,
        progress: Any,
        plan: Any,
        cavity: Any,
        _: Any,
    ) -> Any:
        how = {**vars(plan), "replicas": plan.count, "cavity": cavity}
        self.done.append((design, how))
        count = how["replicas"] or design.process.accuracy.replicas
        evaluation = poisson_evaluation(
            design, chamber, 4.0 * design.shot.mass_g, count, design.process.seed
        )
        return replace(evaluation, stream=how["stream"], objective_name=how["objective_name"])


@pytest.fixture
def simulations(monkeypatch: pytest.MonkeyPatch) -> Simulations:
    found = Simulations()
    monkeypatch.setattr(simulate, "evaluate_until_stopped", found.evaluate)
    monkeypatch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
    return found


@pytest.fixture
def made(tmp_path: Path) -> Callable[..., Path]:
    """A design file in the test's folder, a copy of the plate's with other numbers."""

    def make(name: str, **values: float) -> Path:
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        save_design(plate(**values), path)
        return path

    return make


def run(paths: list[Path], out: Path, seconds: float | None = None) -> tuple[Any, list[str]]:
    found = read_candidates(paths, seconds)
    results, remarks = simulate_missing(found, out, SerialExecutor(), Teller())
    return comparison_of(results, [one.label for one in found]), remarks


def test_designs_of_one_name_on_the_draws_of_the_first(
    simulations: Simulations, made, tmp_path: Path
) -> None:
    first = made("a/plate.toml", process__seed=7, process__accuracy__replicas=5)
    second = made("b/plate.toml", shot__mass_g=6.0)
    second.write_text(
        second.read_text().replace(
            "[process.accuracy]", "[process.accuracy]\nobjective_half_width = 0.01"
        )
    )
    compared, remarks = run([first, second], tmp_path / "out")
    assert compared.labels == ("a/plate", "b/plate")
    instead = "seed = 7 instead of 1 and 5 replicas instead of as many as give ± 0.01"
    assert remarks == [f"b/plate: {instead}, as the first candidate"]
    assert set(compared.parameters) == {"shot.mass_g"}
    assert compared.results[0].seeds == compared.results[1].seeds
    # What was simulated can be inspected after, and simulated again from its own file.
    for name in ("plate", "plate-2"):
        result = load_result(tmp_path / "out" / name)
        assert load_design(tmp_path / "out" / name / "design.toml") == result.design
        process = result.design.process
        assert (process.seed, process.accuracy.replicas, process.accuracy.objective_half_width) == (
            7,
            5,
            None,
        )
        assert result.record.replicas == 5


def test_a_design_against_a_confirmed_result(
    simulations: Simulations, made, tmp_path: Path
) -> None:
    evaluation = replace(
        poisson_evaluation(PLATE, CHAMBER, 20, 6), stream="confirm", objective_name="p05_coverage"
    )
    save_simulation(tmp_path / "best", PLATE, CHAMBER, evaluation)
    compared, _ = run([tmp_path / "best", made("mine.toml", shot__mass_g=6.0)], tmp_path / "out")
    [(design, how)] = simulations.done  # the result is not simulated again
    assert (design.process.seed, how["stream"], how["replicas"]) == (
        PLATE.process.seed,
        "confirm",
        6,
    )
    assert "p05_coverage" in compared.differences
    assert compared.results[0].seeds == compared.results[1].seeds


def test_another_treatment_time_is_simulated_again_on_its_own_seeds(
    simulations: Simulations, made, tmp_path: Path
) -> None:
    short = plate(process__treatment_time_s=2.0, process__seed=9)
    save_simulation(tmp_path / "short", short, CHAMBER, poisson_evaluation(short, CHAMBER, 20, 6))
    paths = [made("long.toml"), tmp_path / "short"]
    with pytest.raises(InputError, match=r"peened for 2 s.*for 5 s.*--treatment-time-s"):
        read_candidates(paths)
    with pytest.raises(InputError, match=r"treatment_time_s"):
        read_candidates(paths, -1.0)
    compared, remarks = run(paths, tmp_path / "out", 5.0)
    assert remarks == ["short: simulated again for 5 s, on its own seeds"]
    assert [design.process.treatment_time_s for design, _ in simulations.done] == [5.0, 5.0]
    assert [design.process.seed for design, _ in simulations.done] == [1, 9]
    assert not compared.differences["mean_coverage"][0].paired
    run(paths, tmp_path / "out-2", 2.0)
    assert len(simulations.done) == 3  # the design alone: the result is of that time


def test_everything_is_refused_before_anything_is_simulated(
    simulations: Simulations, made, tmp_path: Path
) -> None:
    one = made("one.toml")
    for second, said in (
        (made("longer.toml", process__treatment_time_s=50), "cannot be compared"),
        (DESIGNS / "blade.toml", "treatment-time"),
        (DESIGNS.parent / "studies" / "plate.toml", "this is a study file"),
        (tmp_path / "two.toml", "no such design file"),
        (tmp_path, "not a results folder"),
        (one, "given twice"),
    ):
        with pytest.raises(InputError, match=said):
            read_candidates([one, second])
    with pytest.raises(InputError, match=r"another part \(blade.stl\)"):
        read_candidates([one, DESIGNS / "blade.toml"], 5.0)
    with pytest.raises(InputError, match="two or more"):
        read_candidates([one])
    assert simulations.done == []


def test_a_part_may_be_turned_and_its_unit_guessed(
    simulations: Simulations, made, tmp_path: Path
) -> None:
    data = PLATE.model_dump()
    data["part"] |= {"unit": "guess", "offset_mm": (1.0, 0.0), "rotate_deg": (0.0, 0.0, 90.0)}
    save_design(validate(Design, data), tmp_path / "turned.toml")
    compared, _ = run([made("straight.toml"), tmp_path / "turned.toml"], tmp_path / "out")
    assert set(compared.parameters) == {"part.offset_mm", "part.rotate_deg"}


def test_designs_share_the_first_ones_reachable_target(
    simulations: Simulations, tmp_path: Path
) -> None:
    data = PLATE.model_dump()
    data["part"]["target"] = {"direction": (0, 0, -1), "angle_deg": (0, 10), "reachable": True}
    save_design(validate(Design, data), tmp_path / "wide.toml")
    data["chamber"]["diameter_mm"] = 40.0
    save_design(validate(Design, data), tmp_path / "narrow.toml")
    wide, narrow = read_candidates([tmp_path / "wide.toml", tmp_path / "narrow.toml"])
    assert wide.chamber is not None
    assert narrow.chamber is not None
    np.testing.assert_array_equal(wide.chamber.part.target, narrow.chamber.part.target)
    alone = build_chamber(narrow.design)
    assert (alone.part.target != wide.chamber.part.target).any()
    save_simulation(
        tmp_path / "result", narrow.design, alone, poisson_evaluation(narrow.design, alone)
    )
    with pytest.raises(InputError, match=r"its target of \d+ triangles.*give its design"):
        read_candidates([tmp_path / "wide.toml", tmp_path / "result"])


def test_a_result_whose_parts_file_is_gone_is_compared_and_simulated_again(
    simulations: Simulations, made, tmp_path: Path
) -> None:
    parts = tmp_path / "parts"
    parts.mkdir()
    shutil.copy(PLATE.part.mesh_path, parts / "plate.stl")
    data = PLATE.model_dump()
    data["part"]["mesh"] = str(parts / "plate.stl")
    moved = validate(Design, data)
    save_simulation(tmp_path / "old", moved, CHAMBER, poisson_evaluation(moved, CHAMBER))
    shutil.rmtree(parts)
    assert [one.missing for one in read_candidates([tmp_path / "old", made("new.toml")])] == [
        False,
        True,
    ]
    again = read_candidates([tmp_path / "old", made("new.toml")], 6.0)
    assert [one.missing for one in again] == [True, True]
    assert again[0].chamber is not None
    np.testing.assert_array_equal(again[0].chamber.vertices, CHAMBER.vertices)
