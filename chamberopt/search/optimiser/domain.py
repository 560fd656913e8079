"""The values that the parameters of a search can have: numbers, steps and choices.

A search works on points of the unit cube, with a coordinate for each parameter. A parameter that
can have only n values, its levels, has the coordinates 0, 1/(n - 1), ..., 1. The model of a search
learns the nearest of these coordinates, not the coordinate that was drawn: E. C. Garrido-Merchán
and D. Hernández-Lobato, "Dealing with categorical and integer-valued variables in Bayesian
optimization with Gaussian processes", Neurocomputing 380 (2020) 20.
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

    levels: number of values that it can have; 0 for any number between its bounds.
    ordered: whether neighbouring values are similar. If not, they are choices, all equally
        different.
    where: None if all points have the parameter. Else the position of another parameter that
        decides, and the levels (values) of the other parameter for which points have this one.
    shapes: whether it may change the chamber's shape, and so what geometry refuses. The mass of the
        shot does not.
    """

    levels: int = 0
    ordered: bool = True
    where: tuple[int, frozenset[int]] | None = None
    shapes: bool = True


class Domain:
    """The points (d,) of the unit cube that a search may try.

    `free` (d,) bool marks the parameters that can be any number between their bounds.

    Args:
        axes: which values each parameter can have.
        misses: by how much a shop that aims at a value may miss it by the tolerances, as a share of
            the distance between bounds, shape (2, 2, d): at coordinate 0 and 1 the lowest and the
            highest miss of each parameter. Between 0 and 1 they change linearly. By default there
            are no misses.
        counts_worst: whether the worst score over the values that a shop may get counts, instead of
            the mean score.
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

        All values of a choice have equal parts of the cube, so that evenly spread points try them
        equally often. A parameter that a point does not have gets the coordinate 0.
        """
        choice = np.minimum(np.floor(points * (self._steps + 1.0)), self._steps)
        level = np.where(self._are_ordered, np.rint(points * self._steps), choice)
        snapped = np.where(self.free, points, level / self._steps)
        return np.where(self.has(snapped), snapped, 0.0)

    def shape_of(self, points: np.ndarray) -> np.ndarray:
        """Return points (k, d) with the coordinate 0 for each parameter that changes no shape."""
        return np.where([axis.shapes for axis in self.axes], points, 0.0)

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
        """Return s points that a shop may get when it aims at each of the points (k, d), (s, k, d).

        The s points are evenly spread over what the tolerances allow; without tolerances s is 1.
        """
        if self._misses is None:
            return points[None]
        at_0, at_1 = np.where(self.free, self._misses, 0.0)[:, :, None, :]
        low, high = at_0 + points * (at_1 - at_0)
        return np.asarray(low + self._shares[:, None, :] * (high - low) + points)

    @cached_property
    def _shares(self) -> np.ndarray:
        """Evenly spread points of the tolerances' box, as shares of the box's widths, (s, d)."""
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
