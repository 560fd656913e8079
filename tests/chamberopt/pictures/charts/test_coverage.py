"""Charts of coverage show what is known, and no more."""

import numpy as np

from chamberopt.pictures.charts.coverage import MAX_HALF_WIDTH, _known_lines
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
