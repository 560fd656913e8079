"""What a STEP file says in its text: the unit of its numbers, and the names of faces.

An entity is `#12 = TYPE('name', #7, ...);`; a complex one has several types: `#12 = (A() B(#7));`.

Source: ISO 10303-21 (exchange structure), ISO 10303-42 (geometry and topology).
"""

from __future__ import annotations

import re
from functools import cache
from typing import NamedTuple

import numpy as np

# A quote in a string is written twice, which reads as two strings: no text is read in two ways.
ENTITY = re.compile(r"#(\d+)\s*=\s*\(?\s*([A-Z_0-9]+)\s*((?:'[^']*+'|[^';])*+);")
STRING = re.compile(r"'((?:[^']|'')*+)'")
NUMBER = re.compile(r"[-+]?\d*\.?\d+(?:\.?[Ee][-+]?\d+)?")
REFERENCE = re.compile(r"#(\d+)")
IGNORED = dict.fromkeys(range(32))  # characters of a string, such as the end of a line
ESCAPE = re.compile(
    r"\\X2\\(?P<utf16>(?:[0-9A-F]{4})+)\\X0\\|\\X4\\(?P<utf32>(?:[0-9A-F]{8})+)\\X0\\"
    r"|\\X\\(?P<byte>[0-9A-F]{2})|\\S\\(?P<upper>.)|\\(?P<itself>\\)|'(?P<quote>')"
)
UNIT_ASSIGNED = re.compile(r"GLOBAL_UNIT_ASSIGNED_CONTEXT\s*\(\s*\(([^)]*)\)")
SI_UNIT = re.compile(r"SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.\s*\)")
CONVERTED_UNIT = re.compile(r"CONVERSION_BASED_UNIT\s*\(\s*'(\w+)'")
PREFIXES = {"": "m", "MILLI": "mm", "CENTI": "cm", "MICRO": "um"}
NAMED = {"INCH": "in", "MILLIMETRE": "mm", "MILLIMETER": "mm"}
FACES = ("ADVANCED_FACE", "FACE_SURFACE")
SHELLS, TURNED_SHELL = ("CLOSED_SHELL", "OPEN_SHELL"), "ORIENTED_CLOSED_SHELL"
SOLIDS = ("MANIFOLD_SOLID_BREP", "BREP_WITH_VOIDS", "FACETED_BREP")
BOUNDS, LOOPS = ("FACE_OUTER_BOUND", "FACE_BOUND"), ("EDGE_LOOP", "POLY_LOOP")
# The way from a face to its corners. A curve, on which points lie too, is not on it.
LEADS_TO = {
    **dict.fromkeys(FACES, BOUNDS),
    **dict.fromkeys(BOUNDS, LOOPS),
    "EDGE_LOOP": ("ORIENTED_EDGE",),
    "ORIENTED_EDGE": ("EDGE_CURVE",),
    "EDGE_CURVE": ("VERTEX_POINT",),
    "VERTEX_POINT": ("CARTESIAN_POINT",),
    "POLY_LOOP": ("CARTESIAN_POINT",),
}
# Names that CAD programs give to faces that have none.
NO_NAMES = ("", "NONE")


class StepFace(NamedTuple):
    """A face of a solid."""

    name: str  # "" if it has none
    middle: np.ndarray  # mean of its corners, (3,), in the file's numbers; nan if it has none


def stated_unit(text: str) -> str | None:
    """Unit of the lengths of a STEP file, as in part.unit; None if it is none of these."""
    assigned = UNIT_ASSIGNED.search(text)
    for number in REFERENCE.findall(assigned[1]) if assigned else ():
        entity = re.search(rf"#{number}\s*=([^;]*);", text)
        if entity and "LENGTH_UNIT" in entity[1]:
            si, converted = SI_UNIT.search(entity[1]), CONVERTED_UNIT.search(entity[1])
            if converted:
                return NAMED.get(converted[1].upper())
            return PREFIXES.get(si[1] or "") if si else None
    return None


def read_solids(text: str) -> list[list[StepFace]]:
    """The faces of each solid, in the order of its shells."""
    entities = {number: (kind, value) for number, kind, value in ENTITY.findall(text)}

    def linked(number: str, kinds: tuple[str, ...]) -> list[str]:
        """Entities of these kinds to which one refers."""
        found = REFERENCE.findall(STRING.sub("", entities[number][1]))
        return [one for one in found if one in entities and entities[one][0] in kinds]

    @cache
    def corners(number: str) -> frozenset[str]:
        """The points at the ends of a face's edges."""
        kind = entities[number][0]
        if kind == "CARTESIAN_POINT":
            return frozenset([number])
        return frozenset().union(*map(corners, linked(number, LEADS_TO[kind])))

    def face(number: str) -> StepFace:
        name = STRING.search(entities[number][1])
        texts = [STRING.sub("", entities[corner][1]) for corner in sorted(corners(number))]
        places = [list(map(float, NUMBER.findall(text))) for text in texts]
        middle = np.mean(places, axis=0) if places else np.full(3, np.nan)
        return StepFace(_decoded(name[1] if name else ""), middle)

    solids = []
    for number, (kind, _) in entities.items():
        if kind in SOLIDS:
            shells = [
                closed
                for shell in linked(number, (*SHELLS, TURNED_SHELL))
                for closed in (
                    linked(shell, SHELLS) if entities[shell][0] == TURNED_SHELL else [shell]
                )
            ]
            solids.append([face(one) for shell in shells for one in linked(shell, FACES)])
    return solids


def _decoded(text: str) -> str:
    """A string of ISO 10303-21 as text; "" for a name that stands for none."""
    text = ESCAPE.sub(_character, text.translate(IGNORED)).strip()
    return "" if text.upper() in NO_NAMES else text


def _character(escape: re.Match[str]) -> str:
    """What an escape stands for; half a character becomes U+FFFD."""
    kind = str(escape.lastgroup)
    given = escape[kind]
    if kind in ("utf16", "utf32"):
        return bytes.fromhex(given).decode(f"{kind[:3]}-{kind[3:]}-be", errors="replace")
    if kind == "byte":
        return chr(int(given, 16))
    return chr(ord(given) | 0x80) if kind == "upper" else given
