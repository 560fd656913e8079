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

Intervals hold the scatter of the replicas, and not what is not known of the law
(stress_knowledge.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.estimate import Estimate, estimate, jackknife
from chamberopt.coverage.strength import LEVELS, area_of_dent, ball_diameter, dent_rates, levels
from chamberopt.coverage.strength_intervals import MIN_BATCHES, StrengthHistograms, level_histograms
from chamberopt.coverage.stress_knowledge import DEPTH, OF_STRESS, why_not_known
from chamberopt.coverage.stress_law import (
    AS_IS,
    OF_DENT,
    LawFactors,
    eigenstrain_under_dents,
    residual_stress,
)
from chamberopt.coverage.stress_model import law_factors, stress_model

if TYPE_CHECKING:
    from chamberopt.coverage.field.target_field import TargetField
    from chamberopt.coverage.part_impacts import Hits
    from chamberopt.coverage.stress_model import StressModel
    from chamberopt.design.load import Design

POINTS = 129  # depths of a profile
EVERY = slice(None)


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
