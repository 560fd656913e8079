"""Profiles of residual stress on a surface, summed over its dents: figures with intervals.

Notation
    window  disc of the surface round a point of the target, in which dents are counted
    d_j     dent diameter at the upper end of level j of LEVELS equal levels [m]
    e_j(z)  eigenstrain under dents of diameter d_j that cover the surface (stress_law.py)
    L_j     rate of dents wider than the middle of level j: their area per area and time [1/s]
    W_j     share of the surface with such a dent after the time t, the mean over the windows of
            1 - exp(-L_j t)                                          (share, (LEVELS,))

    e(z, t) = sum over j of W_j (e_j(z) - e_(j-1)(z))
    depth of compression = 1.25 sum over j of W_j (d_j - d_(j-1))

Each spot keeps the layer of its widest dent, as a strip keeps its strongest dent (strength.py). The
profile is a mean over the surface, as a measurement by X-rays is over its spot. The stress follows
from e by the balance of forces in the part. Balls of several sizes have a mean e_j by dented area.

Two kinds of error are kept apart. The interval of a figure holds the scatter of the replicas. The
band is a factor on it by which the law may be wrong, the same for all designs of one metal and shot
(BANDS), so that the ratios of such designs are free of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.estimate import CONFIDENCE, Estimate, estimate, jackknife, normal_quantile
from chamberopt.coverage.dents import dent_diameter
from chamberopt.coverage.metrics import FULL_COVERAGE
from chamberopt.coverage.strength import LEVELS, area_of_dent, ball_diameter, dent_rates, levels
from chamberopt.coverage.strength_intervals import MIN_BATCHES, StrengthHistograms, level_histograms
from chamberopt.coverage.stress_law import (
    AS_IS,
    OF_DENT,
    LawFactors,
    PeenedMetal,
    Plate,
    eigenstrain_under_dents,
    residual_stress,
)
from chamberopt.design.flexure import plate_metals

if TYPE_CHECKING:
    from chamberopt.coverage.field.target_field import TargetField
    from chamberopt.coverage.part_impacts import Hits
    from chamberopt.design.calibration import LawCalibration
    from chamberopt.design.load import Design
    from chamberopt.design.materials import PartMaterial

DEPTH, SURFACE, PEAK, PEAK_DEPTH = (
    "compression_depth_um", "surface_stress_MPa", "peak_stress_MPa", "peak_stress_depth_um",
)  # fmt: skip
OF_STRESS = SURFACE, PEAK, PEAK_DEPTH
# Factors within which 95 % of measured values lie, as far as seven published profiles tell: rms of
# the logarithm by Student's t, rounded up (benchmarks/stress_profiles.py).
BANDS = {DEPTH: 1.6, SURFACE: 1.9, PEAK: 1.6, PEAK_DEPTH: 4.0}
OF_LAW = DEPTH, PEAK, SURFACE  # figures that the factors of a calibration move, in their order
# Standard deviation of a factor's logarithm that a measured profile does not take away, from one
# shot, intensity and laboratory to another: 20 %, by judgement.
CARRIED = math.log(1.2) / 1.96
PEAK_STRESS = 0.5, 0.7  # peak compressive stress over tensile strength, at almost any intensity
WIDEST_DENT = 0.4  # over the ball's diameter, up to which the law was compared with anything
THINNEST = 3.0  # thickness of a plate over the depth of compression
POINTS = 129  # depths of a profile
FASTEST = 1000.0  # m/s
SPEEDS = 2001
EVERY = slice(None)


@dataclass(frozen=True)
class StressModel:
    """What a design tells of the stress that a dent leaves.

    Attributes:
        metal: strength and elasticity of the part.
        material: restitution and hardness of the part, which set the size of dents.
        balls: diameters of the balls [m].
        density: of the balls [kg/m³].
        plate: thickness of the part; None for a thick part.
    """

    metal: PeenedMetal
    material: PartMaterial
    balls: tuple[float, ...]
    density: float
    plate: Plate | None = None
    factors: LawFactors = AS_IS

    def speeds(self, dent: np.ndarray, ball: float) -> np.ndarray:
        """Return the normal speeds [m/s] at which a ball leaves these dents on a thick part, (k,).

        Dents smaller than the smallest have the speed at which the part yields.
        """
        speed = np.geomspace(self.material.yield_speed, FASTEST, SPEEDS)
        dents = dent_diameter(speed, ball, self.density, self.material)
        return np.asarray(np.interp(dent, np.maximum.accumulate(dents), speed))


class LevelLayers(NamedTuple):
    """What each level of dent size adds to the profile of a surface that it covers.

    Attributes:
        depth: z [m], (POINTS,).
        eigenstrain, stress: e_j - e_(j-1), and the stress [Pa] by it, (LEVELS, POINTS) each.
    """

    depth: np.ndarray
    eigenstrain: np.ndarray
    stress: np.ndarray


class SurfaceProfile(NamedTuple):
    """Mean residual stress under a surface, by depth, (POINTS,) each.

    half_width is that of the 95 % interval of the stress by the scatter of the replicas.
    """

    depth_um: np.ndarray
    stress_MPa: np.ndarray  # noqa: N815
    half_width_MPa: np.ndarray  # noqa: N815
    eigenstrain: np.ndarray


def stress_model(design: Design) -> StressModel | None:
    """Return the model of a design's residual stress; None if the design does not ask for it."""
    asked, metals = design.stress, plate_metals(design)
    if asked is None or metals is None:
        return None
    part = design.simulated.materials.part
    assert part.yield_MPa is not None
    assert part.tensile_MPa is not None
    metal = PeenedMetal(
        metals.part, 1e6 * part.yield_MPa, 1e6 * part.tensile_MPa, metals.contact_modulus
    )
    height = asked.thickness_mm
    plate = None if height is None else Plate(1e-3 * height, asked.peened)
    factors = law_factors(design)
    balls = tuple(diameter for diameter, _ in design.shot.sizes)
    return StressModel(metal, part, balls, design.shot.density, plate, factors)


def stress_bands(design: Design) -> dict[str, float]:
    """Return the factor by which the law may be wrong in each figure of the compressed layer."""
    if design.materials.part.hardens_strongly:
        return {}
    known, measured = dict(BANDS), _law_of(design)
    if measured is not None:
        for name, row, k in zip(OF_LAW, measured.log_covariance, range(len(OF_LAW)), strict=True):
            sd = math.hypot(math.sqrt(row[k]), CARRIED)
            known[name] = math.exp(normal_quantile(CONFIDENCE) * sd)
    return known if design.stress else {DEPTH: known[DEPTH]}


def law_factors(design: Design) -> LawFactors:
    """Return the factors on the law by measured profiles of the design's metal; 1 without any."""
    measured = _law_of(design)
    return AS_IS if measured is None else LawFactors(*map(math.exp, measured.log_mean))


def _law_of(design: Design) -> LawCalibration | None:
    calibration = design.calibration
    return None if calibration is None else calibration.law_of(design.materials.part)


def level_layers(model: StressModel, highest: float, sizes: np.ndarray) -> LevelLayers:
    """Return what the levels of dent size add to the profile.

    Args:
        highest: dent diameter at the upper end of the levels [m].
        sizes: dented area by size of ball and level, (b, LEVELS). Only their ratios count.
    """
    dent = highest / LEVELS * np.arange(1, LEVELS + 1)
    depth = np.linspace(0.0, OF_DENT * model.factors.depth * highest, POINTS)
    whole = sizes.sum(axis=1, keepdims=True) + 1e-300
    shares = np.where(sizes.sum(axis=0) > 0.0, sizes, whole)
    shares = shares / shares.sum(axis=0)
    strain = sum(
        share[:, None]
        * eigenstrain_under_dents(
            depth, dent, model.speeds(dent, ball), (ball, model.density), model.metal, model.factors
        )
        for ball, share in zip(model.balls, shares, strict=True)
    )
    added = np.diff(np.asarray(strain), axis=0, prepend=0.0)
    return LevelLayers(depth, added, residual_stress(depth, added, model.metal, model.plate))


def dented_by_size(
    batches: Sequence[Sequence[Hits]], highest: float, model: StressModel
) -> np.ndarray:
    """Return the dented area by size of ball and level of dent diameter, (b, LEVELS)."""
    sizes = np.zeros((len(model.balls), LEVELS))
    if len(model.balls) == 1:
        return sizes + 1.0
    for hits in (one for batch in batches for one in batch):
        ball = ball_diameter(hits, model.density)
        nearest = np.abs(ball[:, None] - np.array(model.balls)).argmin(axis=1)
        np.add.at(sizes, (nearest, levels(hits.dent, highest)), area_of_dent(hits.dent))
    return sizes


def share_by_level(histogram: np.ndarray, time_ratio: float) -> np.ndarray:
    """Return for each window the share of it with a dent wider than each level, (p, LEVELS).

    Args:
        histogram: dented area over area of each window, by level of dent diameter, (p, LEVELS).
        time_ratio: peening time over the time in which the dents fell.
    """
    return np.asarray(-np.expm1(-dent_rates(histogram) * time_ratio))


def depth_of_compression(
    levels_covered: float | np.ndarray, highest: float, factors: LawFactors = AS_IS
) -> float | np.ndarray:
    """Return the depth of compression [m].

    Args:
        levels_covered: sum of the shares of all levels.
        highest: dent diameter at the upper end of the levels [m].
    """
    return OF_DENT * factors.depth * highest / LEVELS * levels_covered


class LayerHistograms(NamedTuple):
    """Dents of a surface by batch of replicas and level of diameter, and the layers under them.

    layers is None if the design does not ask for stress, or if nothing was dented.
    """

    found: StrengthHistograms
    layers: LevelLayers | None

    def share(self, peening_time: float, some: slice = EVERY) -> np.ndarray:
        """Return W_j after a peening time [s], from all batches or from some, (LEVELS,)."""
        parts, seconds = self.found.parts[some].sum(axis=0), float(self.found.seconds[some].sum())
        return np.asarray(share_by_level(parts, peening_time / seconds).mean(axis=0))

    def share_without(self, peening_time: float) -> list[np.ndarray]:
        """Return W_j after a peening time [s] from all batches but one, for each batch."""
        parts, seconds = self.found.parts, self.found.seconds
        total, whole = parts.sum(axis=0), float(seconds.sum())
        return [
            share_by_level(total - part, peening_time / (whole - own)).mean(axis=0)
            for part, own in zip(parts, seconds.tolist(), strict=True)
        ]


def layer_histograms(
    field: TargetField,
    batches: Sequence[Sequence[Hits]],
    seconds: float,
    model: StressModel | None = None,
) -> LayerHistograms:
    """Return the dents of a surface by level of diameter, and the layers under them.

    Args:
        batches: impacts of each replica, in batches of replicas, turned into the sector of the
            chamber in which the windows lie.
        seconds: simulated time of each replica.
    """
    found = level_histograms(field, batches, seconds, lambda hits: (hits.dent, hits.dent))
    if model is None or found.highest == 0.0:
        return LayerHistograms(found, None)
    sizes = dented_by_size(batches, found.highest, model)
    return LayerHistograms(found, level_layers(model, found.highest, sizes))


def layer_estimates(
    seen: LayerHistograms, peening_time: float, factors: LawFactors = AS_IS
) -> dict[str, Estimate]:
    """Return the estimates of the compressed layer, by name: means over the reachable surface.

    They are the depth of compression [µm] and, if the design asks for them, the stress at the
    surface and the largest compressive stress [MPa], and the depth of the latter [µm]. Their
    intervals hold the scatter of the replicas, and not the band of the law.
    """
    count, highest = len(seen.found.parts), seen.found.highest

    def figures(share: np.ndarray) -> np.ndarray:
        depth = 1e6 * float(depth_of_compression(float(share.sum()), highest, factors))
        if seen.layers is None:
            return np.array([depth])
        stress = 1e-6 * (share @ seen.layers.stress)
        return np.array([depth, stress[0], *lowest(1e6 * seen.layers.depth, stress)[::-1]])

    names = (DEPTH,) if seen.layers is None else (DEPTH, *OF_STRESS)
    whole = figures(seen.share(peening_time))
    if count < MIN_BATCHES or seen.found.highest == 0.0:
        found = {
            name: Estimate(float(x), math.inf, (float(x),) * count)
            for name, x in zip(names, whole, strict=True)
        }
        return found
    rests = [figures(share) for share in seen.share_without(peening_time)]
    # Windows with few dents lack the widest dents. Half of the dents make the lack twice as large.
    half = count // 2
    halves = [figures(seen.share(peening_time, one))
              for one in (slice(half), slice(half, 2 * half))]  # fmt: skip
    steps = whole - np.mean(halves, axis=0)
    values = np.array([whole, *rests])
    return {
        name: estimate(
            value + step + jackknife(column) - value, 0.0 if name == DEPTH else -math.inf,
            bias=abs(step),
        )
        for name, value, step, column in zip(
            names, whole.tolist(), steps.tolist(), values.T, strict=True
        )
    }  # fmt: skip


def lowest(depth: np.ndarray, stress: np.ndarray) -> tuple[float, float]:
    """Return the depth of the smallest stress, and this stress, by a parabola through 3 points."""
    at = int(stress.argmin())
    if not 0 < at < len(stress) - 1:
        return float(depth[at]), float(stress[at])
    before, here, after = stress[at - 1 : at + 2]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(depth[at] + shift * (depth[1] - depth[0])), float(
        here - 0.25 * (before - after) * shift
    )


def surface_profile(seen: LayerHistograms, peening_time: float) -> SurfaceProfile | None:
    """Return the mean profile of a surface; None without a model, or where nothing was dented."""
    if seen.layers is None:
        return None
    count = len(seen.found.parts)
    share = seen.share(peening_time)
    stress = 1e-6 * (share @ seen.layers.stress)
    half_width = np.full(len(stress), math.inf)
    if count >= MIN_BATCHES:
        rests = np.array([one @ seen.layers.stress for one in seen.share_without(peening_time)])
        columns = np.vstack([stress, 1e-6 * rests]).T
        half_width = np.array([estimate(jackknife(one)).half_width for one in columns])
    return SurfaceProfile(
        1e6 * seen.layers.depth, stress, half_width, share @ seen.layers.eigenstrain
    )


def band_of_profile(
    depth: np.ndarray, stress: np.ndarray, bands: Mapping[str, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and the highest stress at each depth by the bands of the law, (n,) each.

    The law may be wrong by a factor on all depths, and by one on the stress that goes from that of
    the surface to that of the largest stress. The ends are those of the four corners, at the
    nearest depths that they have.

    Args:
        depth: from 0 on, (n,), in any unit, as the stress (n,).
        bands: the factors by the name of their figure.
    """
    at = float(depth[stress.argmin()])
    inside = np.minimum(depth / at, 1.0) if at > 0.0 else np.ones(len(depth))
    size = bands[SURFACE] + (bands[PEAK] - bands[SURFACE]) * inside
    wider = (bands[DEPTH], 1.0 / bands[DEPTH], 1.0)
    moved = [np.interp(depth / one, depth, stress) for one in wider]
    corners = np.array([x * one for one in moved for x in (size, 1.0 / size)])
    return corners.min(axis=0), corners.max(axis=0)


def why_not_known(
    found: dict[str, Estimate], reachable: float, widest: float, model: StressModel
) -> str:
    """Return why the stress of a surface is not told, in a few words; "" if it is told.

    Args:
        found: metrics of the surface, with mean_coverage and the depth of compression.
        reachable: share of the surface that a ball can touch, of which the stress is.
        widest: diameter of the widest dent [m].
    """
    if found["mean_coverage"].value < FULL_COVERAGE * reachable:
        return f"coverage below {100.0 * FULL_COVERAGE:g} %"
    if widest > WIDEST_DENT * max(model.balls):
        return "dents too wide for the law"
    if model.plate and 1e6 * model.plate.thickness < THINNEST * found[DEPTH].value:
        return "plate too thin for the law"
    return ""


def stress_estimates(
    field: TargetField,
    batches: Sequence[Sequence[Hits]],
    design: Design,
    found: dict[str, Estimate],
) -> dict[str, Estimate]:
    """Return the estimates of the compressed layer of a design, by name.

    They are empty for a metal that hardens strongly.

    Args:
        found: metrics of the surface that are known already, with mean_coverage.
    """
    if design.materials.part.hardens_strongly:
        return {}
    model, process = stress_model(design), design.process
    seen = layer_histograms(field, batches, process.recorded_time, model)
    layer = layer_estimates(seen, process.treatment_time, law_factors(design))
    if model is None:
        return layer
    if seen.layers is None:
        nothing = Estimate(0.0, math.inf, (0.0,) * len(batches))
        layer |= dict.fromkeys(OF_STRESS, nothing)
    if why := why_not_known(found | layer, field.reach.share, seen.found.highest, model):
        layer |= {name: layer[name].not_known(why) for name in OF_STRESS}
    return layer


def stress_notes(design: Design) -> tuple[str, ...]:
    """Return notes on the stress under the surface: how well its law is known, its likely peak, and
    a warning if the depth of compression cannot be estimated for this metal.
    """
    notes, metal = [], design.materials.part
    if bands := stress_bands(design):
        known = ", ".join(f"{name} by a factor of {band:.3g}" for name, band in bands.items())
        notes.append(
            f"beyond its interval, the law may be wrong in {known}, more or less, in all designs "
            "with this metal and shot alike: their ratios are better known"
        )
    if metal.tensile_MPa is not None and design.stress is None:
        low, high = (share * metal.tensile_MPa for share in PEAK_STRESS)
        notes.append(
            f"the largest compressive stress is usually {PEAK_STRESS[0]:g} to {PEAK_STRESS[1]:g} "
            f"of the tensile strength, {low:.0f} to {high:.0f} MPa, almost whatever the intensity"
        )
    if metal.hardens_strongly:
        notes.append(
            "materials.part: tensile_MPa and yield_MPa are those of a metal that hardens strongly, "
            "whose depth of compression cannot be estimated from the size of its dents"
        )
    return tuple(notes)
