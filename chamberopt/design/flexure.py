"""Elasticity of a design's part and balls, and what depends on it: flexure and residual stress.

[stress]                     # empty: residual stress below the surface of a thick part
thickness_mm = 3             # in a flat plate
peened = "both_sides"        # or one_side, which bends it, or held_flat
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, NamedTuple

from pydantic import Field

from chamberopt.common.toml_errors import Problem
from chamberopt.common.toml_fields import quantity
from chamberopt.design.materials import alloys, balls, find
from chamberopt.design.materials.catalogue import Elastic
from chamberopt.design.materials.tables import STRONG_HARDENING
from chamberopt.design.table_base import FileTable

PlateKind = Literal["one_side", "held_flat", "both_sides"]
CASE = "case-hardened"
NO_STRESS = "the design does not ask for it; add a table [stress], which may be empty"
REMEDY = (
    "name an alloy in materials.part and a shot.material, or give effects.flexure with E_GPa, "
    "poisson and density_kg_m3 of the part (part_...) and E_GPa and poisson of the balls (shot_...)"
)


class PlateMetals(NamedTuple):
    """Elasticity of the part and of the balls that hit it, and the density of the part [kg/m³]."""

    part: Elastic
    density: float
    shot: Elastic

    @property
    def contact_modulus(self) -> float:
        """Contact modulus E* of a ball on the part [Pa]."""
        return 1.0 / (self.part.compliance + self.shot.compliance)


def plate_metals(design: Any) -> PlateMetals | None:
    """Return the elasticity of part and balls of a Design: as given, or by their catalogue names.

    Return None if either is not known.
    """
    given = design.effects.flexure
    part, shot = find(design.materials.part.alloy, alloys()), find(design.shot.material, balls())
    of_part = None if part is None else (part.elastic, part.density_kg_m3)
    of_shot = None if shot is None else shot.elastic
    if given is not None and given.part_E_GPa is not None:
        assert given.part_poisson is not None
        assert given.part_density_kg_m3 is not None
        elastic = Elastic(1e9 * given.part_E_GPa, given.part_poisson)
        of_part = elastic, given.part_density_kg_m3
    if given is not None and given.shot_E_GPa is not None:
        assert given.shot_poisson is not None
        of_shot = Elastic(1e9 * given.shot_E_GPa, given.shot_poisson)
    return None if of_part is None or of_shot is None else PlateMetals(*of_part, of_shot)


def flexure_problems(design: Any) -> Iterator[Problem]:
    """Yield a problem if a Design asks for flexure, and part or balls have unknown elasticity."""
    given = design.effects.flexure
    if given is not None and given.on and plate_metals(design) is None:
        yield Problem("effects.flexure", f"given, but the metal is not known; {REMEDY}")


class StressTable(FileTable):
    """Asks for the residual stress under the peened surface, of a thick part or of a flat plate."""

    thickness_mm: float | None = quantity(
        0.1, 1000, "mm", "of a flat part; absent: thick, so that its core stays as it is", None
    )
    peened: PlateKind = Field(
        default="one_side",
        description="on one_side of a plate that bends freely or is held_flat, or both_sides alike",
    )

    def _problems(self) -> Iterator[Problem]:
        if self.thickness_mm is None and self.peened != "one_side":
            text = f'given "{self.peened}" without thickness_mm, and a thick part does not bend'
            yield Problem("peened", f"{text}; give both or neither")


def stress_problems(design: Any) -> Iterator[Problem]:
    """Yield a problem for each reason why the residual stress of a Design cannot be estimated."""
    if design.stress is None:
        return
    part, where = design.materials.part, "materials.part"
    alloy, ball = find(part.alloy, alloys()), find(design.shot.material, balls())
    remedy = "or leave out [stress]"
    if alloy is not None and alloy.condition.startswith(CASE):
        text = "is case-hardened: its strength changes with depth, so that its residual stress"
        yield Problem(f"{where}.alloy", f"{alloy.name} {text} is not estimated; leave out [stress]")
    elif part.yield_MPa is None or part.tensile_MPa is None:
        missing = "tensile_MPa" if part.yield_MPa is not None else "yield_MPa"
        text = "missing; [stress] takes yield and tensile strength of the part: give yield_MPa and"
        yield Problem(f"{where}.{missing}", f"{text} tensile_MPa, name an alloy, {remedy}")
    elif part.hardens_strongly:
        text = f"given {part.tensile_MPa:g}, more than {STRONG_HARDENING:g} times yield_MPa"
        why = "the stress in a metal that hardens so strongly is not estimated"
        yield Problem(f"{where}.tensile_MPa", f"{text}: {why}; leave out [stress]")
    if plate_metals(design) is None:
        yield Problem(
            "stress", f"given, but the elasticity of part or balls is not known; {REMEDY}"
        )
    if ball is not None and ball.hardness_HB is None:
        text = f"the hardness of {ball.name} is not known, so that it may be softer than the part"
        yield Problem("shot.material", f"{text}; take other balls, {remedy}")
    elif ball is not None and ball.hardness_HB is not None and part.hardness_HB > ball.hardness_HB:
        text = f"given {part.hardness_HB:g}, harder than the balls of {ball.hardness_HB:g} HB"
        why = "which would yield themselves"
        yield Problem(f"{where}.hardness_HB", f"{text}, {why}; take harder balls, {remedy}")
