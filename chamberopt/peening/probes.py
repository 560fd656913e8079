"""Read off simulated impacts what a measurement would give: logarithms of its figures.

Notation
    h     arc strength of a strip [m], see strip.py
    x     dented area of the part over its area, per second [1/s]; coverage is 1 - exp(-x t)
    d     diameter of a dent on the part [m], as B^(-1/4) with its hardness
    T     saturation time of a strip [s]
    K, B, beta   parameters of the machine, see design/calibration.py. Formulas give the figures for
                 other K, B and beta; for another beta, h is taken at other times.

The figures are ln(K h(beta t)), ln x, ln d, ln T, and ln of the rate of impacts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate, jackknife
from chamberopt.design.calibration import Parameter, calibrated_strip
from chamberopt.peening.kirk_fit import heights, strip_saturation
from chamberopt.peening.strip import Cells, StripDents, count_dents, strip_curve

if TYPE_CHECKING:
    from chamberopt.coverage.part_impacts import Hits
    from chamberopt.design.load import Design
    from chamberopt.design.materials import PartMaterial
    from chamberopt.simulation.replicas import Replica

NOTHING = (
    "process.accuracy: hardly anything that was measured is dented in the simulation; raise "
    "simulated_time_s or replicas"
)


class Impacts(NamedTuple):
    """Simulated impacts on the part.

    Attributes:
        replicas: impacts of each replica, on the whole part.
        seconds: simulated time of each replica [s].
        density: density of the balls [kg/m³].
        strip: metal of an Almen strip, with the restitution that the simulation takes for it.
    """

    replicas: Sequence[Hits]
    seconds: float
    density: float
    strip: PartMaterial

    def strip_dents(self, cells: Cells) -> StripDents:
        """Return the dents that these impacts would leave in the cells of an Almen strip."""
        return count_dents(self.replicas, self.seconds, cells, self.density, self.strip)


def impacts_of(design: Design, replicas: Sequence[Replica]) -> Impacts:
    """Collect the impacts on the part in all replicas of a design."""
    strip = calibrated_strip(design.shot, design.calibration)
    hits, seconds = [one.hits for one in replicas], design.process.recorded_time
    return Impacts(hits, seconds, design.shot.density, strip)


class Reading(NamedTuple):
    """Logarithms of the figures that a simulation gives for a measurement.

    Attributes:
        at: function that returns these logarithms (n,) for a logarithm of beta, the calibrated
            factor on the number of dents of a strip.
        noise: covariance (n, n) of the errors that they have because impacts are limited in number.
    """

    at: Callable[[float], np.ndarray]
    noise: np.ndarray


@dataclass(frozen=True)
class ArcProbe:
    """Reads the arc heights of a strip after some peening times [s] off simulated impacts."""

    cells: Cells
    times: tuple[float, ...]

    @property
    def slopes(self) -> tuple[Mapping[Parameter, float], ...]:
        of_one: Mapping[Parameter, float] = {"K": 1.0}
        return (of_one,) * len(self.times)

    def read(self, impacts: Impacts) -> Reading:
        """Return the logarithms of the arc heights [mm] with a calibration constant K of 1."""
        times = np.array(self.times)
        dents = impacts.strip_dents(self.cells)
        curve, found = strip_curve(dents), heights(dents, times)
        more = _logs(found) - np.log(curve.at(times))  # correction for few dents

        def at(log_beta: float) -> np.ndarray:
            return np.asarray(np.log(1e3 * curve.at(times * np.exp(log_beta))) + more)

        return Reading(at, _noise(found))


@dataclass(frozen=True)
class SaturationProbe:
    """Reads a strip's saturation time, and its arc strength at this time, off simulated impacts.

    The arc strength times the calibration constant K is the Almen intensity [mmA].
    """

    cells: Cells

    slopes: tuple[Mapping[Parameter, float], ...] = ({"K": 1.0}, {"beta": -1.0})

    def read(self, impacts: Impacts) -> Reading:
        """Return the logarithms of arc strength [mm] and saturation time [s]."""
        strength, time = strip_saturation(impacts.strip_dents(self.cells))
        found = strength.times(1e3), time
        values = _logs(found)
        return Reading(lambda _: values, _noise(found))


@dataclass(frozen=True)
class PartProbe:
    """Reads figures of dents and impacts on the part off simulated impacts.

    Args:
        names: figures to read: "rate" (dented area per second), "mean" and "p90" (of dent
            diameters), or "impacts" (per second).
        target: for each triangle of the part, whether dents on it count, (m,) bool.
        area: area of the triangles that count [m²].
    """

    names: tuple[str, ...]
    target: np.ndarray
    area: float

    SLOPES = {"rate": -0.5, "mean": -0.25, "p90": -0.25, "impacts": 0.0}  # noqa: RUF012  # by ln B

    @property
    def slopes(self) -> tuple[Mapping[Parameter, float], ...]:
        return tuple({"hardness": self.SLOPES[name]} for name in self.names)

    def read(self, impacts: Impacts) -> Reading:
        """Return the logarithms of the figures that `names` asks for.

        The figures can be the share of the area that is dented in a second [1/s], mean and 90th
        percentile of the dent diameters [mm], and impacts on the part per second [1/s].
        """
        dents = [hits.on(self.target).dent.astype(float) for hits in impacts.replicas]
        dents = [one[one > 0.0] for one in dents]
        counts = np.array([len(hits) for hits in impacts.replicas])

        def figures(some: np.ndarray) -> np.ndarray:
            d = np.concatenate([one for one, used in zip(dents, some, strict=True) if used])
            seconds = impacts.seconds * some.sum()
            if not len(d):
                return np.zeros(len(self.names))
            rate = np.pi / 4.0 * float((d**2).sum()) / (self.area * seconds)
            every = {
                "rate": rate,
                "mean": 1e3 * float(d.mean()),
                "p90": 1e3 * float(np.quantile(d, 0.9)),
                "impacts": float(counts[some].sum()) / seconds,
            }
            return np.array([every[name] for name in self.names])

        count = len(counts)
        whole = figures(np.ones(count, dtype=bool))
        without = np.array([figures(one) for one in ~np.eye(count, dtype=bool)])
        found = [
            Estimate(value, 0.0, tuple(jackknife(np.array([value, *rest])).tolist()))
            for value, rest in zip(whole, without.T, strict=True)
        ]
        values = _logs(found)
        return Reading(lambda _: values, _noise(found))


Probe = ArcProbe | SaturationProbe | PartProbe


def whole_target(target: np.ndarray, area: float) -> Cells:
    """Return the target, the surface to be peened, as an imagined Almen strip of a single cell.

    Args:
        target: triangles of the part that are its target, (m,) bool.
        area: area of the target [m²].
    """
    return Cells(np.array([area]), np.ones(1), lambda hits: np.where(target[hits.triangle], 0, -1))


def _logs(found: Sequence[Estimate]) -> np.ndarray:
    values = np.array([one.value for one in found])
    if not (values > 0.0).all():
        raise InputError(NOTHING)
    return np.asarray(np.log(values))


def _noise(found: Sequence[Estimate]) -> np.ndarray:
    """Return the covariance (n, n) of figures' logarithms, from their scatter among replicas."""
    relative = np.array([np.array(one.pseudovalues) / one.value for one in found])
    scatter = np.atleast_2d(np.cov(relative)) / relative.shape[1]
    # The possible error of the correction for few dents is added.
    return np.asarray(scatter + np.diag([(one.bias / one.value) ** 2 for one in found]))
