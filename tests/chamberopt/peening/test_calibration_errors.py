"""Intervals hold what a calibration leaves open: with known functions in the simulator's place."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common.estimate import (
    FIRST_OF_CALIBRATION,
    Estimate,
    estimate,
    normal_quantile,
    paired_difference,
)
from chamberopt.common.executor import SerialExecutor
from chamberopt.coverage.part_impacts import Hits
from chamberopt.design.load import Design, load_design, save_design
from chamberopt.peening.calibration_errors import evaluate_calibrated
from chamberopt.results.arrays_file import load_result_arrays
from chamberopt.results.load import load_result
from chamberopt.simulation import variations
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.workflows import save_run
from chamberopt.workflows.save_run import save_simulation
from tests.helpers.synthetic import (
    evaluation_of,
    judged,
    machine_values,
    plate_design,
    poisson_evaluation,
)


@dataclass(frozen=True)
class _Replica:
    hits: Hits
    steps: tuple[()] = ()


SDS = {"amplitude": 0.05, "C0": 0.01, "v0": 0.1, "K": 0.2, "beta": 0.1}


def known(design: Design, *_: Any) -> Evaluation:
    """Speeds go with the amplitude, and coverage falls with the yield speed."""
    speed = design.simulated.sonotrode.amplitude_um
    coverage = 0.9 - 0.5 * math.log(design.simulated.materials.wall.v0_m_s / 0.44)  # type: ignore[operator]
    noise = np.array([-0.01, 0.01, 0.0, 0.0])
    metrics = {
        "mean_coverage": estimate(coverage + noise),
        "std_coverage": estimate(0.1 + 0.0 * noise, shared=[0.01] * 11),
        "mean_normal_speed_m_s": estimate(speed * (1.0 + noise)),
        "almen_intensity": estimate(0.3 + noise),
        "saturation_time_s": estimate(60.0 + noise),
        "p05_coverage": Estimate(0.8, math.inf, in_words="not resolved"),
    }
    return replace(judged(noise), metrics=metrics)


@pytest.fixture(autouse=True)
def _known_functions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(variations, "evaluate", known)


def found(design: Design) -> Evaluation:
    return evaluate_calibrated(design, None, SerialExecutor())  # type: ignore[arg-type]


def test_an_interval_holds_replicas_and_calibration() -> None:
    plain = found(plate_design())
    design = plate_design(calibration=machine_values(**SDS))
    wide = found(design)
    z = normal_quantile(0.95)
    for name, error in (
        ("mean_coverage", 0.5 * 0.1),
        ("mean_normal_speed_m_s", 25.0 * math.expm1(0.25) / 5.0),  # a step of 5 sd
        ("almen_intensity", 0.3 * 0.2),
        ("saturation_time_s", 60.0 * math.hypot(0.1, 0.075)),
        ("std_coverage", 0.0),
    ):
        one, two = plain.metrics[name], wide.metrics[name]
        assert two.value == one.value
        assert two.half_width == pytest.approx(math.hypot(one.half_width, z * error), rel=1e-4)
        assert two.beyond_scatter == pytest.approx(0.0, abs=1e-6)
    assert wide.metrics["p05_coverage"].half_width == math.inf
    objective = wide.objective
    assert objective.half_width >= wide.metrics["mean_coverage"].half_width
    assert "calibration" in wide.notes[-1]


def test_what_two_designs_have_in_common_cancels() -> None:
    design = plate_design(calibration=machine_values(**SDS))
    one = found(design).metrics["mean_coverage"]
    assert len(one.shared) == FIRST_OF_CALIBRATION + 8
    assert paired_difference(one, one).half_width == 0.0


def test_a_result_of_a_calibrated_design_is_whole(tmp_path: Path) -> None:
    """It holds the numbers of the calibration, and the intensities that come from them."""
    machine = machine_values(**SDS)
    machine["log_mean"] = tuple({"K": 2.6, "beta": 0.3}.get(name, 0.0) for name in SDS)
    save_design(plate_design(calibration=machine), tmp_path / "design.toml")
    design = load_design(tmp_path / "design.toml")
    chamber = build_chamber(design)
    evaluation = poisson_evaluation(design, chamber, per_mm2=30.0)
    with patch.object(save_run, "draw_coverage", lambda *_: None):
        save_simulation(tmp_path / "result", design, chamber, evaluation)
    result = load_result(tmp_path / "result")
    assert result.design.calibration == design.calibration
    strength = result.metrics["strength_um"].value
    intensity = result.metrics["almen_intensity"].value
    assert intensity == pytest.approx(math.exp(2.6) * 1e-3 * strength)
    plain = evaluation_of(plate_design(), chamber, evaluation.hits)
    assert not [name for name in plain.metrics if name.startswith("almen")]
    slower = plain.metrics["saturation_time_s"].value / result.metrics["saturation_time_s"].value
    assert slower == pytest.approx(math.exp(0.3))
    values = load_result_arrays(result).elements
    assert np.nanmax(values["almen_intensity_mmA"]) > 0.0


def test_a_harder_part_has_smaller_dents_without_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """The slope of coverage by ln B, with dents that are placed at random: -x exp(-x) / 2."""
    design = plate_design(calibration=machine_values(hardness=0.1))
    chamber = build_chamber(design)
    base = poisson_evaluation(design, chamber, per_mm2=4.0)
    runs = []

    def counted(design: Design, chamber: Any, *args: Any) -> Evaluation:
        replicas = args[-1].replicas
        runs.append(replicas)
        if len(runs) == 1:
            replicas.extend(_Replica(hits) for hits in base.hits)
            return base
        return evaluation_of(design, chamber, [one.hits for one in replicas])

    monkeypatch.setattr(variations, "evaluate", counted)
    wide = evaluate_calibrated(design, chamber, SerialExecutor()).metrics["mean_coverage"]
    assert len(runs) == 2
    assert len(runs[1]) == 4
    left = 1.0 - base.metrics["mean_coverage"].value
    x = -math.log(left)
    slope = left * (math.exp(x * (1.0 - math.exp(-0.2))) - 1.0) / 0.4  # a step of 0.4
    assert -wide.shared[FIRST_OF_CALIBRATION + 4] == pytest.approx(0.1 * slope, rel=0.05)
