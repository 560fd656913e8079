"""An evaluation does not depend on the workers and stops at the wanted accuracy or the budget."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.proposal import Wanted
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate, estimate, paired_difference
from chamberopt.common.executor import SerialExecutor, local_executor
from chamberopt.coverage.dents import dent_diameter
from chamberopt.coverage.field.surface_points import Reach
from chamberopt.coverage.metrics import OBJECTIVES, metric_names
from chamberopt.coverage.part_impacts import Hits
from chamberopt.design.design import validate
from chamberopt.design.load import Design
from chamberopt.simulation.effort import MIN_REPLICAS_TO_STOP
from chamberopt.simulation.estimates import (
    SeenDents,
    estimate_metrics,
    objective_estimate,
    reach_notes,
    weighted_sum,
)
from chamberopt.simulation.evaluate import MAX_SPEED, ReplicaPlan, evaluate, prepare_target
from chamberopt.simulation.replicas import ReplicaSet, ReplicaSetting, Underway, simulate_replica
from tests.helpers.synthetic import evaluation_of, plane_chamber, plate_design, random_dents

DESIGN = plate_design(process__treatment_time_s=50.0)
PLANE = plane_chamber()


def poisson_replicas(rng: np.random.Generator, replicas: int, per_mm2: float) -> list[Hits]:
    mean = 1e6 * per_mm2 / replicas * PLANE.part.area * PLANE.part.target
    return [random_dents(DESIGN, PLANE, mean, rng) for _ in range(replicas)]


def test_pseudovalues_of_a_mean_are_the_sample() -> None:
    # For a ratio of sums whose denominator is fixed the jackknife is the plain mean and its
    # standard error: s/√n · t(n-1).
    replicas = poisson_replicas(np.random.default_rng(5), 6, 20.0)
    got = evaluation_of(DESIGN, PLANE, replicas).metrics["impacts_per_mm2_s"]
    each = np.array([len(hits) for hits in replicas]) / (225.0 * DESIGN.process.recorded_time)
    np.testing.assert_allclose(got.pseudovalues, each, rtol=1e-9)
    assert got.value == pytest.approx(each.mean())
    assert got.half_width == pytest.approx(2.570582 * each.std(ddof=1) / np.sqrt(6), rel=1e-6)


def test_random_dents_on_a_plane_cover_what_avrami_says() -> None:
    """All figures of an even field: x is dented area over area, by the treatment time."""
    replicas = poisson_replicas(np.random.default_rng(6), 8, 60.0)
    found = evaluation_of(DESIGN, PLANE, replicas)
    seconds = 8 * DESIGN.process.recorded_time
    assert found.simulated_time == pytest.approx(seconds)
    x = 60.0 * 0.01 * DESIGN.process.treatment_time / seconds
    for metrics in (found.metrics, found.metrics_of_wide):
        mean, std, low = (metrics[f"{name}_coverage"] for name in ("mean", "std", "p05"))
        assert abs(mean.value + np.expm1(-x)) < mean.half_width + 1e-3
        assert std.low <= 0.0
        assert std.value < 0.03
        assert abs(low.value + np.expm1(-x)) < low.half_width + 1e-3
        exposure = metrics["exposure"]
        assert abs(exposure.value - x / np.log(50.0)) < exposure.half_width
        time = metrics["time_to_98_s"]
        assert abs(time.value - DESIGN.process.treatment_time * np.log(50.0) / x) < time.half_width
    assert found.metrics["intensity_uniformity"].high >= 1.0 - 1e-9
    assert found.resolution.has_mean
    assert found.resolution.has_places
    assert found.resolution.dents == pytest.approx(60.0, rel=0.05)
    assert (found.reachable, found.crease_share, found.notes) == (1.0, 0.0, ())
    assert set(found.metrics) == set(metric_names(DESIGN))
    of_windows = {f"{name}_coverage" for name in ("mean", "std", "p05", "p95")}
    of_windows |= {"exposure", "p95_exposure", "time_to_98_s"}
    assert set(found.metrics_of_wide) == of_windows


def test_without_wide_windows_all_other_figures_are_the_same() -> None:
    hits = poisson_replicas(np.random.default_rng(7), 3, 20.0)
    field, found = prepare_target(DESIGN, PLANE, chamber_mesh(PLANE)), []
    for has_wide in (True, False):
        seen = SeenDents.none(field, has_wide)
        seen.add(hits)
        found.append(estimate_metrics(seen, hits, PLANE, DESIGN))
    assert found[1] == found[0]._replace(metrics_of_wide={})
    assert found[0].metrics_of_wide


def test_a_note_says_how_high_coverage_can_go_with_some_of_the_target_out_of_reach() -> None:
    """r of the area covered to 1 and the rest bare: mean r, standard deviation sqrt(r (1 - r))."""
    covered = np.repeat([1.0, 0.0], [80, 20])
    (note,) = reach_notes(Reach(0.8))
    assert "20.0% of the target is out of reach" in note
    highest = f"mean coverage above {covered.mean():.2f} or a uniform coverage above "
    assert f"{highest}{covered.mean() - covered.std():.2f}" in note
    assert reach_notes(Reach(0.999)) == ()
    assert "uniform coverage above 0.00" in reach_notes(Reach(0.4))[0]
    (of_zone,) = reach_notes(Reach(0.8), "zone root")
    assert of_zone.startswith("20.0% of zone root is out of reach")
    bare = "and the coverage that 95 % of the area exceeds is 0"
    assert of_zone.endswith(f"mean coverage above 0.80, {bare}")


def test_dents_are_looked_at_once_however_replicas_come() -> None:
    replicas = poisson_replicas(np.random.default_rng(7), 5, 60.0)
    field = prepare_target(DESIGN, PLANE, chamber_mesh(PLANE))
    whole, part = SeenDents.none(field), SeenDents.none(field)
    whole.add(replicas)
    for count in (2, 2, 3, 5):
        part.add(replicas[:count])
        assert len(part.gauge) == len(part.wide) == count
    both = [estimate_metrics(seen, replicas, PLANE, DESIGN) for seen in (whole, part)]
    assert both[0] == both[1]


def test_the_widest_dent_is_that_of_a_ball_much_faster_than_the_sonotrode() -> None:
    field = prepare_target(DESIGN, PLANE, chamber_mesh(PLANE))
    material, shot = DESIGN.materials.part, DESIGN.shot
    fast = np.array([MAX_SPEED * DESIGN.sonotrode.peak_speed])
    wanted = dent_diameter(fast, shot.diameter, shot.density, material)[0]
    assert field.setting.largest_dent == pytest.approx(wanted)
    assert field.setting.ball == shot.diameter
    assert field.setting.gauge == pytest.approx(1e-6)


def test_what_is_made_of_a_clipped_value_agrees_with_its_interval() -> None:
    """Objective and gain do not keep the overshoot of a clipped correction in their intervals."""
    metrics = {
        "mean_coverage": estimate([0.7, 0.8, 0.75]),
        "std_coverage": estimate([0.6, 0.7, 0.62], 0.0, 0.5),
    }
    goal = weighted_sum(OBJECTIVES["uniform_coverage"], metrics)
    assert goal.value == pytest.approx(0.75 - 0.5)
    assert np.mean(goal.pseudovalues) == pytest.approx(goal.value)
    gain = paired_difference(goal, estimate(0.5 * np.array(goal.pseudovalues)))
    assert np.mean(gain.pseudovalues) == pytest.approx(gain.value)


def test_numbers_of_the_design_are_exact_terms_of_an_objective() -> None:
    mean = estimate([0.7, 0.8, 0.75])
    exact, mixed = (
        objective_estimate(name, {"mean_coverage": mean}, DESIGN)
        for name in ("minus_treatment_time_s", "2 mean_coverage + -0.01 process.treatment_time_s")
    )
    assert (exact.value, exact.half_width, exact.pseudovalues) == (-50.0, 0.0, (-50.0,) * 3)
    assert mixed.value == pytest.approx(2.0 * 0.75 - 0.5)
    assert mixed.half_width == pytest.approx(2.0 * mean.half_width)


def test_an_objective_of_what_is_not_known_is_not_known() -> None:
    metrics = {
        "mean_coverage": estimate([0.7, 0.8, 0.75]),
        "std_coverage": estimate([0.1, 0.12, 0.11]).not_known("not resolved"),
        "time_to_98_s": Estimate(1e6, 0.0, (1e6,) * 3, in_words="never"),
    }
    goal = weighted_sum(OBJECTIVES["uniform_coverage"], metrics)
    assert (goal.in_words, goal.half_width) == ("not resolved", np.inf)
    assert goal.value == pytest.approx(0.75 - 0.11)
    never = weighted_sum(OBJECTIVES["minus_time_to_98_s"], metrics)
    assert (never.value, never.half_width, never.in_words) == (-1e6, 0.0, "never")


def test_evaluate_gives_the_same_numbers_on_any_number_of_workers() -> None:
    design = plate_design(
        process__accuracy__simulated_time_s=0.02, process__accuracy__warmup_time_s=0.02,
        process__accuracy__replicas=4,
    ).changed({"effects.friction": "none", "effects.roughness": "none"})  # fmt: skip
    chamber = build_chamber(design)
    seen: list[tuple[float, int, float | None]] = []
    serial = evaluate(design, chamber, SerialExecutor(), lambda *args: seen.append(args))
    with local_executor(3) as executor:
        threaded = evaluate(design, chamber, executor)
    assert serial.objective == threaded.objective
    assert serial.metrics == threaded.metrics
    assert serial.metrics_of_wide == threaded.metrics_of_wide
    for one, other in zip(serial.hits, threaded.hits, strict=True):
        np.testing.assert_array_equal(one.place, other.place)
        np.testing.assert_array_equal(one.dent, other.dent)
    assert seen == sorted(seen)
    assert seen[-1] == (4, 4, None)
    impacts = sum(len(hits) for hits in serial.hits)
    assert impacts > 0
    assert serial.simulated_time == pytest.approx(0.08)
    assert serial.collisions["total"] > impacts
    assert any("process.accuracy.simulated_time_s" in note for note in serial.notes)
    assert sum(note.startswith('effects.friction is "none"') for note in serial.notes) == 1
    # Replicas there are, are added to: the same as all at once.
    known = ReplicaSet()
    few = evaluate(design, chamber, SerialExecutor(), plan=ReplicaPlan(3), known=known)
    assert (few.replicas, len(few.hits), len(known.replicas)) == (3, 3, 3)
    assert evaluate(design, chamber, SerialExecutor(), known=known).metrics == serial.metrics
    # Fresh draws for a confirmation.
    other = evaluate(design, chamber, SerialExecutor(), plan=ReplicaPlan(3, "confirm"))
    assert other.objective.value != serial.objective.value
    assert (other.stream, other.replicas) == ("confirm", 3)


def test_a_gauge_too_small_for_the_target_is_refused_before_anything_is_simulated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def nothing(*_: object) -> Callable:
        raise AssertionError("a replica was simulated")

    monkeypatch.setattr("chamberopt.simulation.evaluate.run_in_order", nothing)
    design = plate_design(process__accuracy__gauge_mm2=1e-3)
    chamber = build_chamber(design)
    with pytest.raises(InputError, match=r"process\.accuracy\.gauge_mm2.*give at least 0\.0013"):
        evaluate(design, chamber, SerialExecutor())


def accurate(coverage: float, most: int) -> Design:
    """The plate in short replicas, with a wanted half-width and a maximum number."""
    design = plate_design(
        process__accuracy__simulated_time_s=0.3, process__accuracy__warmup_time_s=0.02
    )
    accuracy = {
        **design.process.accuracy.model_dump(),
        "objective_half_width": coverage,
        "max_replicas": most,
    }
    return validate(
        Design,
        {**design.model_dump(), "process": {**design.process.model_dump(), "accuracy": accuracy}},
    )


def test_replicas_are_added_until_the_accuracy_holds_or_the_budget_ends() -> None:
    chamber = build_chamber(accurate(0.2, 100))
    told: list[tuple[float, int]] = []
    loose = evaluate(
        accurate(0.2, 100), chamber, SerialExecutor(), progress=lambda *now: told.append(now[:2])
    )
    assert {total for _, total in told[:-1]} == {100}
    assert told[-1] == (loose.replicas, loose.replicas)
    assert loose.stopped_by == "accuracy"
    assert loose.objective.half_width <= 0.2
    assert loose.replicas >= MIN_REPLICAS_TO_STOP
    tight = evaluate(accurate(0.001, 14), chamber, SerialExecutor())
    assert (tight.stopped_by, tight.replicas) == ("max_replicas", 14)
    assert tight.objective.half_width > 0.001
    assert any("max_replicas = 14" in note and "not reached" in note for note in tight.notes)
    # The same replicas at once give the same: how they were added leaves no trace.
    again = evaluate(accurate(0.001, 14), chamber, SerialExecutor(), plan=ReplicaPlan(14))
    assert again.metrics == tight.metrics
    assert again.stopped_by == "replicas"


def test_a_figure_that_is_not_resolved_does_not_reach_the_wanted_accuracy() -> None:
    """Too few dents give no interval: replicas are added until there are enough."""
    design = accurate(0.4, 12).changed({"process.accuracy.simulated_time_s": 0.002})
    found = evaluate(design, build_chamber(design), SerialExecutor())
    assert found.objective.half_width == np.inf
    assert (found.stopped_by, found.replicas) == ("max_replicas", 12)
    assert not any("± inf" in note for note in found.notes)


def test_a_figure_without_an_interval_is_not_resolved() -> None:
    """The spread of intensity takes four replicas, of which a design may have three."""
    found = evaluation_of(DESIGN, PLANE, poisson_replicas(np.random.default_rng(8), 3, 60.0))
    assert found.resolution.has_places
    assert found.metrics["intensity_uniformity"].in_words == "not resolved"
    for name in ("mean_coverage", "std_coverage", "p05_coverage"):
        assert np.isfinite(found.metrics[name].half_width)
        assert found.metrics[name].in_words == ""


def test_an_accuracy_that_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match=r"process\.accuracy\.max_replicas.*below replicas"):
        accurate(0.01, 5)
    with pytest.raises(InputError, match=r"process\.accuracy\.objective_half_width"):
        accurate(-0.01, 50)


def test_an_objective_keeps_what_replicas_do_not_show() -> None:
    """Of one metric it has the metric's interval and bias; of two it has both surpluses."""
    replicas = (0.4, 0.5, 0.6)
    shown = estimate(replicas).half_width
    one = Estimate(0.5, shown + 0.07, replicas, bias=0.02)
    alone = weighted_sum(OBJECTIVES["p05_coverage"], {"p05_coverage": one})
    assert alone.half_width == pytest.approx(one.half_width)
    assert alone.bias == one.bias
    metrics = {"mean_coverage": one, "std_coverage": one}
    both = weighted_sum(OBJECTIVES["uniform_coverage"], metrics)
    assert both.half_width == pytest.approx(0.14)  # the replicas cancel out
    assert both.bias == pytest.approx(0.04)


def test_a_replica_tells_how_far_it_has_come() -> None:
    design = plate_design(
        process__accuracy__simulated_time_s=0.8, process__accuracy__warmup_time_s=0.4
    )
    chamber = build_chamber(design)
    setting = ReplicaSetting(design, chamber, chamber_mesh(chamber))
    here, elsewhere = Underway(setting, setting), Underway(setting, setting._replace())
    seen: list[float] = []
    simulate_replica(setting, 1, lambda seed, part, held: seen.append(part))
    assert seen == sorted(seen)
    assert 6 <= len(seen) <= 8  # at least every 0.2 s
    assert seen[-1] == pytest.approx(1.0)
    here.task(setting, 1)
    elsewhere.task(setting, 1)
    assert (here.done, elsewhere.done) == (pytest.approx(1.0), 0.0)
    here.tell(2, 0.25, np.array([[1e-3, 2e-3, 3e-3]]))
    assert here.done == pytest.approx(1.25)
    assert here.held() == {"balls": 1, "place": "(1.0, 2.0, 3.0) mm"}
    here.tell(2, 1.0, np.array([[1e-3, 2e-3, 3e-3]]))
    assert here.held() == {"balls": 0, "place": ""}  # it runs no more


def test_a_target_that_no_ball_touches_has_no_figures(tmp_path: Path) -> None:
    """The bottom of a slot of 2 mm, and balls of 3 mm. A search refuses such a candidate."""
    block, slot = trimesh.creation.box((30, 30, 20)), trimesh.creation.box((2, 40, 20))
    slot.apply_translation((0.0, 0.0, 5.0))
    trimesh.boolean.difference([block, slot]).export(tmp_path / "slotted.stl")
    bottom = [{"at_mm": [0.0, 0.0, -5.0]}]
    made = propose(tmp_path / "slotted.stl", Wanted("mm", ball_mm=3.0), lambda known: [])
    design = made.design.changed({"part.target": {"faces": bottom}, "mask": None, "holder": None})
    chamber = build_chamber(design)
    with pytest.raises(InputError, match=r"part\.target: a ball of 3 mm touches nothing of it"):
        prepare_target(design, chamber, chamber_mesh(chamber))
