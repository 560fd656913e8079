"""A box, and other solids, as files of every mesh format."""

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.triangles import areas, tetrahedron_volumes

SIDES = (20.0, 30.0, 40.0)


# A box's corners in the order of a hexahedral element, and its faces, outward; the one at z = 40
# comes first.
CORNERS = np.array(
    [[x, y, z] for z in (0, 40) for x, y in ((0, 0), (20, 0), (20, 30), (0, 30))], dtype=float
)


TOP, BOTTOM = (4, 5, 6, 7), (0, 3, 2, 1)


QUADS = (TOP, BOTTOM, (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


TOP_AREA = 600e-6


def volume(part: PartMesh) -> float:
    return float(tetrahedron_volumes(part.vertices, part.triangles).sum())


def named_area(part: PartMesh, name: str) -> float:
    return float(areas(part.vertices, part.triangles)[part.groups[name]].sum())


def assert_box(part: PartMesh) -> None:
    assert np.sort(part.size) == pytest.approx([0.02, 0.03, 0.04], rel=1e-6)
    assert volume(part) == pytest.approx(24e-6, rel=1e-6)
    assert all("inside out" not in note and "against" not in note for note in part.notes)


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


OBJ_HEAD = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)


def obj_face(quad: tuple[int, ...], shift: int = 1) -> str:
    return "f " + " ".join(f"{k + shift}/1" for k in quad) + "\n"


def step_of_a_box(unit: str, heights: tuple[float, ...] = (0.0,)) -> str:
    """A box, or several at heights, as faceted_breps of ISO 10303-42: points, loops, planes."""
    lines: list[str] = []

    def put(text: str) -> int:
        lines.append(f"#{len(lines) + 1}={text};")
        return len(lines)

    def references(numbers: Iterable[int]) -> str:
        return ",".join(f"#{number}" for number in numbers)

    length = put(unit)
    angle = put("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
    solid = put("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
    context = put(
        f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#{length},#{angle},#{solid}))"
        "REPRESENTATION_CONTEXT('',''))"
    )
    breps = []
    for height in heights:
        points = [
            put(f"CARTESIAN_POINT('',({x:.1f},{y:.1f},{z:.1f}))")
            for x, y, z in CORNERS + np.array([0, 0, height])
        ]
        faces = []
        for quad in QUADS:
            loop = put(f"POLY_LOOP('',({references(points[k] for k in quad)}))")
            bound = put(f"FACE_OUTER_BOUND('',#{loop},.T.)")
            along, normal = (
                CORNERS[quad[1]] - CORNERS[quad[0]],
                np.cross(*np.diff(CORNERS[list(quad[:3])], axis=0)),
            )
            z, x = (
                put(f"DIRECTION('',({x:.1f},{y:.1f},{z:.1f}))")
                for x, y, z in np.sign([normal, along])
            )
            axes = put(f"AXIS2_PLACEMENT_3D('',#{points[quad[0]]},#{z},#{x})")
            plane = put(f"PLANE('',#{axes})")
            faces.append(put(f"FACE_SURFACE('',(#{bound}),#{plane},.T.)"))
        shell = put(f"CLOSED_SHELL('',({references(faces)}))")
        breps.append(put(f"FACETED_BREP('block',#{shell})"))
    origin = put("CARTESIAN_POINT('',(0.,0.,0.))")
    z, x = put("DIRECTION('',(0.,0.,1.))"), put("DIRECTION('',(1.,0.,0.))")
    axes = put(f"AXIS2_PLACEMENT_3D('',#{origin},#{z},#{x})")
    shape = put(f"FACETED_BREP_SHAPE_REPRESENTATION('',(#{axes},{references(breps)}),#{context})")
    application = put("APPLICATION_CONTEXT('automotive design')")
    about = put(f"PRODUCT_CONTEXT('',#{application},'mechanical')")
    product = put(f"PRODUCT('block','block','',(#{about}))")
    formation = put(f"PRODUCT_DEFINITION_FORMATION('','',#{product})")
    stage = put(f"PRODUCT_DEFINITION_CONTEXT('part definition',#{application},'design')")
    definition = put(f"PRODUCT_DEFINITION('design','',#{formation},#{stage})")
    form = put(f"PRODUCT_DEFINITION_SHAPE('','',#{definition})")
    put(f"SHAPE_DEFINITION_REPRESENTATION(#{form},#{shape})")
    head = (
        "FILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n"
        "FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));"
    )
    data = "\n".join(lines)
    return f"ISO-10303-21;\nHEADER;\n{head}\nENDSEC;\nDATA;\n{data}\nENDSEC;\nEND-ISO-10303-21;\n"


def small(name: str, *fields: object) -> str:
    """A card in Nastran's small field format: 8 columns, with continuation lines."""
    words = [f"{field:<8}" for field in fields]
    lines = ["".join(words[at : at + 8]) for at in range(0, len(words), 8)]
    return f"{name:<8}" + "\n+       ".join(lines) + "\n"


def large(number: int, place: np.ndarray) -> str:
    """A GRID card as CATIA V5 writes it: fields of 16 columns, two lines."""
    x, y, z = (f"{value:<16.9g}" for value in place)
    return f"GRID*   {number:<16}{'':<16}{x}{y}*{number}\n*{number:<7}{z}\n"


def free(number: int, place: np.ndarray) -> str:
    return f"GRID,{number},,{place[0]},{place[1]},{place[2]}\n"


def exponent(number: int, place: np.ndarray) -> str:
    """A GRID card with exponents as Nastran writes them: 20.0 as 2.0+1."""
    return small(
        "GRID", number, "", *(re.sub(r"e([+-])0?", r"\1", f"{value:.1e}") for value in place)
    )


def nodes_text(points: np.ndarray) -> str:
    return "".join(f"{k + 1}, {x}, {y}, {z}\n" for k, (x, y, z) in enumerate(points))


def gmsh_2(
    points: np.ndarray, elements: list[tuple[int, tuple[int, ...], np.ndarray]], binary: bool
) -> bytes:
    """A file in Gmsh's format 2.2; elements are (type, tags, nodes from 0)."""
    ints = lambda *values: np.array(values, dtype="<i4").tobytes()  # noqa: E731
    head = f"$MeshFormat\n2.2 {int(binary)} 8\n".encode() + (ints(1) + b"\n" if binary else b"")
    head += b'$EndMeshFormat\n$PhysicalNames\n1\n2 7 "crown"\n$EndPhysicalNames\n'
    nodes, rows = b"", b""
    for number, place in enumerate(points, start=1):
        nodes += (
            ints(number) + place.astype("<f8").tobytes()
            if binary
            else f"{number} {float(place[0])!r} ".encode()
        )
        nodes += b"" if binary else f"{float(place[1])!r} {float(place[2])!r}\n".encode()
    for number, (kind, tags, row) in enumerate(elements, start=1):
        values = (*tags, *(np.asarray(row) + 1).tolist())
        plain = " ".join(map(str, (number, kind, len(tags), *values))).encode() + b"\n"
        rows += ints(kind, 1, len(tags), number, *values) if binary else plain
    counts = [f"{len(things)}\n".encode() for things in (points, elements)]
    return (
        head
        + b"$Nodes\n"
        + counts[0]
        + nodes
        + b"\n$EndNodes\n$Elements\n"
        + counts[1]
        + rows
        + b"\n$EndElements\n"
    )


GMSH_4 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
1
2 7 "crown"
$EndPhysicalNames
$Entities
0 0 2 0
1 0 0 40 20 30 40 1 7 0
2 0 0 0 20 30 40 0 0
$EndEntities
$Nodes
1 8 1 8
2 1 0 8
1
2
3
4
5
6
7
8
{points}$EndNodes
$Elements
2 6 1 6
2 1 3 1
1 5 6 7 8
2 2 3 5
{quads}$EndElements
"""


def nastran_text(cards: list[str], points: np.ndarray = CORNERS) -> str:
    grids = [f"GRID,{k},,{x:.9f},{y:.9f},{z:.9f}" for k, (x, y, z) in enumerate(points, start=1)]
    return "\n".join(["BEGIN BULK", *grids, *cards, "ENDDATA"]) + "\n"


def node_list(nodes: tuple[int, ...]) -> str:
    return ",".join(str(k + 1) for k in nodes)


def box_corners(size: float = 20.0, at: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    """Corners (12, 3, 3) of an axis-parallel box that faces outward."""
    mesh = trimesh.creation.box((size, size, size))
    return mesh.vertices[np.asarray(mesh.faces)] + np.asarray(at)


def ball_corners(subdivisions: int = 4) -> np.ndarray:
    """Corners (m, 3, 3) of a ball of radius 10."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=10.0)
    return ball.vertices[ball.faces]


def write_stl(path: Path, corners: np.ndarray) -> Path:
    record = np.zeros(len(corners), dtype=[("n", "<f4", 3), ("c", "<f4", (3, 3)), ("u", "<u2")])
    record["c"] = corners
    path.write_bytes(b"a box".ljust(80) + np.uint32(len(corners)).tobytes() + record.tobytes())
    return path


def write_ascii_stl(
    path: Path, corners: np.ndarray, digits: int = 9, end: str = "endsolid box\n"
) -> Path:
    lines = ["solid box"]
    for triangle in corners:
        lines += ["facet normal 0 0 0", " outer loop"]
        lines += [
            "  vertex " + " ".join(f"{value:.{digits}g}" for value in corner) for corner in triangle
        ]
        lines += [" endloop", "endfacet"]
    path.write_text("\n".join(lines) + "\n" + end)
    return path
