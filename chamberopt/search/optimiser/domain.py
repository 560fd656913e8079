"""The values that the parameters of a search can have: numbers, steps and choices.

A search works on points of the unit cube, one coordinate for each parameter. A parameter with
levels has the places 0, 1/(n - 1), ..., 1. Its model is told the place that is meant, not the point
that was drawn: E. C. Garrido-Merchán and D. Hernández-Lobato, "Dealing with categorical and
integer-valued variables in Bayesian optimization with Gaussian processes", Neurocomputing 380
(2020) 20.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

MISSES = 16  # places in the box of tolerances


class Axis(NamedTuple):
    """One parameter.

    levels: how many values it can have; 0 for any number between its bounds.
    ordered: whether near levels are alike. If not, they are choices, and all differ alike.
    where: if only some points have it: the axis of choices that decides, and the levels of that
        axis with which they do.
    """

    levels: int = 0
    ordered: bool = True
    where: tuple[int, frozenset[int]] | None = None


class Domain:
    """The points (d,) of a search; `free` (d,) bool are the parameters without levels.

    Args:
        axes: the parameters.
        misses: by how much a shop may miss each, lowest and highest, where the coordinate is 0 and
            where it is 1, shape (2, 2, d); between them in proportion; default 0.
        counts_worst: whether the worst of MISSES places counts that a shop may end at, instead of
            their mean.
    """

    def __init__(
        self, axes: Sequence[Axis], misses: np.ndarray | None = None, counts_worst: bool = False
    ) -> None:
        self.axes, self.counts_worst = tuple(axes), counts_worst
        self._misses = misses if misses is not None and misses.any() else None
        self._steps = np.array([max(1, axis.levels - 1) for axis in self.axes], dtype=float)
        self._are_ordered = np.array([axis.ordered for axis in self.axes])
        self.free = np.array([axis.levels == 0 for axis in self.axes])

    def __len__(self) -> int:
        return len(self.axes)

    def snap(self, points: np.ndarray) -> np.ndarray:
        """The points (k, d) of the cube with each coordinate on its nearest level.

        Choices have equal parts of the cube, so that evenly spread points try each as often. A
        parameter that a point does not have is 0.
        """
        choice = np.minimum(np.floor(points * (self._steps + 1.0)), self._steps)
        level = np.where(self._are_ordered, np.rint(points * self._steps), choice)
        snapped = np.where(self.free, points, level / self._steps)
        return np.where(self.has(snapped), snapped, 0.0)

    def has(self, snapped: np.ndarray) -> np.ndarray:
        """Which parameters points (k, d) on their levels have, (k, d) bool."""
        there = np.ones(snapped.shape, dtype=bool)
        for k, axis in enumerate(self.axes):
            if axis.where is not None:
                decides, levels = axis.where
                level = np.rint(snapped[:, decides] * self._steps[decides])
                there[:, k] = np.isin(level, list(levels))
        return there

    @property
    def size(self) -> float:
        """How many points there are; infinite if a parameter can be any number."""
        by = next((axis.where[0] for axis in self.axes if axis.where), None)
        if by is None:
            return math.prod(axis.levels or math.inf for axis in self.axes)
        rest = [axis for k, axis in enumerate(self.axes) if k != by]
        return sum(
            math.prod(x.levels or math.inf for x in rest if not x.where or level in x.where[1])
            for level in range(self.axes[by].levels)
        )

    @property
    def has_misses(self) -> bool:
        return self._misses is not None

    def around(self, points: np.ndarray) -> np.ndarray:
        """Where a shop may end that aims at points (k, d), evenly spread, shape (s, k, d)."""
        if self._misses is None:
            return points[None]
        at_0, at_1 = np.where(self.free, self._misses, 0.0)[:, :, None, :]
        low, high = at_0 + points * (at_1 - at_0)
        return np.asarray(low + self._shares[:, None, :] * (high - low) + points)

    @cached_property
    def _shares(self) -> np.ndarray:
        """Places in the box of misses, as shares of its sides, shape (s, d)."""
        from scipy.stats.qmc import Sobol

        # The middles of equal boxes: unscrambled, the first point of the sequence is a corner.
        shares: np.ndarray = Sobol(len(self), scramble=False).random(MISSES) + 0.5 / MISSES
        return shares

    def features(self, points: np.ndarray) -> np.ndarray:
        """What a model sees of points (k, d), shape (k, f): a column for each level of a choice."""
        if self.free.all():
            return points
        snapped, columns = self.snap(points), []
        for k, axis in enumerate(self.axes):
            one = snapped[:, k]
            if axis.ordered:
                columns.append(one)
            else:
                chosen = np.rint(one * self._steps[k]).astype(int)
                columns += list(np.eye(axis.levels)[chosen].T)
        return np.stack(columns, axis=1)
