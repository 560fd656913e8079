"""Charts of the report hold every value, as text that can be searched."""

from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.axes import Axes

from chamberopt.common.estimate import Estimate
from chamberopt.pictures.charts import coverage, study
from chamberopt.pictures.charts.coverage import HistogramData, draw_histogram
from chamberopt.pictures.charts.figure_style import SVG, new_figure, svg_text
from chamberopt.pictures.charts.study import EvaluatedCandidate, draw_convergence


def evaluation(
    number: int, value: float | None, stage: str = "search", feasible: bool = True
) -> EvaluatedCandidate:
    objective = None if value is None else Estimate(value, 1.0)
    parameters = {"shot.mass_g": 2.5 * number}
    return EvaluatedCandidate(number, stage, objective, feasible, parameters)


def svg_of_search(rows: list[EvaluatedCandidate], smaller_is_better: bool) -> str:
    figure, tooltips = study.convergence_figure(rows, "time [s]", smaller_is_better)
    return svg_text(figure, "convergence", tooltips)


ROWS = [
    evaluation(1, 900.0),
    evaluation(2, None),
    evaluation(3, 400.0),
    evaluation(4, 100.0, feasible=False),
    evaluation(5, 600.0),
    evaluation(6, 410.0, "confirm"),
]


def best_so_far(axes: Axes) -> list[float]:
    (line,) = (line for line in axes.lines if str(line.get_label()).startswith("best so far"))
    return list(line.get_ydata())


@pytest.mark.parametrize(
    ("smaller_is_better", "best"), [(True, [900.0, 400.0, 400.0, 400.0]), (False, [900.0] * 4)]
)
def test_best_so_far_counts_feasible_candidates_only(smaller_is_better, best) -> None:
    axes = new_figure(4.0, 3.0).subplots()
    draw_convergence(axes, ROWS, "time [s]", smaller_is_better)
    assert best_so_far(axes) == best


def test_failed_infeasible_and_confirmed_candidates_are_marked() -> None:
    root = ElementTree.fromstring(svg_of_search(ROWS, True))
    texts = ["".join(element.itertext()).strip() for element in root.iter(f"{{{SVG}}}text")]
    for label in (
        "time [s]",
        "evaluation",
        "not simulated",
        "misses a constraint",
        "confirmed on fresh seeds",
        "best so far (as searched)",
    ):
        assert label in texts
    tooltips = [element.text for element in root.iter(f"{{{SVG}}}title")]
    assert sorted(tooltips) == [
        "evaluation 1: 900.0 ± 1.0\nshot.mass_g = 2.5",
        "evaluation 3: 400.0 ± 1.0\nshot.mass_g = 7.5",
        "evaluation 4: 100.0 ± 1.0\nshot.mass_g = 10",
        "evaluation 5: 600.0 ± 1.0\nshot.mass_g = 12.5",
        "evaluation 6: 410.0 ± 1.0\nshot.mass_g = 15",
    ]


def test_a_search_in_which_all_failed_is_drawn() -> None:
    assert "not simulated" in svg_of_search([evaluation(1, None), evaluation(2, None)], False)


def test_ids_are_unique_on_a_page_with_several_charts() -> None:
    shown = {"result": (np.array([0.0, 0.5, 1.0]), np.array([1.0, 2.0, 1.0]))}
    first, second = (
        svg_text(coverage.histogram_figure(shown), "histogram"),
        svg_of_search(ROWS, False),
    )
    ids = [
        {e.get("id") for e in ElementTree.fromstring(s).iter()} - {None} for s in (first, second)
    ]
    assert not ids[0] & ids[1]


def test_a_histogram_holds_all_of_the_area() -> None:
    shares = np.histogram([0.0, 50.0, 100.0], coverage.BIN_EDGES, weights=[0.25, 0.5, 0.25])[0]
    axes = new_figure(4.0, 3.0).subplots()
    draw_histogram(axes, HistogramData(coverage.BIN_EDGES, [shares], [""], [{}], "", ""))
    (steps,) = axes.patches
    assert sum(steps.get_data().values) == pytest.approx(100.0)


def test_what_is_not_resolved_is_ringed_and_has_no_bar() -> None:
    rows = [evaluation(1, 900.0), EvaluatedCandidate(2, "search", Estimate(500.0, np.inf), True)]
    axes = new_figure(4.0, 3.0).subplots()
    draw_convergence(axes, rows, "time [s]", True)
    (ring,) = (line for line in axes.lines if "not resolved" in str(line.get_label()))
    assert (ring.get_xdata().tolist(), ring.get_ydata().tolist()) == ([2], [500.0])
    low, high = axes.get_ylim()
    assert np.isfinite([low, high]).all()
