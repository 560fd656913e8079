"""Numbers as text, as people read them."""

import pytest

from chamberopt.common.estimate import Estimate
from chamberopt.common.number_text import (
    NO_BREAK,
    THIN_SPACE,
    counted,
    estimate_text,
    held_together,
    percent,
    plain,
    range_text,
    rounded,
    share_in_words,
    typeset_plain,
    with_interval,
)


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


@pytest.mark.parametrize(
    ("value", "half_width", "text"),
    [
        (0.80912, 0.0041, "0.809 ± 0.004"),
        (0.80912, 0.0031, "0.809 ± 0.003"),
        (0.80912, 0.0029, "0.8091 ± 0.0029"),
        (0.80912, 0.0010, "0.8091 ± 0.0010"),
        (12346.0, 270.0, "12350 ± 270"),
        (12346.0, 310.0, "12300 ± 300"),
        (4000.0, 5e5, "4000 ± 500000"),  # says more than 0 ± 500000
        (60000.0, 5e5, "100000 ± 500000"),
        (80.9, 0.0, "80.9"),
        (80.9, float("inf"), "80.9 ± not known"),
    ],
)
def test_a_value_has_the_decimals_of_its_half_width_which_has_two_digits_below_three(
    value: float, half_width: float, text: str
) -> None:
    assert with_interval(value, half_width) == text
    assert with_interval(-value, half_width) == f"-{text}"
    assert with_interval(value, half_width, "mm", sign=True) == f"+{text} mm"
    estimate = Estimate(0.01 * value, 0.01 * half_width)
    assert estimate_text(estimate, 100.0, "%") == f"{text} %"
    assert estimate_text(estimate, -100.0) == f"-{text}"
    assert held_together(f"{text} mm {text}") == (
        f"{text.replace(' ± ', f'{NO_BREAK}±{NO_BREAK}')}{NO_BREAK}mm "
        f"{text.replace(' ± ', f'{NO_BREAK}±{NO_BREAK}')}"
    ).replace(f"not known{NO_BREAK}mm", "not known mm")


def test_what_rounds_to_nothing_has_no_sign() -> None:
    for nearly in (-1e-4, 0.0, 1e-15, -1e-15):
        assert with_interval(nearly, 0.3, sign=True) == "0.0 ± 0.3"
    assert with_interval(1e-15, 0.0, sign=True) == plain(1e-15) == "0"
    assert with_interval(float("nan"), 0.3, "mm") == plain(float("inf")) == "not known"


def test_a_number_has_its_digits_and_an_exponent_only_far_from_one() -> None:
    for power in range(-3, 8):
        assert float(plain(1.23456 * 10.0**power)) == pytest.approx(1.235 * 10.0**power, rel=5e-4)
        assert "e" not in plain(1.2 * 10.0**power)
    assert [plain(one) for one in (1e-4, 0.99e-4, 9.9e8, 1e9)] == [
        "0.0001", "9.9e-05", "990000000", "1e+09",
    ]  # fmt: skip
    assert plain(1.23456e-7) == "1.23e-07"
    assert plain("box") == "box"
    assert [plain(one, 2) for one in (120.0, 1.0)] == ["120", "1"]
    assert [rounded(2805.0, digits) for digits in (1, 2, 3, 4)] == ["3000", "2800", "2800", "2805"]
    assert [counted(one, "dent") for one in (1.04, 1.06, 27.3)] == [
        "1 dent",
        "1.1 dents",
        "27 dents",
    ]


def test_thousands_part_from_ten_thousand_on() -> None:
    assert typeset_plain(-1234567.0, 7) == f"−1{THIN_SPACE}234{THIN_SPACE}567"
    assert typeset_plain(10000.0) == f"10{THIN_SPACE}000"
    assert typeset_plain(9999.0) == "9999"
    assert typeset_plain("0.123456") == "0.123456"


def test_ends_of_a_range_have_the_decimals_of_half_of_it() -> None:
    assert range_text(0.7, 0.83, "s") == "0.70 to 0.83 s"
    assert range_text(0.7, 0.757) == "0.700 to 0.757"  # of half a range of 0.0285
    assert range_text(0.7, 0.761) == "0.70 to 0.76"
    assert range_text(0.83, 0.7) == "0.83 to 0.70"
    assert range_text(1.0, float("inf")) == "1 to not known"
