"""Recommendations from a convergence study whose runs are made up."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from chamberopt.common.estimate import Estimate, estimate, shared_half_width, student_quantile
from chamberopt.design.load import load_design
from chamberopt.documents.accuracy import describe_error_law
from chamberopt.simulation.convergence import ConvergenceStudy, EvaluationCost
from chamberopt.simulation.error_law import BatchSize, ErrorLaw
from chamberopt.simulation.numerical_parameters import (
    ELASTIC_SPEED,
    FACETS,
    GAUGE,
    MOTION,
    POINTS,
    TIME,
    WARM_UP,
)
from chamberopt.simulation.recommendation import recommend, replicas_for
from chamberopt.simulation.timed_replicas import Run
from chamberopt.workflows.accuracy import convergence_record
from tests.helpers.synthetic import DESIGNS

NO_SIZES = (BatchSize(4, 4, 1.0, 1.0, 1.0),)  # too wide to tell anything


def run(
    parameter: str,
    setting: Any,
    cpu: float,
    bias: float = 0.0,
    half_width: float = 0.0,
    mean_bias: float = 0.0,
) -> Run:
    """100 replicas of standard deviation 0.02, or of a quarter or four times the simulated time."""
    ratio = {"0.375": 4.0, "6": 0.25}.get(str(setting), 1.0) if parameter == TIME else 1.0
    noise = np.random.default_rng(5).normal(size=100)
    goal = estimate(0.3 + 0.02 * np.sqrt(ratio) * (noise - noise.mean()) / noise.std(ddof=1))
    return Run(
        parameter,
        str(setting),
        100,
        Estimate(cpu, 1e-3 * cpu),
        goal,
        goal,
        Estimate(bias, half_width),
        Estimate(mean_bias, 0.0),
    )


def study_of(*runs: Run) -> ConvergenceStudy:
    """A replica costs 0.05 s + 0.1 s for each of 1.5 s recorded and 0.8 s of warm-up."""
    settings = {FACETS: 256, MOTION: "sinusoidal", WARM_UP: 0.8, ELASTIC_SPEED: 1.0}
    settings |= {POINTS: 20_000, GAUGE: 1.0, TIME: 1.5}
    times = [run(TIME, 0.375, 0.1675), run(TIME, 6, 0.73), run(WARM_UP, 0.2, 0.22, 0.0, 0.03)]
    sizes = tuple(
        BatchSize(k, 400 // k, 0.02 / k**0.5, student_quantile(k - 1) * 0.02 / k**0.5, 0.28 * k)
        for k in (4, 8, 16, 32)
    )
    return ConvergenceStudy(
        design=load_design(DESIGNS / "gear.toml"),
        settings=settings,
        reference=run("reference", "", 0.28),
        runs=(*times, *runs),
        sizes=sizes,
        law=ErrorLaw(1.96 * 0.02 * 0.28**0.5, 0.5, 0.05),
        resolved_s=0.0,
        cost=EvaluationCost(0.0, 0.0),
        cpu_s=300.0,
        wall_s=150,
    )


def test_replicas_are_those_whose_interval_is_narrow_enough() -> None:
    """The interval of random replicas is within the accuracy in nine of ten simulations."""
    rng, goal = np.random.default_rng(6), 0.005
    for shared in (0.0, 0.004):
        study = study_of()
        own = replace(study.reference.objective, shared=(shared / shared_half_width([1.0]),))
        study = replace(study, reference=replace(study.reference, objective=own), sizes=NO_SIZES)
        needed = replicas_for(study, goal, 1.5)
        runs = 0.02 * rng.normal(size=(400, needed))
        widths = [estimate(one, shared=own.shared).half_width for one in runs]
        assert 0.85 <= np.mean(np.array(widths) <= goal) <= 0.95
    assert replicas_for(study, goal, 6.0) == pytest.approx(needed / 4, rel=0.2)
    assert replicas_for(study_of(), 0.5, 1.5) == 4  # fewer were not tried
    assert replicas_for(replace(study_of(), resolved_s=30.0), 0.5, 1.5) == 20  # for their dents


def test_cheapest_setting_within_a_third_of_the_accuracy_is_taken() -> None:
    coarse, middle = run(FACETS, 16, 0.14, 0.004, 0.001), run(FACETS, 64, 0.21, 0.001, 0.001)
    study = study_of(coarse, middle, run(ELASTIC_SPEED, 100, 0.2799))
    loose, usual, tight = (recommend(study, accuracy) for accuracy in (0.05, 0.01, 0.001))
    assert [one.settings[FACETS] for one in (loose, usual, tight)] == [16, 64, 256]
    assert usual.settings[ELASTIC_SPEED] == 1.0  # a coarser one saves no more than chance
    assert usual.settings[WARM_UP] == 0.8  # its bias is not known to 0.0033
    assert any(WARM_UP in text and "not known well enough" in text for text in usual.remarks)
    assert tight.remarks[0].startswith(f"{FACETS}, {WARM_UP}: cheaper settings may do")
    # More recorded time shares the cost of start and warm-up.
    assert tight.settings[TIME] == 6.0
    seconds = tight.settings[TIME] + tight.settings[WARM_UP]
    assert tight.cpu_s == pytest.approx(tight.replicas * (0.05 + 0.1 * seconds))
    assert usual.cpu_s < tight.cpu_s / 40
    with_build = recommend(replace(study, cost=EvaluationCost(3.0, 0.0)), 0.01)
    assert with_build.cpu_s == pytest.approx(usual.cpu_s + 3.0)


def test_a_shorter_warm_up_saves_its_own_cpu_time() -> None:
    rough = recommend(study_of(), 0.1)
    assert rough.settings[WARM_UP] == 0.2
    assert rough.cpu_s == pytest.approx(
        rough.replicas * (0.05 + 0.1 * (rough.settings[TIME] + 0.2))
    )


def test_an_accuracy_out_of_reach_is_reported() -> None:
    advice = recommend(study_of(), 1e-5)
    assert advice.replicas == 0
    assert "not reachable with these settings" in advice.lines[0]
    assert all(line.startswith("#") for line in advice.lines)
    study = study_of()
    own = replace(study.reference.objective, shared=(0.02,))
    by_points = recommend(replace(study, reference=replace(study.reference, objective=own)), 0.01)
    assert by_points.replicas == 0
    assert any("± 0.039 comes from the choice of points" in text for text in by_points.remarks)


def test_the_gauge_is_what_is_measured_and_not_how_well() -> None:
    """A wider one is cheaper and without a bias, and still not recommended."""
    study = study_of(run(GAUGE, 4.0, 0.1))
    for accuracy in (0.05, 0.01):
        found = recommend(study, accuracy)
        assert found.settings[GAUGE] == 1.0
        assert "gauge_mm2 = 1" in found.lines
        assert not any(GAUGE in text for text in found.remarks)


def test_a_law_without_a_cost_of_halving_is_told_and_written() -> None:
    for law in (None, ErrorLaw(0.1, -0.2), ErrorLaw(0.1, 0.15, 0.4)):
        study = replace(study_of(), law=law)
        assert "batches do not tell what halving the error costs" in describe_error_law(study)
        record = convergence_record(study)
        assert record.halving.times is None
        assert json.loads(json.dumps(record.as_json(), allow_nan=False))["halving"]["high"] is None


def test_the_cost_of_halving_the_error_is_compared_with_independent_replicas() -> None:
    assert "as independent replicas should: 4" in describe_error_law(study_of())
