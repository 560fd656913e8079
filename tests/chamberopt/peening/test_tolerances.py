"""Figures over a box of tolerances, of responses that are known."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import FIRST_OF_CALIBRATION, Estimate, estimate
from chamberopt.common.executor import SerialExecutor
from chamberopt.design.load import Design
from chamberopt.peening.responses import combine, on_scale, scale_of
from chamberopt.peening.tolerance_result import EffectEnds, ToleranceResult
from chamberopt.peening.tolerances import (
    find_tolerances,
    plan_tolerances,
    simulate_tolerances,
    with_usual_tolerances,
)
from chamberopt.simulation.evaluate import evaluate
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.simulation.variations import RunsProgress, Variations
from tests.helpers.synthetic import judged, plate_design

BOX = {"amplitude_um": 2, "shot.mass_g": ["-10 %", "0 %"], "process.treatment_time_s": "4 %"}
POWERS = {"sonotrode.amplitude_um": 1.4, "shot.mass_g": 0.7, "process.treatment_time_s": 1.0}
PLATE = plate_design()
DOSE = 0.5  # dent density of the plate as designed
REPLICAS = 8
Response = Callable[[dict[str, float]], float]

ZERO = EffectEnds(low=Estimate(0.0, 0.0), high=Estimate(0.0, 0.0))


def tolerated(tolerances: dict, **values: float) -> Design:
    return plate_design(**values).changed({"tolerances": tolerances})


def changes(design: Design) -> dict[str, float]:
    """Logarithms of the numbers over those of the plate; the mass is that of its whole balls."""
    found = {name: np.log(design.value(name) / PLATE.value(name)) for name in POWERS}
    return found | {"shot.mass_g": np.log(design.shot.count / PLATE.shot.count)}


def power_law(u: dict[str, float]) -> float:
    return DOSE * float(np.exp(sum(power * u[name] for name, power in POWERS.items())))


def simulator(noise: Callable[[], np.ndarray], law: Response) -> Callable[[Design], Evaluation]:
    """Evaluates designs by the dent density that the law gives, with noise (n,) on it."""

    def evaluate(design: Design) -> Evaluation:
        doses = law(changes(design)) * (1.0 + noise())
        figures = {
            "mean_coverage": estimate(-np.expm1(-doses), 0.0, 1.0),
            "impacts_per_mm2_s": estimate(2.0 * doses, 0.0),
            "time_to_98_s": estimate(400.0 / doses, 0.0),
            "shot_count": Estimate(30.0, 0.0, (30.0,) * REPLICAS),
            "p05_coverage": Estimate(0.3, np.inf, in_words="not resolved"),
        }
        return replace(judged(doses), metrics=figures)

    return evaluate


def found_by(evaluate: Callable[[Design], Evaluation], design: Design) -> ToleranceResult:
    return find_tolerances(design, plan_tolerances(design), evaluate(design), evaluate)


def sampled_coverage(rng: np.random.Generator, count: int = 100_000) -> np.ndarray:
    """Mean coverage of the power law at random places of the box."""
    amplitude = rng.uniform(23.0, 27.0, count) / 25.0
    mass, time = rng.uniform(0.9, 1.0, count), rng.uniform(0.96, 1.04, count)
    return np.asarray(-np.expm1(-DOSE * amplitude**1.4 * mass**0.7 * time))


def common_noise() -> np.ndarray:
    return np.asarray(0.02 * np.linspace(-1.0, 1.0, REPLICAS))


def test_a_power_law_is_recovered() -> None:
    """On its scale a power law is a straight line: quantiles, corners and effects are exact."""
    design = tolerated(BOX)
    found = found_by(simulator(common_noise, power_law), design)
    coverage = found.figures["mean_coverage"]
    truth = sampled_coverage(np.random.default_rng(1))
    assert coverage.q05.value == pytest.approx(np.quantile(truth, 0.05), abs=4e-4)
    assert coverage.q95.value == pytest.approx(np.quantile(truth, 0.95), abs=4e-4)
    ends = coverage.effects["sonotrode.amplitude_um"]
    low, high = ends.low, ends.high
    at = [-np.expm1(-DOSE * ratio**1.4) + np.expm1(-DOSE) for ratio in (23 / 25, 27 / 25)]
    assert [low.value, high.value] == pytest.approx(at, abs=2e-5)
    assert coverage.effects["shot.mass_g"].high == Estimate(0.0, 0.0)
    assert found.worst_for == "mean_coverage"  # the 5th percentile is not resolved
    mass = PLATE.value("shot.mass_g")
    assert list(found.corner.values()) == pytest.approx([23.0, 0.9 * mass, 4.8])
    assert coverage.lowest.value == pytest.approx(coverage.corner.predicted.value)
    assert coverage.corner.simulated.value == pytest.approx(
        coverage.corner.predicted.value, abs=2e-5
    )
    assert coverage.corner.agrees
    assert set(found.figures) == {"mean_coverage", "impacts_per_mm2_s", "time_to_98_s"}
    assert found.notes[0].startswith("not resolved over the tolerances: p05_coverage; raise ")
    assert "27 to 30 whole balls" in found.notes[1]


def test_intervals_hold_the_truth() -> None:
    """Independent noise of 2 % in each replica, much as in the chamber."""
    truth = np.quantile(sampled_coverage(np.random.default_rng(2)), 0.05)
    design, held = tolerated(BOX), []
    numbers = plan_tolerances(design)
    for seed in range(25):
        rng = np.random.default_rng(seed)
        run = simulator(lambda rng=rng: 0.02 * rng.standard_normal(REPLICAS), power_law)
        found = find_tolerances(design, numbers, run(design), run)
        coverage = found.figures["mean_coverage"]
        low = coverage.effects["sonotrode.amplitude_um"].low
        true_low = -np.expm1(-DOSE * (23 / 25) ** 1.4) + np.expm1(-DOSE)
        held.append(
            (
                abs(coverage.q05.value - truth) <= coverage.q05.half_width,
                abs(low.value - true_low) <= low.half_width,
                coverage.corner.agrees,
            )
        )
    # 95 % of 25; one time in 150 fewer than 21 hold.
    assert (np.sum(held, axis=0) >= 21).all()


def test_curvature_that_the_worst_corner_shows_is_named() -> None:
    def bent(u: dict[str, float]) -> float:
        return power_law(u) * float(np.exp(-8.0 * u["sonotrode.amplitude_um"] ** 2))

    found = found_by(simulator(common_noise, bent), tolerated(BOX))
    assert not found.figures["mean_coverage"].corner.agrees
    assert "mean_coverage, impacts_per_mm2_s, time_to_98_s: not as first" in found.notes[-1]


def test_what_a_calibration_leaves_open_moves_all_runs_alike() -> None:
    """It widens the quantiles, and effects as far as they go with the figure itself."""
    design, run = tolerated(BOX), simulator(common_noise, power_law)
    nominal = run(design)
    wider = {
        name: one.with_shared(FIRST_OF_CALIBRATION, (0.02,)) if one.half_width < np.inf else one
        for name, one in nominal.metrics.items()
    }
    numbers = plan_tolerances(design)
    plain = find_tolerances(design, numbers, nominal, run).figures["mean_coverage"]
    calibrated = find_tolerances(design, numbers, replace(nominal, metrics=wider), run)
    open_ = calibrated.figures["mean_coverage"]
    assert open_.q05.half_width > 0.03 > plain.q05.half_width
    assert open_.corner.simulated.half_width > 0.03
    time = calibrated.figures["time_to_98_s"]  # how long is peened does not change it
    assert time.effects["process.treatment_time_s"] == ZERO
    name = "sonotrode.amplitude_um"
    wide, narrow = open_.effects[name].low, plain.effects[name].low
    assert narrow.half_width < wide.half_width < narrow.half_width + 0.1 * abs(narrow.value)


def test_near_full_coverage_intervals_are_as_wide_as_their_own() -> None:
    """Dents to 20 %: the ends of intervals are coverages of some dents less, by no linear rule."""
    design = tolerated(BOX)
    doses = np.array([10.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0, 19.0])
    covered = estimate(-np.expm1(-15.25) + np.exp(-15.25) * (doses - 15.25), 0.0, 1.0)
    steep = replace(covered, half_width=float(np.exp(-15.25 + 2.5)))

    def run(design: Design) -> Evaluation:
        return replace(judged(doses), metrics={"p95_coverage": steep})

    figure = found_by(run, design).figures["p95_coverage"]
    on = on_scale(steep, scale_of("p95_coverage"))
    assert on.low == pytest.approx(np.log(15.25 - 2.5), abs=0.02)
    assert figure.q05.half_width < 10.0 * steep.half_width
    assert figure.nominal.half_width == steep.half_width


def test_the_effect_of_the_peening_time_has_the_error_of_the_figure_itself() -> None:
    """It moves the same impacts: what does not go with time has exactly no effect."""
    design, noise = tolerated(BOX), 0.1 * np.linspace(-1.0, 1.0, REPLICAS)

    def run(design: Design) -> Evaluation:
        u = changes(design)
        doses = power_law(u) * (1.0 + noise)
        still = power_law({**u, "process.treatment_time_s": 0.0}) * (1.0 + noise)
        figures = {
            "impacts_per_mm2_s": estimate(still, bias=0.2),
            "exposure": estimate(doses, bias=0.04 * doses.mean()),
        }
        return replace(judged(doses), metrics=figures)

    figures = found_by(run, design).figures
    time = "process.treatment_time_s"
    assert figures["impacts_per_mm2_s"].effects[time] == ZERO
    low = figures["exposure"].effects[time].low
    assert low.value == pytest.approx(-0.04 * DOSE)
    share = figures["exposure"].nominal.half_width / DOSE
    assert low.half_width == pytest.approx(share * abs(low.value), rel=0.05)


def test_a_corner_may_lie_on_a_bound_of_its_number() -> None:
    """A range about the corner itself would go beyond."""
    design = tolerated({"materials.wall.C0": [0, 0.09], "amplitude_um": 2})
    found = found_by(simulator(common_noise, power_law), design)
    assert found.corner == {"materials.wall.C0": 1.0, "sonotrode.amplitude_um": 23.0}
    assert found.figures["mean_coverage"].corner is not None


def test_few_balls_change_by_whole_ones() -> None:
    """The slope belongs to the mass that is there: 5 balls, of which the tolerance is no ball."""
    design = tolerated({"shot.mass_g": "1 %"}, shot__mass_g=5 * PLATE.value("shot.mass_g") / 30)
    (number,) = plan_tolerances(design)
    assert design.shot.count == 5
    assert number.changed.shot.count == 4
    assert number.step == pytest.approx(np.log(4 / 5), abs=1e-3)


def test_a_step_that_the_design_cannot_have_is_made_smaller() -> None:
    design = tolerated({"chamber.sonotrode_distance_mm": [-0.1, 1.0]}, chamber__height_mm=16.5)
    (number,) = plan_tolerances(design)
    assert number.changed.value("chamber.sonotrode_distance_mm") < 15.0


def test_a_design_without_tolerances_has_the_usual_one() -> None:
    """4 µm peak to valley, given in either way: 25 ± 2 µm zero to peak, 50 ± 4 peak to valley."""
    (number,) = plan_tolerances(PLATE)
    assert (number.name, number.low, number.high) == ("sonotrode.amplitude_um", 23.0, 27.0)
    twice = {"sonotrode.amplitude_um": None, "sonotrode.amplitude_pv_um": 50.0}
    (number,) = plan_tolerances(PLATE.changed(twice))
    assert (number.name, number.low, number.high) == ("sonotrode.amplitude_pv_um", 46.0, 54.0)
    assert with_usual_tolerances(tolerated({"shot.mass_g": "2 %"})).tolerances.keys() == {
        "shot.mass_g"
    }


def test_an_empty_table_of_tolerances_is_refused() -> None:
    with pytest.raises(InputError, match=r"tolerances: the table is empty; give one"):
        plan_tolerances(tolerated({}))


def test_a_face_that_hardly_moves_cannot_have_the_usual_tolerance() -> None:
    with pytest.raises(InputError, match=r"tolerances\.amplitude_pv_um"):
        plan_tolerances(PLATE.changed({"sonotrode.amplitude_um": 1.0}))


def test_a_short_real_run() -> None:
    """The nominal run is that of `evaluate`, and another peening time is not simulated."""
    short = {"simulated_time_s": 0.3, "warmup_time_s": 0.05, "replicas": 3, "points": 1000}
    values = {f"process__accuracy__{name}": value for name, value in short.items()}
    values["process__treatment_time_s"] = 2.5
    design = tolerated({"amplitude_um": 2, "process.treatment_time_s": "4 %"}, **values)
    chamber, done = build_chamber(design), []
    nominal, found = simulate_tolerances(
        design, chamber, SerialExecutor(), lambda *at: done.append(at)
    )
    assert nominal.metrics == evaluate(design, chamber, SerialExecutor()).metrics
    assert len(done) == 9  # nominal, amplitude and the worst corner
    assert done[-1] == (9, 9, None)
    assert found.corner == {"sonotrode.amplitude_um": 23.0, "process.treatment_time_s": 2.4}
    low = found.figures["mean_coverage"].effects["process.treatment_time_s"].low
    runs = Variations(design, chamber, SerialExecutor(), RunsProgress(None, 1))
    changed = design.changed({"process.treatment_time_s": 2.4})
    at_low = runs.run(changed, replicas=runs.known.replicas)
    gap = at_low.metrics["mean_coverage"].value - nominal.metrics["mean_coverage"].value
    assert low.value == pytest.approx(gap, abs=1e-4)
    one = nominal.metrics["mean_coverage"]
    assert low.half_width / abs(gap) == pytest.approx(one.half_width / one.value, rel=0.2)
    assert found.figures["impacts_per_mm2_s"].effects["process.treatment_time_s"].low.value == 0.0
    scale = scale_of("mean_coverage")
    ends = {"low": at_low, "nominal": nominal}
    pair = {end: on_scale(one.metrics["mean_coverage"], scale) for end, one in ends.items()}
    change = combine(pair, {"low": 1.0, "nominal": -1.0})
    assert change.value / np.log(4.8 / 5.0) == pytest.approx(1.0, abs=0.05)
