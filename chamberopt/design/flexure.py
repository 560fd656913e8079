"""Elasticity of a design's part and balls, which the flexure of thin parts depends on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from chamberopt.common.toml_errors import Problem
from chamberopt.design.materials import alloys, balls, find
from chamberopt.design.materials.catalogue import Elastic

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
