"""Replace names of metals in [materials] by the catalogue's numbers.

The speed v0 from which a ball dents a surface is computed by Johnson's formula.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from chamberopt.common.toml_errors import Problem
from chamberopt.design.materials.catalogue import (
    BRINELL_TO_PASCAL,
    Alloy,
    Ball,
    alloys,
    balls,
    find,
    unknown,
    yield_speed,
)

SURFACES = ("wall", "sonotrode", "part")
OTHER_LAW = {"exponent", "e_at_m_s"}  # a table with one of these keys has all of its law
DEFAULT_C0 = 0.91
NOT_NAMED = (
    "the catalogue gives both only for a shot.material with a known hardness, see chamberopt shot"
)


def with_numbers(materials: Mapping[str, object], material: object) -> dict[str, object]:
    """Return the tables of [materials] with numbers in place of names of metals.

    Numbers that the design gives stay. A yield speed v0 that was computed for another ball,
    hardness or C0 is computed again. A name that is not in the catalogue stays, and is reported
    when the tables are checked.

    Args:
        material: shot.material as given. An unknown material is reported when [shot] is checked.
    """
    ball = find(material, balls()) or (None if material is None else balls()[0])
    tables = {name: _surface(name, given, ball) for name, given in materials.items()}
    if (shot := _pair(materials.get("shot"), ball)) is not None:
        tables["shot"] = shot
    return tables


def name_problems(materials: object) -> Iterator[Problem]:
    """Yield a problem for each name of a metal in [materials] that is not in the catalogue."""
    for name, given in materials.items() if isinstance(materials, Mapping) else ():
        if isinstance(given, str) and name == "shot":
            known = find(given, balls()) is not None
            text = "it is not shot.material; leave it out" if known else unknown(given, balls())
            yield Problem(name, f"given {given!r}: {text}")
        elif isinstance(given, str) and name in SURFACES:
            yield Problem(name, f"given {given!r}: {unknown(given, alloys())}")
        elif isinstance(given, Mapping) and name in SURFACES and not given.get("v0_for"):
            alloy = given.get("alloy")
            if isinstance(alloy, str) and find(alloy, alloys()) is None:
                yield Problem(f"{name}.alloy", f"given {alloy!r}: {unknown(alloy, alloys())}")


def _surface(name: str, given: object, ball: Ball | None) -> object:
    """Return the table of a surface with the numbers of the alloy that it names.

    Return the given value unchanged if it names no known alloy.

    Args:
        name: the surface: wall, sonotrode or part.
        ball: material of the balls that hit it; None if it is not known.
    """
    table = {"alloy": given} if isinstance(given, str) else given
    if name not in SURFACES or not isinstance(table, Mapping) or not table.get("alloy"):
        return given
    table = {key: value for key, value in table.items() if value is not None}
    alloy = find(table["alloy"], alloys())
    if alloy is not None and "v0_for" not in table:  # a resolved table has all of them
        keys = ("hardness_HB", "yield_MPa", "tensile_MPa")[: 3 if name == "part" else 1]
        table = {key: getattr(alloy, key) for key in keys} | table | {"alloy": alloy.name}
    elif alloy is None and "v0_for" not in table:
        return given
    return _with_v0(table, ball, alloy, table.get("hardness_HB", 0.0))


def _pair(given: object, ball: Ball | None) -> object:
    """Return the table of ball on ball in [materials], computed for this material of the balls.

    Return the given value unchanged if it has a restitution law of its own.
    """
    if given is None or (isinstance(given, str) and ball and find(given, balls()) is ball):
        given = {}
    if not isinstance(given, Mapping) or (given and not given.get("v0_for")):
        return given
    table = {key: value for key, value in given.items() if value is not None}
    return _with_v0(table, ball, ball, None) or None


def _with_v0(
    table: dict[str, Any], ball: Ball | None, other: Alloy | Ball | None, hardness: Any
) -> dict[str, Any]:
    """Return a table with restitution C0, yield speed v0, and the ball and hardness behind v0.

    A table with a restitution law of its own stays as it is.

    Args:
        other: solid that the ball hits; None if it is not in the catalogue.
        hardness: given hardness of the surface [HB]; None for two balls.
    """
    c0 = table.get("C0", DEFAULT_C0)
    if not (_is_number(c0) and (hardness is None or _is_number(hardness))):
        return table  # reported by the table
    surface = "its like" if hardness is None else f"{hardness:g} HB"
    v0_for = f"{ball.name if ball else 'unknown'} on {surface}, C0 = {c0:g}"
    if table.get("v0_for") == v0_for:
        return table
    if "v0_for" in table:
        table = {key: value for key, value in table.items() if key not in ("v0_m_s", "v0_for")}
    if "v0_m_s" in table and OTHER_LAW.isdisjoint(table):
        return {"C0": c0, **table}
    if ball is None or ball.hardness_HB is None or other is None or not OTHER_LAW.isdisjoint(table):
        return table
    v0 = computed_v0(ball, other, c0, hardness)
    return {**table, "C0": c0, "v0_m_s": v0, "v0_for": v0_for}


def computed_v0(
    ball: Ball, other: Alloy | Ball, c0: float = DEFAULT_C0, hardness: float | None = None
) -> float:
    """Return the speed v0 [m/s] from which a ball dents a surface, or an equal ball.

    The ball's hardness must be known. The result has two digits, which is more than the accuracy
    of the formula.

    Args:
        hardness: hardness of the surface [HB]; None means the catalogue's hardness.
    """
    harder, given = ball.hardness_HB, hardness or other.hardness_HB
    assert harder is not None
    assert given is not None
    softer = min(harder, given) * BRINELL_TO_PASCAL
    v0 = yield_speed(ball.elastic, other.elastic, ball.density_kg_m3, softer, c0)
    return float(f"{0.5 * v0 if isinstance(other, Ball) else v0:.2g}")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and value > 0.0
