"""The size of the dent that a single impact leaves, and the angle at which the ball comes.

Notation
    d   dent diameter [m]                               (dent_diameter)
    D   ball diameter [m]                               (diameter)
    rho density of the ball [kg/m³]                     (density)
    v   normal speed of the impact [m/s]                (normal_speed)
    B   Brinell hardness of the part [Pa]               (hardness)
    e   coefficient of restitution of ball on part at this speed
    v0  yield speed of the part [m/s]                   (yield_speed)
    Y   mobility of the part where it is thin [s/kg]    (mobility)
    F   largest force of the impact on a thick part [N]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.flexure import mobility_of_part
from chamberopt.geometry.triangles import unit_normals

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.design.materials import PartMaterial
    from sim_core import ImpactLog


@dataclass(frozen=True)
class Dents:
    """Dents on the part in order of time. Positions are in the part's own frame."""

    place: np.ndarray  # contact points [m], (k, 3)
    normal: np.ndarray  # unit normals of the triangles that were hit, (k, 3)
    radius: np.ndarray  # radii of the dents [m], (k,)
    time: np.ndarray  # times of the impacts [s], (k,)

    def __len__(self) -> int:
        return len(self.time)


def dents_on_part(impacts: ImpactLog, chamber: Chamber, design: Design) -> Dents:
    """Return the dents that impacts leave on the part; none for impacts below the yield speed."""
    from sim_core import closest_on_each

    diameter = dent_diameters(impacts, chamber, design)
    dents = np.flatnonzero((diameter > 0.0) & (chamber.source[impacts.triangle] >= 0))
    corners = chamber.vertices[chamber.triangles[impacts.triangle[dents]]]
    place = closest_on_each(corners, impacts.position[dents])
    return Dents(place, unit_normals(corners), 0.5 * diameter[dents], impacts.time[dents])


def dent_diameter(
    normal_speed: np.ndarray, diameter: float | np.ndarray, density: float, material: PartMaterial
) -> np.ndarray:
    """Return the diameter of the dent that a ball leaves: d = 1.278 D (1 - e²)^¼ (rho v² / B)^¼.

    The energy that the impact loses makes a spherical cap in the material.

    Args:
        normal_speed: v, speed of the impact along the normal [m/s], (n,).
        diameter: D, diameter of the ball [m], (n,) or one for all.
        density: rho, density of the balls [kg/m³].
        material: material of the part, with restitution e(v), yield speed v0 and hardness B.
    Returns:
        Diameter [m], (n,); 0 where the normal speed is not above the yield speed v0.

    Source: D. Kirk, "Prediction and control of indent diameter", The Shot Peener, 2004.
    """
    from sim_core import restitution_at

    speed = np.asarray(normal_speed, dtype=float)
    hardness = material.hardness
    # Below v0 the contact is elastic (Kirk). An energy loss by e < 1 goes into waves there, not
    # into a dent, whichever law gives e.
    dents = speed > material.yield_speed
    e = np.where(dents, restitution_at(speed, material.restitution), 1.0)
    loss = np.maximum(1.0 - e * e, 0.0) * density * speed * speed / hardness
    dent: np.ndarray = 1.278 * diameter * loss**0.25
    return dent


def ball_diameters(impacts: ImpactLog, design: Design) -> float | np.ndarray:
    """Return the diameter [m] of the ball of each impact, (n,), or one number if all balls are
    alike.
    """
    shot = design.shot
    return shot.diameter if shot.mix is None else np.array(shot.diameters)[impacts.ball]


def dent_diameters(impacts: ImpactLog, chamber: Chamber, design: Design) -> np.ndarray:
    """Return the diameter [m] of the dent that each impact would leave on the part, (n,)."""
    diameters, density = ball_diameters(impacts, design), design.shot.density
    material, speed = design.simulated.materials.part, np.asarray(impacts.normal_speed)
    dents = dent_diameter(speed, diameters, density, material)
    of_part = mobility_of_part(design, chamber.part)
    if of_part is None:
        return dents
    # a source of -1, off the part, reads the appended 0
    mobility = np.append(of_part, 0.0)[chamber.source[impacts.triangle]]
    factor = thin_part_factor(dents, speed, mobility, material.hardness)
    return np.asarray(dents * factor)


def thin_part_factor(
    diameter: np.ndarray, normal_speed: np.ndarray, mobility: np.ndarray, hardness: float
) -> np.ndarray:
    """Return the diameter of dents on a thin part over that on a thick one, (n,).

    A contact whose force F = K s grows linearly with the approach s, as that of a dent does, makes
    a damped oscillation of Zener's equation, m s'' = -F - m Y F'. The largest s, and with it the
    largest force, is exp(-zeta arccos(zeta) / sqrt(1 - zeta²)) of that on a thick part, for

        zeta = Y (m K)^(1/2) / 2 = Y F / (2 v),    F = B pi d² / 4 = v (m K)^(1/2)

    The square of the diameter goes with the force. The factor is 1 where the part is rigid.

    Args:
        diameter: d, of the dents on a thick part [m], (n,).
        normal_speed: v [m/s], (n,).
        mobility: Y, of the part at each dent [s/kg], (n,); 0 where it is rigid.
        hardness: B, of the part [Pa].

    Source: C. Zener, Phys. Rev. 59 (1941) 669, with this force; docs/explanation/effects.md says
    how exact.
    """
    force = 0.25 * np.pi * hardness * diameter**2
    zeta = np.divide(0.5 * mobility * force, normal_speed, out=0.0 * force, where=force > 0.0)
    angle = np.where(
        zeta < 1.0, np.arccos(np.minimum(zeta, 1.0)), np.arccosh(np.maximum(zeta, 1.0))
    )
    root = np.sqrt(np.abs(1.0 - zeta**2))
    ratio = np.divide(angle, root, out=np.ones_like(root), where=root > 0.0)
    return np.asarray(np.exp(-0.5 * zeta * ratio))


def impact_angle_deg(velocity: np.ndarray, normal_speed: np.ndarray) -> np.ndarray:
    """Return the angle between the path of the incoming ball and the surface.

    An angle of 90 is head on, 0 is grazing.

    >>> impact_angle_deg(np.array([[1.0, 0.0, -1.0]]), np.array([1.0]))
    array([45.])

    Args:
        velocity: velocity of the ball relative to the surface [m/s], (n, 3).
        normal_speed: its component along the normal [m/s], (n,).

    Returns:
        Angle [degrees], (n,).
    """
    speed = np.linalg.norm(velocity, axis=1)
    ratio = np.divide(normal_speed, speed, out=np.ones_like(speed), where=speed > 0)
    angle: np.ndarray = np.degrees(np.arcsin(np.clip(ratio, 0.0, 1.0)))
    return angle
