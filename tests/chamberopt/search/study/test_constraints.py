"""Constraints are judged by the intervals of the figures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.estimate import Estimate, estimate
from chamberopt.search.study import Limits, Study
from chamberopt.search.study.constraints import (
    NOT_KNOWN,
    assess_feasibility,
    describe_violations,
    expected_violation,
)
from tests.helpers.known_optima import GEAR, VARY, bowl, bowl_shares, run_bowl
from tests.helpers.synthetic import judged


def test_a_constraint_is_priced_by_what_is_to_be_expected_beyond_it() -> None:
    limits = Limits(min=0.5)
    assert expected_violation(Estimate(0.4, 0.0), limits) == pytest.approx(0.2)
    assert expected_violation(Estimate(0.6, 0.0), limits) == 0.0
    assert expected_violation(Estimate(-2.0, 0.0), Limits(min=1e-10)) == pytest.approx(2e10)
    for nothing in (0.0, 1e-13):  # the excess itself
        assert expected_violation(Estimate(-2.0, 0.0), Limits(min=nothing)) == pytest.approx(2.0)
    # Of a normal figure at its limit: its standard error over sqrt(2 pi).
    at_limit = estimate(0.5 + np.array([-0.1, 0.1, -0.1, 0.1]))
    error = np.std(at_limit.pseudovalues, ddof=1) / 2.0
    assert expected_violation(at_limit, limits) == pytest.approx(error / np.sqrt(2.0 * np.pi) / 0.5)


@pytest.mark.parametrize(
    ("half_width", "standing"), [(0.05, "feasible"), (0.2, "not known"), (0.0, "feasible")]
)
def test_an_answer_keeps_its_limits_to_the_end_of_the_interval(
    half_width: float, standing: str
) -> None:
    constraints = {"mean_coverage": Limits(min=0.5, max=0.9)}
    assert (
        assess_feasibility(constraints, {"mean_coverage": Estimate(0.6, half_width)})[0] == standing
    )
    said, (why,) = assess_feasibility(constraints, {"mean_coverage": Estimate(0.3, 0.1)})
    assert said == "infeasible"
    assert why == ("mean_coverage", "mean coverage of the target 0.3 ± 0.1 < min 0.5")


def test_limits_that_no_candidate_can_meet_are_refused_before_any_work() -> None:
    steps = {"sonotrode.amplitude_um": {"low": 25, "high": 40, "step": 5}}
    for limits, said in (
        ({"sonotrode.amplitude_um": Limits(min=26.0, max=29.0)}, "none of its values in"),
        ({"sonotrode.amplitude_um": Limits(min=41.0)}, "it is from 25 to 40 in every candidate"),
    ):
        with pytest.raises(ValueError, match=said):
            Study(design=GEAR, vary=steps, constraints=limits)
    shapes = {"chamber.shape": {"choose": ["cylinder", "prism"]}, "chamber.across_mm": (50, 70),
              "chamber.sides": (4, 8)}  # fmt: skip
    with pytest.raises(ValueError, match="only some of the shapes have it"):
        Study(design=GEAR, vary=shapes, constraints={"chamber.diameter_mm": Limits(max=60.0)})


def test_a_number_of_the_design_can_be_a_constraint(tmp_path: Path) -> None:
    limits = {"shot.mass_g": Limits(max=4.0)}  # the best is at 4.4
    result = run_bowl(
        tmp_path, lambda d, s, n: judged(np.full(3, bowl(bowl_shares(d)))), constraints=limits
    )
    assert 3.5 < result.best.design.shot.mass_g <= 4.0
    assert result.best.feasibility == "feasible"


def test_the_limits_of_a_zone_are_constraints(tmp_path: Path) -> None:
    """The best is at 4.4 g, where the zone is covered to 0.56: it may be covered to 0.5."""
    zone = {"name": "face", "target": {}, "coverage_max": 0.5}
    design = GEAR.changed({"zones": (zone,)})

    def simulator(design, stream, replicas):
        made = judged(np.full(3, bowl(bowl_shares(design))))
        of_zone = {f"face.{k}": one for k, one in made.metrics.items() if k != "shot_count"}
        covered = Estimate(design.shot.mass_g / 8.0, 0.0, (design.shot.mass_g / 8.0,) * 3)
        metrics = made.metrics | of_zone | {"face.p95_coverage": covered}
        return replace(made, metrics=metrics)

    result = run_bowl(tmp_path, simulator, design=design)
    assert 3.5 < result.best.design.shot.mass_g <= 4.0
    assert result.best.feasibility == "feasible"
    reasons = [trial.reason for trial in result.trials if not trial.feasible]
    assert any("area exceeds, zone face" in reason and "> max 0.5" in reason for reason in reasons)
    with pytest.raises(ValueError, match="the zone limits it in the design already"):
        Study(design=design, vary=VARY, constraints={"face.p95_coverage": Limits(max=0.4)})
    with pytest.raises(ValueError, match=r"zones\.0\.coverage_max: what is asked of"):
        Study(design=design, vary={"zones.0.coverage_max": (0.1, 0.9)})


def test_where_no_constraint_is_surely_kept_the_answer_says_so(tmp_path: Path) -> None:
    def simulator(design, stream, replicas):
        made = judged(np.full(4, bowl(bowl_shares(design))))
        made.metrics["mean_coverage"] = estimate([0.4, 0.6, 0.5, 0.52])
        return made

    result = run_bowl(tmp_path, simulator, constraints={"mean_coverage": Limits(min=0.5)})
    assert result.best.feasibility == "not known"
    assert "mean coverage of the target 0.505 ± 0.13 may be < min 0.5" in result.warnings[0]


def test_a_figure_that_is_not_resolved_is_not_known_to_violate_anything() -> None:
    figure = Estimate(0.3, 0.1).not_known("not resolved")
    assert expected_violation(figure, Limits(min=0.5)) == 0.0
    assert describe_violations("figure", figure, Limits(min=0.5)) == []
    assert assess_feasibility({"figure": Limits(min=0.5)}, {"figure": figure})[0] == NOT_KNOWN
