"""Dimensionless numbers that estimate how much an effect matters, before anything is simulated.

V   peak speed of the sonotrode, 2 pi f A [m/s], the scale of the shot's speed; its rms over a face
    that bends
H   height of the chamber [m]
d   ball diameter [m]
g   standard gravity [m/s²]
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design

STANDARD_GRAVITY = 9.80665  # m/s², CGPM 1901
# Largest share of a solid sphere's tangential velocity that an impact turns into spin. It is the
# share of an impact that sticks, by Walton's formula.
MAX_SPIN_SHARE = 2.0 / 7.0


def gravity_speed_change(design: Design, chamber: Chamber) -> float:
    """Return the share by which gravity changes a ball's speed over the chamber's height.

    It is g H / V² for gravity g, height H and peak speed V of the sonotrode.
    """
    return STANDARD_GRAVITY * chamber.height / design.sonotrode.rms_peak_speed**2


def free_path(design: Design, chamber: Chamber) -> float:
    """Return the mean path of a ball from ball to ball, in chamber heights; infinite for one ball.

    The path is 1 / (sqrt(2) pi d² n chi) for n balls per volume, with chi = (1 - p/2)/(1 - p)³ for
    the packing fraction p.

    Source: Chapman and Cowling, "The Mathematical Theory of Non-uniform Gases", chapter 16;
    chi: Carnahan and Starling, J. Chem. Phys. 51 (1969) 635.
    """
    count, diameter = design.shot.count, design.shot.diameter
    if count < 2:
        return math.inf
    packing = min(0.6, count * math.pi / 6.0 * diameter**3 / chamber.volume)
    chi = (1.0 - 0.5 * packing) / (1.0 - packing) ** 3
    number_density = count / chamber.volume
    return 1.0 / (math.sqrt(2.0) * math.pi * diameter**2 * number_density * chi) / chamber.height


def drag_loss(design: Design, chamber: Chamber) -> float:
    """Return the share of its speed that a ball loses by air drag over the chamber's height.

    It is 3/4 Cd (rho_air / rho) (H / d) for height H and ball diameter d. Cd is the drag
    coefficient at the sonotrode's peak speed. rho_air and rho are the densities of air and ball.
    """
    from sim_core import Drag, drag_coefficient

    air, shot = Drag(), design.shot
    reynolds = air.density * design.sonotrode.rms_peak_speed * shot.diameter / air.viscosity
    loss_per_metre = (
        0.75 * drag_coefficient(reynolds) * air.density / (shot.density * shot.diameter)
    )
    return loss_per_metre * chamber.height


def drag_change(design: Design, chamber: Chamber) -> float:
    """Return about how much air drag changes the shot's steady speed, as a share of it.

    Each flight loses drag_loss of the speed, and each hit 1 - e. The shot's speed is steady where
    the sonotrode makes up for both, so that a small further loss lowers it by drag_loss / (1 - e).
    e is that of the most elastic surface at the sonotrode's peak speed. It is infinite for e = 1.
    """
    from sim_core import restitution_at

    materials, speed = design.materials, np.array([design.sonotrode.rms_peak_speed])
    laws = [one.restitution for one in (materials.part, materials.sonotrode, materials.wall)]
    lost = 1.0 - max(float(restitution_at(speed, law)[0]) for law in laws)
    return drag_loss(design, chamber) / lost if lost > 0.0 else math.inf
