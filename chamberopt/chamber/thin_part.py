"""Find where a part is so thin that its flexure takes energy from the balls, and say so.

The thickness is measured once for each mesh of a part and size of balls. Flexure is simulated where
a design asks for it or, if it does not say, where it lowers the restitution by more than LOSS on
more than SHARE of the target or of a zone. The theory is in sim_core/effects/flexure.py.

Notation:
    h: local thickness [m]
    l: length of the waves of a hit [m], (D / rho h)^(1/4) T^(1/2) = (c h T)^(1/2)
    c: (E / (12 rho (1 - nu²)))^(1/2) of the part [m/s]
    T: duration of the contact by Hertz [s]
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.design.flexure import REMEDY, PlateMetals, plate_metals
from chamberopt.geometry.thickness import (
    Samples,
    border_distance,
    measure_depth,
    only_plates,
    thickness_of_triangles,
)

if TYPE_CHECKING:
    from chamberopt.design.design import Design
    from chamberopt.geometry.meshes.part_mesh import PartMesh

LOSS = 0.02  # of the restitution; C0 of a metal is known no better
SHARE = 0.01  # of the area of the target or a zone
REACH = 5.0  # thickest plate that is measured, in diameters of the largest ball
# Lengths l between a hit and an edge, below which waves that come back change e by more than 0.05
# to 0.1 (docs/explanation/effects.md).
NEAR_EDGE = 1.5
UNKNOWN = 1.0  # ball diameters; below, plates of any metal lower e by 5 % and more
HERTZ = 3.218  # duration of the contact in units of (m / k)^(2/5) v^(-1/5)


@dataclass(frozen=True)
class ThinTarget:
    """How thin a target is, and what that does to the balls, as shares of its area.

    restitution: Zener's e in the middle (median) of the area, at the sonotrode's peak speed.
    lowered: share on which flexure lowers the restitution by more than LOSS.
    near_edge: share of that which lies nearer to an edge than the theory allows for.
    """

    thinnest: float  # [m]; a hundredth of the area is thinner
    median: float  # [m]; inf if half of the area is no plate or thick
    restitution: float
    lowered: float
    near_edge: float


@lru_cache(maxsize=4)
def _depths(mesh: PartMesh, ball: float) -> Samples:
    """Return points over a part with the depth of material under each, for this diameter [m]."""
    return measure_depth(mesh.vertices, mesh.triangles, ball, REACH * ball)


@lru_cache(maxsize=4)
def _plates(mesh: PartMesh, ball: float) -> tuple[Samples, np.ndarray]:
    """Return the points of _depths that are of plates, and the thickness of the triangles [m].

    The thickness has the shape (m,), float32.
    """
    samples = only_plates(_depths(mesh, ball))
    thickness = thickness_of_triangles(samples, mesh.vertices, mesh.triangles, ball)
    return samples, thickness.astype(np.float32)


def thickness_to_simulate(
    design: Design, mesh: PartMesh, chosen: Mapping[str, np.ndarray]
) -> tuple[np.ndarray | None, list[str]]:
    """Return the thickness of each triangle of a part [m], (m,) float32, and notes on its flexure.

    The thickness is None where no flexure is to be simulated.

    Args:
        mesh: the part, closed, in its file's frame.
        chosen: the triangles (m,) of the target and of each zone, by their names for messages. The
            target is the first.
    """
    given, metals = design.effects.flexure, plate_metals(design)
    if given is not None and not given.on:
        return None, []
    ball = design.shot.diameter
    if given is None and not _may_be_thin(design, metals, mesh, chosen):
        return None, []
    samples, thickness = _plates(mesh, ball)
    if not np.isfinite(thickness).any():
        return None, [_thick_note()] if given is not None else []
    name, target = next(iter(chosen.items()))
    if metals is None:
        on = target[samples.triangle]
        share = float((samples.thickness[on] < UNKNOWN * ball).mean()) if on.any() else 0.0
        return None, [_unknown_note(name, share)] if share > SHARE else []
    found = {one: thin_target(design, samples, rows) for one, rows in chosen.items()}
    if given is None and max(one.lowered for one in found.values()) <= SHARE:
        return None, []
    return thickness, [_note(design, one, thin) for one, thin in found.items() if thin.lowered]


def _may_be_thin(
    design: Design, metals: PlateMetals | None, mesh: PartMesh, chosen: Mapping[str, np.ndarray]
) -> bool:
    """Return False for a part that is thick all over, which spares the search for plates."""
    samples = _depths(mesh, design.shot.diameter)
    thin = samples.thickness < UNKNOWN * design.shot.diameter
    if metals is not None:
        thin = zener_factor(design, metals, samples.thickness) < 1.0 - LOSS
    shares = [thin[rows[samples.triangle]] for rows in chosen.values()]
    return any(bool(len(one)) and float(one.mean()) > SHARE for one in shares)


def thin_target(design: Design, samples: Samples, chosen: np.ndarray) -> ThinTarget:
    """Return how thin the chosen triangles (m,) are. The metals of the design must be known."""
    metals = plate_metals(design)
    assert metals is not None
    rows = np.flatnonzero(chosen[samples.triangle])
    if not len(rows):
        return ThinTarget(math.inf, math.inf, 1.0, 0.0, 0.0)
    thickness = samples.thickness[rows]
    e = zener_factor(design, metals, thickness)
    thin = e < 1.0 - LOSS
    far = np.where(thin, NEAR_EDGE * wave_length(design, metals, thickness), np.inf)
    radius = np.full(len(samples.place), np.inf)
    radius[rows] = far
    near = np.isfinite(border_distance(samples, radius)[rows])
    return ThinTarget(
        thinnest=float(np.sort(thickness)[int(0.01 * len(thickness))]),
        median=float(np.sort(thickness)[len(thickness) // 2]),
        restitution=float(np.sort(e)[len(e) // 2]),
        lowered=float(thin.mean()),
        near_edge=float(near.sum() / max(thin.sum(), 1)),
    )


def _ball(design: Design) -> tuple[float, float]:
    """Return radius [m] and mass [kg] of the largest ball."""
    radius = 0.5 * design.shot.diameter
    return radius, 4.0 / 3.0 * math.pi * radius**3 * design.shot.density


def zener_factor(design: Design, metals: PlateMetals, thickness: np.ndarray) -> np.ndarray:
    """Return Zener's restitution of the largest ball at the peak speed of the sonotrode's face,
    (k,), its rms over the face.

    Args:
        thickness: of the part [m], (k,); inf where it is rigid.
    """
    from sim_core import zener_parameter, zener_restitution

    radius, mass = _ball(design)
    parameter = zener_parameter(
        mobility(metals, thickness),
        metals.contact_modulus,
        radius,
        mass,
        design.sonotrode.rms_peak_speed,
    )
    return zener_restitution(parameter)


def wave_length(design: Design, metals: PlateMetals, thickness: np.ndarray) -> np.ndarray:
    """Return the length l of the notation above [m] at the sonotrode's peak speed, (k,)."""
    radius, mass = _ball(design)
    stiffness = 4.0 / 3.0 * metals.contact_modulus * math.sqrt(radius)
    contact = HERTZ * (mass / stiffness) ** 0.4 * design.sonotrode.rms_peak_speed**-0.2
    speed = math.sqrt(1.0 / (12.0 * metals.density * metals.part.compliance))
    return np.asarray(np.sqrt(speed * thickness * contact))


def mobility(metals: PlateMetals, thickness: np.ndarray) -> np.ndarray:
    """Return the mobility of plates [s/kg], (k,), for their thickness [m]; 0 where it is inf."""
    from sim_core import plate_mobility

    modulus = 1.0 / metals.part.compliance
    return np.asarray(plate_mobility(thickness.astype(np.float64), modulus, metals.density))


def _note(design: Design, name: str, thin: ThinTarget) -> str:
    median = f"median {1e3 * thin.median:.2g} mm"
    if not math.isfinite(thin.median):
        median = "half of it thick, or no plate"
    return (
        f"{name} gives way under the balls (thinnest {1e3 * thin.thinnest:.2g} mm, {median}): "
        f"flexure lowers the restitution to {thin.restitution:.2f} times at the median, at "
        f"{design.sonotrode.rms_peak_speed:.2g} m/s, and by more than {LOSS:.0%} on "
        f"{thin.lowered:.0%} of it (Zener 1941); "
        f"{thin.near_edge:.0%} of that is so near to an edge that the theory is rough there; "
        "dents are narrower by an estimate (docs/explanation/effects.md); "
        "effects.flexure = false leaves it out"
    )


def _unknown_note(name: str, share: float) -> str:
    return (
        f"{share:.0%} of {name} is thinner than a ball, and balls lose energy to its flexure, "
        f"which is left out because the metal is not known: {REMEDY}"
    )


def _thick_note() -> str:
    return "effects.flexure is given, but the part is no thin plate anywhere: nothing is left out"
