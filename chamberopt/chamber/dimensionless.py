"""Dimensionless groups that say how much an effect can matter, before anything is simulated.

V = 2 pi f A is the sonotrode's peak speed, the scale of the shot's; H the chamber's height.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design

STANDARD_GRAVITY = 9.80665  # m/s², CGPM 1901
MAX_SPIN_SHARE = (
    2.0 / 7.0
)  # of a solid sphere's tangential velocity, by an impact that sticks (Walton's formula)


def gravity_speed_change(design: Design, chamber: Chamber) -> float:
    """g H / V²: by what share speed changes over the chamber's height, half the change of kinetic energy."""
    return STANDARD_GRAVITY * chamber.height / design.sonotrode.peak_speed**2


def free_path(design: Design, chamber: Chamber) -> float:
    """Mean free path between balls over the chamber's height.

    1 / (sqrt(2) pi d² n chi), with chi = (1 - p/2)/(1 - p)³ for packing p (Chapman and Cowling, "The Mathematical
    Theory of Non-uniform Gases", chapter 16; chi: Carnahan and Starling, J. Chem. Phys. 51 (1969) 635). Infinite for
    one ball.
    """
    count, diameter = design.shot.count, design.shot.diameter
    if count < 2:
        return math.inf
    packing = min(0.6, count * math.pi / 6.0 * diameter**3 / chamber.volume)
    crowding = (1.0 - 0.5 * packing) / (1.0 - packing) ** 3
    number = count / chamber.volume
    return 1.0 / (math.sqrt(2.0) * math.pi * diameter**2 * number * crowding) / chamber.height


def drag_loss(design: Design, chamber: Chamber) -> float:
    """3/4 Cd (rho_air / rho) (H / d): the share of its speed a ball loses to the air on its way up the chamber."""
    from sim_core import Drag, drag_coefficient

    air, shot = Drag(), design.shot
    reynolds = air.density * design.sonotrode.peak_speed * shot.diameter / air.viscosity
    slowing = (
        0.75 * drag_coefficient(reynolds) * air.density / (shot.density * shot.diameter)
    )  # 1/m
    return slowing * chamber.height
