"""The shot of a design: all its balls, either of one size or a mix of sizes by mass."""

import math
from collections.abc import Iterator
from typing import Literal

from pydantic import Field, field_validator

from chamberopt.common.toml_errors import Problem
from chamberopt.common.toml_fields import Several, list_field, quantity
from chamberopt.design.materials import ball, balls, find
from chamberopt.design.table_base import SI, FileTable


class ShotSize(FileTable):
    """One of several sizes of balls."""

    diameter_mm: float = quantity(0.1, 20, "mm", "of one ball of this size")
    share: float = quantity(1e-6, 1, "of the charge's mass", "the shares of all sizes add up to 1")


class ShotTable(FileTable):
    """All balls of a design: their mass, size and material.

    The size is given as exactly one of diameter_mm and mix, the material as exactly one of material
    and density_kg_m3.
    """

    mass_g: float = quantity(1e-4, 10000, "g", "of all balls together")
    diameter_mm: float | None = quantity(0.1, 20, "mm", "of one ball", None)
    mix: Several[ShotSize] | None = list_field(
        "a list of { diameter_mm = ..., share = ... }",
        "2 to 8 sizes and their shares of the mass",
        None,
    )
    material: Literal[tuple(one.name for one in balls())] | None = Field(  # type: ignore[valid-type]
        default=None, description="sets the density"
    )
    density_kg_m3: float | None = quantity(500, 25000, "kg/m³", "instead of material", None)

    @field_validator("material", mode="before")
    @classmethod
    def _use_its_first_name(cls, given: object) -> object:
        found = find(given, balls())
        return given if found is None else found.name

    def _problems(self) -> Iterator[Problem]:
        if self.material is None and self.density_kg_m3 is None:
            materials = ", ".join(f'"{one.name}"' for one in balls())
            text = f"missing; give material (one of {materials}) or density_kg_m3"
            yield Problem("material", text)
        if self.material is not None and self.density_kg_m3 is not None:
            text = f"given {self.density_kg_m3:g} beside material = {self.material!r}"
            yield Problem("density_kg_m3", f"{text}; keep one of the two")
        if self.mix is not None:
            yield from self._mix_problems(self.mix)
        elif self.diameter_mm is None:
            text = "missing; a number from 0.1 to 20 mm (of one ball), or several sizes: mix"
            yield Problem("diameter_mm", text)

    def _mix_problems(self, mix: tuple[ShotSize, ...]) -> Iterator[Problem]:
        if self.diameter_mm is not None:
            text = f"given {self.diameter_mm:g} beside mix; keep one of the two"
            yield Problem("diameter_mm", text)
        if not 2 <= len(mix) <= 8:
            yield Problem("mix", f"given {len(mix)} sizes; allowed: 2 to 8, or one as diameter_mm")
        if len({size.diameter_mm for size in mix}) < len(mix):
            yield Problem("mix", "given one diameter_mm twice; add up its shares")
        whole = sum(size.share for size in mix)
        if abs(whole - 1.0) > 1e-6:
            yield Problem("mix", f"given shares that add up to {whole:g}; they must add up to 1")

    @property
    def sizes(self) -> tuple[tuple[float, int], ...]:
        """Return the diameter [m] and the number of balls of each size.

        The number is rounded to whole balls, and is at least 1.
        """
        if self.mix is not None:
            shares = [(size.diameter_mm * 1e-3, size.share) for size in self.mix]
        else:
            shares = [] if self.diameter_mm is None else [(self.diameter_mm * 1e-3, 1.0)]
        whole = self.mass / (self.density * math.pi / 6.0)
        return tuple((size, max(1, round(share * whole / size**3))) for size, share in shares)

    @property
    def diameter(self) -> float:
        """Ball diameter [m]; diameter of the largest ball if there are several sizes."""
        return max(diameter for diameter, _ in self.sizes)

    @property
    def diameters(self) -> tuple[float, ...]:
        """Return the diameter of each ball [m], size by size, in the simulator's order of balls."""
        return tuple(diameter for diameter, count in self.sizes for _ in range(count))

    @property
    def density(self) -> float:
        """Ball density [kg/m³]."""
        if self.material is not None:
            return ball(self.material).density_kg_m3
        assert self.density_kg_m3 is not None
        return self.density_kg_m3

    mass = SI("mass_g", 1e-3, "Wanted mass of the whole charge [kg], not rounded to whole balls")

    @property
    def volume(self) -> float:
        """Volume of all balls [m³]."""
        return math.pi / 6.0 * sum(count * diameter**3 for diameter, count in self.sizes)

    @property
    def ball_mass(self) -> float:
        """Mass of one ball [kg]; the mean mass if there are several sizes."""
        if self.mix is None:
            return self.density * math.pi / 6.0 * self.diameter**3
        return self.density * self.volume / self.count

    @property
    def count(self) -> int:
        """Number of balls."""
        return sum(count for _, count in self.sizes)
