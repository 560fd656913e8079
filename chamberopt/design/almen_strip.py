"""Almen strips: sizes, material, and the speed at which a ball starts to dent a strip."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from chamberopt.design.materials import BRINELL_TO_PASCAL, PartMaterial, ball
from chamberopt.design.materials.catalogue import Elastic, yield_speed

if TYPE_CHECKING:
    from chamberopt.design.shot import ShotTable

StripType = Literal["N", "A", "C"]
STRIP_C0 = 0.91
STRIP_HB = 450.0  # SAE 1070 spring steel of 44 to 50 HRC (SAE J442)


@dataclass(frozen=True)
class AlmenStrip:
    """Dimensions [m] of an Almen strip. Its type, N, A or C, sets the thickness (SAE J442)."""

    type: StripType
    thickness: float
    length: float = 76.2e-3
    width: float = 19.0e-3


STRIPS = {
    one.type: one
    for one in (AlmenStrip("N", 0.79e-3), AlmenStrip("A", 1.29e-3), AlmenStrip("C", 2.39e-3))
}
# Arc height over the arc height of an A strip, and the range [mm on an A strip] of each type:
# "approximate", AMS-S-13165 6.10. The bending by the same layer goes with 1 / thickness².
OVER_A: dict[StripType, float] = {"N": 3.0, "A": 1.0, "C": 1.0 / 3.5}
USED_FOR: dict[StripType, tuple[float, float]] = {
    "N": (0.0, 0.1016), "A": (0.1016, 0.6096), "C": (0.6096, math.inf),
}  # fmt: skip
STRIP_STEEL = Elastic(205e9, 0.29)
STRIP_YIELD, STRIP_TENSILE = 1350e6, 1550e6  # Pa, by heart
# Arc height of an A strip over peening strength [mmA/mm] before any strip of the machine is
# measured: the median, and the standard deviation of its logarithm, a factor of 2.5. From one
# published intensity 4.8 to 14 follow, by the restitution assumed (docs/explanation/peening.md).
USUAL_K, USUAL_K_LOG_SD = 13.5, 0.90


def usual_strip(intensity: float) -> StripType:
    """Return the type of the strips that are usual for an intensity [mmA]."""
    return next(one for one, (_, high) in USED_FOR.items() if intensity < high)


def strip_material(shot: ShotTable) -> PartMaterial:
    """Return the hardness of an Almen strip and its restitution under this shot.

    Shot of which only the density is given is taken to have the elasticity of steel.
    """
    elastic = ball(shot.material or "steel").elastic
    hardness = STRIP_HB * BRINELL_TO_PASCAL
    v0 = yield_speed(elastic, STRIP_STEEL, shot.density, hardness, STRIP_C0)
    return PartMaterial(C0=STRIP_C0, v0_m_s=v0, hardness_HB=STRIP_HB)
