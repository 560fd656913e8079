"""The runs of benchmarks/analytic.py: one chamber, analytical or meshed, and their differences."""

from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np

from chamberopt.chamber.analytic import analytic_cavity, impacts_on_chamber
from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.replica_seed import replica_seed
from chamberopt.chamber.scene import build_scene, chamber_mesh
from chamberopt.common.estimate import Estimate, estimate
from chamberopt.coverage.dents import impact_angle_deg
from chamberopt.coverage.part_impacts import Hits, hits_on_part
from chamberopt.design.load import Design
from chamberopt.simulation.estimates import SeenDents, estimate_metrics
from chamberopt.simulation.evaluate import prepare_target
from sim_core import AnalyticCavity, ImpactLog, TriangleMesh, simulate

MEASURED, PEENED = 0.39, 50.0  # the paper's experiment: coverage, and after how long [s]
BINS = 10
GUESS, SLOPE, STEPS = (
    5.0,
    2.5,
    3,
)  # µm to start from; of exponent against amplitude, both logarithmic
FAR = 0.01  # of a logarithm: nearer to one another two points give no slope but noise
FIGURES = {
    "mean_coverage": "coverage",
    "impacts_per_mm2_s": "impacts / mm² s",
    "mean_normal_speed_m_s": "normal speed, m/s",
}
INSCRIBED = (
    -2.0 * np.pi**2 / 3.0
)  # relative volume of a polygon in its circle, less 1, times n² (first order)
PROFILES = {  # of the impacts on the plate: name, unit
    "distance from the axis": "mm",
    "normal speed": "m/s",
    "impact angle": "degrees",
}


@dataclass(frozen=True)
class Effort:
    """How much is simulated: replicas, the seconds of each, and the numbers of facets to try."""

    replicas: int
    seconds: float
    facets: tuple[int, ...]


@dataclass(frozen=True)
class Run:
    """One simulated chamber: its figures with their intervals, and its profiles.

    Of each profile ``shares`` holds the share of impacts in each bin, one row for each replica.
    """

    volume: float
    figures: dict[str, Estimate]
    shares: dict[str, np.ndarray]


def values(log: ImpactLog) -> dict[str, np.ndarray]:
    """What the profiles are made of, one number an impact."""
    return dict(
        zip(
            PROFILES,
            (
                1e3 * np.hypot(log.position[:, 0], log.position[:, 1]),
                log.normal_speed,
                impact_angle_deg(log.velocity, log.normal_speed),
            ),
            strict=True,
        )
    )


def replica(
    design: Design, chamber: Chamber, surface: TriangleMesh | AnalyticCavity, seed: int
) -> tuple[Hits, ImpactLog]:
    """What the plate got in one replica, and its impacts."""
    log = simulate(build_scene(design, surface, seed)).impacts
    if isinstance(surface, AnalyticCavity):
        log = impacts_on_chamber(log, chamber)
    return hits_on_part(log, chamber, design), log


def run(
    design: Design,
    effort: Effort,
    edges: dict[str, np.ndarray],
    executor: Executor,
    stream: str,
    analytic: bool,
) -> Run:
    """Simulate a design's chamber, analytical or meshed, on one of the two streams of seeds."""
    chamber = build_chamber(design)
    surface = analytic_cavity(design, chamber) if analytic else chamber_mesh(chamber)

    def one(number: int) -> tuple[Hits, list[np.ndarray]]:
        got, log = replica(
            design, chamber, surface, replica_seed(design.process.seed, number, stream)
        )
        seen = values(log)
        return got, [
            np.histogram(np.clip(seen[name], *bins[[0, -1]]), bins)[0] / len(log)
            for name, bins in edges.items()
        ]

    hits, counts = zip(*executor.map(one, range(effort.replicas)), strict=True)
    seen = SeenDents.none(prepare_target(design, chamber, chamber_mesh(chamber)))
    seen.add(hits)
    found = estimate_metrics(seen, hits, chamber, design).metrics
    shares = {name: np.array([one[k] for one in counts]) for k, name in enumerate(edges)}
    return Run(surface.volume, {name: found[name] for name in FIGURES}, shares)


def calibrated(design: Design, effort: Effort, executor: Executor) -> Design:
    """The design at the amplitude that covers what was measured, in the analytical chamber.

    The amplitude [µm] is rounded to 0.01. It is found by secants, because the logarithm of
    coverage's exponent is nearly straight in the logarithm of the amplitude.
    """
    wanted, slope, amplitude = np.log(-np.log1p(-MEASURED)), SLOPE, GUESS
    before: tuple[float, float] | None = None
    for _ in range(STEPS):
        design = design.changed({"sonotrode.amplitude_um": round(amplitude, 2)})
        covered = run(design, effort, {}, executor, "search", True).figures["mean_coverage"].value
        here = np.log(1e6 * design.sonotrode.amplitude), np.log(-np.log1p(-covered))
        if before is not None and abs(here[0] - before[0]) > FAR:
            slope = (here[1] - before[1]) / (here[0] - before[0])
        before, amplitude = here, float(np.exp(here[0] + (wanted - here[1]) / slope))
    return design.changed({"sonotrode.amplitude_um": round(amplitude, 2)})


def bin_edges(design: Design) -> dict[str, np.ndarray]:
    """Edges of the bins of each profile.

    The bins hold equally many impacts in one replica of the analytical chamber, except that those
    of distances have equal areas. What lies beyond the edges is counted in the first and last bin.
    """
    chamber = build_chamber(design)
    log = replica(design, chamber, analytic_cavity(design, chamber), replica_seed(0, 0))[1]
    edges = {
        name: np.quantile(seen, np.linspace(0.0, 1.0, BINS + 1))
        for name, seen in values(log).items()
    }
    reach = 1e3 * 0.5 * (design.chamber.diameter - design.shot.diameter)
    edges["distance from the axis"] = reach * np.sqrt(np.linspace(0.0, 1.0, BINS + 1))
    return edges


def hotelling(one: np.ndarray, two: np.ndarray) -> float:
    """The probability that two sets of replicas (n, bins) with equal means differ by as much.

    This is Hotelling's two-sample T² (T. W. Anderson, An Introduction to Multivariate Statistical
    Analysis, 3rd ed. 2003, section 5.3), which allows for bins that move together. Shares add up to
    1, so the last bin adds no information and is left out.
    """
    from scipy.stats import f

    one, two = one[:, :-1], two[:, :-1]
    n, m, p = len(one), len(two), one.shape[1]
    pooled = ((n - 1) * np.cov(one.T) + (m - 1) * np.cov(two.T)) / (n + m - 2)
    apart = one.mean(axis=0) - two.mean(axis=0)
    square = n * m / (n + m) * apart @ np.linalg.solve(pooled, apart)
    return float(f.sf(square * (n + m - p - 1) / (p * (n + m - 2)), p, n + m - p - 1))


def difference(one: Estimate, two: Estimate) -> Estimate:
    """One minus two, of independent replicas, with its 95 % interval."""
    return Estimate(one.value - two.value, float(np.hypot(one.half_width, two.half_width)), ())


def relative(run: Run, exact: Run, name: str) -> tuple[float, float]:
    """How much [-] a figure is off the analytical one, and the 95 % half-width of that."""
    apart, whole = difference(run.figures[name], exact.figures[name]), exact.figures[name].value
    return apart.value / whole, apart.half_width / whole


def fit(exact: Run, meshed: dict[int, Run], name: str) -> tuple[float, float, float]:
    """Fits k of the relative difference k/n² by least squares.

    Returns k, its 95 % half-width and the p-value of the fit.
    """
    from scipy.stats import chi2

    square = np.array([1.0 / n**2 for n in meshed])
    off, half_width = np.array([relative(run, exact, name) for run in meshed.values()]).T
    weight = half_width**-2.0
    k = float((weight * square * off).sum() / (weight * square**2).sum())
    misfit = 1.96**2 * (weight * (off - k * square) ** 2).sum()
    return k, float((weight * square**2).sum() ** -0.5), float(chi2.sf(misfit, len(meshed) - 1))


def rows(
    exact: Run, meshed: dict[int, Run], facets: int, edges: dict[str, np.ndarray]
) -> list[dict[str, Any]]:
    """The rows of the CSV: the figures of every mesh and the bins of the design's own mesh.

    Each stands beside the value of the analytical chamber.
    """
    found = [
        (f"{name}, {n} facets", "", exact.figures[name], run.figures[name])
        for n, run in meshed.items()
        for name in FIGURES
    ]
    for name in PROFILES:
        for k in range(BINS):
            a, b = (estimate(one.shares[name][:, k]) for one in (exact, meshed[facets]))
            found.append(
                (name, f"{edges[name][k]:.4g} to {edges[name][k + 1]:.4g} {PROFILES[name]}", a, b)
            )
    return [
        {
            "quantity": name,
            "bin": where,
            "analytical": f"{a.value:.6g}",
            "half_width": f"{a.half_width:.2g}",
            "meshed": f"{b.value:.6g}",
            "meshed_half_width": f"{b.half_width:.2g}",
            "difference_over_half_width": round(
                difference(b, a).value / difference(b, a).half_width, 2
            ),
        }
        for name, where, a, b in found
    ]
