"""Charts of coverage show what is known, and no more."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from chamberopt.common.estimate import Estimate
from chamberopt.pictures.charts.coverage import (
    MAX_HALF_WIDTH,
    CoverageCurve,
    HistogramData,
    _known_lines,
    draw_coverage_over_time,
    draw_histogram,
)
from chamberopt.results.records import CoverageAtTime


def test_curves_end_where_the_interval_grows_too_wide() -> None:
    widths = ((0.01, 0.02), (0.1, 0.2), (0.2, 0.1))
    rows = [
        CoverageAtTime(
            time_s=k + 1.0, mean_coverage=0.5, half_width=mean, p05_coverage=0.4, p05_half_width=p05
        )
        for k, (mean, p05) in enumerate(widths)
    ]
    mean, p05 = _known_lines(rows, MAX_HALF_WIDTH)
    np.testing.assert_array_equal(mean[0], [1.0, 2.0])
    np.testing.assert_array_equal(p05[0], [1.0])


def test_dents_one_by_one_have_no_curve_of_the_5th_percentile() -> None:
    rows = [CoverageAtTime(time_s=1.0, mean_coverage=0.5, half_width=0.01)]
    assert _known_lines(rows, MAX_HALF_WIDTH)[1].shape == (3, 0)


def test_curves_begin_at_nothing_and_bands_hold_their_intervals() -> None:
    rows = [
        CoverageAtTime(time_s=t, mean_coverage=c, half_width=0.1, p05_coverage=0.5 * c,
                       p05_half_width=0.05)
        for t, c in ((1.0, 0.4), (4.0, 0.95))
    ]  # fmt: skip
    style = {"color": "red", "ls": "-"}
    for value, last in ((3.0, 4.0), (30.0, 4.0)):
        curve = CoverageCurve("one", rows, style, Estimate(value, 5.0))
        axes = Figure().subplots()
        draw_coverage_over_time(axes, [curve], treatment_time=2.5)
        drawn = [line.get_xydata() for line in axes.lines if len(line.get_xydata()) == 3]
        np.testing.assert_allclose(drawn[0], [[0, 0], [1, 40], [4, 95]])
        np.testing.assert_allclose(drawn[1], [[0, 0], [1, 20], [4, 47.5]])
        bands = [one.get_paths()[0].get_extents() for one in axes.collections[-2:]]
        assert [(one.ymin, one.ymax) for one in bands] == [
            (pytest.approx(30.0), pytest.approx(100.0)),  # no more than all is covered
            (pytest.approx(15.0), pytest.approx(52.5)),
        ]
        assert axes.get_xlim()[1] == pytest.approx(1.02 * last)
        marks = [line.get_xydata() for line in axes.lines if line.get_marker() in (">", "D")]
        assert len(marks) == 1
        assert marks[0][0, 0] == pytest.approx(value if value < last else 1.01 * last)
        errors = [one for one in axes.containers if value < last]
        for one in errors:
            ((low, high),) = one.lines[2][0].get_segments()
            assert (low[0], high[0]) == pytest.approx((0.0, 8.0))


def test_a_histogram_is_in_per_cent_over_its_edges() -> None:
    axes, edges = Figure().subplots(), np.array([0.0, 1.0, 3.0])
    shares = np.array([0.25, 0.75])
    draw_histogram(
        axes, HistogramData(edges, [shares, None], ["a", "b"], [{"color": "red"}] * 2, "x", "y")
    )
    (step,) = axes.patches
    np.testing.assert_allclose(step.get_data().values, [25.0, 75.0])
    np.testing.assert_allclose(step.get_data().edges, edges)
    assert axes.get_xlim() == (0.0, 3.0)
    assert axes.get_ylim()[0] == 0.0
