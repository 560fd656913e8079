"""Arc height of a virtual Almen strip against peening time, before a calibration's K and beta.

Notation: as in coverage/strength.py, and
    x, y      position along the strip and across it, from its middle [m]
    a, b      half distances of the gauge's balls along x and y [m]            (GAUGE)
    k_x, k_y  curvatures of the strip [1/m], in proportion to the local h
    w         weight of a point of the strip in the arc height; its integral over the strip is 1

    arc height = 1/2 integral of (a - |x|) k_x dx + 1/2 integral of (b - |y|) k_y dy

The gauge's four balls stand at (± a, ± b), and its tip measures the height of the middle over the
balls. A strip bends along x as a whole, so that k_x is proportional to the mean of h over its
width. k_y is proportional to the mean of h over the length between the balls. So bending along x
makes a² / (a² + b²) = 80 % of the arc height. On discs, strips of other sizes and zones of a part
all points have the same weight, as the weights of their gauge are not known.

The strip is divided into cells. h of a cell follows from its dents, and is summed over cells with
their w. With few dents, h of a cell saturates too early. So neighbouring cells are put together
until they have ENOUGH_DENTS, and their dents count by the w of their cells.

Source: the gauge of SAE J442: balls 31.75 mm and 15.87 mm apart.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.coverage.field.surface_points import morton
from chamberopt.coverage.strength import SATURATED, strip_dents
from chamberopt.design.almen_strip import STRIPS
from chamberopt.design.calibration import WHOLE_STRIP

if TYPE_CHECKING:
    from chamberopt.coverage.part_impacts import Hits
    from chamberopt.design.materials import PartMaterial

GAUGE = 15.875e-3, 7.94e-3  # a, b [m]
LENGTH, WIDTH = STRIPS["A"].length, STRIPS["A"].width
CELLS = 4, 4  # cells along and across a strip; a disc has 4 rings of 4 sectors
ENOUGH_DENTS = 400  # mean number of dents in a cell
LEVELS = 64  # levels of strength; twice as many change S by less than 0.1 %
SCANNED = 200  # number of times at which the largest root is looked for


@dataclass(frozen=True)
class StripSize:
    """Length and width [m] of an Almen strip; both are the diameter if the strip is round."""

    length: float = LENGTH
    width: float = WIDTH
    is_disc: bool = False

    @property
    def is_whole(self) -> bool:
        """Whether this is the size of a standard Almen strip, whose gauge is known."""
        return not self.is_disc and (self.length, self.width) == (LENGTH, WIDTH)

    @property
    def calibrated_as(self) -> str:
        """Name of this size in a calibration, which holds only for strips of one size."""
        if self.is_whole:
            return WHOLE_STRIP
        return f"{self}" if self.is_disc else f"{self} strip"

    def __str__(self) -> str:
        if self.is_disc:
            return f"disc of {1e3 * self.length:g} mm"
        return f"{1e3 * self.length:g} x {1e3 * self.width:g} mm"


class Cells(NamedTuple):
    """Pieces of a strip in which dents are counted.

    Attributes:
        area: area of each cell [m²], (c,).
        weight: weight of each cell in the arc height, (c,); their sum is 1.
        of: function of impacts that gives the cell of each impact, (k,); -1 outside.
    """

    area: np.ndarray
    weight: np.ndarray
    of: Callable[[Hits], np.ndarray]


class StripDents(NamedTuple):
    """Dents in the cells of a strip, sorted by strength (dent diameter² / ball diameter).

    The range of strengths is divided into LEVELS equal intervals, the levels.

    Attributes:
        parts: dented area over area, of each replica in each cell, (g, c, LEVELS).
        strength: mean strength of the dents of each level [m], ascending, (LEVELS,).
        weight: weight of each cell in the arc height, (c,).
        number: number of dents in each cell in all replicas, (c,).
        seconds: simulated time of each replica [s].
    """

    parts: np.ndarray
    strength: np.ndarray
    weight: np.ndarray
    number: np.ndarray
    seconds: float


class StripCurve(NamedTuple):
    """Saturation curve: arc strength after time t is the sum of height (1 - exp(-rate t)).

    Attributes:
        height: arc strength that each term reaches in the end [m], (n,).
        rate: rate at which each term approaches it [1/s], (n,).
    """

    height: np.ndarray
    rate: np.ndarray

    def at(self, times: np.ndarray | float) -> np.ndarray:
        """Return the arc strength [m] after some times [s], in an array of the same shape."""
        gone = -np.expm1(-np.multiply.outer(np.asarray(times, dtype=float), self.rate))
        return np.asarray(gone @ self.height)

    def growth(self, times: np.ndarray | float) -> np.ndarray:
        """Return the slope [m] of arc strength by the logarithm of time, in the shape of times."""
        exposure = np.multiply.outer(np.asarray(times, dtype=float), self.rate)
        return np.asarray((exposure * np.exp(-exposure)) @ self.height)

    def saturation_time(self) -> float:
        """Return the longest time [s] after which twice the time gives a tenth more arc strength.

        This is the saturation time. It is 0 if there are no dents.
        """
        from scipy.optimize import brentq

        rates = self.rate[self.rate > 0.0]
        if not len(rates):
            return 0.0

        # After the largest root, twice the time gives less than a tenth more.
        times = np.geomspace(0.1 / rates.max(), 5.0 / rates.min(), SCANNED)
        last = int(np.flatnonzero(self._gain(times) > 0.0)[-1])
        return float(brentq(self._gain, times[last], times[last + 1], rtol=1e-10))

    def _gain(self, times: np.ndarray) -> np.ndarray:
        return np.asarray(self.at(2.0 * times) - SATURATED * self.at(times))


def strip_cells(size: StripSize, along_y: bool = False) -> Cells:
    """Divide a strip, whose middle is at x = y = 0, into cells in which dents are counted.

    Args:
        along_y: its length is along y instead of x.
    """
    if size.is_disc:
        return _disc_cells(0.5 * size.length)
    a, b = GAUGE
    along = np.linspace(-1.0, 1.0, CELLS[0] + 1) * min(a, 0.5 * size.length)
    across = np.linspace(-0.5, 0.5, CELLS[1] + 1) * size.width
    area = np.outer(np.diff(along), np.diff(across))
    weight = area / area.sum()
    if size.is_whole:
        share = a**2 / (a**2 + b**2)
        by_x = np.outer(_leverage(along, a), np.diff(across) / size.width)
        by_y = np.outer(np.diff(along) / (2.0 * a), _leverage(across, b))
        weight = share * by_x + (1.0 - share) * by_y

    def of(hits: Hits) -> np.ndarray:
        i, j = (
            np.searchsorted(edges, hits.place[:, axis], "right") - 1
            for axis, edges in ((int(along_y), along), (int(not along_y), across))
        )
        inside = (i >= 0) & (i < CELLS[0]) & (j >= 0) & (j < CELLS[1])
        return np.where(inside, i * CELLS[1] + j, -1)

    return Cells(area.ravel(), weight.ravel(), of)


def _leverage(edges: np.ndarray, half: float) -> np.ndarray:
    """Return the share of each interval between edges in the integral of half - |x|.

    The integral runs from x = -half to half. The gauge weighs bending at x with half - |x|.
    """
    x = np.clip(edges, -half, half)
    return np.asarray(np.diff(x * (2.0 * half - np.abs(x))) / (2.0 * half**2))


def _disc_cells(radius: float) -> Cells:
    """Divide a round strip into cells of equal area: four sectors of each of its rings."""
    rings, sectors = CELLS[0], 4
    count = rings * sectors

    def of(hits: Hits) -> np.ndarray:
        x, y = hits.place[:, 0].astype(float), hits.place[:, 1].astype(float)
        ring = (rings * (x * x + y * y) / radius**2).astype(int)
        sector = ((np.arctan2(y, x) / (2.0 * np.pi) + 0.5) * sectors).astype(int) % sectors
        return np.where(ring < rings, ring * sectors + sector, -1)

    area = np.full(count, np.pi * radius**2 / count)
    return Cells(area, area / area.sum(), of)


def surface_cells(vertices: np.ndarray, triangles: np.ndarray, area: np.ndarray) -> Cells:
    """Divide a surface into about 16 cells of neighbouring triangles, in which dents are counted.

    Each cell has its share of the area as its weight in the arc height.

    Args:
        vertices: vertices of the part [m], (n, 3).
        triangles: triangles of the part, (m, 3).
        area: area of each triangle of the surface [m²], (m,); 0 for other triangles.
    """
    own = np.flatnonzero(area > 0.0)
    own = own[np.argsort(morton(vertices[triangles[own]].mean(axis=1)), kind="stable")]
    middle = (np.cumsum(area[own]) - 0.5 * area[own]) / area.sum()
    number = np.unique((CELLS[0] * CELLS[1] * middle).astype(int), return_inverse=True)[1]
    cell = np.full(len(area), -1)
    cell[own] = number
    areas = np.bincount(number, area[own])
    return Cells(areas, areas / areas.sum(), lambda hits: cell[hits.triangle])


def count_dents(
    replicas: Sequence[Hits], seconds: float, cells: Cells, density: float, strip: PartMaterial
) -> StripDents:
    """Count the dents that the impacts of replicas leave in the cells of a strip.

    Args:
        replicas: impacts of each replica, on the strip and perhaps beside it.
        seconds: simulated time of each replica [s].
        density: density of the balls [kg/m³].
        strip: the metal of a strip.
    """
    found = []
    for hits in replicas:
        dent, s = strip_dents(hits, density, strip)
        cell = cells.of(hits)
        rows = np.flatnonzero((cell >= 0) & (s > 0.0))
        found.append((cell[rows], np.pi / 4.0 * dent[rows] ** 2, s[rows]))
    highest = max((float(s.max(initial=0.0)) for _, _, s in found), default=0.0)
    parts, count = np.zeros((len(found), len(cells.area), LEVELS)), np.zeros(len(cells.area))
    sums = np.zeros((2, LEVELS))  # dented area, and dented area times s
    for part, (cell, dented, s) in zip(parts, found, strict=True):
        count += np.bincount(cell, minlength=len(count))
        level = np.minimum((LEVELS * s / max(highest, 1e-300)).astype(int), LEVELS - 1)
        part += np.bincount(cell * LEVELS + level, dented, part.size).reshape(part.shape)
        sums += [np.bincount(level, dented * power, LEVELS) for power in (1.0, s)]
    middle = (np.arange(LEVELS) + 0.5) * highest / LEVELS
    strength = np.divide(sums[1], sums[0], out=middle, where=sums[0] > 0.0)
    whole = StripDents(parts / cells.area[:, None], strength, cells.weight, count, seconds)
    return _put_together(whole)


def _put_together(dents: StripDents) -> StripDents:
    """Return the dents in 4 larger cells, or in 1 cell, if they are too few for all cells."""
    cells, total = len(dents.weight), dents.number.sum()
    groups = next((k for k in (cells, 4) if total >= ENOUGH_DENTS * k), 1)
    if groups >= cells:
        return dents
    member = np.arange(cells) * groups // cells == np.arange(groups)[:, None]
    weight = member @ dents.weight
    share = member * dents.weight / weight[:, None]
    parts = np.einsum("kc,gcl->gkl", share, dents.parts)
    return StripDents(parts, dents.strength, weight, member @ dents.number, dents.seconds)


def strip_curve(dents: StripDents, some: np.ndarray | slice = slice(None)) -> StripCurve:
    """Return the curve of arc strength against time.

    The arc height of a real strip is K times the arc strength at beta times the time, with K and
    beta from a calibration.

    Args:
        some: replicas that count; by default all.
    """
    parts = dents.parts[some]
    density = parts.sum(axis=0) / (dents.seconds * len(parts))
    rate = np.cumsum(density[:, ::-1], axis=1)[:, ::-1]
    height = np.outer(dents.weight, np.diff(dents.strength, prepend=0.0))
    return StripCurve(height.ravel(), rate.ravel())
