"""The speed from which a ball dents what it hits, by Johnson's formula.

Notation
    E*   1 / ((1 - nu1²) / E1 + (1 - nu2²) / E2) [Pa], of ball and surface
    Y    yield stress of the softer of the two, 9.81e6 HB / 2.8 [Pa]
    rho  density of the ball [kg/m³]
    v_Y  speed at which yielding starts; v_Y² = 26 (Y / E*)^4 Y / rho
    v0   speed from which e = C0 (v / v0)^(-1/4) holds, v_Y (1.18 / C0)^4

Two equal balls have half the radius and half the mass of one on a surface: half its v_Y.

Source: K. L. Johnson, "Contact Mechanics", Cambridge 1985, section 11.5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

BRINELL_TO_PASCAL = 9.81e6  # HB is kgf/mm²


@dataclass(frozen=True)
class Elastic:
    """Young's modulus [Pa] and Poisson's ratio."""

    modulus: float
    poisson: float

    @property
    def compliance(self) -> float:
        """(1 - nu²) / E [1/Pa]."""
        return (1.0 - self.poisson**2) / self.modulus


def yield_speed(
    ball: Elastic, surface: Elastic, density: float, hardness: float, c0: float
) -> float:
    """v0 [m/s] of a ball on a surface, see above.

    Args:
        density: of the ball [kg/m³].
        hardness: of the softer of the two [Pa].
        c0: restitution below v0.
    """
    stress = hardness / 2.8
    ratio = stress * (ball.compliance + surface.compliance)
    return math.sqrt(26.0 * ratio**4 * stress / density) * (1.18 / c0) ** 4
