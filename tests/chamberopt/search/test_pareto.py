"""The Pareto front of two objectives, as an array and as a study finds it."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from chamberopt.documents.wording import Label
from chamberopt.pictures.charts.study import pareto_picture
from chamberopt.search.optimiser.scalarisation import scalarise
from chamberopt.search.pareto import as_csv, on_front, pareto_points
from chamberopt.search.study import load_study
from tests.helpers.known_optima import VARY, bowl_shares, run_bowl
from tests.helpers.synthetic import judged


def test_the_front_is_who_nobody_beats() -> None:
    values = np.array([[0.0, 3.0], [1.0, 2.0], [1.0, 1.0], [2.0, 0.0], [5.0, 5.0], [0.0, 3.0]])
    among = np.array([True, True, True, True, False, True])
    assert on_front(values, among).tolist() == [True, True, False, True, False, True]
    assert on_front(values).tolist() == [False, False, False, False, True, False]
    for weight, best in (([0.999, 0.001], 3), ([0.001, 0.999], 0), ([0.5, 0.5], 1)):
        scores, _ = scalarise(values[:4], np.zeros((4, 2)), np.array(weight))
        assert scores.argmax() == best


def test_two_objectives_give_a_front(tmp_path: Path) -> None:
    """Bowls about two places: what nobody beats lies on the line between them."""
    low, high = np.array([0.2, 0.5]), np.array([0.8, 0.5])

    def simulator(design, stream, replicas):
        x = bowl_shares(design)
        one, two = (1.0 - float(((x - at) ** 2).sum()) for at in (low, high))
        return judged(one + np.linspace(-0.01, 0.01, 4), p05_coverage=one, intensity_uniformity=two)

    question = {"pareto": ["p05_coverage", "intensity_uniformity"]}
    result = run_bowl(
        tmp_path / "out", simulator, {"evaluations": 24, "confirm": 4}, objective=question
    )
    assert all(np.isfinite(goal.value) for one in pareto_points(result) for goal in one.goals)
    front = [one for one in pareto_points(result) if one.stage == "confirm" and one.on_front]
    assert len(front) >= 3
    places = np.array(
        [
            [one.parameters[name] for name in VARY]
            for one in front
            if one.parameters != result.start.parameters
        ]
    )
    places = (places - [35.0, 2.0]) / [25.0, 8.0]
    assert np.abs(places[:, 1] - 0.5).max() < 0.1
    assert np.ptp(places[:, 0]) > 0.3
    header, *table = as_csv(result).splitlines()
    assert header.startswith("stage,on_front,standing,p05_coverage,p05_coverage_pm,intensity_")
    searched = [row.split(",") for row in table if row.startswith("search,")]
    expected = [trial.goals for trial in result.trials if trial.stage == "search"]
    assert [[float(x) for x in row[3:7]] for row in searched] == [
        [number for goal in goals for number in (goal.value, goal.half_width)] for goals in expected
    ]
    unresolved = result.start.goals[0].not_known("not resolved")
    start = replace(result.start, goals=(unresolved, result.start.goals[1]))
    words = as_csv(replace(result, confirmed=(start, *result.confirmed[1:])))
    assert "not resolved,," in words
    assert "inf" not in words
    assert all(np.isfinite(goal.half_width) for goals in expected for goal in goals)
    axes = [Label("one"), Label("time", "s", -1.0)]
    pareto_picture(tmp_path / "pareto.png", result, axes)
    assert (tmp_path / "pareto.png").stat().st_size > 10000
    assert load_study(tmp_path / "out" / "study.toml").objective.pareto == (
        "p05_coverage",
        "intensity_uniformity",
    )
