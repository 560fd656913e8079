"""The dents of several steps add up by place, as independent random dents do."""

from functools import cache

import numpy as np
import pytest

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import FIRST_OF_CALIBRATION, Estimate
from chamberopt.common.executor import SerialExecutor
from chamberopt.coverage.field.surface_points import ball_fits, spread_points
from chamberopt.coverage.metrics import metric_names
from chamberopt.coverage.part_impacts import in_pose_of
from chamberopt.design.calibration import PARAMETERS
from chamberopt.design.load import Design, load_design
from chamberopt.peening.calibration_errors import evaluate_calibrated
from chamberopt.simulation.budget_pilot import measure_budget
from chamberopt.simulation.estimates import OF_EACH_STEP
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate, rooms_of
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.simulation.replicas import (
    Replica,
    ReplicaSet,
    ReplicaSetting,
    join_steps,
    simulate_replica,
)
from chamberopt.simulation.trapped_balls import NOT_TRAPPED
from tests.helpers.synthetic import DESIGNS, machine_values, no_hits, random_dents

REPLICAS, DENT = 6, 1e-8  # area of a dent of random_dents [m²]
COUNTS = {"walls": 0, "balls": 0, "sonotrode": 0, "total": 0}
TURNED = {"name": "turned", "part": {"rotate_deg": (180.0, 0.0, 0.0)}}
SIDE = {"direction": (0.0, 0.0, 1.0), "angle_deg": (0.0, 10.0)}
BOX = ((-13.0, -13.0, -0.1), (13.0, 13.0, 10.1))
LOWER = {"name": "lower", "target": {**SIDE, "direction": (0.0, 0.0, -1.0), "box_mm": BOX}}
UPPER = {"name": "upper", "target": {**SIDE, "box_mm": BOX}}


def plate(*further: dict, **more: object) -> Design:
    """The plate that is peened on both sides, in other steps after the first."""
    design = load_design(DESIGNS / "plate_both_sides.toml")
    steps = ({"name": "first_side"}, *further)
    values = {"process.accuracy.points": 2000, "process.treatment_time_s": 8, **more}
    return design.changed({**values, "steps": steps if further else None})


def random_replicas(
    design: Design, chamber: Chamber, densities: tuple[float, ...]
) -> list[Replica]:
    """Replicas whose steps have random dents, with these dent densities after all of their time."""
    rng, found = np.random.default_rng(4), []
    for _ in range(REPLICAS):
        steps = []
        for x, one, room in zip(densities, design.in_steps.values(), chamber.steps, strict=True):
            time_ratio = one.process.recorded_time / one.process.treatment_time
            mean = x * time_ratio * room.exposed_area / DENT
            hits = random_dents(one, room, mean, rng) if x else no_hits()
            steps.append(Replica(COUNTS, None, NOT_TRAPPED, hits))
        found.append(join_steps(steps, chamber))
    return found


def evaluated(design: Design, densities: tuple[float, ...]) -> Evaluation:
    chamber = build_chamber(design)
    known = ReplicaSet(random_replicas(design, chamber, densities))
    return evaluate(
        design, chamber, SerialExecutor(), plan=ReplicaPlan(count=REPLICAS), known=known
    )


def assert_holds(one: Estimate, wanted: float) -> None:
    assert one.half_width < 0.1
    assert abs(one.value - wanted) < one.half_width + 1e-3


def test_each_side_of_a_turned_plate_has_what_its_own_step_threw() -> None:
    """x = 0.6 on one side and 1.8 on the other: c = 1 - exp(-x) on each, and their mean on both."""
    design = plate({**TURNED, "time_share": 3.0}, zones=(LOWER, UPPER))
    found = evaluated(design, (0.6, 1.8))
    assert set(found.metrics) == set(metric_names(design))
    assert found.steps == pytest.approx({"first_side": 0.5, "turned": 0.5}, abs=0.01)
    lower, upper = -np.expm1(-0.6), -np.expm1(-1.8)
    assert_holds(found.metrics["lower.mean_coverage"], lower)
    assert_holds(found.metrics["upper.mean_coverage"], upper)
    assert_holds(found.metrics["mean_coverage"], 0.5 * (lower + upper))
    assert_holds(found.metrics["p05_coverage"], lower)  # where half of the target is of each level
    assert_holds(found.metrics["p95_coverage"], upper)
    assert_holds(found.metrics["steps.first_side.mean_coverage"], 0.5 * lower)
    assert_holds(found.metrics["steps.turned.mean_coverage"], 0.5 * upper)
    assert found.reachable > 0.999


@pytest.mark.long
def test_uncovered_shares_of_steps_in_one_pose_multiply() -> None:
    """On the side that both steps peen, 1 - c = (1 - c1) (1 - c2), whatever their order."""
    fine = {"name": "fine", "shot": {"diameter_mm": 2.0}}
    design = plate(fine, **{"part.target": LOWER["target"]})
    for densities in ((0.5, 1.0), (1.0, 0.5)):
        found = evaluated(design, densities).metrics
        assert_holds(found["mean_coverage"], -np.expm1(-1.5))
        assert_holds(found["steps.first_side.mean_coverage"], -np.expm1(-densities[0]))
        assert_holds(found["steps.fine.mean_coverage"], -np.expm1(-densities[1]))
        time = found["time_to_98_s"]  # the times of both steps are scaled alike
        assert abs(time.value - 8.0 * np.log(50.0) / 1.5) < time.half_width
        assert found["strength_um"].in_words == OF_EACH_STEP
        assert not found["steps.fine.strength_um"].in_words


@pytest.mark.long
def test_two_equal_steps_are_one_step_of_twice_the_time() -> None:
    """The same impacts, in two steps and in one, give the same figures of the target."""
    design = plate({"name": "again"}, **{"part.target": LOWER["target"]})
    chamber = build_chamber(design)
    replicas = random_replicas(design, chamber, (0.7, 0.7))
    plan, whole = ReplicaPlan(count=REPLICAS), plate(**{"part.target": LOWER["target"]})
    twice = evaluate(design, chamber, SerialExecutor(), plan=plan, known=ReplicaSet(replicas))
    once = evaluate(
        whole, build_chamber(whole), SerialExecutor(), plan=plan, known=ReplicaSet(replicas)
    )
    for name, one in once.metrics.items():
        found = twice.metrics[name]
        room = found.half_width + one.half_width
        assert found.in_words == one.in_words, name
        assert abs(found.value - one.value) <= (room if np.isfinite(room) else 0.1 * one.value), (
            name
        )


def test_a_step_that_hits_nothing_changes_nothing() -> None:
    found = evaluated(plate({"name": "idle"}, **{"part.target": LOWER["target"]}), (0.9, 0.0))
    for name in ("mean_coverage", "p05_coverage", "strength_um", "time_to_98_s"):
        one, other = found.metrics[name], found.metrics[f"steps.first_side.{name}"]
        scale = 2.0 if name == "time_to_98_s" else 1.0  # the idle step takes its time too
        assert one.value == pytest.approx(scale * other.value, rel=0.02)
    assert found.metrics["steps.idle.mean_coverage"].value == 0.0


@pytest.mark.long
def test_errors_of_a_calibration_are_in_the_figures_of_each_step() -> None:
    """By Avrami's law d C / d ln x = (1 - C) x, and x goes with the hardness to the power -1/2."""
    design = plate({"name": "again"}, **{"part.target": LOWER["target"]})
    design = design.changed({"calibration": machine_values(hardness=0.1)})
    chamber = build_chamber(design)
    known = ReplicaSet(random_replicas(design, chamber, (0.5, 1.0)))
    plan = ReplicaPlan(count=REPLICAS)
    found = evaluate_calibrated(design, chamber, SerialExecutor(), plan=plan, known=known).metrics
    for name, x in (("", 1.5), ("steps.first_side.", 0.5), ("steps.again.", 1.0)):
        errors = found[f"{name}mean_coverage"].shared[FIRST_OF_CALIBRATION:]
        error = errors[PARAMETERS.index("hardness")]
        assert abs(error) == pytest.approx(0.1 * 0.5 * x * np.exp(-x), rel=0.15)


@cache
def in_two_poses() -> tuple[Design, Chamber]:
    accuracy = {"simulated_time_s": 0.1, "warmup_time_s": 0.0, "replicas": 3}
    values = {f"process.accuracy.{name}": value for name, value in accuracy.items()}
    design = plate({**TURNED, "part": {"rotate_deg": (180.0, 0.0, 31.0)}}, **values)
    return design, build_chamber(design)


def test_a_replica_plays_each_step_for_its_share_of_the_time() -> None:
    design, chamber = in_two_poses()
    replica = simulate_replica(ReplicaSetting(design, chamber, chamber.mesh), 5)
    one, two = replica.steps
    first, turned = chamber.steps
    own = design.in_steps["first_side"]
    alone = simulate_replica(ReplicaSetting(own, first, first.mesh), 5)
    np.testing.assert_array_equal(one.hits.place, alone.hits.place)  # same bits
    assert replica.collisions["total"] == one.collisions["total"] + two.collisions["total"]
    assert len(replica.hits) == len(one.hits) + len(two.hits)
    assert len(two.hits) > 50
    # The turned plate was hit from below, which is its upper side in the pose of the first step.
    np.testing.assert_allclose(two.hits.place[:, 2], 0.015, atol=1e-7)
    np.testing.assert_allclose(replica.hits.place[len(one.hits) :, 2], 0.025, atol=1e-7)
    back = in_pose_of(in_pose_of(two.hits, turned.part, first.part), first.part, turned.part)
    np.testing.assert_allclose(back.place, two.hits.place, atol=1e-8)


def test_a_ball_touches_what_it_touches_in_any_step() -> None:
    design, chamber = in_two_poses()
    part, each = chamber.part, []
    spread = spread_points(part.vertices, part.triangles, part.area, 2000)
    for room in chamber.steps:
        turn = room.part.file.rotation @ part.file.rotation.T
        place = (spread.place - part.file.shift) @ turn.T + room.part.file.shift
        each.append(ball_fits(room.mesh, place, spread.normal @ turn.T, 1.5e-3))
    found = ball_fits(rooms_of(design, chamber, chamber.mesh), spread.place, spread.normal, 0.0)
    np.testing.assert_array_equal(found, np.any(each, axis=0))
    assert found.sum() == sum(one.sum() for one in each) > 600  # each step has its own side
    assert chamber.exposed_area[part.target].sum() == pytest.approx(part.area[part.target].sum())


def test_a_pilot_of_two_sides_takes_twice_the_time_of_one() -> None:
    two, one = plate(TURNED), plate(**{"part.target": LOWER["target"]})
    found, alone = (
        measure_budget(design, build_chamber(design), SerialExecutor()) for design in (two, one)
    )
    assert found.places
    assert alone.places
    assert found.time_to_98 == pytest.approx(2.0 * alone.time_to_98, rel=0.3)
    assert found.mean_time == pytest.approx(2.0 * alone.mean_time, rel=0.1)


def test_what_a_step_cannot_be_is_refused_with_its_name() -> None:
    with pytest.raises(InputError, match=r"^step turned: part\.target: none of its"):
        build_chamber(plate(TURNED, **{"part.target": LOWER["target"]}))
