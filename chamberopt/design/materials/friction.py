"""Friction of balls on metals and slopes of faces, from the catalogue friction.toml.

A design that says nothing about friction has that of its metals, and faces that shot has dented.
The program puts the catalogue's numbers in the place of "catalogue" or the name of a treatment, so
that results hold the numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from pydantic import Field

from chamberopt.common.toml_fields import Pair as TwoNumbers
from chamberopt.common.toml_fields import Several, list_field, quantity
from chamberopt.design.materials.catalogue import alloys, balls, find, read_catalogue
from chamberopt.design.table_base import FileTable

CATALOGUE, NONE, USUAL = "catalogue", "none", "peened"
BY_NAME = ("friction", "roughness")  # effects that a file has by name if it does not give them
ANY, LIKE = "any", "balls"  # any ball or metal, and a ball against its like
FACES = ("part", "sonotrode", "wall")


class FrictionPair(FileTable):
    """Friction of a ball on a metal, or on its like, at dry impacts."""

    ball: str = Field(description='name of a ball material, or "any"')
    metal: str = Field(description='base metal of a surface, "any", or "balls"')
    mu: float = quantity(0, 10, "", "coefficient of friction")
    mu_range: TwoNumbers = list_field("two numbers", "what mu may be")
    beta0: float = quantity(-1, 1, "", "tangential restitution of a sticking impact")
    sure: str = Field(description="what the numbers rest on")
    source: str = Field(description="what was read where; what is by heart is not verified")


class Treatment(FileTable):
    """Treatment of a face, and the rms slope of a profile that it leaves."""

    name: str
    slope_deg: float = quantity(0, 25, "degrees", "rms slope over the length of a contact")
    slope_range: TwoNumbers = list_field("two numbers", "what it may be")
    source: str = Field(description="what was read where; what is by heart is not verified")


class _Friction(FileTable):
    pair: Several[FrictionPair]
    treatment: Several[Treatment]


@cache
def _catalogue() -> _Friction:
    return read_catalogue("friction.toml", _Friction)


def friction_pairs() -> tuple[FrictionPair, ...]:
    """Return the friction of all pairs of materials in the catalogue."""
    return _catalogue().pair


def treatments() -> tuple[Treatment, ...]:
    """Return the slopes of all treatments of faces in the catalogue."""
    return _catalogue().treatment


def treatment(name: str) -> Treatment:
    """Return the slopes of the treatment of this name, which the catalogue must have."""
    return next(one for one in treatments() if one.name == name)


def friction_pair(ball: str | None, metal: str | None) -> FrictionPair:
    """Return the friction of a ball material on a base metal.

    A pair that the catalogue does not have is that of the ball on any metal or, without one, that
    of any ball on any metal.

    Args:
        ball: name of the ball material; None if it is not known.
        metal: base metal of the surface, "balls" for a ball against its like, None if not known.
    """
    known = {(one.ball, one.metal): one for one in friction_pairs()}
    wanted = ((ball, metal), (ball, ANY), (ANY, ANY))
    return next(known[one] for one in wanted if one in known)


def with_friction(
    effects: object, materials: Mapping[str, object], material: object, is_record: bool
) -> Mapping[str, object] | object:
    """Return the table [effects] with numbers in the place of names for friction and roughness.

    Friction that is not given is that of the catalogue, and "none" is none. Faces whose roughness
    is not given are peened if there is friction, and smooth without. Numbers that were looked up
    for other materials are looked up again; numbers of the design's own stay. Values that are
    neither stay as they are, and are reported when the table is checked.

    Args:
        effects: the table as given, or "auto".
        materials: tables of [materials], with numbers.
        material: shot.material as given.
        is_record: True for the design of a result, which has all effects that were simulated.
    """
    if effects == "auto":
        effects = {"auto": True}
    if not isinstance(effects, Mapping):
        return effects
    friction = effects.get("friction", NONE if is_record else CATALOGUE)
    looked_up = isinstance(friction, Mapping) and friction.get("pairs")
    if friction == CATALOGUE:
        friction = catalogue_friction(materials, material)
    elif friction == NONE:
        friction = None
    elif looked_up:
        anew = catalogue_friction(materials, material)
        friction = friction if looked_up == anew["pairs"] else anew
    roughness = effects.get("roughness", NONE if is_record or friction is None else USUAL)
    if roughness == NONE:
        roughness = None
    elif isinstance(roughness, str):
        known = any(one.name == roughness for one in treatments())
        if known:
            slope = treatment(roughness).slope_deg
            roughness = {"slope_deg": slope, "treatment": roughness}
    return {**effects, "friction": friction, "roughness": roughness}


def catalogue_friction(materials: Mapping[str, object], material: object) -> dict[str, object]:
    """Return the table effects.friction for the metals of a design, by the catalogue.

    Args:
        materials: tables of [materials]; metals that they do not name are not known.
        material: shot.material.
    """
    pairs = surface_pairs(materials, material)
    wall, part, like = (pairs[f"mu_{key}"] for key in ("wall", "part", LIKE))
    table: dict[str, object] = {"mu": wall.mu, "beta0": part.beta0}
    table |= {key: one.mu for key, one in pairs.items() if one.mu != wall.mu}
    if like.beta0 != part.beta0:
        table["beta0_balls"] = like.beta0
    words = ", ".join(f"{key} {_metal(materials.get(key)) or 'unknown'}" for key in FACES)
    return {**table, "pairs": f"{_ball(material) or 'unknown'} on {words}"}


def surface_pairs(materials: Mapping[str, object], material: object) -> dict[str, FrictionPair]:
    """Return the catalogue's friction on each surface and between balls, by its key in
    effects.friction.

    Args:
        materials: tables of [materials]; metals that they do not name are not known.
        material: shot.material.
    """
    ball = _ball(material)
    pairs = {key: friction_pair(ball, _metal(materials.get(key))) for key in FACES}
    return {f"mu_{key}": one for key, one in {**pairs, LIKE: friction_pair(ball, LIKE)}.items()}


def _ball(material: object) -> str | None:
    ball = find(material, balls())
    return None if ball is None else ball.name


def _metal(table: object) -> str | None:
    named = table.get("alloy") if isinstance(table, Mapping) else getattr(table, "alloy", None)
    alloy = find(named, alloys())
    return None if alloy is None else alloy.metal
