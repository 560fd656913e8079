"""Read Abaqus input files with shells, solids, parts and instances.

Sets and surfaces of the file become groups of triangles.

The reader never ignores an unsupported keyword that makes or moves nodes or elements. It refuses
the file and names the keyword.

Source: Abaqus Keywords Reference Guide.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.limits import require_few
from chamberopt.geometry.meshes.elements import CORNERS, EDGES, Block, ElementMesh, extract_surface
from chamberopt.geometry.meshes.raw_mesh import RawMesh

UNSUPPORTED = (
    "INCLUDE", "SYSTEM", "NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY",
    "SUBSTRUCTURE GENERATE",
)  # fmt: skip
# STRI65 has six nodes. The last 5 of its name counts its degrees of freedom.
SHELL = re.compile(r"(?:STRI|SFM3D|M3D|R3D|CPS|CPE|DS|S)(3|4|6|8|9)\D*5?$")
SOLID = re.compile(r"(?:AC3D|DC3D|C3D)(4|5|6|8|10|13|15|20)\D*$")
WITHOUT_SURFACE = re.compile(
    r"(B\d|PIPE|T[23]D|MASS|ROTARYI|SPRING|DASHPOT|CONN|GAP|JOINT|DCOUP|RB3D|RAX)"
)
SHELL_KIND = {3: "triangle", 6: "triangle", 4: "quad", 8: "quad", 9: "quad"}
SOLID_KIND = {
    4: "tetra", 10: "tetra", 5: "pyramid", 13: "pyramid", 6: "wedge", 15: "wedge",
    8: "hexahedron", 20: "hexahedron",
}  # fmt: skip
MAX_LABEL = 999_999_999  # the largest number of an element that Abaqus takes
Options = dict[str, str]
# instance that a set names ("" for any), and element or node numbers in it
Member = tuple[str, range]
# members in their order, each once, because sets may name one another many times
Members = dict[Member, None]
Place = tuple[int, int]  # position of a placed scope, and the file's number in it
NO_ROWS = np.zeros(0, dtype=np.int64)
_FindRows = Callable[[Iterable[Member]], np.ndarray]


@dataclass
class _Scope:
    """Nodes, elements and sets of one *PART of the file, or of the file outside of all parts."""

    nodes: dict[int, list[float]] = field(default_factory=dict)
    elements: dict[int, tuple[str, list[int]]] = field(default_factory=dict)
    element_sets: dict[str, Members] = field(default_factory=lambda: defaultdict(dict))
    node_sets: dict[str, Members] = field(default_factory=lambda: defaultdict(dict))
    surfaces: dict[str, list[tuple[str, str]]] = field(default_factory=lambda: defaultdict(list))


class _Instance(NamedTuple):
    part: str
    lines: list[list[float]]

    def place(self, points: np.ndarray) -> np.ndarray:
        """Return a part's points (n, 3), moved and turned as this instance of the part is.

        The first data line of *INSTANCE moves the points. The second then turns them about an axis
        through two points.
        """
        if self.lines:
            points = points + np.array((self.lines[0] + [0.0] * 3)[:3])
        if len(self.lines) > 1:
            line = self.lines[1]
            a, b, degrees = np.array(line[:3]), np.array(line[3:6]), line[6]
            axis = (b - a) / np.linalg.norm(b - a)
            angle, arm = np.radians(degrees), points - a
            along = np.outer(arm @ axis, axis)  # Rodrigues' formula
            points = a + along + np.cos(angle) * (arm - along) + np.sin(angle) * np.cross(axis, arm)
        return points


def read_abaqus(path: Path, content: bytes) -> RawMesh:
    """Read the surface of an Abaqus input file.

    Raises InputError, which names the line, for a keyword that is not supported or is damaged.
    """
    return extract_surface(read_elements(path, content))


def read_elements(path: Path, content: bytes, only: Sequence[str] = ()) -> ElementMesh:
    """Read the elements of an Abaqus input file, with the nodes and sets of all its instances.

    Args:
        only: types of elements with a surface that the file may have, e.g. "C3D4"; none for all
            that are known.
    Raises:
        InputError: for a keyword that is not supported or is damaged, with its line.
    """
    scopes, instances, notes = _read_scopes(path, content.decode("utf-8", errors="replace"), only)
    try:
        placed = [scopes[instance.part] for instance in instances.values()]
        count = sum(len(scope.nodes) + len(scope.elements) for scope in placed)
        require_few(path, count, "nodes and elements in all instances")
        return _assemble(scopes, instances, notes)
    except KeyError as error:
        why = f"names {error.args[0]}, which is not there"
        raise InputError(f"{path}: {why}; export the whole model") from None


def _keywords(text: str) -> list[tuple[str, Options, list[str], int]]:
    """Return the blocks of a file: keyword, options, data lines and line number of each."""
    blocks: list[tuple[str, Options, list[str], int]] = []
    continued = False
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.strip()
        if not line or line.startswith("**"):
            continue
        words = line.split(",")
        if line.startswith("*") and not continued:
            keyword = words.pop(0)[1:].partition("=")[0].strip().upper()
            blocks.append((re.sub(r"\s+", " ", keyword), {}, [], number))
        elif not continued:
            if blocks:
                blocks[-1][2].append(line)
            continue
        for word in filter(str.strip, words):
            name, _, value = word.partition("=")
            blocks[-1][1][name.strip().upper()] = value.strip().strip('"')
        continued = line.endswith(",")
    return blocks


def _read_scopes(
    path: Path, text: str, only: Sequence[str]
) -> tuple[dict[str, _Scope], dict[str, _Instance], list[str]]:
    """Return the parts and the instances of a file by upper-case name, and notes for the user.

    Nodes, elements and sets outside of all parts are under the name "".

    Args:
        only: types of elements that the file may have, as in `read_elements`.
    """
    scopes, instances, left_out = {"": _Scope()}, {}, Counter[str]()
    current = ""
    for keyword, options, data, line in _keywords(text):
        scope = scopes[current]
        try:
            if keyword in UNSUPPORTED:
                raise ValueError(f"*{keyword} is not supported; write the model out flat")
            if keyword == "PART":
                current = options["NAME"].upper()
                scopes[current] = _Scope()
            elif keyword == "END PART":
                current = ""
            elif keyword == "INSTANCE":
                rows = [[float(value) for value in row.split(",") if value.strip()] for row in data]
                instances[options["NAME"].upper()] = _Instance(options["PART"].upper(), rows)
            elif keyword == "NODE":
                _add_nodes(scope, options, data)
            elif keyword == "ELEMENT":
                _add_elements(scope, options, data, left_out, only)
            elif keyword in ("ELSET", "NSET"):
                sets = scope.element_sets if keyword == "ELSET" else scope.node_sets
                sets[options[keyword]] |= _members(options, data, sets)
            elif keyword == "SURFACE" and options.get("TYPE", "ELEMENT").upper() == "ELEMENT":
                for row in data:
                    of, _, face = row.partition(",")
                    member = of.strip().rpartition(".")[2].strip('"')  # part-1.top -> top
                    scope.surfaces[options["NAME"]].append((member, face.strip().upper()))
        except (ValueError, KeyError, IndexError) as error:
            reason = f"lacks {error.args[0]}=" if isinstance(error, KeyError) else str(error)
            where = f"line {line}: *{keyword}"
            raise InputError(f"{path}: {where}: {reason}; export it again") from None
    notes = [f"left out {count} {kind}: it has no surface" for kind, count in left_out.items()]
    return scopes, instances, notes


def _add_nodes(scope: _Scope, options: Options, data: list[str]) -> None:
    if options.get("SYSTEM", "R").upper() != "R":
        raise ValueError(
            "cylindrical and spherical coordinates are not supported; write rectangular ones"
        )
    for row in data:
        number, *values = row.split(",")
        point = [float(value) if value.strip() else 0.0 for value in [*values, "", ""][:3]]
        scope.nodes[int(number)] = point
        if "NSET" in options:
            scope.node_sets[options["NSET"]][_one("", number)] = None


def _add_elements(
    scope: _Scope, options: Options, data: list[str], left_out: Counter[str], only: Sequence[str]
) -> None:
    name = options["TYPE"].upper()
    if WITHOUT_SURFACE.match(name):
        left_out[name] += len(data)
        return
    if only and name not in only:
        raise ValueError(
            f"type={name} is not supported here; leave it out, and use {' or '.join(only)}"
        )
    if found := SHELL.match(name):
        kind = SHELL_KIND[int(found[1])]
    elif found := SOLID.match(name):
        kind = SOLID_KIND[int(found[1])]
    else:
        raise ValueError(
            f"type={name} is not supported; use S3, S4, S8R, C3D4, C3D8, C3D10 or similar"
        )
    count = int(found[1])
    flat = [int(value) for row in data for value in row.split(",") if value.strip()]
    if len(flat) % (count + 1):
        raise ValueError(
            f"type={name} has {count} nodes, and the data are no whole number of elements"
        )
    for at in range(0, len(flat), count + 1):
        number, *nodes = flat[at : at + count + 1]
        if not 0 < number <= MAX_LABEL:
            raise ValueError(f"element {number}: allowed are numbers from 1 to {MAX_LABEL}")
        scope.elements[number] = kind, nodes[: CORNERS[kind] + len(EDGES[kind])]
        if "ELSET" in options:
            scope.element_sets[options["ELSET"]][_one("", number)] = None


def _one(instance: str, number: int | str) -> Member:
    return instance, range(int(number), int(number) + 1)


def _members(options: Options, data: list[str], sets: dict[str, Members]) -> Members:
    """Return the elements or nodes that an *ELSET or *NSET lists, generates, or takes from a set.

    Args:
        sets: members of the sets read so far, by name.
    """
    members: Members = {}
    instance = options.get("INSTANCE", "").upper()
    by_upper = {name.upper(): name for name in sets}
    for row in data:
        words = [word.strip() for word in row.split(",") if word.strip()]
        if "GENERATE" in options:
            first, last, step = (*map(int, words), 1)[:3]
            members[instance, range(first, last + 1, step)] = None
            continue
        for word in words:
            of, _, name = word.rpartition(".")
            if name.isdigit():
                members[_one(of.upper() or instance, name)] = None
            else:
                members |= sets[by_upper[name.upper()]]
    return members


def _assemble(
    scopes: dict[str, _Scope], instances: dict[str, _Instance], notes: list[str]
) -> ElementMesh:
    """Return one mesh of all instances or, in a file without instances, of everything in it.

    Elements keep the file's numbers. If several instances have elements, whose numbers may be the
    same, each element gets its position in the mesh as its number.
    """
    placed = [(scopes[instance.part], instance) for instance in instances.values()]
    placed += [
        (scope, _Instance("", [])) for name, scope in scopes.items() if not (name and instances)
    ]
    points: list[np.ndarray] = [np.zeros((0, 3))]
    blocks: dict[tuple[str, int], dict[Place, list[int]]] = defaultdict(dict)
    row_of: dict[Place, int] = {}  # row of each node in the points
    for at, (scope, instance) in enumerate(placed):
        before = len(row_of)
        row_of.update({(at, number): before + k for k, number in enumerate(scope.nodes)})
        if scope.nodes:
            points.append(instance.place(np.array(list(scope.nodes.values()))))
        for number, (kind, nodes) in scope.elements.items():
            for node in nodes:
                if (at, node) not in row_of:
                    raise KeyError(f"node {node} in element {number}")
            blocks[kind, len(nodes)][at, number] = [row_of[at, node] for node in nodes]
    places = [place for rows in blocks.values() for place in rows]
    element_of = {place: k for k, place in enumerate(places)}
    names = list(instances)
    own = len({at for at, _ in places}) < 2 and len(names) < 2
    mesh = ElementMesh(
        np.concatenate(points),
        [Block(kind, np.array(list(rows.values()))) for (kind, _), rows in blocks.items()],
        np.array([n for _, n in places] if own else range(1, len(places) + 1), dtype=np.int64),
        own,
        instance=names[0] if len(names) == 1 else "",
        notes=notes,
    )
    for at, (scope, _) in enumerate(placed):
        # A set outside of parts means the instance that it names, or every instance.
        anywhere = [at] if scope.elements or scope.nodes else list(range(len(names) + 1))

        def find(
            row_of: dict[Place, int], members: Iterable[Member], anywhere: list[int] = anywhere
        ) -> np.ndarray:
            found: list[int] = []
            for name, numbers in members:
                where = [names.index(name)] if name in names else anywhere
                if len(numbers) == 1:
                    places = [(which, numbers[0]) for which in where]
                    found += [row_of[place] for place in places if place in row_of]
                else:  # a range may have far more numbers than the file
                    within = (place for place in row_of if place[1] in numbers)
                    found += [row_of[place] for place in within if place[0] in where]
            return np.array(found, dtype=np.int64)

        _add_groups(mesh, scope, partial(find, element_of), partial(find, row_of))
    return mesh


def _add_groups(mesh: ElementMesh, scope: _Scope, elements: _FindRows, nodes: _FindRows) -> None:
    """Add the sets and surfaces of a part of the file to the mesh.

    Args:
        elements, nodes: functions that return the rows, in the mesh, of the members of a set.
    """
    for name, members in scope.element_sets.items():
        mesh.element_sets[name] = np.r_[mesh.element_sets.get(name, NO_ROWS), elements(members)]
    for name, members in scope.node_sets.items():
        mesh.node_sets[name] = np.r_[mesh.node_sets.get(name, NO_ROWS), nodes(members)]
    for name, faces in scope.surfaces.items():
        rows, sides = mesh.face_sets.get(name, (NO_ROWS, NO_ROWS))
        for of, face in faces:
            if of.isdigit() or of in scope.element_sets:
                more = elements([_one("", of)] if of.isdigit() else scope.element_sets[of])
            elif of in mesh.element_sets:
                more = mesh.element_sets[of]
            else:
                raise KeyError(f"the element set {of}")
            # SPOS, SNEG and "" are the shell itself.
            side = int(face[1:]) - 1 if re.fullmatch(r"S\d", face) else 0
            rows, sides = np.r_[rows, more], np.r_[sides, np.full(len(more), side)]
        mesh.face_sets[name] = rows, sides
