"""Simulate the chambers in which measurements were made, at any parameters of the machine."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.scene import chamber_mesh
from chamberopt.coverage.metrics import exposed_target, require_target
from chamberopt.design.calibration import PARAMETERS, Calibration, Parameter, scaled_restitution
from chamberopt.peening.posterior import Figures, Model, SimulatedModel
from chamberopt.peening.probes import Impacts, Probe, impacts_of
from chamberopt.simulation.replicas import ReplicaSetting, simulate_replicas

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.design.materials import RestitutionTable


@dataclass
class Setup:
    """A design in which something was measured, and functions that predict the measurements.

    Attributes:
        design: the design as it was set on the machine, without a calibration.
        simulated: parameters of the machine whose effect only a simulation tells.
        models: each kind of measurement, with the function that predicts its figures.
    """

    design: Design
    chamber: Chamber
    simulated: tuple[Parameter, ...]
    models: list[tuple[Probe, SimulatedModel]] = field(default_factory=list)

    def __post_init__(self) -> None:
        require_target(self.chamber)
        self.target = exposed_target(self.chamber)
        self.area = float(self.chamber.exposed_area[self.target].sum())
        self.mesh = chamber_mesh(self.chamber)

    def model(self, probe: Probe) -> SimulatedModel:
        """Return a function that predicts a measurement's figures from all runs added from now on.

        Args:
            probe: reads these figures off the impacts of a simulation run.
        """
        made = SimulatedModel(probe, self.simulated)
        self.models.append((probe, made))
        return made

    def add_run(self, place: np.ndarray, impacts: Impacts) -> None:
        """Read the figures of all measurements off the impacts of a simulation run, and keep them.

        Args:
            place: logarithms of the simulated parameters in this run, (k,).
        """
        for probe, model in self.models:
            model.add(place, probe.read(impacts))


def simulate_setup(
    setup: Setup, values: Mapping[Parameter, float], executor: Executor, seed: int
) -> Impacts:
    """Simulate a set-up in as many replicas as its design asks for, and return its impacts.

    Args:
        values: logarithms of the parameters by name.
        seed: seed of random numbers; simulations with the same seed start alike.
    """
    design = setup.design
    process = design.process.model_copy(update={"seed": seed})
    changed = {"calibration": exact_calibration(design, values), "process": process}
    tried = design.model_copy(update=changed)
    setting = ReplicaSetting(tried, setup.chamber, setup.mesh)
    return impacts_of(tried, simulate_replicas(setting, executor))


def exact_calibration(design: Design, values: Mapping[Parameter, float]) -> Calibration:
    """Return a calibration whose parameters are known exactly.

    Args:
        values: logarithms of the parameters by name.
    """
    names = tuple(name for name in PARAMETERS if name in values)
    count, balls = len(names), sorted(design.shot.diameters)
    return Calibration(
        program="",
        parameters=names,
        log_mean=tuple(float(values[name]) for name in names),
        log_covariance=((0.0,) * count,) * count,
        amplitude_um=(design.sonotrode.amplitude * 1e6,) * 2,
        ball_diameter_mm=(1e3 * balls[0], 1e3 * balls[-1]),
        ball_density_kg_m3=design.shot.density,
    )


@dataclass(frozen=True)
class DropModel:
    """A function that predicts the restitution of a ball, the share of its speed left by a bounce.

    It returns the logarithm of the restitution, which is C0 (v / v0)^(-1/4) above the yield speed
    v0 as a rule.

    Attributes:
        law: restitution of the surface against speed.
        speed: speed of the ball [m/s].
    """

    law: RestitutionTable
    speed: float  # [m/s]

    def __call__(self, theta: Mapping[Parameter, float]) -> Figures:
        from sim_core import restitution_at

        c0, v0 = (math.exp(theta.get(name, 0.0)) for name in ("C0", "v0"))
        law = scaled_restitution(self.law, c0, v0)
        e = restitution_at(np.array([self.speed]), law.restitution)
        return Figures(np.log(e), np.zeros((1, 1)))


def amplitude_model(theta: Mapping[Parameter, float]) -> Figures:
    """Return the logarithm of the sonotrode's real amplitude over its set amplitude."""
    return Figures(np.array([theta["amplitude"]]), np.zeros((1, 1)))


def rows_of(model: Model, rows: Sequence[int]) -> Model:
    """Return a function that predicts only some of the figures that `model` predicts.

    Args:
        rows: positions of the figures to keep; a position may come twice.
    """
    at = list(rows)

    def some(theta: Mapping[Parameter, float]) -> Figures:
        found = model(theta)
        return Figures(found.values[at], found.noise[np.ix_(at, at)])

    return some
