"""Materials of balls and surfaces: densities, restitution laws, hardness.

Restitution follows e(v) = C0 for v < v0 and C0 (v/v0)^(-1/4) above, where v is the relative normal
speed at contact (McNamara & Falcon 2005). The paper gives no values, so a design must give them.
"""

from typing import Literal

from pydantic import Field

from chamberopt.common.toml_fields import quantity
from chamberopt.design.table_base import SI, FileTable

ShotMaterial = Literal["steel", "tungsten_carbide", "zirconia", "glass"]

# Handbook values from memory, not verified [R]. A design can give density_kg_m3 instead.
SHOT_DENSITY: dict[str, float] = {
    "steel": 7800.0,  # bearing steel 100Cr6
    "tungsten_carbide": 14900.0,  # WC with 6 % cobalt binder
    "zirconia": 6050.0,  # yttria-stabilised, sintered; fused zirconia-silica shot is nearer 3850
    "glass": 2500.0,  # soda-lime bead
}

BRINELL_TO_PASCAL = 9.81e6  # HB is kgf/mm²


class RestitutionTable(FileTable):
    """C0 and v0 of the restitution law of one surface, or of two balls."""

    C0: float = quantity(0.05, 1, "", "restitution below v0")
    v0_m_s: float = quantity(1e-4, 100, "m/s", "normal speed where yielding starts")

    restitution = SI("C0", 1.0, "C0, dimensionless")
    yield_speed = SI("v0_m_s", 1.0, "v0 [m/s]: slower impacts rebound with C0 and leave no dent")


class PartMaterial(RestitutionTable):
    """The part's restitution law, and its hardness, which sets the size of a dent."""

    # HB is how hardness is written.
    hardness_HB: float = quantity(5, 1000, "HB", "Brinell hardness of the part")  # noqa: N815

    @property
    def hardness(self) -> float:
        """Dynamic hardness B [Pa] of Kirk's dent law, B = 9.81e6 HB."""
        return self.hardness_HB * BRINELL_TO_PASCAL


class Materials(FileTable):
    """One restitution law for each thing that a ball can hit."""

    shot: RestitutionTable = Field(description="ball against ball")
    wall: RestitutionTable = Field(description="ball against chamber wall and lid")
    sonotrode: RestitutionTable = Field(description="ball against sonotrode")
    part: PartMaterial = Field(description="ball against part")
