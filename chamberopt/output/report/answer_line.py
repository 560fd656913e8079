"""Sentences of an answer, with what they speak of."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class AnswerLine:
    """A sentence that belongs to the answer.

    about: of which candidate or thing it speaks; "best" is the result itself.
    warns: whether a limit is not certainly met, or the calibration has something to know.
    """

    about: Literal["zone", "best", "start", "other", "calibration"]
    text: str
    warns: bool
