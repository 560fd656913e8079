"""Numbers as text, as people read them."""

import pytest

from chamberopt.common.estimate import Estimate
from chamberopt.common.number_text import percent, plain, range_text, share_in_words


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0, "0 %"),
        (0.0024, "0.24 %"),
        (0.075, "7.5 %"),
        (0.48, "48 %"),
        (0.9949, "99 %"),
        (0.9962, "99.6 %"),
        (0.99999, "99.9 %"),
        (1.0, "100 %"),
        (1.5, "150 %"),
    ],
)
def test_a_share_has_no_exponent_and_is_100_only_if_it_is_all(share: float, text: str) -> None:
    assert percent(share) == text
    assert percent(share, sign=True) == (f"+{text}" if share else text)


def test_seconds_have_no_exponent() -> None:
    assert [plain(value, 2) for value in (238.6, 23.86, 0.02386)] == ["239", "24", "0.024"]


@pytest.mark.parametrize("half_width", [2e-2, 2e-3, 5e-4, 7e-5, 3e-6])
def test_words_for_a_share_claim_no_more_than_its_interval(half_width: float) -> None:
    words = share_in_words(Estimate(1.0, half_width))
    assert (words == "") == (half_width > 1e-3)
    if words:
        claimed = float(words.removeprefix("more than ").removesuffix(" %")) / 100.0
        assert 1.0 - 10.0 * half_width < claimed <= 1.0 - half_width  # and at most a nine less


def test_ends_of_a_range_that_rounding_alone_parts_are_one_number() -> None:
    assert range_text(99.9999999999979, 100.0, "%") == "100 %"
    assert range_text(89.8943, 89.8950, "%") == "89.89 %"
    assert range_text(0.997, 1.0) == "0.9970 to 1.0000"
