"""Messages in the words of the page, and what they offer to take."""

import pytest

from chamberopt.page.page_words import amplitudes_named, balls_named


@pytest.mark.parametrize(
    ("matter", "balls", "amplitudes"),
    [
        ("MANY BALLS, some 7,958 under the whole part: 0.7 mm would serve 80%", [0.7], []),
        ("LARGER BALLS: they serve 60%, and 1 mm would serve 90%, with about 0.2 mmA "
         "(--ball-mm 1 takes these)", [1.0], []),
        ("NOT IN THE RANGE: it takes an amplitude of about 55 µm zero-to-peak, or balls of about "
         "1.3 mm, larger than are proposed here", [1.3], [55.0]),
        ("BALLS JAM in gaps of 0.43 mm, as every size does", [], []),
    ],
)  # fmt: skip
def test_balls_and_amplitudes_are_those_that_would_serve(
    matter: str, balls: list[float], amplitudes: list[float]
) -> None:
    assert balls_named(matter) == balls
    assert amplitudes_named(matter) == amplitudes
