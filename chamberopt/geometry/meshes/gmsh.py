"""Read Gmsh's .msh files of versions 2.2 and 4.1, text and binary.

Physical groups of the file become groups of triangles. Text and binary files hold the same numbers
in the same order, so that one reader serves both. It asks a stream, which hides the difference, for
the next integers or reals.

Source: Gmsh reference manual, sections "MSH file format" and "Node ordering".
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.elements import (
    CORNERS,
    EDGES,
    SHELLS,
    Block,
    ElementMesh,
    extract_surface,
)
from chamberopt.geometry.meshes.raw_mesh import RawMesh

# Kind and number of nodes by Gmsh's number of an element type.
TYPES = {
    2: ("triangle", 3), 9: ("triangle", 6), 3: ("quad", 4), 16: ("quad", 8), 10: ("quad", 9),
    4: ("tetra", 4), 11: ("tetra", 10), 7: ("pyramid", 5), 19: ("pyramid", 13),
    14: ("pyramid", 14), 6: ("wedge", 6), 18: ("wedge", 15), 13: ("wedge", 18),
    5: ("hexahedron", 8), 17: ("hexahedron", 20), 12: ("hexahedron", 27),
}  # fmt: skip
WITHOUT_SURFACE = {15: 1, 1: 2, 8: 3, 26: 4, 27: 5}  # number of nodes of points and lines
# Order of mid-edge nodes of the kinds for which Gmsh's order differs from `elements.EDGES`.
MIDS = {
    "tetra": ((0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)),
    "pyramid": ((0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)),
    "wedge": ((0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)),
    "hexahedron": (
        (0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3),
        (2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7),
    ),
}  # fmt: skip
PHYSICAL = re.compile(rb"^\s*(\d)\s+(-?\d+)\s+\"([^\"]*)\"", re.M)


class _Stream:
    """Numbers of one section of a file, stored as text or as bytes, and taken one after another."""

    def __init__(self, path: Path, section: bytes, text: bool, order: str) -> None:
        self.path, self.text, self.order, self.at = path, text, order, 0
        self.tokens = np.array(section.split()) if text else np.zeros(0)
        self.bytes = section

    def ints(self, count: int) -> np.ndarray:
        return self._take(count, "i4")

    def sizes(self, count: int) -> np.ndarray:
        return self._take(count, "u8").astype(np.int64)

    def reals(self, count: int) -> np.ndarray:
        return self._take(count, "f8")

    def one_size(self) -> int:
        return int(self.sizes(1)[0])

    def text_size(self) -> int:
        """Return the next number, a count that is text even in binary files."""
        if self.text:
            return self.one_size()
        line, _, self.bytes = self.bytes.partition(b"\n")
        return int(line)

    def numbered_points(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the next `count` nodes: their numbers (count,) and points (count, 3)."""
        if self.text:
            rows = self.reals(4 * count).reshape(count, 4)
            return rows[:, 0].astype(np.int64), rows[:, 1:]
        kind = np.dtype([("number", self.order + "i4"), ("point", self.order + "f8", 3)])
        records = np.frombuffer(self.bytes[self.at : self.at + count * kind.itemsize], dtype=kind)
        return records["number"].astype(np.int64), records["point"]

    def _take(self, count: int, kind: str) -> np.ndarray:
        if self.text:
            taken = self.tokens[self.at : self.at + count]
            taken = taken.astype(np.float64 if kind == "f8" else np.int64)
            self.at += count
        else:
            size = count * int(kind[1])
            taken = np.frombuffer(self.bytes[self.at : self.at + size], dtype=self.order + kind)
            self.at += size
        if len(taken) < count or count < 0:
            raise InputError(f"{self.path}: truncated or damaged; export or copy it again")
        return taken


class _GmshMesh(NamedTuple):
    """Nodes and elements of a file, with the numbers that Gmsh gave them."""

    numbers: list[np.ndarray]
    points: list[np.ndarray]
    # Gmsh's element type, rows (k, 1 + p) of element numbers and nodes, and physical groups
    batches: list[tuple[int, np.ndarray, tuple[int, ...]]]


def read_gmsh(path: Path, content: bytes) -> RawMesh:
    """Read the surface of a Gmsh .msh file.

    Raises InputError for other versions of the format and for elements that are not supported.
    """
    found = re.match(
        rb"\s*\$MeshFormat\s+([\d.]+)\s+([01])\s+(\d+)[ \t]*\r?\n?(.{0,4})", content, re.S
    )
    if not found or found[1] not in (b"2.2", b"2", b"4.1"):
        version = f"version {found[1].decode() if found else '?'} of Gmsh's format"
        raise InputError(f"{path}: {version} is not supported; save as 4.1 or 2.2")
    text, order = found[2] == b"0", "<" if found[4][:1] == b"\x01" else ">"
    streams = {
        name: _Stream(path, body, text, order) for name, body in _sections(path, content).items()
    }
    mesh = (_read_version_2 if found[1][:1] == b"2" else _read_version_4)(streams)
    names = content.partition(b"$PhysicalNames")[2].partition(b"$EndPhysicalNames")[0]
    name_of = {
        (int(dimension), int(group)): name.decode("utf-8", "replace")
        for dimension, group, name in PHYSICAL.findall(names)
    }
    return extract_surface(_element_mesh(path, mesh, name_of))


def _sections(path: Path, content: bytes) -> dict[str, bytes]:
    sections = {}
    for name in ("Entities", "Nodes", "Elements"):
        start = content.find(f"${name}".encode())
        end = content.rfind(f"$End{name}".encode())
        if start >= 0 and end < 0:
            why = f"${name} has no $End{name}"
            raise InputError(f"{path}: truncated: {why}; export or copy it again")
        if start >= 0:
            sections[name] = content[start:end].partition(b"\n")[2]
        elif name != "Entities":
            raise InputError(f"{path}: holds no ${name}; mesh it and save it again")
    return sections


def _read_version_2(streams: dict[str, _Stream]) -> _GmshMesh:
    nodes, elements = streams["Nodes"], streams["Elements"]
    numbers, points = nodes.numbered_points(nodes.text_size())
    left = elements.text_size()
    rows: dict[tuple[int, tuple[int, ...]], list[np.ndarray]] = {}
    while left > 0:
        if elements.text:
            number, kind, tags = elements.ints(3).tolist()
            count = 1
        else:
            kind, count, tags = elements.ints(3).tolist()
        for _ in range(count):
            if not elements.text:
                number = int(elements.ints(1)[0])
            physical = tuple(elements.ints(tags)[:1].tolist())
            nodes_of = elements.ints(_node_count(elements.path, kind))
            rows.setdefault((kind, physical), []).append(np.r_[number, nodes_of])
        left -= count
    batches = [(kind, np.array(own), physical) for (kind, physical), own in rows.items()]
    return _GmshMesh([numbers], [points], batches)


def _read_version_4(streams: dict[str, _Stream]) -> _GmshMesh:
    mesh = _GmshMesh([], [], [])
    physical: dict[tuple[int, int], tuple[int, ...]] = {}
    if "Entities" in streams:
        entities = streams["Entities"]
        for dimension, count in enumerate(entities.sizes(4).tolist()):
            for _ in range(count):
                tag = int(entities.ints(1)[0])
                entities.reals(3 if dimension == 0 else 6)  # bounding box
                physical[dimension, tag] = tuple(entities.ints(entities.one_size()).tolist())
                if dimension > 0:
                    entities.ints(entities.one_size())  # bounding entities
    nodes, elements = streams["Nodes"], streams["Elements"]
    for _ in range(int(nodes.sizes(4)[0])):
        dimension, _, parametric = nodes.ints(3).tolist()
        count = nodes.one_size()
        mesh.numbers.append(nodes.sizes(count))
        width = 3 + (dimension if parametric else 0)
        mesh.points.append(nodes.reals(width * count).reshape(count, width)[:, :3])
    for _ in range(int(elements.sizes(4)[0])):
        dimension, tag, kind = elements.ints(3).tolist()
        count, width = elements.one_size(), _node_count(elements.path, kind) + 1
        rows = elements.sizes(count * width).reshape(count, width)
        mesh.batches.append((kind, rows, physical.get((dimension, tag), ())))
    return mesh


def _node_count(path: Path, kind: int) -> int:
    if kind in WITHOUT_SURFACE:
        return WITHOUT_SURFACE[kind]
    if kind in TYPES:
        return TYPES[kind][1]
    what = f"elements of Gmsh's type {kind}"
    raise InputError(f"{path}: {what} are not supported; mesh with order 1 or 2")


def _element_mesh(path: Path, mesh: _GmshMesh, name_of: dict[tuple[int, int], str]) -> ElementMesh:
    """Return the shells and solids of a file, with each physical group as a set of elements.

    Points and lines are left out. The group number 0 means no group.

    Args:
        name_of: name of each group by its dimension and number.
    """
    numbers = np.concatenate([np.zeros(0, dtype=np.int64), *mesh.numbers])
    points = np.concatenate([np.zeros((0, 3)), *(point.reshape(-1, 3) for point in mesh.points)])
    by_number = np.argsort(numbers, kind="stable")
    result = ElementMesh(points, [])
    own = [np.zeros(0, dtype=np.int64)]
    members: dict[str, list[np.ndarray]] = {}
    for kind, rows, groups in mesh.batches:
        if kind in WITHOUT_SURFACE or not len(rows):
            continue
        nodes, first = rows[:, 1:], sum(map(len, own))
        own.append(rows[:, 0])
        place = np.searchsorted(numbers, nodes, sorter=by_number)
        at = by_number[np.minimum(place, len(numbers) - 1)]
        if not np.array_equal(numbers[at], nodes):
            raise InputError(f"{path}: an element names a node that is not there; export it again")
        name = TYPES[kind][0]
        result.blocks.append(Block(name, _reorder(name, at)))
        for group in filter(None, groups):
            group_name = name_of.get((2 if name in SHELLS else 3, group), f"physical {group}")
            members.setdefault(group_name, []).append(first + np.arange(len(rows)))
    result.numbers = np.concatenate(own)
    result.element_sets = {name: np.concatenate(parts) for name, parts in members.items()}
    return result


def _reorder(kind: str, nodes: np.ndarray) -> np.ndarray:
    """Return the nodes of elements with mid-edge nodes in the order of EDGES instead of Gmsh's."""
    corners = CORNERS[kind]
    if kind not in MIDS or nodes.shape[1] == corners:
        return nodes
    at = {frozenset(edge): corners + k for k, edge in enumerate(MIDS[kind])}
    return nodes[:, [*range(corners), *(at[frozenset(edge)] for edge in EDGES[kind])]]
