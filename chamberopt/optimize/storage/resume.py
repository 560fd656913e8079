"""Resuming a study: the trials that its folder holds already.

The search is deterministic: after an interruption it runs again from its first candidate and asks
for the same candidates in the same order. A recorded trial is returned instead of simulating the
candidate again. Where the record ends, simulation continues; the result is the same, bit for bit,
as that of an uninterrupted run.
"""

from __future__ import annotations

from collections.abc import Sequence

from chamberopt.common.errors import InputError
from chamberopt.optimize.storage.trial_log import DAMAGED, JsonLines, Trial


class RecordedTrials:
    """The trials of a log, read once; a last line cut off by a crash is removed."""

    def __init__(self, log: JsonLines) -> None:
        self._log = log
        log.repair()
        self.trials = [self._trial(number, row) for number, row in enumerate(log.rows())]

    def find(self, number: int, stage: str, point: Sequence[float]) -> Trial | None:
        """The recorded trial of a candidate, or None if the record has ended.

        InputError if the record has another candidate at this number, by as little as a bit.
        """
        if number >= len(self.trials):
            return None
        trial = self.trials[number]
        wanted, recorded = f"{stage} of {_exact(point)}", f"{trial.stage} of {_exact(trial.point)}"
        if wanted != recorded:
            what = f"recorded is the {recorded}, but the search now asks for the {wanted}"
            raise self._mismatch(number, what)
        return trial

    def require_end(self, number: int) -> None:
        """Raise InputError if there are more trials than the finished study asked for."""
        if len(self.trials) > number:
            raise self._mismatch(number, "the study has ended before this row")

    def _trial(self, number: int, row: dict[str, object]) -> Trial:
        try:
            trial = Trial.from_row(row)
            if trial.number != number:
                raise ValueError
        except DAMAGED:
            raise self._log.damaged(number + 1) from None
        return trial

    def _mismatch(self, number: int, what: str) -> InputError:
        return InputError(
            f"{self._log.path}:{number + 1}: {what}. The file was edited, or written by another "
            "version of the program or another kind of machine; resume the study where it was "
            "begun, or run it in a new folder (--out)"
        )


def _exact(point: Sequence[float]) -> str:
    """The numbers of a point, so exactly that different numbers have different texts."""
    return "[" + ", ".join(repr(float(share)) for share in point) + "]"
