"""How well residual stress is known: bands of its law, what it does not tell, and notes on it.

The interval of a figure holds the scatter of the replicas. The band is a factor on the figure by
which the law may be wrong, the same for all designs of one metal and shot, so that the ratios of
such designs are free of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.estimate import CONFIDENCE, Estimate, normal_quantile
from chamberopt.coverage.metrics import FULL_COVERAGE, named
from chamberopt.coverage.stress_law import OF_DENT, PeenedMetal, arc_height, eigenstrain_under_dents
from chamberopt.coverage.stress_model import StressModel, measured_law
from chamberopt.design.almen_strip import STRIP_STEEL, STRIP_TENSILE, STRIP_YIELD, STRIPS
from chamberopt.design.calibration import calibrated_strip
from chamberopt.design.flexure import plate_metals
from chamberopt.geometry.triangles import border_edges, sharp_sides, sides_of

if TYPE_CHECKING:
    from chamberopt.chamber.part import Part
    from chamberopt.design.load import Design

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
AT_SATURATION = 0.9  # share of the strength and arc of equal dents that a saturated strip has
ARC_AGREES = 0.6, 1.6  # arc height by the law over the calibrated intensity, as far as it is usual
THINNEST = 3.0  # thickness of a plate over the depth of compression
POINTS = 129  # depths in a strip
EDGE = 2.0  # distance from a sharp edge over the depth of compression, below which nothing is told
FEW = 0.005  # share of a surface that is worth no note


def stress_bands(design: Design) -> dict[str, float]:
    """Return the factor by which the law may be wrong in each figure of the compressed layer."""
    if design.materials.part.hardens_strongly:
        return {}
    known, measured = dict(BANDS), measured_law(design)
    if measured is not None:
        for name, row, k in zip(OF_LAW, measured.log_covariance, range(len(OF_LAW)), strict=True):
            sd = math.hypot(math.sqrt(row[k]), CARRIED)
            known[name] = math.exp(normal_quantile(CONFIDENCE) * sd)
    return known if design.stress else {DEPTH: known[DEPTH]}


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


def arc_by_law(design: Design, strength: float) -> float:
    """Return the arc height [m] of a whole A strip by the law, for equal dents of the largest ball.

    Args:
        strength: peening strength S [m], 0.9 d² / D of equal dents.
    """
    metals, shot = plate_metals(design), design.shot
    assert metals is not None
    contact = 1.0 / (metals.shot.compliance + STRIP_STEEL.compliance)
    metal = PeenedMetal(STRIP_STEEL, STRIP_YIELD, STRIP_TENSILE, contact)
    strip, ball = calibrated_strip(shot, design.calibration), shot.diameter
    dent = np.array([math.sqrt(strength * ball / AT_SATURATION)])
    speed = StressModel(metal, strip, (ball,), shot.density).speeds(dent, ball)
    depth = np.linspace(0.0, OF_DENT * float(dent[0]), POINTS)
    strain = eigenstrain_under_dents(depth, dent, speed, (ball, shot.density), metal)
    return AT_SATURATION * arc_height(depth, strain[0], STRIPS["A"].thickness)


def _arc_note(design: Design, strength: Estimate) -> tuple[str, ...]:
    """Return a note if the law bends a strip by far more or less than the machine's strips did."""
    machine = design.calibration
    has_strips = machine is not None and machine.has_strips and not machine.not_mmA
    if not (design.stress and has_strips and strength.value > 0.0):
        return ()
    assert machine is not None
    intensity, arc = machine.intensity_mmA(strength.value), arc_by_law(design, strength.value / 1e6)
    if ARC_AGREES[0] < 1e3 * arc / intensity < ARC_AGREES[1]:
        return ()
    return (
        f"the law of residual stress bends an A strip by {1e3 * arc:.2g} mm, and the calibration "
        f"has {intensity:.2g}: they disagree, so trust the stress less, or measure a [[profile]]",
    )


def edge_notes(design: Design, part: Part, found: Mapping[str, Estimate]) -> tuple[str, ...]:
    """Return a note on the share of target and zones that is near a sharp edge of the part.

    It is that of strips along the edges, which overlap at corners, so that it is a little large.

    Args:
        found: figures of the target and of zones.
    """
    if design.stress is None or len(border_edges(part.triangles)):
        return ()
    sides = sharp_sides(part.vertices, part.triangles).ravel()
    ends = part.vertices[sides_of(part.triangles)[sides]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    shares = []
    for name, inside in {"": part.target, **part.zones}.items():
        depth = 1e-6 * found[f"{name}.{DEPTH}" if name else DEPTH].value
        share = EDGE * depth * float(length[inside[sides // 3]].sum() / part.area[inside].sum())
        if share > FEW:
            of = f"zone {name}" if name else "the target"
            shares.append(f"{100.0 * min(share, 1.0):.2g} % of {of}")
    if not shares:
        return ()
    return (
        f"{' and '.join(shares)} are within {EDGE:g} depths of compression of a sharp edge, where "
        "the residual stress is another: it is told for a flat surface",
    )


def stress_notes(design: Design, metrics: Mapping[str, Estimate]) -> tuple[str, ...]:
    """Return notes on the stress under the surface: how well its law is known, its likely peak, and
    a warning if the depth of compression cannot be estimated for this metal.

    Args:
        metrics: of the target. Only figures of which a number is told are named.
    """
    notes, metal = [*_arc_note(design, metrics["strength_um"])], design.materials.part
    told = {name: band for name, band in stress_bands(design).items()
            if name in metrics and not metrics[name].in_words}  # fmt: skip
    if told:
        parts = (f"the {named(name)} by a factor of {band:.3g}" for name, band in told.items())
        known = ", ".join(parts)
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
