"""Resuming a study: the trials that its folder holds already.

The search is deterministic: after an interruption it runs again from its first candidate and asks
for the same candidates in the same order. A recorded trial is returned instead of simulating the
candidate again. Where the record ends, simulation continues; the result is the same, bit for bit,
as that of an uninterrupted run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.coverage.metrics import metric_names
from chamberopt.optimize.storage.trial_log import DAMAGED, JsonLines, Trial
from chamberopt.optimize.study.parameters import ParameterSpace

if TYPE_CHECKING:
    from chamberopt.optimize.study import Study


class RecordedTrials:
    """The trials of a log, read once; a last line cut off by a crash is removed.

    InputError for a row that is none of this study.
    """

    def __init__(self, log: JsonLines, study: Study) -> None:
        self._log, self._objectives = log, len(study.objective.goals)
        self._space = ParameterSpace(study.design, study.vary)
        self._metrics = set(metric_names(study.design))
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
        if trial.parameters != self._space.values_at(np.array(point)):
            raise self._log.damaged(number + 1)
        return trial

    def require_end(self, number: int) -> None:
        """Raise InputError if there are more trials than the finished study asked for."""
        if len(self.trials) > number:
            raise self._mismatch(number, "the study has ended before this row")

    def _trial(self, number: int, row: dict[str, object]) -> Trial:
        try:
            trial = Trial.from_row(row)
            if trial.number != number or not self._is_possible(trial):
                raise ValueError
        except DAMAGED:
            raise self._log.damaged(number + 1) from None
        return trial

    def _is_possible(self, trial: Trial) -> bool:
        """Whether a trial has the figures of this study, or failed, which its start never does."""
        if not trial.goals:
            return trial.number > 0 or trial.stage != "search"
        return (
            len(trial.goals) == self._objectives
            and all(math.isfinite(goal.value) for goal in trial.goals)
            and all(one.half_width >= 0.0 for one in (*trial.goals, *trial.metrics.values()))
            and trial.metrics.keys() == self._metrics
            and (trial.replicas or 0) > 0
            and trial.highest is None
        )

    def _mismatch(self, number: int, what: str) -> InputError:
        return InputError(
            f"{self._log.path}:{number + 1}: {what}. The file was edited, or written by another "
            "version of the program or another kind of machine; resume the study where it was "
            "begun, or run it in a new folder (--out)"
        )


def _exact(point: Sequence[float]) -> str:
    """The numbers of a point, so exactly that different numbers have different texts."""
    return "[" + ", ".join(repr(float(share)) for share in point) + "]"
