"""Abaqus input files: nodes, shells, solids, parts and instances; sets and surfaces give names.

A keyword that makes or moves nodes or elements in a way not understood here is refused by name, never passed over.
Keywords as in the Abaqus Keywords Reference Guide.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io.readers.elements import CORNERS, EDGES, Block, Elements, surface_of
from chamberopt.geometry.mesh_io.readers.raw_mesh import RawMesh

REFUSED = (
    "INCLUDE",
    "SYSTEM",
    "NGEN",
    "NFILL",
    "NCOPY",
    "NMAP",
    "ELGEN",
    "ELCOPY",
    "SUBSTRUCTURE GENERATE",
)
SHELL = re.compile(r"(?:STRI|SFM3D|M3D|R3D|CPS|CPE|DS|S)(3|4|6|8|9)\D*5?$")
STRI65 = re.compile(r"STRI65$")  # six nodes, five degrees of freedom
SOLID = re.compile(r"(?:AC3D|DC3D|C3D)(4|5|6|8|10|13|15|20)\D*$")
WITHOUT_SURFACE = re.compile(
    r"(B\d|PIPE|T[23]D|MASS|ROTARYI|SPRING|DASHPOT|CONN|GAP|JOINT|DCOUP|RB3D|RAX)"
)
SHELL_KIND = {3: "triangle", 6: "triangle", 4: "quad", 8: "quad", 9: "quad"}
SOLID_KIND = {
    4: "tetra", 10: "tetra", 5: "pyramid", 13: "pyramid", 6: "wedge", 15: "wedge", 8: "hexahedron", 20: "hexahedron",
}  # fmt: skip
Options = dict[str, str]
Member = tuple[str, int]  # the instance that a set speaks of, "" for any, and the number there


@dataclass
class _Scope:
    """What stands between *PART and *END PART, or outside of all parts: by the file's own numbers."""

    nodes: dict[int, list[float]] = field(default_factory=dict)
    elements: dict[int, tuple[str, list[int], int]] = field(default_factory=dict)
    sets: dict[str, list[Member]] = field(default_factory=lambda: defaultdict(list))
    node_sets: dict[str, list[Member]] = field(default_factory=lambda: defaultdict(list))
    faces: dict[str, list[tuple[str, str]]] = field(default_factory=lambda: defaultdict(list))


@dataclass
class _Instance:
    part: str
    lines: list[list[float]]

    def placed(self, points: np.ndarray) -> np.ndarray:
        """Moved by the first data line, then turned about the axis of the second: a, b and degrees."""
        if self.lines:
            points = points + np.array((self.lines[0] + [0.0] * 3)[:3])
        if len(self.lines) > 1:
            a, b, degrees = (
                np.array(self.lines[1][:3]),
                np.array(self.lines[1][3:6]),
                self.lines[1][6],
            )
            axis = (b - a) / np.linalg.norm(b - a)
            angle, arm = np.radians(degrees), points - a
            along = np.outer(arm @ axis, axis)  # Rodrigues' formula
            points = a + along + np.cos(angle) * (arm - along) + np.sin(angle) * np.cross(axis, arm)
        return points


def read_abaqus(path: Path, content: bytes) -> RawMesh:
    """The surface in an input file. Raises InputError with keyword and line for what is not understood."""
    scopes, instances, notes = _scopes(path, content.decode("utf-8", errors="replace"))
    try:
        return surface_of(_assembled(scopes, instances, notes))
    except KeyError as error:
        raise InputError(
            f"{path}: names {error.args[0]}, which is not there; export the whole model"
        ) from None


def _keywords(text: str) -> Iterator[tuple[str, Options, list[str], int]]:
    """Keyword, options, data lines and line number of each block; comments left out."""
    keyword, first = "", 0
    options: Options = {}
    data: list[str] = []
    continued = False
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.strip()
        if not line or line.startswith("**"):
            continue
        if line.startswith("*") or continued:
            if not continued:
                if keyword:
                    yield keyword, options, data, first
                keyword, options, data, first = "", {}, [], number
            for index, word in enumerate(line.split(",")):
                name, _, value = word.partition("=")
                if index == 0 and not continued:
                    keyword = re.sub(r"\s+", " ", name[1:].strip().upper())
                elif word.strip():
                    options[name.strip().upper()] = value.strip().strip('"')
            continued = line.endswith(",")
        else:
            data.append(line)
    if keyword:
        yield keyword, options, data, first


def _scopes(path: Path, text: str) -> tuple[dict[str, _Scope], dict[str, _Instance], list[str]]:
    """Parts by upper-case name ("" is outside of parts), instances by name, and notes."""
    scopes, instances, passed = {"": _Scope()}, {}, Counter[str]()
    now = ""
    for keyword, options, data, line in _keywords(text):
        scope = scopes[now]
        try:
            if keyword in REFUSED:
                raise ValueError(f"*{keyword} is not supported; write the model out flat")
            if keyword == "PART":
                now = options["NAME"].upper()
                scopes[now] = _Scope()
            elif keyword == "END PART":
                now = ""
            elif keyword == "INSTANCE":
                numbers = [
                    [float(value) for value in row.split(",") if value.strip()] for row in data
                ]
                instances[options["NAME"].upper()] = _Instance(options["PART"].upper(), numbers)
            elif keyword == "NODE":
                _add_nodes(scope, options, data)
            elif keyword == "ELEMENT":
                _add_elements(scope, options, data, passed)
            elif keyword in ("ELSET", "NSET"):
                sets = scope.sets if keyword == "ELSET" else scope.node_sets
                sets[options[keyword]] += _members(options, data, sets)
            elif keyword == "SURFACE" and options.get("TYPE", "ELEMENT").upper() == "ELEMENT":
                for row in data:
                    whose, _, face = row.partition(",")
                    scope.faces[options["NAME"]].append(
                        (_tail(whose.strip()), face.strip().upper())
                    )
        except (ValueError, KeyError, IndexError) as error:
            reason = f"lacks {error.args[0]}=" if isinstance(error, KeyError) else str(error)
            raise InputError(
                f"{path}: line {line}: *{keyword}: {reason}; export it again"
            ) from None
    return (
        scopes,
        instances,
        [f"left out {count} {kind}: it has no surface" for kind, count in passed.items()],
    )


def _add_nodes(scope: _Scope, options: Options, data: list[str]) -> None:
    if options.get("SYSTEM", "R").upper() != "R":
        raise ValueError(
            "cylindrical and spherical coordinates are not supported; write rectangular ones"
        )
    for row in data:
        number, *place = row.split(",")
        scope.nodes[int(number)] = [
            float(value) if value.strip() else 0.0 for value in [*place, "", ""][:3]
        ]
        if "NSET" in options:
            scope.node_sets[options["NSET"]].append(("", int(number)))


def _add_elements(scope: _Scope, options: Options, data: list[str], passed: Counter[str]) -> None:
    name = options["TYPE"].upper()
    shell, solid = SHELL.match(name), SOLID.match(name)
    if WITHOUT_SURFACE.match(name):
        passed[name] += len(data)
        return
    if STRI65.match(name):
        count, kind = 6, "triangle"
    elif shell or solid:
        count = int((shell or solid)[1])  # type: ignore[index]
        kind = SHELL_KIND[count] if shell else SOLID_KIND[count]
    else:
        raise ValueError(
            f"type={name} is not supported; use S3, S4, S8R, C3D4, C3D8, C3D10 or their like"
        )
    flat = [int(value) for row in data for value in row.split(",") if value.strip()]
    if len(flat) % (count + 1):
        raise ValueError(
            f"type={name} has {count} nodes, and the data are no whole number of elements"
        )
    for at in range(0, len(flat), count + 1):
        number, *nodes = flat[at : at + count + 1]
        scope.elements[number] = kind, nodes[: CORNERS[kind] + len(EDGES[kind])], count
        if "ELSET" in options:
            scope.sets[options["ELSET"]].append(("", number))


def _members(options: Options, data: list[str], sets: dict[str, list[Member]]) -> list[Member]:
    """What a *ELSET or *NSET lists, counts out with GENERATE, or takes over from another set."""
    members: list[Member] = []
    instance = options.get("INSTANCE", "").upper()
    by_upper = {name.upper(): name for name in sets}
    for row in data:
        words = [word.strip() for word in row.split(",") if word.strip()]
        if "GENERATE" in options:
            first, last, step = (*map(int, words), 1)[:3]
            members += [(instance, number) for number in range(first, last + 1, step)]
            continue
        for word in words:
            whose, _, name = word.rpartition(".")
            known = (
                [(whose.upper() or instance, int(name))]
                if name.isdigit()
                else sets[by_upper[name.upper()]]
            )
            members += known
    return members


def _tail(name: str) -> str:
    """part-1.top -> top: which instance a set is of is left aside."""
    return name.rpartition(".")[2].strip('"')


def _assembled(
    scopes: dict[str, _Scope], instances: dict[str, _Instance], notes: list[str]
) -> Elements:
    """All instances in one mesh; without instances, whatever the file holds."""
    placed = [(scopes[instance.part], instance) for instance in instances.values()]
    placed += [
        (scope, _Instance("", [])) for name, scope in scopes.items() if not (name and instances)
    ]
    points: list[np.ndarray] = []
    groups: dict[tuple[str, int], list[list[int]]] = defaultdict(list)
    members: dict[
        tuple[int, int], tuple[tuple[str, int], int]
    ] = {}  # (scope, number) -> block and row in it
    row_of: dict[tuple[int, int], int] = {}
    for at, (scope, instance) in enumerate(placed):
        before = len(row_of)
        row_of.update({(at, number): before + k for k, number in enumerate(scope.nodes)})
        if scope.nodes:
            points.append(instance.placed(np.array(list(scope.nodes.values()))))
        for number, (kind, nodes, _) in scope.elements.items():
            block = groups[kind, len(nodes)]
            members[at, number] = (kind, len(nodes)), len(block)
            block.append([_row(row_of, at, node, number) for node in nodes])
    starts, total = {}, 0
    for key, rows in groups.items():
        starts[key], total = total, total + len(rows)
    mesh = Elements(np.concatenate(points) if points else np.zeros((0, 3)), [], notes=notes)
    mesh.blocks = [Block(kind, np.array(rows)) for (kind, _), rows in groups.items()]
    index = {who: starts[key] + row for who, (key, row) in members.items()}
    _number(mesh, index, list(instances))
    for at, (scope, _) in enumerate(placed):
        _name(mesh, scope, at, index, row_of, list(instances))
    return mesh


def _number(mesh: Elements, index: dict[tuple[int, int], int], instances: list[str]) -> None:
    """The elements' own numbers; their places where several instances count each for itself."""
    mesh.own = len({at for at, _ in index}) < 2 and len(instances) < 2
    mesh.instance = instances[0] if len(instances) == 1 else ""
    mesh.numbers = np.arange(1, len(index) + 1)
    for (_, number), row in index.items() if mesh.own else ():
        mesh.numbers[row] = number


def _row(row_of: dict[tuple[int, int], int], at: int, node: int, element: int) -> int:
    if (at, node) not in row_of:
        raise KeyError(f"node {node} in element {element}")
    return row_of[at, node]


def _name(
    mesh: Elements,
    scope: _Scope,
    at: int,
    index: dict[tuple[int, int], int],
    row_of: dict[tuple[int, int], int],
    instances: list[str],
) -> None:
    """Adds a scope's sets and surfaces; those outside of parts speak of the instance they name, or of every one."""
    home = [at] if scope.elements or scope.nodes else list(range(len(instances) + 1))

    def found(members: list[Member], known: dict[tuple[int, int], int]) -> np.ndarray:
        places = (
            (who, n)
            for name, n in members
            for who in ([instances.index(name)] if name in instances else home)
        )
        return np.array([known[place] for place in places if place in known], dtype=np.int64)

    def joined(one: dict[str, np.ndarray], name: str, more: np.ndarray) -> None:
        one[name] = np.concatenate([one.get(name, np.zeros(0, dtype=np.int64)), more])

    for name, members in scope.sets.items():
        joined(mesh.element_sets, name, found(members, index))
    for name, members in scope.node_sets.items():
        joined(mesh.node_sets, name, found(members, row_of))
    for name, faces in scope.faces.items():
        elements, sides = mesh.face_sets.get(
            name, (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))
        )
        for whose, face in faces:
            if whose.isdigit():
                more = found([("", int(whose))], index)
            elif whose in scope.sets:
                more = found(scope.sets[whose], index)
            elif whose in mesh.element_sets:
                more = mesh.element_sets[whose]
            else:
                raise KeyError(f"the element set {whose}")
            side = (
                int(face[1:]) - 1 if re.fullmatch(r"S\d", face) else 0
            )  # SPOS, SNEG, "": the shell itself
            elements, sides = np.r_[elements, more], np.r_[sides, np.full(len(more), side)]
        mesh.face_sets[name] = elements, sides
