"""Every key and option of `inspect` changes one ViewState."""

from typing import Any

import pytest

from chamberopt.common.errors import InputError
from chamberopt.pictures.quantities import QUANTITIES
from chamberopt.viewer.view_state import ViewState, parse_clip, parse_view, state_after_key

ALL = list(QUANTITIES)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"quantity": "covrage"}, "did you mean coverage"),
        ({"quantity": "intensity"}, "did you mean strength"),
        ({"quantity": "xyz"}, "there are coverage, impacts"),
        ({"time_s": -1.0}, "0 or more"),
        ({"time_s": float("nan")}, "0 or more"),
        ({"time_s": 3.0, "quantity": "interval"}, "not supported"),
        ({"below": 0.0}, "up to 100 %"),
        ({"below": 101.0}, "up to 100 %"),
        ({"cut_part": True}, "--clip"),
    ],
)
def test_what_cannot_be_looked_at_is_said(options: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        ViewState(**options)


def test_a_plane_is_said_by_its_axis() -> None:
    assert parse_clip("Z") == ((0.0, 0.0, 1.0), None)
    assert parse_clip("x=-3.5") == ((1.0, 0.0, 0.0), (-3.5, 0.0, 0.0))
    assert parse_clip("Y=2") == ((0.0, -1.0, 0.0), (0.0, 2.0, 0.0))
    for text in ("W", "X=", "X=a", "XY", ""):
        with pytest.raises(InputError, match=r"Z=12\.5"):
            parse_clip(text)


def test_an_eye_is_said_by_a_direction() -> None:
    assert parse_view("1,-1.4,-0.8") == (1.0, -1.4, -0.8)
    for text in ("0,0,0", "1,2", "x", "1,2,inf", "0,0,1e300", "1e-300,0,0"):
        with pytest.raises(InputError, match="direction"):
            parse_view(text)


def test_keys() -> None:
    first = ViewState("speed", below=80.0)
    assert [state_after_key(first, str(n + 1), first, ALL).quantity for n in range(len(ALL))] == ALL
    assert state_after_key(first, "4", first, ["coverage"]) == first  # not there
    look, thresholds = first, []
    for _ in range(6):
        look = state_after_key(look, "b", first, ALL)
        thresholds.append(look.below)
    assert thresholds == [75.0, 50.0, None, 98.0, 90.0, 75.0]
    look = state_after_key(first, "x", first, ALL)
    assert (look.cut is not None, look.cut_part) == (True, True)
    look = state_after_key(look, "c", first, ALL)
    assert (look.cut, look.cut_part) == (None, False)
    assert not state_after_key(first, "g", first, ALL).chamber
    assert state_after_key(state_after_key(first, "h", first, ALL), "h", first, ALL) == first
    assert state_after_key(ViewState(triangle=3, view=0), "u", first, ALL) == ViewState()
    assert state_after_key(ViewState("angle", time_s=3.0), "r", first, ALL) == first
    assert (
        state_after_key(ViewState(time_s=3.0), str(1 + ALL.index("interval")), first, ALL).time_s
        is None
    )
