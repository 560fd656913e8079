"""What balls and surfaces are made of: densities, the rebound law's two numbers, hardness.

Rebound follows the paper's law e(v) = C0 for v < v0 and C0 (v/v0)^(-1/4) above, v the relative normal speed
at contact (McNamara & Falcon 2005). The paper gives no values: they are the user's choice, and mandatory.
"""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

STRICT = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

ShotMaterial = Literal["steel", "tungsten_carbide", "zirconia", "glass"]

# Handbook values, recalled and not verified [R]: a design that knows better gives density_kg_m3 instead.
SHOT_DENSITY: dict[str, float] = {
    "steel": 7800.0,  # bearing steel 100Cr6
    "tungsten_carbide": 14900.0,  # WC with 6 % cobalt binder
    "zirconia": 6050.0,  # yttria-stabilised, sintered; fused zirconia-silica shot is nearer 3850
    "glass": 2500.0,  # soda-lime bead
}

BRINELL_TO_PASCAL = 9.81e6  # HB is kgf/mm²


class RestitutionLaw(BaseModel):
    """C0 and v0 of the paper's rebound law for one surface (or for ball on ball)."""

    model_config = STRICT

    C0: float = Field(ge=0.05, le=1.0, description="restitution below v0")
    v0_m_s: float = Field(
        ge=1e-4,
        le=100.0,
        description="normal speed where yielding starts",
        json_schema_extra={"unit": "m/s"},
    )

    @property
    def restitution(self) -> float:
        """C0, dimensionless."""
        return self.C0

    @property
    def yield_speed(self) -> float:
        """v0 [m/s]: slower impacts rebound with C0 and leave no dent."""
        return self.v0_m_s


class PartMaterial(RestitutionLaw):
    """The part's rebound law and its hardness, which sets how big a dent is."""

    hardness_HB: float = Field(  # noqa: N815 -- HB is how hardness is written
        ge=5.0,
        le=1000.0,
        description="Brinell hardness of the part",
        json_schema_extra={"unit": "HB"},
    )

    @property
    def hardness(self) -> float:
        """Dynamic hardness B [Pa] of Kirk's dent law, B = 9.81e6 HB."""
        return self.hardness_HB * BRINELL_TO_PASCAL


class Materials(BaseModel):
    """One rebound law for each thing a ball can hit: another ball, a wall, the sonotrode, the part."""

    model_config = STRICT

    shot: RestitutionLaw = Field(description="ball against ball")
    wall: RestitutionLaw = Field(description="ball against chamber wall and lid")
    sonotrode: RestitutionLaw = Field(description="ball against sonotrode")
    part: PartMaterial = Field(description="ball against part")
