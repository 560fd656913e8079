"""Tables of [materials]: restitution laws and hardness.

The restitution e depends on the relative normal speed v at contact. A law is given in one of three
ways:

    { C0 = 0.91, v0_m_s = 0.44 }                  e = C0 for v < v0, C0 (v / v0)^(-1/4) above
    { C0 = 0.91, v0_m_s = 0.44, exponent = 0.2 }  with another exponent; 0 makes e = C0 at all v
    { e_at_m_s = [[0.1, 0.97], [5, 0.6]] }        pairs [v, e]: linear between, constant beyond

The first law is by McNamara and Falcon (2005). Their paper and the paper by Badreddine give no
values, so a design must give C0 and v0, or name a metal of the catalogue, for which named_metals.py
computes them.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import Field, model_validator

from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import Pair, Several, list_field, quantity
from chamberopt.design.materials.catalogue import BRINELL_TO_PASCAL
from chamberopt.design.materials.named_metals import NOT_NAMED, name_problems
from chamberopt.design.table_base import SI, FileTable

if TYPE_CHECKING:
    from sim_core import RestitutionLaw

MAX_POINTS = 200  # points of a table
# Tensile over yield strength. It is 2 for 316L, whose layer is 1.6 times as deep as the estimate of
# coverage/stress_profile.py. It is 1.1 to 1.4 for the metals that agree with the estimate.
STRONG_HARDENING = 1.6
ALLOY = "name in the catalogue (chamberopt materials), whose numbers hold where none are given"
POINTS = "pairs [v in m/s, e] with ascending v, e.g. [[0.1, 0.97], [1, 0.9], [5, 0.6]]"


class RestitutionTable(FileTable):
    """Restitution over impact speed of a ball on one surface, or of a ball on a ball."""

    WITHOUT_EFFECT: ClassVar[tuple[str, ...]] = ("C0", "v0_m_s", "exponent")  # keys beside a table

    C0: float | None = quantity(0.05, 1, "", "restitution below v0", None)
    v0_m_s: float | None = quantity(1e-4, 100, "m/s", "normal speed where yielding starts", None)
    exponent: float | None = quantity(
        0, 10, "", "of the fall of e above v0; 0: e = C0 at all speeds; absent: 1/4", None
    )
    e_at_m_s: Annotated[Several[Pair], Field(max_length=MAX_POINTS)] | None = list_field(
        POINTS, "instead of C0: measured restitution", None
    )
    v0_for: str | None = Field(
        default=None,
        description="ball, hardness and C0 for which the catalogue gave v0_m_s; written by the "
        "program, which computes v0_m_s anew for others",
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
            yield Problem("C0", f"missing; give C0, or e_at_m_s for a table{self._why_not_named}")
        elif self.v0_m_s is None and self.exponent != 0.0:
            text = "missing; give the speed above which e falls, or exponent = 0"
            yield Problem("v0_m_s", text + self._why_not_named)

    @property
    def _why_not_named(self) -> str:
        """Return why the catalogue did not give missing numbers; "" if no alloy is named."""
        return f" ({NOT_NAMED})" if getattr(self, "alloy", None) and self.exponent is None else ""

    @property
    def in_words(self) -> str:
        """Return the material in words: alloy, hardness, and the numbers of its restitution law."""
        alloy, hardness = getattr(self, "alloy", None), getattr(self, "hardness_HB", None)
        words = [alloy] if alloy else []
        words += [f"{hardness:g} HB"] if hardness else []
        slow = "restitution by a table" if self.C0 is None else f"restitution {self.C0:g}"
        ends = "" if self.v0_m_s is None else f" up to {self.v0_m_s:g} m/s"
        return ", ".join([*words, slow + ends])

    @property
    def restitution(self) -> RestitutionLaw:
        """Return the restitution law in the form that the simulator takes."""
        from sim_core import TabulatedRestitution

        if self.e_at_m_s is not None:
            return TabulatedRestitution(*zip(*self.e_at_m_s, strict=True))
        assert self.C0 is not None
        # any speed does if e is the same at all speeds
        v0 = 1.0 if self.v0_m_s is None else self.v0_m_s
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


class SurfaceMaterial(RestitutionTable):
    """Restitution over impact speed of a ball on the wall or on a sonotrode."""

    alloy: str | None = Field(default=None, description=ALLOY)
    hardness_HB: float | None = quantity(  # noqa: N815
        5, 1000, "HB", "if not the alloy's", None
    )

    def _problems(self) -> Iterator[Problem]:
        yield from super()._problems()
        if self.hardness_HB is not None and self.alloy is None:
            yield Problem("hardness_HB", "given without alloy; it has no effect here, leave it out")


class PartMaterial(RestitutionTable):
    """Restitution over impact speed of a ball on the part, and the part's hardness.

    Hardness and v0_m_s set the size of dents. Below the normal speed v0_m_s the contact is elastic
    and leaves no dent.
    """

    alloy: str | None = Field(default=None, description=ALLOY)
    WITHOUT_EFFECT: ClassVar[tuple[str, ...]] = ("C0", "exponent")
    # HB is the usual symbol of hardness.
    hardness_HB: float = quantity(5, 1000, "HB", "Brinell hardness of the part")  # noqa: N815

    yield_MPa: float | None = quantity(  # noqa: N815
        10,
        5000,
        "MPa",
        "yield strength, 0.2 %; with tensile_MPa it tells how the metal hardens",
        None,
    )
    tensile_MPa: float | None = quantity(  # noqa: N815
        10, 5000, "MPa", "tensile strength, for the peak of the compressive stress", None
    )

    yield_speed = SI("v0_m_s", 1.0, "v0 [m/s]: slower impacts leave no dent")

    def _problems(self) -> Iterator[Problem]:
        yield from super()._problems()
        if self.v0_m_s is None and (self.exponent == 0.0 or self.e_at_m_s is not None):
            yield Problem("v0_m_s", "missing; give the speed below which the part is not dented")
        if self.yield_MPa is None:
            return
        if self.tensile_MPa is None:
            yield Problem("yield_MPa", "given without tensile_MPa; give both, or the latter alone")
        elif self.tensile_MPa < self.yield_MPa:
            text = f"given {self.tensile_MPa:g}, below yield_MPa = {self.yield_MPa:g}"
            yield Problem("tensile_MPa", f"{text}; exchange or correct them")

    @property
    def hardens_strongly(self) -> bool:
        """True if the metal hardens so much that its depth of compression cannot be estimated.

        Then its tensile strength is far above its yield strength.
        """
        if self.yield_MPa is None or self.tensile_MPa is None:
            return False
        return self.tensile_MPa > STRONG_HARDENING * self.yield_MPa

    @property
    def hardness(self) -> float:
        """Return the part's hardness [Pa], 9.81e6 times HB, which sets the size of its dents.

        It is the dynamic hardness B in Kirk's formula of the dent diameter.
        """
        return self.hardness_HB * BRINELL_TO_PASCAL


def _law(what: str, else_: str = 'the name of an alloy, e.g. "Ti-6Al-4V"') -> Any:
    return Field(description=what, json_schema_extra={"form": f"a table, or {else_}"})


class Materials(FileTable):
    """Material of each object that a ball can hit: another ball, wall, sonotrode and part."""

    shot: RestitutionTable = _law("ball against ball", "a shot.material of known hardness")
    wall: SurfaceMaterial = _law("ball against chamber wall and lid")
    sonotrode: SurfaceMaterial = _law("ball against sonotrode")
    part: PartMaterial = _law("ball against part")

    @model_validator(mode="before")
    @classmethod
    def _know_all_names(cls, data: object) -> object:
        if problems := list(name_problems(data)):
            raise CrossCheckError(problems)
        return data
