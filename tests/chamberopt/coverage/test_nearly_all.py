"""Coverage near 1: digits end where knowledge ends, in words, and candidates can be compared."""

import math

import numpy as np
import pytest

from chamberopt.common.estimate import Estimate
from chamberopt.common.number_text import estimate_text, share_in_words
from chamberopt.coverage.metrics import OBJECTIVES
from chamberopt.documents.wording import metric_label
from chamberopt.results.compare.difference import difference
from chamberopt.simulation.estimates import weighted_sum
from tests.helpers.synthetic import evaluation_of, plane_chamber, plate_design, random_dents

SHOWN = "mean_coverage", "p05_coverage", "p95_coverage"


def treated(seconds: float) -> dict[str, Estimate]:
    """Figures of a plane that is covered once in each second."""
    design = plate_design(
        process__treatment_time_s=seconds, process__accuracy__simulated_time_s=seconds / 8.0
    )
    chamber, rng = plane_chamber(), np.random.default_rng(3)
    mean = 8e8 * seconds / 8.0 * chamber.exposed_area / 8.0
    hits = [random_dents(design, chamber, mean, rng) for _ in range(8)]
    return evaluation_of(design, chamber, hits).metrics


def test_full_coverage_is_said_in_words_and_stays_a_number() -> None:
    found = treated(15.0)
    for name in SHOWN:
        one = found[name]
        assert one.half_width >= 3.0 / 40_000 * 0.999  # of the points that were tested for a ball
        assert one.value > 0.999
        assert one.in_words in ("more than 99.9 %", "more than 99.99 %")
        assert one.has_number
        assert estimate_text(one) == one.in_words
        label = metric_label(name)
        assert label.format(one) == label.number(one) == one.in_words
        again = Estimate.from_json(one.to_json())
        assert (again.value, again.in_words) == (one.value, one.in_words)
    uniform = weighted_sum(OBJECTIVES["uniform_coverage"], found)
    assert uniform.in_words == ""
    # 3 in 40,000 places may be bare, and they alone would deviate by the root of that.
    assert 0.004 < uniform.half_width < 0.02
    assert weighted_sum(OBJECTIVES["p05_coverage"], found).has_number


def test_full_coverage_can_be_compared() -> None:
    more, less = treated(15.0), treated(2.0)
    gap = difference(more["mean_coverage"], less["mean_coverage"], same_seeds=False)
    assert gap.real
    assert gap.in_words == ""
    assert gap.value == pytest.approx(math.exp(-2.0), abs=0.05)


@pytest.mark.parametrize(
    ("value", "half_width", "words"),
    [
        (0.9999999991, 1.4e-9, "more than 99.9999 %"),
        (0.99999, 7.5e-5, "more than 99.99 %"),
        (0.9999, 2e-4, "more than 99.9 %"),
        (1.0, 0.0, "more than 99.9999 %"),
        (0.9995, 6e-4, ""),
        (0.5, 0.1, ""),
        (0.99999, math.inf, ""),
        (math.nan, math.inf, ""),
    ],
)
def test_as_many_nines_are_said_as_the_interval_leaves(
    value: float, half_width: float, words: str
) -> None:
    assert share_in_words(Estimate(value, half_width)) == words
