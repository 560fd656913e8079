"""Materials of balls and surfaces: densities, restitution laws, hardness.

The restitution e depends on the relative normal speed v at contact. A law is given in one of three
ways:

    { C0 = 0.91, v0_m_s = 0.44 }                  e = C0 for v < v0, C0 (v / v0)^(-1/4) above
    { C0 = 0.91, v0_m_s = 0.44, exponent = 0.2 }  with another exponent; 0 makes e = C0 at all v
    { e_at_m_s = [[0.1, 0.97], [5, 0.6]] }        pairs [v, e]: linear between, constant beyond

The first is McNamara & Falcon's (2005). Their paper and Badreddine's give no values, so a design
must give them.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from chamberopt.common.toml_errors import Problem
from chamberopt.common.toml_fields import Pair, Several, list_field, quantity
from chamberopt.design.table_base import SI, FileTable

if TYPE_CHECKING:
    from sim_core import RestitutionLaw

ShotMaterial = Literal["steel", "tungsten_carbide", "zirconia", "glass"]

# Handbook values from memory, not verified [R]. A design can give density_kg_m3 instead.
SHOT_DENSITY: dict[str, float] = {
    "steel": 7800.0,  # bearing steel 100Cr6
    "tungsten_carbide": 14900.0,  # WC with 6 % cobalt binder
    "zirconia": 6050.0,  # yttria-stabilised, sintered; fused zirconia-silica shot is nearer 3850
    "glass": 2500.0,  # soda-lime bead
}

BRINELL_TO_PASCAL = 9.81e6  # HB is kgf/mm²
MAX_POINTS = 200  # of a table
POINTS = "pairs [v in m/s, e] with ascending v, e.g. [[0.1, 0.97], [1, 0.9], [5, 0.6]]"


class RestitutionTable(FileTable):
    """The restitution law of one surface, or of two balls."""

    WITHOUT_EFFECT: ClassVar[tuple[str, ...]] = ("C0", "v0_m_s", "exponent")  # beside a table

    C0: float | None = quantity(0.05, 1, "", "restitution below v0", None)
    v0_m_s: float | None = quantity(1e-4, 100, "m/s", "normal speed where yielding starts", None)
    exponent: float | None = quantity(
        0, 10, "", "of the fall of e above v0; 0: e = C0 at all speeds; absent: 1/4", None
    )
    e_at_m_s: Annotated[Several[Pair], Field(max_length=MAX_POINTS)] | None = list_field(
        POINTS, "instead of C0: measured restitution", None
    )

    def _problems(self) -> Iterator[Problem]:
        if self.e_at_m_s is None:
            yield from self._power_law_problems()
            return
        for name in self.WITHOUT_EFFECT:
            if getattr(self, name) is not None:
                yield Problem(name, "given beside e_at_m_s, the whole law; leave one of them out")
        yield from _table_problems(self.e_at_m_s)

    def _power_law_problems(self) -> Iterator[Problem]:
        if self.C0 is None:
            yield Problem("C0", "missing; give C0, or e_at_m_s for a table")
        elif self.v0_m_s is None and self.exponent != 0.0:
            yield Problem("v0_m_s", "missing; give the speed above which e falls, or exponent = 0")

    @property
    def restitution(self) -> RestitutionLaw:
        """The law as the simulator takes it."""
        from sim_core import TabulatedRestitution

        if self.e_at_m_s is not None:
            return TabulatedRestitution(*zip(*self.e_at_m_s, strict=True))
        assert self.C0 is not None
        v0 = 1.0 if self.v0_m_s is None else self.v0_m_s  # any does where e is the same at all
        return (self.C0, v0) if self.exponent is None else (self.C0, v0, self.exponent)


def _table_problems(points: tuple[tuple[float, float], ...]) -> Iterator[Problem]:
    if not points:
        yield Problem("e_at_m_s", f"given an empty list; allowed: {POINTS}")
    for i, (speed, e) in enumerate(points):
        if not 0.0 <= e <= 1.0:
            yield Problem(f"e_at_m_s.{i}.1", f"given {e:g}; allowed: e from 0 to 1")
        if not 0.0 <= speed <= 1000.0:
            yield Problem(f"e_at_m_s.{i}.0", f"given {speed:g}; allowed: 0 to 1000 m/s")
    for i, ((slower, _), (faster, _)) in enumerate(pairwise(points), start=1):
        if faster <= slower:
            text = f"given {faster:g} after {slower:g} m/s; give each speed once, in order"
            yield Problem(f"e_at_m_s.{i}.0", text)


class PartMaterial(RestitutionTable):
    """The part's restitution law, and what sets the size of a dent: hardness and yield speed.

    With every law v0_m_s is the speed below which the contact is elastic and no dent is left.
    """

    WITHOUT_EFFECT: ClassVar[tuple[str, ...]] = ("C0", "exponent")
    # HB is how hardness is written.
    hardness_HB: float = quantity(5, 1000, "HB", "Brinell hardness of the part")  # noqa: N815

    yield_speed = SI("v0_m_s", 1.0, "v0 [m/s]: slower impacts leave no dent")

    def _problems(self) -> Iterator[Problem]:
        yield from super()._problems()
        if self.v0_m_s is None and (self.exponent == 0.0 or self.e_at_m_s is not None):
            yield Problem("v0_m_s", "missing; give the speed below which the part is not dented")

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
