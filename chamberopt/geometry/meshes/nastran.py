"""Read Nastran bulk data (from CATIA V5, Patran, HyperMesh ...).

Properties and sets of the file become groups of triangles. The reader never ignores an
unsupported geometry card (an entry of the file). It refuses the file and names the card. Fields
come in the small format (8 columns), the large format (16 columns, name with *) and the free format
(commas).

Source: MSC Nastran Quick Reference Guide.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.elements import (
    CORNERS,
    EDGES,
    NONE,
    Block,
    ElementMesh,
    extract_surface,
)
from chamberopt.geometry.meshes.raw_mesh import RawMesh

KINDS = {
    "CTRIA3": "triangle", "CTRIAR": "triangle", "CTRIA6": "triangle",
    "CQUAD4": "quad", "CQUADR": "quad", "CQUAD8": "quad",
    "CTETRA": "tetra", "CPYRAM": "pyramid", "CPENTA": "wedge", "CHEXA": "hexahedron",
}  # fmt: skip
# Nastran counts the mid-edge nodes of these kinds bottom, upright, top. `elements` counts bottom,
# top, upright.
REORDERED = {
    "wedge": [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13, 14, 9, 10, 11],
    "hexahedron": [*range(12), 16, 17, 18, 19, 12, 13, 14, 15],
}
UNSUPPORTED = {
    "INCLUDE": "put the included file's text in its place",
    "CORD1R": "use CORD2R", "CORD1C": "use CORD2C", "CORD1S": "use CORD2S",
    "CORD3G": "use CORD2R", "SPOINT": "remove it",
    "GRDSET": "write its values into each GRID",
    "CQUAD": "export CQUAD4 or CQUAD8", "CTRIAX6": "export a solid's surface",
}  # fmt: skip
WITHOUT_SURFACE = re.compile(
    r"C(BAR|BEAM|ROD|TUBE|BUSH|ELAS|DAMP|MASS|ONM|ONROD|GAP|WELD|FAST|VISC|BEND|SEAM|HBDY)"
)
SYSTEMS = ("CORD2R", "CORD2C", "CORD2S")
GEOMETRY_CARDS = {"GRID", *KINDS, *SYSTEMS, *UNSUPPORTED}
NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+))(?:[ED]?([-+]?\d+))?$")
Card = tuple[str, list[str], int]


def read_nastran(path: Path, content: bytes) -> RawMesh:
    """Read the surface of Nastran bulk data.

    Raises InputError, which names the line, for a card that is not supported or is damaged.
    """
    text = content.decode("latin-1")
    cards: dict[str, list[Card]] = defaultdict(list)
    left_out: Counter[str] = Counter()
    for name, fields, line in _cards(text):
        if name in GEOMETRY_CARDS:
            cards[name].append((name, fields, line))
        elif WITHOUT_SURFACE.match(name):
            left_out[name] += 1
    for name, remedy in UNSUPPORTED.items():
        if cards[name]:
            raise InputError(f"{path}: line {cards[name][0][2]}: {name} is not supported; {remedy}")
    try:
        points, row_of = _points(cards)
        mesh = ElementMesh(points, [])
        properties = _add_blocks(mesh, cards, row_of)
    except (ValueError, IndexError) as error:
        why = f"cannot be read as Nastran bulk data: {error}"
        raise InputError(f"{path}: {why}; export it again") from None
    _add_groups(mesh, properties, text)
    mesh.notes += [f"left out {n} {name}: it has no surface" for name, n in left_out.items()]
    return extract_surface(mesh)


def _cards(text: str) -> list[Card]:
    """Return the name, further fields and line number of each card, continuation lines joined."""
    lines = text.splitlines()
    starts = (k + 1 for k, line in enumerate(lines) if re.match(r"\s*BEGIN\s+BULK", line, re.I))
    start = next(starts, 0)
    cards: list[Card] = []
    for number, line in enumerate(lines[start:], start=start + 1):
        line = line.split("$")[0].rstrip()
        if line.upper().startswith("ENDDATA"):
            break
        if not line.strip():
            continue
        head, values = _fields(line)
        if head[:1] not in ("", "+", "*"):
            cards.append((head, values, number))
        elif cards:
            cards[-1][1].extend(values)
    return cards


def _fields(line: str) -> tuple[str, list[str]]:
    """Return the first field of a line, without the large format's *, and the fields after it."""
    if "," in line:
        head, *values = (value.strip() for value in line.split(","))
        count = 4 if "*" in head else 8
        values = (values + [""] * count)[:count]
    else:
        line = line.expandtabs(8)
        head, width = line[:8].strip(), 16 if "*" in line[:8] else 8
        values = [line[at : at + width].strip() for at in range(8, 72, width)]
    return (head if head[:1] in ("", "+", "*") else head.rstrip("*").strip().upper()), values


def _number(text: str, line: int, what: str) -> float:
    """Return the value of a number such as 1.5, 1.5E-3, 1.5D-3 or Nastran's 1.5-3.

    A blank means 0. `line` and `what` are line number and meaning of the number in messages.
    """
    if not text:
        return 0.0
    found = NUMBER.match(text.upper())
    if not found:
        raise ValueError(f"line {line}: {what} is {text!r}, which is not a number")
    return float(f"{found[1]}e{found[2] or 0}")


def _whole(text: str, line: int, what: str) -> int:
    if not re.fullmatch(r"\d*", text):
        raise ValueError(f"line {line}: {what} is {text!r}, which is not a whole number")
    return int(text or 0)


def _points(cards: dict[str, list[Card]]) -> tuple[np.ndarray, dict[int, int]]:
    """Return the points (n, 3) of all GRID cards, and the row of each by its GRID number.

    The points are in Nastran's basic coordinate system.
    """
    systems = {
        _whole(fields[0], line, f"{name}'s number"): (name, fields, line)
        for system in SYSTEMS
        for name, fields, line in cards[system]
    }
    row_of: dict[int, int] = {}
    points = np.zeros((len(cards["GRID"]), 3))
    rows_of_system: dict[int, list[int]] = defaultdict(list)
    for row, (_, fields, line) in enumerate(cards["GRID"]):
        number = _whole(fields[0], line, "GRID's number")
        points[row] = [_number(text, line, "a GRID coordinate") for text in fields[2:5]]
        if (points[row] != points[row_of.setdefault(number, row)]).any():
            raise ValueError(
                f"line {line}: GRID {number} is given twice, at two places; give each number once"
            )
        if fields[1] not in ("", "0"):
            rows_of_system[_whole(fields[1], line, "GRID's coordinate system")].append(row)
    for system, rows in rows_of_system.items():
        points[rows] = _to_basic(systems, system, points[rows])
    return points, row_of


def _to_basic(
    systems: dict[int, Card], number: int, points: np.ndarray, above: tuple[int, ...] = ()
) -> np.ndarray:
    """Return points (n, 3) of a coordinate system in the basic coordinate system.

    A card CORD2R, CORD2C or CORD2S gives the origin A, a point B on the z axis and a point C in
    the xz plane, perhaps in another system.

    Args:
        systems: cards by the number of their system.
        number: number of the system.
        above: numbers of the systems that refer to this system.
    """
    if number == 0:
        return points
    if number in above or number not in systems:
        remedy = "export it along with the mesh"
        raise ValueError(f"coordinate system {number} is not defined; {remedy}")
    name, fields, line = systems[number]
    parent = _whole(fields[1], line, "the reference system")
    frame = np.array([_number(text, line, "a coordinate") for text in fields[2:11]]).reshape(3, 3)
    a, b, c = _to_basic(systems, parent, frame, (*above, number))
    z = (b - a) / np.linalg.norm(b - a)
    y = np.cross(z, c - a)
    y /= np.linalg.norm(y)
    if name != "CORD2R":
        radius, theta, height = points[:, 0], np.radians(points[:, 1]), points[:, 2]
        if name == "CORD2S":  # spherical coordinates: r, theta from z, phi
            radius, height = radius * np.sin(theta), radius * np.cos(theta)
            theta = np.radians(points[:, 2])
        points = np.stack([radius * np.cos(theta), radius * np.sin(theta), height], axis=1)
    return np.asarray(a + points @ np.array([np.cross(y, z), y, z]))


def _add_blocks(
    mesh: ElementMesh, cards: dict[str, list[Card]], row_of: dict[int, int]
) -> np.ndarray:
    """Add the elements of all cards to the mesh, and return the property number (e,) of each.

    Elements from cards of one name keep the file's order.

    Args:
        row_of: row of each point by its GRID number.
    """
    numbers: list[int] = []
    properties: list[int] = []
    for card, kind in KINDS.items():
        corners, size = CORNERS[kind], CORNERS[kind] + len(EDGES[kind])
        nodes = np.full((len(cards[card]), size), NONE)
        for row, (_, fields, line) in enumerate(cards[card]):
            number = _whole(fields[0], line, f"{card}'s number")
            numbers.append(number)
            properties.append(_whole(fields[1], line, f"{card}'s property") or number)
            count = corners if card.endswith(("3", "4", "R")) else size
            for column, text in enumerate(fields[2 : 2 + count]):
                grid = _whole(text, line, f"a grid of {card}")
                if grid and grid not in row_of:
                    raise ValueError(
                        f"line {line}: {card} {number} names grid {grid}, which is not there"
                    )
                nodes[row, column] = row_of[grid] if grid else NONE
            if (nodes[row, :corners] == NONE).any():
                raise ValueError(f"line {line}: {card} {number} has fewer than {corners} corners")
        if len(nodes):
            mesh.blocks.append(Block(kind, nodes[:, REORDERED.get(kind, range(size))]))
    mesh.numbers = np.array(numbers, dtype=np.int64)
    return np.array(properties, dtype=np.int64)


def _add_groups(mesh: ElementMesh, properties: np.ndarray, text: str) -> None:
    """Add a set of elements to the mesh for each property, by number and name, and each SET."""
    names = _property_names(text)
    for number in np.unique(properties).tolist():
        members = np.flatnonzero(properties == number)
        mesh.element_sets[f"PID {number}"] = members
        if number in names:
            mesh.element_sets[names[number]] = members
    for number, ranges in _sets(text).items():
        members = np.zeros(len(mesh.numbers), dtype=bool)
        for first, last in ranges:
            members |= (first <= mesh.numbers) & (mesh.numbers <= last)
        mesh.element_sets[f"SET {number}"] = np.flatnonzero(members)


def _property_names(text: str) -> dict[int, str]:
    """Return the names of properties by number, from comments of HyperMesh, ANSA, Patran, Femap."""
    names = {}
    for pattern in (
        r"^\$HMNAME (?:PROP|COMP)\s+(?P<number>\d+)\s*\"(?P<name>[^\"]+)\"",
        r"^\$ANSA_NAME(?:_COMMENT)?;(?P<number>\d+);P\w+;(?P<name>[^;\n\r]+)",
        r"^\$ Elements and Element Properties for region : "
        r"(?P<name>[^\n\r]+)\s+P\w+\s+(?P<number>\d+)",
        r"^\$ Femap(?: with NX Nastran)? Property (?P<number>\d+) : (?P<name>[^\n\r]+)",
    ):
        for found in re.finditer(pattern, text, re.M):
            names[int(found["number"])] = found["name"].strip()
    return names


def _sets(text: str) -> dict[int, list[tuple[int, int]]]:
    """Return the ranges of elements, first and last, of each set such as SET 4 = 1, 10 THRU 20."""
    sets = {}
    for found in re.finditer(r"^\s*SET\s+(\d+)\s*=((?:[^\n,]*,\s*\n?)*[^\n]*)", text, re.M | re.I):
        ranges = re.findall(r"(\d+)(?:\s+THRU\s+(\d+))?", found[2], re.I)
        sets[int(found[1])] = [(int(first), int(last or first)) for first, last in ranges]
    return sets
