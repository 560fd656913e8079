"""Warnings of a design, told apart by kind and subject."""

from dataclasses import replace

import pytest

from chamberopt.chamber.build import found_in_steps
from chamberopt.chamber.checks.place_names import PART
from chamberopt.chamber.checks.warning import DesignWarning, WarningKind

POCKET = DesignWarning(WarningKind.POCKET, "a pocket around (1.0, 2.0, 3.0) mm is closed", (PART,))


def test_the_subject_is_the_same_at_another_place_and_in_another_step() -> None:
    other = replace(POCKET, message="a pocket around (9.0, 2.0, 3.0) mm is closed", step="two")
    assert other.subject == POCKET.subject
    assert replace(POCKET, about=("the holder", PART)).subject != POCKET.subject
    kinds = {replace(POCKET, kind=kind).subject for kind in WarningKind}
    assert len(kinds) == len(WarningKind)


def test_the_step_stands_before_the_message_unless_all_steps_have_it() -> None:
    rest = DesignWarning(WarningKind.REST, "balls can come to rest on the part", (PART,))
    found = found_in_steps({"one": [POCKET, rest], "two": [POCKET]})
    assert found == [("", POCKET), ("one", rest)]
    assert [replace(warning, step=name).text for name, warning in found] == [
        POCKET.message,
        "step one: balls can come to rest on the part",
    ]


@pytest.mark.parametrize(
    ("message", "beginning"),
    [
        (POCKET.message, "a pocket"),
        ("balls can jam in the gap at (1.0, 2.0, 3.0) mm", "balls can jam in the gap"),
        ("balls can come to rest on the part, which turns", "balls can come to rest on the part"),
        ("the balls fill 30% of the volume", "the balls fill 30% of the volume"),
    ],
)
def test_another_sentence_takes_the_message_up_to_its_first_comma_or_place(
    message: str, beginning: str
) -> None:
    warning = replace(POCKET, message=message, step="two")
    assert warning.beginning == beginning
