"""A blind prediction holds where measured and predicted differ by no more than both intervals."""

import pytest

from benchmarks.blind_prediction import ARC_SD, COVERAGE_SD, Z, compared


def test_scores_by_hand() -> None:
    """45 ± 4 against 50 ± 1.96 · 3: 5 / sqrt(16 + 34.6) = 0.70; arcs have 3 % of themselves."""
    rows = compared(
        {"coverage after 10 s, %": (45.0, 4.0), "arc after 20 s, mm": (0.2, 0.01)},
        {"coverage after 10 s, %": 50.0, "arc after 20 s, mm": 0.25},
    )
    coverage, arc = rows
    assert float(coverage["E_n"]) == pytest.approx(
        5.0 / (16.0 + (Z * COVERAGE_SD) ** 2) ** 0.5, abs=0.01
    )
    assert coverage["holds"] == "yes"
    own = Z * ARC_SD * 0.25
    assert float(arc["E_n"]) == pytest.approx(0.05 / (0.01**2 + own**2) ** 0.5, abs=0.01)
    assert arc["holds"] == "NO"


def test_all_that_was_predicted_must_be_measured() -> None:
    with pytest.raises(ValueError, match="was predicted and is not in the file"):
        compared({"coverage after 10 s, %": (45.0, 4.0)}, {})
