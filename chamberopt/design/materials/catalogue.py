"""The catalogue of alloys and commercial balls, read from alloys.toml and balls.toml."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Literal, TypeVar

from pydantic import Field

from chamberopt.common.errors import InputError
from chamberopt.common.files import read_file
from chamberopt.common.toml_errors import did_you_mean
from chamberopt.common.toml_fields import Several, quantity
from chamberopt.design.table_base import FileTable

# The speed from which a ball dents a surface or another ball, by Johnson's formula.
#
# Notation
#     E*   1 / ((1 - nu1²) / E1 + (1 - nu2²) / E2) [Pa], for ball and surface
#     Y    yield stress of the softer of the two, 9.81e6 HB / 2.8 [Pa]
#     rho  density of the ball [kg/m³]
#     v_Y  speed at which yielding starts; v_Y² = 26 (Y / E*)^4 Y / rho
#     v0   speed from which e = C0 (v / v0)^(-1/4) holds, v_Y (1.18 / C0)^4
#
# Two equal balls have half the radius and half the mass of a ball on a surface: half its v_Y.
#
# Source: K. L. Johnson, "Contact Mechanics", Cambridge 1985, section 11.5.

BRINELL_TO_PASCAL = 9.81e6  # HB is kgf/mm²
BY_HEART = "by heart"
# What is said of numbers by the kind of text that they were read in.
ORIGINS = {
    "data sheet": "read in a maker's data sheet",
    "standard": "read in a standard",
    "handbook": "read in a handbook",
    "supplier": "read at a supplier's",
    BY_HEART: "by heart, not verified",
}


@dataclass(frozen=True)
class Elastic:
    """Elasticity of a material: Young's modulus [Pa] and Poisson's ratio."""

    modulus: float
    poisson: float

    @property
    def compliance(self) -> float:
        """Return (1 - nu²) / E [1/Pa], for Poisson's ratio nu and Young's modulus E."""
        return (1.0 - self.poisson**2) / self.modulus


def yield_speed(
    ball: Elastic, surface: Elastic, density: float, hardness: float, c0: float
) -> float:
    """Return the speed v0 [m/s] from which a ball dents a surface, by Johnson's formula.

    Args:
        density: density of the ball [kg/m³].
        hardness: hardness of the softer of the two [Pa].
        c0: restitution of impacts slower than v0.
    """
    stress = hardness / 2.8
    ratio = stress * (ball.compliance + surface.compliance)
    return math.sqrt(26.0 * ratio**4 * stress / density) * (1.18 / c0) ** 4


class Named(FileTable):
    """Properties that all alloys and ball materials of the catalogue have."""

    name: str
    also: Several[str] = Field(description="other names under which it is found")
    condition: str
    density_kg_m3: float = quantity(500, 25000, "kg/m³", "density")
    E_GPa: float = quantity(1, 1500, "GPa", "Young's modulus")
    poisson: float = quantity(0, 0.5, "", "Poisson's ratio")
    kind: Literal["data sheet", "standard", "handbook", "supplier", "by heart"] = Field(
        description="kind of text that hardness, strengths or (glass) elasticity were read in"
    )
    source: str = Field(description="what was read where; what is by heart is not verified")

    @property
    def origin(self) -> str:
        """Return in words how hardness, strengths or (of glass) elasticity are known."""
        return ORIGINS[self.kind]

    @property
    def elastic(self) -> Elastic:
        return Elastic(self.E_GPa * 1e9, self.poisson)


class Alloy(Named):
    """A metal of parts, walls and sonotrodes, in one condition."""

    metal: str = Field(description="its base metal, for friction")
    stainless: bool = Field(default=False, description="of a steel, on which iron would rust")
    hardness_HB: float = quantity(5, 1000, "HB", "Brinell hardness of the surface")  # noqa: N815
    yield_MPa: float | None = quantity(10, 5000, "MPa", "yield strength", None)  # noqa: N815
    tensile_MPa: float | None = quantity(10, 5000, "MPa", "tensile strength", None)  # noqa: N815


class Ball(Named):
    """A material of balls, and the diameters and grades in which they are sold."""

    hardness_HB: float | None = quantity(5, 3000, "HB", "None: v0 is not known", None)  # noqa: N815
    sizes_mm: Several[float] = Field(description="diameters sold")
    grades: Several[str] = Field(description="names of the grades sold")


class Grade(FileTable):
    """Tolerances of balls of one grade of ISO 3290-1."""

    name: str
    ball_um: float = quantity(0.01, 1000, "µm", "differences of the diameters of one ball")
    form_um: float = quantity(0.01, 1000, "µm", "deviation of a ball from a sphere")
    lot_um: float = quantity(0.01, 1000, "µm", "differences of the mean diameters in a lot")


class _Alloys(FileTable):
    alloy: Several[Alloy]


class _Balls(FileTable):
    ball: Several[Ball]
    grade: Several[Grade]


File = TypeVar("File", bound=FileTable)
Solid = TypeVar("Solid", bound=Named)


@cache
def alloys() -> tuple[Alloy, ...]:
    """Return all alloys of the catalogue. The alloys of one base metal are together."""
    return read_catalogue("alloys.toml", _Alloys).alloy


@cache
def balls() -> tuple[Ball, ...]:
    """Return all materials of balls in the catalogue."""
    return read_catalogue("balls.toml", _Balls).ball


@cache
def grades() -> tuple[Grade, ...]:
    """Return the tolerances of all grades of balls, the finest first."""
    return read_catalogue("balls.toml", _Balls).grade


def find(name: object, among: Iterable[Solid]) -> Solid | None:
    """Return the alloy or ball material of this name among the given ones; None if unknown.

    Case, spaces and hyphens do not matter.
    """
    if not isinstance(name, str):
        return None
    plain = _plain(name)
    return next((one for one in among if plain in map(_plain, (one.name, *one.also))), None)


def alloy(name: str) -> Alloy:
    """Return the alloy of this name. Raises InputError if there is none."""
    return _found(name, alloys(), "alloy")


def ball(name: str) -> Ball:
    """Return the material of balls of this name. Raises InputError if there is none."""
    return _found(name, balls(), "material of balls")


def ball_sizes(material: str) -> tuple[float, ...]:
    """Return the diameters [mm] in which balls of a material are sold, in ascending order.

    Raises InputError if there is no such material.
    """
    return ball(material).sizes_mm


def unknown(name: object, among: Iterable[Named]) -> str:
    """Return a message that a name is unknown.

    The message gives the most similar name among the given materials, or all names if none is
    similar.
    """
    known = [word for one in among for word in (one.name, *one.also)]
    close = did_you_mean(str(name), known)
    if close.startswith("did"):
        return f"unknown; {close}"
    return f"unknown; known are {', '.join(one.name for one in among)}"


def _found(name: str, among: tuple[Solid, ...], kind: str) -> Solid:
    found = find(name, among)
    if found is None:
        raise InputError(f"{kind} {name!r}: {unknown(name, among)}")
    return found


@lru_cache(maxsize=1024)  # all names of the catalogue, and some of users
def _plain(name: str) -> str:
    return re.sub(r"[\W_]", "", name).casefold()


def read_catalogue(file: str, kind: type[File]) -> File:
    """Return the tables of a file of the catalogue, in the folder of this module."""
    path = Path(__file__).with_name(file)
    return kind.model_validate(tomllib.loads(read_file(path, follow=True).decode()))
