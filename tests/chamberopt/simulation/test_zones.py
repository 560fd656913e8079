"""Zones have the figures of a target of their own, and limits."""

from dataclasses import replace

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.check import warnings
from chamberopt.chamber.checks.warning import WarningKind
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.common.executor import SerialExecutor
from chamberopt.coverage.field.target_field import require_touchable_zones
from chamberopt.coverage.metrics import metric_names
from chamberopt.search.study.constraints import judge_zones
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate
from tests.helpers.synthetic import (
    evaluation_of,
    machine_values,
    plane_chamber,
    plate_design,
    random_dents,
)

LEFT = {"name": "left", "target": {}, "coverage_min": 0.2, "exposure_max": 0.5}
RIGHT = {"name": "right", "target": {}, "coverage_max": 0.9}
DESIGN = plate_design(process__treatment_time_s=8).changed({"zones": (LEFT, RIGHT)})
DENT = 1e-8  # area of a dent of random_dents [m²]


def halves() -> tuple:
    """A plane whose left half has x = 0.8, and whose right half has x = 2.4; and 4 replicas."""
    chamber = plane_chamber()
    side = chamber.part.vertices[chamber.part.triangles].mean(axis=1)[:, 0]
    top = chamber.part.target
    zones = {"left": top & (side < -1e-3), "right": top & (side > 1e-3)}
    chamber = replace(chamber, part=replace(chamber.part, zones=zones))
    rng, process = np.random.default_rng(3), DESIGN.process
    x = np.where(side < 0.0, 0.8, 2.4) * process.recorded_time / process.treatment_time
    mean = x * chamber.exposed_area / DENT
    return chamber, [random_dents(DESIGN, chamber, mean, rng) for _ in range(4)]


def test_a_zone_has_the_figures_of_its_surface() -> None:
    chamber, hits = halves()
    found = evaluation_of(DESIGN, chamber, hits)
    assert set(found.metrics) == set(metric_names(DESIGN))
    assert "left.shot_count" not in found.metrics
    assert found.zones == {"left": 1.0, "right": 1.0}
    assert not any("smaller than two windows" in note for note in found.notes)
    for zone, x in (("left", 0.8), ("right", 2.4)):
        wanted = {
            "mean_coverage": -np.expm1(-x),
            "p05_coverage": -np.expm1(-x),
            "p95_coverage": -np.expm1(-x),
            "exposure": x / np.log(50.0),
            "p95_exposure": x / np.log(50.0),
        }
        for name, value in wanted.items():
            one = found.metrics[f"{zone}.{name}"]
            assert abs(one.value - value) < max(1.5 * one.half_width, 0.02 * value), (zone, name)
    # The simplest meaning of a zone: the target of the same chamber.
    alone = evaluation_of(plate_design(process__treatment_time_s=8), chamber.on_zone("left"), hits)
    for name in ("mean_coverage", "p95_exposure", "strength_um", "impacts_per_mm2_s"):
        assert found.metrics[f"left.{name}"] == alone.metrics[name]


def test_notes_of_a_zone_name_it() -> None:
    chamber, hits = halves()
    side = chamber.part.vertices[chamber.part.triangles].mean(axis=1)[:, 0]
    right_only = [one.select(side[one.triangle] > 1e-3) for one in hits]
    notes = evaluation_of(DESIGN, chamber, right_only).notes
    assert any("fewer than half of the windows of zone left were hit" in one for one in notes)
    assert not any("zone right" in one for one in notes)


def test_a_zone_outside_the_chamber_is_warned_of_unless_it_is_spared() -> None:
    whole = {"name": "whole", "target": {}}
    texts = []
    for limits in ({}, {"coverage_max": 0.1}):
        design = plate_design().changed({"zones": (whole | limits,)})
        chamber = build_chamber(design)
        assert any("of the area of zone whole is outside the cavity" in n for n in chamber.notes)
        found = warnings(design, chamber)
        assert any(one.kind is WarningKind.HIDDEN for one in found) is not bool(limits)
        texts.append(" ".join(one.text for one in found))
    assert "of the area of zone whole is outside the chamber" in texts[0]
    assert "narrow the target of zone whole" in texts[0]
    assert "zone whole" not in texts[1]


def test_a_zone_of_one_window_tells_nothing_of_evenness() -> None:
    chamber, hits = halves()
    few = [one.select(np.arange(0, len(one), 30)) for one in hits]
    large = DESIGN.changed({"process.accuracy.gauge_mm2": 100, "process.accuracy.points": 1000})
    found = evaluation_of(large, chamber, few)
    assert found.metrics["left.strength_p05_um"].in_words == ""
    assert found.metrics["left.intensity_uniformity"].in_words == "not resolved"
    assert any("zone left: smaller than two windows" in note for note in found.notes)


def test_limits_are_judged_by_whole_intervals() -> None:
    metrics = {
        "left.p05_coverage": Estimate(0.5, 0.1),
        "left.p95_exposure": Estimate(0.45, 0.1),
        "right.p95_coverage": Estimate(0.95, 0.01),
    }
    judged = judge_zones(DESIGN, metrics)
    assert [row["standing"] for row in judged["left"]] == ["met", "not known"]
    assert judged["right"] == [
        {"key": "coverage_max", "limit": 0.9, "metric": "right.p95_coverage", "standing": "not met"}
    ]


def test_a_calibrated_design_may_have_a_band_of_intensity() -> None:
    band = {"name": "left", "target": {}, "intensity_mmA": [0.1, 0.2]}
    design = plate_design().changed(
        {"calibration": machine_values(K=0.1, beta=0.1), "zones": (band,)}
    )
    found = {"left.almen_intensity_p05": Estimate(0.15, 0.01)}
    judged = judge_zones(design, found | {"left.almen_intensity_p95": Estimate(0.25, 0.01)})
    assert [(row["limit"], row["standing"]) for row in judged["left"]] == [
        (0.1, "met"), (0.2, "not met"),
    ]  # fmt: skip
    assert "left.almen_intensity" in metric_names(design)


@pytest.mark.parametrize(
    ("zones", "said"),
    [
        ((LEFT, LEFT), r"zones\.1\.name: given 'left', as zones\.0 has"),
        (({**LEFT, "name": "a b"},), r"zones\.0\.name: given 'a b'; allowed: .*digits and _"),
        (({**LEFT, "name": "lid"},), r"zones\.0\.name: given 'lid'; .* other than lid"),
        (({**LEFT, "coverage_max": 0.1},), r"zones\.0\.coverage_min: given 0\.2, above"),
        (({**LEFT, "intensity_mmA": [0.1, 0.2]},), r"zones\.0\.intensity_mmA: .*a calibration"),
        (({**LEFT, "intensity_mmA": [0.2, 0.1]},), r"zones\.0\.intensity_mmA: given \[0\.2, 0\.1"),
        (({**LEFT, "target": {"element_mm": 1.0}},), r"zones\.0\.target\.element_mm"),
        (({**LEFT, "target": {"radius_mm": [3.0, 2.0]}},), r"zones\.0\.target\.radius_mm: given"),
    ],
)
def test_a_wrong_zone_is_named(zones: tuple, said: str) -> None:
    with pytest.raises(InputError, match=said):
        plate_design().changed({"zones": zones})


def test_a_zone_that_no_shot_comes_to_is_refused_before_any_work() -> None:
    top = {"name": "top", "target": {"direction": [0, 0, 1], "angle_deg": [0, 10]}}
    with pytest.raises(InputError, match=r"zones: top: none of its .* bounds the cavity"):
        build_chamber(plate_design().changed({"zones": (top,)}))
    nowhere = {"name": "far", "target": {"radius_mm": [900.0, 901.0]}}
    with pytest.raises(InputError, match=r"zones\.0\.target: chooses none .* radius_mm"):
        build_chamber(plate_design().changed({"zones": (nowhere,)}))
    chamber, _ = halves()
    with pytest.raises(InputError, match="zones: left: a ball of 80 mm touches nothing of it"):
        require_touchable_zones(chamber, chamber_mesh(chamber), 0.04)
    plan = ReplicaPlan(objective_name="1 middle.mean_coverage")
    with pytest.raises(InputError, match=r"no zone 'middle'.*left, right"):
        evaluate(DESIGN, chamber, SerialExecutor(), plan=plan)
