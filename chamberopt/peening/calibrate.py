"""Calibrate a machine: find the parameters with which simulations give what was measured on it.

The machine's parameters are amplitude, restitution, friction and others. A set-up is a chamber in
which something was measured. A figure is a number that is measured and simulated, such as an arc
height. A round simulates every set-up at a centre, a point in the space of the parameters, and at
one step to each side along each parameter. A quadratic surface through all runs so far stands in
for the simulator. The most probable values by this surface are the centre of the next round, and
the last surface gives their covariance. Some parameters take no simulation, because a formula gives
what they change. Measurements that formulas predict (ball drops, amplitude) set the first centre.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.build import build_chamber
from chamberopt.common.files import make_folder
from chamberopt.common.versions import package_versions
from chamberopt.design.almen_strip import USUAL_K, USUAL_K_LOG_SD
from chamberopt.design.calibration import OF_STRIPS, PARAMETERS, WHOLE_STRIP, Calibration, Parameter
from chamberopt.peening.calibration_errors import SIMULATED
from chamberopt.peening.measured import (
    Measured,
    MeasuredCoupon,
    MeasuredStrip,
    Peened,
    dent_errors,
    with_amplitude,
    with_material,
)
from chamberopt.peening.posterior import (
    Data,
    Model,
    Posterior,
    Prior,
    explaining_posterior,
    find_posterior,
)
from chamberopt.peening.probes import ArcProbe, Impacts, PartProbe, SaturationProbe, whole_target
from chamberopt.peening.setups import DropModel, Setup, amplitude_model, rows_of, simulate_setup
from chamberopt.peening.strip import strip_cells
from chamberopt.peening.strip_holder import lies_along_y, strip_design

if TYPE_CHECKING:
    from chamberopt.common.progress import Progress
    from chamberopt.design.load import Design

# Medians, and standard deviations of logarithms, before measuring: docs/explanation/calibration.md.
PRIORS: dict[Parameter, tuple[float, float]] = {
    "amplitude": (1.0, 0.10),
    "C0": (1.0, 0.04),
    "v0": (1.0, 0.70),
    "mu": (1.0, 0.30),
    "hardness": (1.0, 0.20),
    "K": (USUAL_K, USUAL_K_LOG_SD),
    "beta": (1.0, 0.40),
}
# Least and largest step of a run from the centre; between these, a step is a standard deviation.
STEPS: dict[Parameter, tuple[float, float]] = {
    "amplitude": (0.05, 0.10), "C0": (0.02, 0.04), "v0": (0.2, 0.7), "mu": (0.15, 0.3),
}  # fmt: skip
REACH = 2.0  # steps from the centre within which the next centre may lie
MIN_ROUNDS, MAX_ROUNDS = 2, 5
STAYS = 0.5  # standard deviations by which the centre of the last round may be off
OF_DESIGN = 2  # number of probes for predictions of the design
DRAWN_TIMES = 12  # points of a strip's curve

Simulator = Callable[[Setup, Mapping[Parameter, float], Executor, int], Impacts]


@dataclass(frozen=True)
class Calibrated:
    """A calibration of a machine, and the simulations and measurements that led to it.

    figures: functions that predict the design's figures (Almen intensity, coverage rate, ...) from
        the parameters of the machine, by name of the figure.
    moved: distance of the result from the parameters round which the last simulations were made,
        in standard deviations.
    """

    design: Design
    table: Calibration
    posterior: Posterior
    data: tuple[Data, ...]
    figures: dict[str, Model]
    rounds: int
    runs: int
    moved: float


class Prepared(NamedTuple):
    """What a calibration has to simulate, and what it compares with the measurements.

    Attributes:
        setups: the chambers in which something was measured; the design itself comes first.
        data: the measurements, each with the function that predicts it from the parameters.
        figures: functions that predict the design's figures from the parameters, by name of the
            figure.
    """

    setups: list[Setup]
    data: list[Data]
    figures: dict[str, Model]


def prepare(measured: Measured, designs: Mapping[str, Design], folder: Path) -> Prepared:
    """Return what a calibration has to simulate to explain the measurements.

    Args:
        designs: the designs that the file of measurements names, by path.
        folder: folder into which the meshes of strips in the lid of a chamber are written.

    Raises:
        InputError: a chamber cannot be built, or a strip does not fit.
    """
    has_friction = any(one.effects.friction is not None for one in designs.values())
    simulated = tuple(name for name in SIMULATED if name != "mu" or has_friction)
    setups: dict[str, Setup] = {}

    def setup_of(design: Design) -> Setup:
        key = design.model_dump_json()
        if key not in setups:
            setups[key] = Setup(design, build_chamber(design), simulated)
        return setups[key]

    def design_of(entry: Peened) -> Design:
        design = designs[entry.design or measured.design]
        return with_amplitude(design, entry.zero_to_peak_um)

    own = setup_of(designs[measured.design])
    saturation = own.model(SaturationProbe(whole_target(own.target, own.area)))
    part = own.model(PartProbe(("rate", "mean", "impacts"), own.target, own.area))
    figures = {
        "intensity": rows_of(saturation, [0]), "saturation_time": rows_of(saturation, [1]),
        "coverage_rate": rows_of(part, [0]), "mean_dent": rows_of(part, [1]),
        "impacts": rows_of(part, [2]),
    }  # fmt: skip
    data: list[Data] = []
    for number, strip in enumerate(measured.strip):
        place = make_folder(folder / f"strip-{number + 1}")
        lid = strip_design(design_of(strip), strip.size, place, strip.distance_mm)
        data.append(_arcs(strip, setup_of(lid)))
    for coupon in measured.coupon:
        of_coupon = setup_of(with_material(design_of(coupon), coupon.material))
        data += _coupon_data(coupon, of_coupon)
    for one in measured.impacts:
        at = setup_of(design_of(one))
        model = at.model(PartProbe(("impacts",), at.target, at.area))
        data.append(_single("impact rates", "", 0.0, one.per_s, 1e-2 * one.sd_percent, model))
    for drop in measured.drop:
        law = getattr(designs[drop.design or measured.design].materials, drop.surface)
        sd, bounce = 1e-2 * drop.sd_percent, DropModel(law, drop.speed_m_s)
        data.append(
            _single("ball drops", drop.surface, drop.speed_m_s, drop.restitution, sd, bounce)
        )
    if measured.amplitude is not None:
        laser = measured.amplitude
        sd = 0.03 if laser.sd is None else laser.sd / laser.measured_pv_um
        ratio = laser.measured_pv_um / laser.set_pv_um
        data.append(_single("amplitude", "", laser.set_pv_um, ratio, sd, amplitude_model))
    return Prepared(list(setups.values()), data, figures)


def _single(kind: str, label: str, at: float, value: float, sd: float, model: Model) -> Data:
    one = np.array([math.log(value)])
    return Data(kind, label, np.array([at]), one, np.array([[sd**2]]), model)


def _arcs(strip: MeasuredStrip, setup: Setup) -> Data:
    """Return the measured arc heights of a strip, with the function that predicts them.

    The result also holds a function that predicts arc heights at further times, for a picture.
    """
    times = np.array(strip.time_s)
    drawn = np.geomspace(0.5 * times[0], 1.5 * times[-1], DRAWN_TIMES)
    cells = strip_cells(strip.size, lies_along_y(setup.design, strip.size))
    model = setup.model(ArcProbe(cells, (*strip.time_s, *drawn.tolist())))
    label = f"{2e6 * setup.design.sonotrode.amplitude:g} µm peak to valley"
    sd = np.full(len(times), 1e-2 * strip.sd_percent)
    y = np.log(np.array(strip.arc_mm))
    return Data(
        "arc heights",
        label,
        times,
        y,
        np.diag(sd**2),
        rows_of(model, range(len(times))),
        (drawn, rows_of(model, range(len(times), len(times) + DRAWN_TIMES))),
    )


def _coupon_data(coupon: MeasuredCoupon, setup: Setup) -> list[Data]:
    model = setup.model(PartProbe(("rate", "mean", "p90"), setup.target, setup.area))
    label = f"{2e6 * setup.design.sonotrode.amplitude:g} µm peak to valley"
    data = []
    if coupon.coverage:
        times = np.array([one.time_s for one in coupon.coverage])
        left = 1.0 - np.array([one.percent for one in coupon.coverage]) / 100.0
        x = -np.log(left)
        # The standard deviation of ln x, by its slope over the coverage.
        sd = np.array([one.sd for one in coupon.coverage]) / 100.0 / (left * x)
        rows = rows_of(model, [0] * len(times))
        data.append(Data("coverage", label, times, np.log(x / times), np.diag(sd**2), rows))
    if coupon.dent_mm is not None:
        dents = coupon.dent_mm
        found = [dents.mean] if dents.p90 is None else [dents.mean, dents.p90]
        rows = rows_of(model, [1, 2][: len(found)])
        at = np.array([0.5, 0.9])[: len(found)]
        y = np.log(np.array(found))
        data.append(Data("dent diameters", label, at, y, dent_errors(dents), rows))
    return data


def prior_of(measured: Measured, simulated: tuple[Parameter, ...]) -> Prior:
    """Return what is known before measuring about each parameter that the measurements concern.

    Args:
        simulated: parameters whose effect only a simulation tells.
    """
    names = [
        name
        for name in PARAMETERS
        if (name not in SIMULATED or name in simulated)
        and (name not in OF_STRIPS or measured.strip)
    ]
    mean, sd = [], []
    for name in names:
        given = getattr(measured.prior, name)
        median, usual = PRIORS[name]
        mean.append(math.log(median if given is None or given.mean is None else given.mean))
        sd.append(usual if given is None else given.sd_log)
    return Prior(tuple(names), np.array(mean), np.array(sd))


def calibrate(
    measured: Measured,
    designs: Mapping[str, Design],
    prepared: Prepared,
    executor: Executor,
    progress: Progress | None = None,
    simulator: Simulator = simulate_setup,
) -> Calibrated:
    """Find the parameters of a machine, such as its real amplitude, from its measurements.

    Args:
        designs: designs by path, as `load_measured` gives them.
        prepared: result of `prepare`.
        progress: called as progress(simulations done, simulations in all, None).
        simulator: function that simulates a set-up at given logarithms of the parameters, and
            returns its impacts.

    Raises:
        InputError: the simulated balls hardly hit a surface on which something was measured.
        sim_core.SimulationError: a simulation must stop.
    """
    setups, data, figures = prepared
    simulated = setups[0].simulated
    prior = prior_of(measured, simulated)
    at = [prior.names.index(name) for name in simulated]
    known = Posterior(prior, prior.mean, np.diag(prior.sd**2))
    direct = [one for one in data if one.model is amplitude_model or type(one.model) is DropModel]
    if direct:
        far = np.full(len(prior.mean), np.inf)
        known = find_posterior(direct, prior, prior.mean, (-far, far))
    runs, count = 0, len(setups) * (1 + 2 * len(at))
    for number in range(MAX_ROUNDS):
        centre = known.mean[at]
        sds = np.sqrt(np.diag(known.covariance))[at]
        steps = np.clip(sds, *np.array([STEPS[name] for name in simulated]).T)
        for place in _places(centre, steps):
            values = dict(zip(simulated, place.tolist(), strict=True))
            for setup in setups:
                seed = setup.design.process.seed + number
                setup.add_run(place, simulator(setup, values, executor, seed))
                runs += 1
                if progress:
                    progress(runs, MAX_ROUNDS * count, None)
        _centre_at(setups, centre)
        known = find_posterior(data, prior, known.mean, _bounds(known, at, centre, REACH * steps))
        if number + 1 >= MIN_ROUNDS and _moved(known, at, centre) < STAYS:
            break
    if progress:
        progress(runs, runs, None)  # no further round is needed
    _centre_at(setups, known.mean[at])
    bounds = _bounds(known, at, known.mean[at], REACH * steps)
    known = explaining_posterior(data, prior, known.mean, bounds)
    moved, design = _moved(known, at, centre), designs[measured.design]
    table = _table(known, setups, design, measured)
    return Calibrated(design, table, known, tuple(data), figures, number + 1, runs, moved)


def _places(centre: np.ndarray, steps: np.ndarray) -> list[np.ndarray]:
    """Return the points (k,) at which to simulate: the centre, and two neighbours per parameter.

    Args:
        centre: logarithms of the k parameters whose effect only a simulation tells, (k,).
        steps: distance of the neighbours from the centre along each parameter, (k,).
    """
    sides = [sign * row for row in np.diag(steps) for sign in (-1.0, 1.0)]
    return [centre, *(centre + side for side in sides)]


def _centre_at(setups: list[Setup], middle: np.ndarray) -> None:
    """Fit the polynomials that predict all simulated figures, expanded about a point.

    Args:
        middle: logarithms at this point of the parameters that are simulated, (k,).
    """
    for setup in setups:
        for _, model in setup.models:
            model.centre_at(middle)


def _bounds(
    known: Posterior, at: list[int], middle: np.ndarray, reach: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest values (p,) that the logarithms of all parameters may have.

    Args:
        at: positions of the simulated parameters among all p; the other parameters have no bounds.
        middle: middle of the bounds of the parameters at these positions, (k,).
        reach: distance of these bounds from the middle, (k,).
    """
    low, high = np.full((2, len(known.mean)), np.inf) * [[-1.0], [1.0]]
    low[at], high[at] = middle - reach, middle + reach
    return low, high


def _moved(known: Posterior, at: list[int], centre: np.ndarray) -> float:
    """Return by how many standard deviations the result differs from the centre of a round.

    Only the parameter that differs most counts.

    Args:
        known: the result, the most probable parameters with their covariance.
        at: positions of the simulated parameters among all.
        centre: logarithms of the simulated parameters at the centre of the round, (k,).
    """
    sds = np.sqrt(np.diag(known.covariance))[at]
    return float((np.abs(known.mean[at] - centre) / sds).max())


def _table(
    found: Posterior, setups: list[Setup], design: Design, measured: Measured
) -> Calibration:
    """Return the table [calibration] that designs of this machine name.

    It holds the parameters, and the ranges of amplitude and ball diameter that were measured.
    """
    tried = setups if len(setups[0].models) > OF_DESIGN else setups[1:] or setups
    amplitudes = [round(1e6 * one.design.sonotrode.amplitude, 6) for one in tried]
    balls = [1e3 * ball for one in tried for ball, _ in one.design.shot.sizes]
    return Calibration(
        program=package_versions(["chamberopt"])["chamberopt"],
        parameters=found.prior.names,
        log_mean=tuple(found.mean.tolist()),
        log_covariance=tuple(map(tuple, found.covariance.tolist())),
        amplitude_um=(min(amplitudes), max(amplitudes)),
        ball_diameter_mm=(min(balls), max(balls)),
        ball_density_kg_m3=design.shot.density,
        strips=measured.strip[0].size.calibrated_as if measured.strip else WHOLE_STRIP,
        misfits=found.misfits,
    )
