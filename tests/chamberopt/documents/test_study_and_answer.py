"""What the report says about parameters follows from the model's curves and their intervals."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from chamberopt.common.estimate import Estimate
from chamberopt.documents.answer import (
    _ended_lines,
    _unresolved_lines,
    answer,
    answer_lines,
    on_average,
)
from chamberopt.documents.coverage import figures, main_figures
from chamberopt.documents.study import influence_sentences, influences, tried_sentence
from chamberopt.documents.wording import Label, objective_label
from chamberopt.results.records import (
    BestRecord,
    ConfirmedRecord,
    ModelRecord,
    SliceRecord,
    StartRecord,
    StudyRecord,
    ViolationRecord,
    ZoneLimit,
    ZoneRecord,
)
from chamberopt.search.trial_log import Trial


def a_study(model: ModelRecord | None = None, **other: object) -> StudyRecord:
    """The record of a study of one parameter x in 0 .. 2, best at 0 and begun at 1."""
    values: dict[str, Any] = {
        "evaluations": 20,
        "failed": 0,
        "vary": {"x": [0.0, 2.0]},
        "start": StartRecord.model_construct(parameters={"x": 1.0}),
        "best": BestRecord(parameters={"x": 0.0}),
        "model": model,
        "confirmed": [],
        "gain": Estimate(0.3, 0.1),
        "counts": 0.0,
    }
    return StudyRecord.model_construct(**values | other)


def a_model(mean: list[float], half_width: list[float]) -> ModelRecord:
    """The model of such a study."""
    curve = SliceRecord(
        flat=[0.0, 0.1],
        share_of_variance=1.0,
        values=[0.0, 1.0, 2.0],
        mean=mean,
        half_width=half_width,
        main_effect=mean,
        or_worse=[False] * len(mean),
    )
    expected = Estimate(mean[0], half_width[0])
    return ModelRecord(noise=0.01, expected=expected, together=1.0, parameters={"x": curve})


def test_a_sentence_says_what_became_of_each_candidate() -> None:
    def trial(stage: str = "search", **other: object) -> Trial:
        values = {"stage": stage, "goals": (), "refused": False, "highest": None, "reason": ""}
        values |= other
        return SimpleNamespace(**values)  # type: ignore[return-value]

    simulated = {"goals": (Estimate(0.5, 0.1),)}
    trials = [trial(**simulated), trial(refused=True), trial(highest=0.4, refused=True), trial()]
    trials += [trial(), trial()]
    assert tried_sentence([*trials, trial("confirm", **simulated)]) == (
        "6 proposed, 2 refused by geometry before any simulation, 1 simulated, "
        "3 that could not be simulated, 1 confirmed with new seeds."
    )
    gaps = [
        trial(refused=True, reason=f"not simulated: the gap at ({x}, -2.0) mm is {x} mm wide")
        for x in (1.5, 27.0)
    ]
    assert tried_sentence([trial(**simulated), trial(refused=True, reason="other"), *gaps]) == (
        "4 proposed, 3 refused by geometry before any simulation, 1 simulated. For 2 of 3 refusals "
        "it is the same reason, as: the gap at (1.5, -2.0) mm is 1.5 mm wide."
    )
    assert tried_sentence([]) == "No candidate has been evaluated yet."


def test_the_cost_of_moving_a_parameter_has_an_interval() -> None:
    """It costs 0.5 ± 0.5 at its far end, but 0.4 ± 0.05 in the middle: certainly 0.35."""
    study, label = a_study(a_model([1.0, 0.6, 0.5], [0.03, 0.04, 0.5])), Label("goal")
    (one,) = influences(study, label)
    assert (one.loss, one.half_width) == pytest.approx((0.5, math.hypot(0.5, 0.03)))
    assert one.surely == pytest.approx(0.35)
    said = influence_sentences(study, [one], label)
    assert said[0].startswith("x mattered most")
    assert "0.5 ± 0.5" in said[0]
    assert "0.35 or more" in said[0]


def test_too_few_evaluations_are_reported() -> None:
    unsure, label = a_study(a_model([1.0, 0.9, 0.8], [0.2, 0.2, 0.2])), Label("goal")
    rows = influences(unsure, label)
    assert rows[0].surely == 0.0
    said = influence_sentences(unsure, rows, label)
    assert "20 simulated candidates are too few to show an influence of x" in said[0]
    none = a_study(evaluations=3, failed=1)
    assert influences(none, label) == []
    assert influence_sentences(none, [], label) == [
        "3 evaluations, 1 of them not simulated, are too few to tell what each parameter does: "
        "4 or more are needed for a model of them."
    ]


def test_a_time_to_minimise_is_shown_as_a_time() -> None:
    study = a_study(a_model([-400.0, -900.0, -2000.0], [10.0] * 3))
    (found,) = influences(study, objective_label("minus_time_to_98_s"))
    assert found.curve.mean.tolist() == [400.0, 900.0, 2000.0]
    assert found.loss == pytest.approx(1600.0)


def test_constraints_that_are_not_certainly_met_are_in_the_answer() -> None:
    metric = "root.almen_intensity_p05"
    band = ZoneLimit(key="intensity_mmA", limit=0.1, metric=metric, standing="not known")
    shares = {"triangles": 1, "exposed_area_mm2": 1.0, "reachable_share": 1.0}
    zones = [
        ZoneRecord(name="root", limits=[band], **shares),
        ZoneRecord(name="tip", limits=[], **shares),
    ]
    many = ViolationRecord(figure="shot_count", text="shot_count 33 may be > max 30")
    weak = ViolationRecord(figure=metric, text=f"{metric} 0.12 may be < min 0.1")
    too_many = ViolationRecord(figure="shot_count", text="shot_count 50 > max 30")
    other = ViolationRecord(figure="speed", text="faster")
    confirmed = [
        ConfirmedRecord(
            parameters={"x": x},
            searched_as=None,
            objective=Estimate(-seconds, 20.0),
            feasible=False,
            standing=standing,
            violations=violations,
        )
        for x, seconds, standing, violations in (
            (2, 300, "infeasible", [too_many]),
            (1, 200, "not known", [many, weak]),
            (3, 100, "not known", [other]),
            (4, 400, "not known", [other]),
        )
    ]
    misfit = SimpleNamespace(kind="dent diameters", error_scale=2.0)
    study = a_study(
        best=BestRecord(parameters={"x": 1}),
        start=StartRecord.model_construct(parameters={"x": 2}),
        confirmed=confirmed,
    )
    process = SimpleNamespace(intensity_mmA=None, coverage_percent=None)
    calibration = SimpleNamespace(misfits=[misfit], not_mmA="", has_strips=True)
    design = SimpleNamespace(calibration=calibration, process=process, steps=None)
    result: Any = SimpleNamespace(
        study=study,
        record=SimpleNamespace(zones=zones, ranges=None, trapped=None, first_half_excess=None),
        metrics={
            metric: Estimate(0.12, 0.03),
            "tip.mean_coverage": Estimate(0.9, 0.02),
            "root.mean_coverage": Estimate(0.9, 0.02),
            "mean_normal_speed_m_s": Estimate(4.1, 0.1),
            "strength_um": Estimate(80.0, 9.0),
        },
        seeds=[1],
        design=design,
        objective_name="minus_time_to_98_s",
        objective=Estimate(-200.0, 20.0),
    )
    faster = {"mean_normal_speed_m_s": Estimate(4.4, 0.1), "strength_um": Estimate(81.0, 9.0)}
    start: Any = SimpleNamespace(metrics=faster, seeds=[2])
    lines = answer_lines(result, start)
    assert [one.text for one in lines] == [
        "It peens less hard than the start: the mean normal speed of the impacts goes from "
        "4.40 ± 0.10 m/s to 4.10 ± 0.10 m/s.",
        "Zone root: Almen intensity ≥ 0.1 mmA is not known (0.12 ± 0.03 mmA).",
        "Zone tip: no limits; mean coverage 90.0 ± 2.0 %.",
        "The start: constraints not met: shot_count 50 > max 30.",
        "The best chamber found: constraints not known: shot_count 33 may be > max 30.",
        "Another chamber, whose time until 95 % of the area is 98 % covered is 100 ± 20 "
        "s: constraints not known: faster.",
        "Calibration: the model explains your dent diameters only with errors 2 times as "
        "large, as intervals have them: look at the picture of the calibration.",
    ]
    assert [one.warns for one in lines] == [True, True, False, True, True, True, True]


@pytest.mark.parametrize(("counts", "keeps"), [(30.0, True), (5.0, False)])
def test_a_gain_that_does_not_count_keeps_the_start(counts: float, keeps: bool) -> None:
    """Objectives are minus times, of which a start of 530 s and a best of 520 s."""
    study = a_study(counts=counts, gain=Estimate(10.0, 2.0))
    start, result = (
        SimpleNamespace(
            objective_name="minus_time_to_98_s", objective=one, study=study, seeds=seeds
        )
        for one, seeds in ((Estimate(-530.0, 1.0), [1]), (Estimate(-520.0, 1.0), [2]))
    )
    said = answer(result, start)  # type: ignore[arg-type]
    assert said.startswith("No useful difference: keep the start. ") == keeps
    assert ("; less than 30 s does not count." in said) == keeps


@pytest.mark.parametrize(("reach", "only"), [(1.0, ""), (0.2, "Balls get to 20% of the target. ")])
def test_what_is_not_resolved_is_not_in_the_answer_as_a_number(reach: float, only: str) -> None:
    unknown = Estimate(0.4, 0.1).not_known("not resolved")
    result: Any = SimpleNamespace(
        objective_name="uniform_coverage",
        objective=unknown,
        metrics={"mean_coverage": unknown},
        design=SimpleNamespace(process=SimpleNamespace(treatment_time=120.0)),
        record=SimpleNamespace(field=SimpleNamespace(reachable_share=reach)),
        study=a_study(),
    )
    assert answer(result, None) == (
        f"{only}Too few dents were simulated to tell how much of the target is covered after 120 s."
    )
    assert "its mean coverage is not resolved" in on_average(result)
    assert answer(result, result).startswith("Too few dents were simulated to tell wheth")


def test_a_time_that_is_not_resolved_is_warned_of() -> None:
    design = SimpleNamespace(process=SimpleNamespace(treatment_time=120.0))

    def warned(time: Estimate) -> list[tuple[str, bool]]:
        result: Any = SimpleNamespace(design=design, metrics={"time_to_98_s": time})
        return [(one.text, one.warns) for one in _unresolved_lines(result)]

    few = "So few dents do not tell whether 120 s are enough: simulate longer."
    assert warned(Estimate(100.0, 10.0).not_known("not resolved")) == [(few, True)]
    assert not warned(Estimate(100.0, 10.0))
    assert not warned(Estimate(1e6, 0.0, in_words="never"))  # which time_lines tells


def test_a_mean_that_is_but_bounded_is_told_by_the_least_covered_places() -> None:
    """They are covered to 99.9 %: "94 % on average" beside that would read as a contradiction."""
    metrics = {
        "mean_coverage": Estimate(0.999, math.inf, in_words="more than 94 %"),
        "p05_coverage": Estimate(0.9987, 0.001),
        "time_to_98_s": Estimate(300.0, 20.0),
    }
    result: Any = SimpleNamespace(
        objective_name="uniform_coverage",
        objective=Estimate(0.9, 0.1),
        metrics=metrics,
        design=SimpleNamespace(process=SimpleNamespace(treatment_time=420.0)),
        record=SimpleNamespace(field=SimpleNamespace(reachable_share=1.0), ranges=None),
    )
    least = "95 % of the target's area is covered to 99.87 ± 0.10 % or more"
    assert answer(result, None).startswith(f"After 420 s {least}, and more dents would tell the m")
    assert "94 %" not in answer(result, None)  # less than 95 % of the area has
    assert on_average(result).endswith(f"; {least}")
    all_of_it = Estimate(0.99995, 1e-5, in_words="more than 99.99 %")
    full: Any = SimpleNamespace(
        **{**vars(result), "metrics": {**metrics, "p05_coverage": all_of_it}}
    )
    assert "covered to more than 99.99 %, and more dents" in answer(full, None)
    shown = figures(result, None)
    assert [one.name for one in shown] == ["uniform_coverage", *metrics]
    assert shown[1].result.in_words == "more than 94 %: too few dents"
    assert [one.name for one in main_figures(shown)] == [
        "uniform_coverage",
        "p05_coverage",
        "time_to_98_s",
    ]


@pytest.mark.parametrize(("by", "time"), [("gain", 800.0), ("gain", 1300.0), ("budget", 800.0)])
def test_a_search_that_has_nothing_to_gain_says_so_in_the_answer(by: str, time: float) -> None:
    """A treatment of 1200 s, in which all is covered or not."""
    found: Any = SimpleNamespace(
        study=a_study(evaluations=2, ended_by=by, possible_gain=0.009),
        objective_name="uniform_coverage",
        metrics={"time_to_98_s": Estimate(time, 20.0)},
        design=SimpleNamespace(process=SimpleNamespace(treatment_time=1200.0)),
    )
    lines = [one.text for one in _ended_lines(found)]
    assert len(lines) == (by == "gain")
    assert all("ended after 2 chambers: between its bounds" in text for text in lines)
    assert all("by more than 0.009 (95 % sure)" in text for text in lines)
    assert [("ask for the shortest time" in text) for text in lines] == [time < 1200.0] * len(lines)
