"""Numbers as text, as people read them."""

import pytest

from chamberopt.common.number_text import percent, plain


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
