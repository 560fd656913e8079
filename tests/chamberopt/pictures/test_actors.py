"""Colour bars have round labels; a folder's name is not typeset as a formula."""

import pytest

from chamberopt.pictures.actors import colour_bar_ticks, escape_dollars


@pytest.mark.parametrize("high", [0.35, 1.5, 2.0, 8.5, 90.0, 100.0, 500.0])
def test_bars_have_round_labels(high: float) -> None:
    steps, written = colour_bar_ticks((0.0, high))
    labels = [high * k / steps for k in range(steps + 1)]
    assert [float(written % label) for label in labels] == pytest.approx(labels)
    assert len({written % label for label in labels}) == len(labels)


def test_a_dollar_in_a_name_is_no_formula() -> None:
    assert escape_dollars("x$y$_{z}") == r"x\$y\$_{z}"
