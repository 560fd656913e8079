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
    """The values that one parameter of a search can have, and which points have this parameter.

    levels: how many values it can have; 0 for any number between its bounds.
    ordered: whether near levels are alike. If not, they are choices, and all differ alike.
    where: if only some points have it: the axis of choices that decides, and the levels of that
        axis with which they do.
    """

    levels: int = 0
    ordered: bool = True
    where: tuple[int, frozenset[int]] | None = None


class Domain:
    """The points (d,) of the unit cube that a search may try.

    `free` (d,) bool are the parameters without levels, which can be any number between bounds.

    Args:
        axes: which values each parameter can have.
        misses: by how much a shop that aims at a value may miss it, as a share of the bounds, shape
            (2, 2, d): where the coordinate is 0 and 1, the lowest and highest miss of each
            parameter. Between 0 and 1 it is in proportion; by default it is 0.
        counts_worst: whether the worst of the values counts that a shop may get, instead of their
            mean.
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
        """Return points (k, d) with each coordinate moved to the nearest value that it can have.

        Choices have equal parts of the cube, so that evenly spread points try each as often. A
        parameter that a point does not have is 0.
        """
        choice = np.minimum(np.floor(points * (self._steps + 1.0)), self._steps)
        level = np.where(self._are_ordered, np.rint(points * self._steps), choice)
        snapped = np.where(self.free, points, level / self._steps)
        return np.where(self.has(snapped), snapped, 0.0)

    def has(self, snapped: np.ndarray) -> np.ndarray:
        """Return which parameters each point has, (k, d) bool.

        Args:
            snapped: points as `snap` returns them, (k, d).
        """
        there = np.ones(snapped.shape, dtype=bool)
        for k, axis in enumerate(self.axes):
            if axis.where is not None:
                decides, levels = axis.where
                level = np.rint(snapped[:, decides] * self._steps[decides])
                there[:, k] = np.isin(level, list(levels))
        return there

    @property
    def size(self) -> float:
        """Number of points that a search can try; infinite if a parameter can be any number."""
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
        """Return points that a shop may get when it aims at points (k, d), shape (s, k, d).

        They are evenly spread over what the tolerances allow; without tolerances s is 1.
        """
        if self._misses is None:
            return points[None]
        at_0, at_1 = np.where(self.free, self._misses, 0.0)[:, :, None, :]
        low, high = at_0 + points * (at_1 - at_0)
        return np.asarray(low + self._shares[:, None, :] * (high - low) + points)

    @cached_property
    def _shares(self) -> np.ndarray:
        """Points spread evenly over what a shop may miss, as shares of the widths, shape (s, d)."""
        from scipy.stats.qmc import Sobol

        # The middles of equal boxes: unscrambled, the first point of the sequence is a corner.
        shares: np.ndarray = Sobol(len(self), scramble=False).random(MISSES) + 0.5 / MISSES
        return shares

    def features(self, points: np.ndarray) -> np.ndarray:
        """Return points (k, d) in the form that a model learns from, shape (k, f).

        A number is one column; a choice is a column of 0 and 1 for each of its values.
        """
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
