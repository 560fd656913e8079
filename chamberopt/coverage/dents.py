"""What a single impact leaves on the part: the size of its dent and the angle at which it came."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.geometry.triangles import closest_points, unit_normals

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import ImpactLog


@dataclass(frozen=True)
class Dents:
    """Dents in order of time: place of the contact, normal of the triangle that was hit (k, 3) m · radius (k,) m ·
    time (k,) s. Places are in the part's own frame.
    """

    place: np.ndarray
    normal: np.ndarray
    radius: np.ndarray
    time: np.ndarray

    def __len__(self) -> int:
        return len(self.time)


def dent_diameter(
    normal_speed: np.ndarray,
    diameter: float | np.ndarray,
    density: float,
    hardness: float,
    c0: float,
    v0: float,
) -> np.ndarray:
    """Diameter [m] of the dent a ball leaves; 0 where the normal speed is not above the yield speed v0.

    d = 1.278 D (1 - e²)^¼ (rho v² / B)^¼, Kirk's energy balance (D. Kirk, "Prediction and control of indent
    diameter", The Shot Peener, 2004): the energy lost at normal speed v [m/s] makes a spherical cap in a
    material of Brinell hardness B [Pa]. D [m], rho [kg/m³] of the ball; e the restitution at that very speed.
    """
    from sim_core import restitution_at

    speed = np.asarray(normal_speed, dtype=float)
    # Below v0 the contact is elastic (the paper): what C0 < 1 loses there goes into waves, not into a dent.
    dents = speed > v0
    e = np.where(dents, restitution_at(speed, c0, v0), 1.0)
    return (
        1.278
        * diameter
        * (np.maximum(1.0 - e * e, 0.0) * density * speed * speed / hardness) ** 0.25
    )


def ball_diameters(impacts: ImpactLog, design: Design) -> float | np.ndarray:
    """Diameter [m] of the ball of each impact, (n,); one number where all are alike."""
    shot = design.shot
    return shot.diameter if shot.mix is None else np.array(shot.diameters)[impacts.ball]


def dent_diameters(impacts: ImpactLog, design: Design) -> np.ndarray:
    """Diameter [m] of the dent each impact would leave on the part, (n,), each ball with its own size."""
    material, ball = design.materials.part, ball_diameters(impacts, design)
    return dent_diameter(
        impacts.normal_speed,
        ball,
        design.shot.density,
        material.hardness,
        material.restitution,
        material.yield_speed,
    )


def impact_angle_deg(velocity: np.ndarray, normal_speed: np.ndarray) -> np.ndarray:
    """Angle [degrees] between the incoming ball's path and the surface: 90 is head on, 0 grazing."""
    speed = np.linalg.norm(velocity, axis=1)
    ratio = np.divide(normal_speed, speed, out=np.ones_like(speed), where=speed > 0)
    return np.degrees(np.arcsin(np.clip(ratio, 0.0, 1.0)))


def dents_on_part(impacts: ImpactLog, chamber: Chamber, design: Design) -> Dents:
    """The dents that impacts leave on the part; impacts below its yield speed leave none."""
    diameter = dent_diameters(impacts, design)
    dents = np.flatnonzero((diameter > 0.0) & (chamber.source[impacts.triangle] >= 0))
    corners = chamber.vertices[chamber.triangles[impacts.triangle[dents]]]
    place = closest_points(corners, impacts.position[dents])
    return Dents(place, unit_normals(corners), 0.5 * diameter[dents], impacts.time[dents])
