"""What a design tells of the residual stress that a dent leaves: metal, balls, part, factors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.coverage.dents import dent_diameter
from chamberopt.coverage.stress_law import AS_IS, LawFactors, PeenedMetal, Plate
from chamberopt.design.flexure import plate_metals

if TYPE_CHECKING:
    from chamberopt.design.calibration import LawCalibration
    from chamberopt.design.load import Design
    from chamberopt.design.materials import PartMaterial

FASTEST = 1000.0  # m/s
SPEEDS = 2001


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
    steps = design.in_steps.values()
    balls = tuple(dict.fromkeys(ball for one in steps for ball, _ in one.shot.sizes))
    return StressModel(metal, part, balls, design.shot.density, plate, factors)


def law_factors(design: Design) -> LawFactors:
    """Return the factors on the law by measured profiles of the design's metal; 1 without any."""
    measured = measured_law(design)
    return AS_IS if measured is None else LawFactors(*map(math.exp, measured.log_mean))


def measured_law(design: Design) -> LawCalibration | None:
    calibration = design.calibration
    return None if calibration is None else calibration.law_of(design.materials.part)
