"""Every format of docs/parts.md, on a file of its own: the same solid arrives, and the names that its file gives."""

import re
import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io import MESH_FORMATS, PartMesh, read_part
from chamberopt.geometry.triangles import areas, tetrahedron_volumes

SIDES = (20.0, 30.0, 40.0)
# A box's corners in the order of a hexahedral element, and its faces, outward, the one at z = 40 first.
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


def test_a_text_stls_solids_are_named(tmp_path: Path) -> None:
    text = ""
    for name, quads in (("crown", QUADS[:1]), ("rest", QUADS[1:])):
        text += f"solid {name}\n"
        for a, b, c, d in quads:
            for triangle in ((a, b, c), (a, c, d)):
                rows = "".join(f"   vertex {x} {y} {z}\n" for x, y, z in CORNERS[list(triangle)])
                text += f" facet normal 0 0 0\n  outer loop\n{rows}  endloop\n endfacet\n"
        text += f"endsolid {name}\n"

    part = read_part(written(tmp_path / "box.stl", text), "mm")

    assert_box(part)
    assert named_area(part, "crown") == pytest.approx(TOP_AREA)


OBJ_HEAD = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)


def obj_face(quad: tuple[int, ...], shift: int = 1) -> str:
    return "f " + " ".join(f"{k + shift}/1" for k in quad) + "\n"


def test_an_objs_quadrilaterals_groups_and_materials(tmp_path: Path) -> None:
    rest = "".join(obj_face(quad, shift=-8) for quad in QUADS[1:])  # counted from the last vertex
    text = (
        OBJ_HEAD + "g crown upper\nusemtl red steel\n" + obj_face(TOP) + "g\nusemtl grey\n" + rest
    )

    part = read_part(written(tmp_path / "box.obj", text), "mm")

    assert_box(part)
    for name in ("crown", "upper", "red steel"):
        assert named_area(part, name) == pytest.approx(TOP_AREA)
    assert part.groups["grey"].sum() == 10


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
@pytest.mark.parametrize("painted", ["faces", "corners"])
def test_a_painted_ply_names_its_colours(tmp_path: Path, encoding: str, painted: str) -> None:
    box = trimesh.creation.box(SIDES)
    top = box.face_normals[:, 2] > 0.5
    if painted == "faces":
        box.visual.face_colors = np.where(
            top[:, None], [255, 0, 0, 255], [200, 200, 200, 255]
        ).astype(np.uint8)
    else:
        upper = box.vertices[:, 2] > 0
        box.visual.vertex_colors = np.where(
            upper[:, None], [255, 0, 0, 255], [200, 200, 200, 255]
        ).astype(np.uint8)
    box.export(tmp_path / "box.ply", encoding=encoding)

    part = read_part(tmp_path / "box.ply", "mm")

    assert_box(part)
    assert named_area(part, "#ff0000") == pytest.approx(TOP_AREA)
    assert part.groups["#c8c8c8"].sum() == (10 if painted == "faces" else 2)


def test_a_3mf_names_its_objects_and_states_its_unit(tmp_path: Path) -> None:
    pytest.importorskip("lxml")
    path, inches = tmp_path / "box.3mf", tmp_path / "inches.3mf"
    left, right = trimesh.creation.box(SIDES), trimesh.creation.box(SIDES)
    right.apply_translation([50, 0, 0])
    trimesh.Scene({"left": left, "right": right}).export(path)
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(inches, "w") as new:
        for name in old.namelist():
            new.writestr(name, re.sub(rb'unit="\w+"', b'unit="inch"', old.read(name)))

    part = read_part(path)
    large = read_part(inches)

    assert volume(part) == pytest.approx(48e-6, rel=1e-6)
    assert [named_area(part, name) for name in ("left", "right")] == pytest.approx([5200e-6] * 2)
    assert (part.unit, large.unit) == ("mm", "in")
    assert large.size == pytest.approx(part.size * 25.4)
    with pytest.raises(InputError, match=r"part\.unit is 'mm', but the file says .*'in'"):
        read_part(inches, "mm")


def step_of_a_box(unit: str) -> str:
    """ISO 10303-42's faceted_brep: points, loops, planes."""
    lines: list[str] = []

    def put(text: str) -> int:
        lines.append(f"#{len(lines) + 1}={text};")
        return len(lines)

    def listed(numbers: Iterable[int]) -> str:
        return ",".join(f"#{number}" for number in numbers)

    length = put(unit)
    angle = put("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
    solid = put("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
    context = put(
        f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#{length},#{angle},#{solid}))"
        "REPRESENTATION_CONTEXT('',''))"
    )
    points = [put(f"CARTESIAN_POINT('',({x:.1f},{y:.1f},{z:.1f}))") for x, y, z in CORNERS]
    faces = []
    for quad in QUADS:
        loop = put(f"POLY_LOOP('',({listed(points[k] for k in quad)}))")
        bound = put(f"FACE_OUTER_BOUND('',#{loop},.T.)")
        along, normal = (
            CORNERS[quad[1]] - CORNERS[quad[0]],
            np.cross(*np.diff(CORNERS[list(quad[:3])], axis=0)),
        )
        z, x = (
            put(f"DIRECTION('',({x:.1f},{y:.1f},{z:.1f}))") for x, y, z in np.sign([normal, along])
        )
        axes = put(f"AXIS2_PLACEMENT_3D('',#{points[quad[0]]},#{z},#{x})")
        plane = put(f"PLANE('',#{axes})")
        faces.append(put(f"FACE_SURFACE('',(#{bound}),#{plane},.T.)"))
    shell = put(f"CLOSED_SHELL('',({listed(faces)}))")
    brep = put(f"FACETED_BREP('block',#{shell})")
    origin = put("CARTESIAN_POINT('',(0.,0.,0.))")
    z, x = put("DIRECTION('',(0.,0.,1.))"), put("DIRECTION('',(1.,0.,0.))")
    axes = put(f"AXIS2_PLACEMENT_3D('',#{origin},#{z},#{x})")
    shape = put(f"FACETED_BREP_SHAPE_REPRESENTATION('',(#{axes},#{brep}),#{context})")
    application = put("APPLICATION_CONTEXT('automotive design')")
    about = put(f"PRODUCT_CONTEXT('',#{application},'mechanical')")
    product = put(f"PRODUCT('block','block','',(#{about}))")
    formation = put(f"PRODUCT_DEFINITION_FORMATION('','',#{product})")
    stage = put(f"PRODUCT_DEFINITION_CONTEXT('part definition',#{application},'design')")
    definition = put(f"PRODUCT_DEFINITION('design','',#{formation},#{stage})")
    form = put(f"PRODUCT_DEFINITION_SHAPE('','',#{definition})")
    put(f"SHAPE_DEFINITION_REPRESENTATION(#{form},#{shape})")
    head = "FILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN'));"
    data = "\n".join(lines)
    return f"ISO-10303-21;\nHEADER;\n{head}\nENDSEC;\nDATA;\n{data}\nENDSEC;\nEND-ISO-10303-21;\n"


@pytest.mark.parametrize(("prefix", "metres"), [(".MILLI.", 1e-3), (".CENTI.", 1e-2)])
def test_a_step_file_states_its_unit_and_names_its_bodies(
    tmp_path: Path, prefix: str, metres: float, capfd
) -> None:  # type: ignore[no-untyped-def]
    pytest.importorskip("cascadio")
    text = step_of_a_box(f"(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({prefix},.METRE.))")

    part = read_part(written(tmp_path / "block.stp", text))

    assert part.size == pytest.approx(np.array(SIDES) * metres, rel=1e-6)
    assert part.groups["block"].all()
    assert any("unit stated by the file" in note for note in part.notes)
    assert capfd.readouterr().out == ""  # OpenCASCADE is kept from stdout


def small(name: str, *fields: object) -> str:
    """Nastran's small field format, eight columns a field, with continuation lines."""
    words = [f"{field:<8}" for field in fields]
    lines = ["".join(words[at : at + 8]) for at in range(0, len(words), 8)]
    return f"{name:<8}" + "\n+       ".join(lines) + "\n"


def large(number: int, place: np.ndarray) -> str:
    """As CATIA V5 writes a grid: 16 columns a field, two lines."""
    x, y, z = (f"{value:<16.9g}" for value in place)
    return f"GRID*   {number:<16}{'':<16}{x}{y}*{number}\n*{number:<7}{z}\n"


def free(number: int, place: np.ndarray) -> str:
    return f"GRID,{number},,{place[0]},{place[1]},{place[2]}\n"


def exponent(number: int, place: np.ndarray) -> str:
    """20.0 as 2.0+1: Nastran leaves the E out."""
    return small(
        "GRID", number, "", *(re.sub(r"e([+-])0?", r"\1", f"{value:.1e}") for value in place)
    )


@pytest.mark.parametrize("grid", [large, free, exponent])
@pytest.mark.parametrize("name", ["part.dat", "part.data", "part.bdf", "part.nas", "part.txt"])
def test_nastran_shells_in_every_field_format_and_by_any_name(
    tmp_path: Path, grid, name: str
) -> None:  # type: ignore[no-untyped-def]
    """What CATIA V5 exports has no BEGIN BULK and may be called .dat or .data; CTRIA3 may carry THETA and ZOFFS."""
    text = "$ CATIA V5\n" if grid is large else "SOL 101\nSET 7 = 1, 2\nCEND\nBEGIN BULK\n"
    text += '$HMNAME COMP 9"crown"\n' + "".join(
        grid(k + 1, place) for k, place in enumerate(CORNERS)
    )
    number = 1
    for quad, pid in ((TOP, 9), *((quad, 4) for quad in QUADS[1:])):
        a, b, c, d = (k + 1 for k in quad)
        if pid == 9:
            text += small("CTRIA3", number, pid, a, b, c, "30.", "0.5") + small(
                "CTRIA3", number + 1, pid, a, c, d
            )
        else:
            text += small("CQUAD4", number, pid, a, b, c, d)
        number += 2
    text += (
        "PSHELL  9       1       1.0\nMAT1    1       2.1+5           .3\nCBAR,99,1,1,2\nENDDATA\n"
    )

    part = read_part(written(tmp_path / name, text), "mm")

    assert_box(part)
    for group in ("PID 9", "crown", *(() if grid is large else ("SET 7",))):
        assert named_area(part, group) == pytest.approx(TOP_AREA)
    assert any("left out 1 CBAR" in note for note in part.notes)


def test_nastran_solids_give_their_skin_and_the_shells_on_it_the_names(tmp_path: Path) -> None:
    """Two hexahedra on top of each other, the upper one's top coated with a shell of property 5."""
    middle = CORNERS[:4] + np.array([0, 0, 20])
    points = np.concatenate([CORNERS, middle])
    text = "BEGIN BULK\n" + "".join(large(k + 1, place) for k, place in enumerate(points))
    text += small("CHEXA", 1, 2, 1, 2, 3, 4, 9, 10, 11, 12) + small(
        "CHEXA", 2, 3, 9, 10, 11, 12, 5, 6, 7, 8
    )
    text += small("CQUAD4", 3, 5, 5, 6, 7, 8)

    part = read_part(written(tmp_path / "part.bdf", text), "mm")

    assert_box(part)
    assert len(part.triangles) == 20  # the face between the two is not there
    assert named_area(part, "PID 5") == pytest.approx(TOP_AREA)
    assert named_area(part, "PID 2") == pytest.approx((600 + 2 * 20 * 50) * 1e-6)


def test_nastran_cylindrical_coordinates_are_turned_into_rectangular_ones(tmp_path: Path) -> None:
    """A box given in r, theta, z of a system whose z axis is the basic y axis, its origin moved."""
    origin = np.array([1.0, 2.0, 3.0])
    x, z = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
    local = (CORNERS - origin) @ np.array([x, np.cross(z, x), z]).T
    polar = np.stack(
        [
            np.hypot(local[:, 0], local[:, 1]),
            np.degrees(np.arctan2(local[:, 1], local[:, 0])),
            local[:, 2],
        ]
    )
    text = "CORD2C,3,,1.,2.,3.,1.,3.,3.,\n,1.,2.,4.\n"
    text += "".join(
        f"GRID,{k + 1},3,{r:.12f},{t:.12f},{h:.12f}\n" for k, (r, t, h) in enumerate(polar.T)
    )
    text += "".join(
        small("CQUAD4", n + 1, 1, *(k + 1 for k in quad)) for n, quad in enumerate(QUADS)
    )

    part = read_part(written(tmp_path / "part.nas", text), "mm")

    assert_box(part)
    assert np.sort(part.vertices, axis=0) == pytest.approx(
        np.sort(CORNERS, axis=0) * 1e-3, abs=1e-12
    )


def nodes_text(points: np.ndarray) -> str:
    return "".join(f"{k + 1}, {x}, {y}, {z}\n" for k, (x, y, z) in enumerate(points))


def test_abaqus_shells_with_sets_of_elements_and_nodes(tmp_path: Path) -> None:
    text = "*HEADING\na box\n** a comment\n*NODE, NSET=all\n" + nodes_text(CORNERS)
    text += "*ELEMENT, TYPE=S4R, ELSET=crown\n1, 5, 6, 7, 8\n*ELEMENT, TYPE=S4R, ELSET=sides\n"
    text += "".join(
        f"{n + 2}, {', '.join(str(k + 1) for k in quad)}\n" for n, quad in enumerate(QUADS[1:])
    )
    text += "*ELSET, ELSET=both, GENERATE\n1, 2, 1\n*ELSET, ELSET=again\ncrown,\n*NSET, NSET=upper\n5, 6, 7, 8\n"
    text += "*ELEMENT, TYPE=T3D2, ELSET=wire\n90, 1, 2\n"

    part = read_part(written(tmp_path / "box.inp", text), "mm")

    assert_box(part)
    for name in ("crown", "again", "upper"):
        assert named_area(part, name) == pytest.approx(TOP_AREA)
    assert named_area(part, "both") == pytest.approx(2 * TOP_AREA)
    assert any("left out 1 T3D2" in note for note in part.notes)


def test_abaqus_instances_are_put_where_they_stand_and_their_surfaces_named(tmp_path: Path) -> None:
    """Two instances of one solid, the second moved 50 mm along x and then turned a quarter about z."""
    text = (
        "*Part, name=Block\n*Node\n" + nodes_text(CORNERS) + "*Element, type=C3D8R, elset=body\n1, "
    )
    text += (
        ", ".join(str(k + 1) for k in range(8))
        + "\n*Surface, type=ELEMENT, name=crown\nbody, S2\n*End Part\n"
    )
    text += "*Assembly, name=A\n*Instance, name=one, part=Block\n*End Instance\n*Instance, name=two, part=Block\n"
    text += "50., 0., 0.\n0., 0., 0., 0., 0., 1., 90.\n*End Instance\n"
    text += "*Elset, elset=_s, internal, instance=two\n1,\n*Surface, type=ELEMENT, name=second\n_s, S1\n*End Assembly\n"

    part = read_part(written(tmp_path / "two.inp", text), "mm")

    assert volume(part) == pytest.approx(48e-6)
    assert part.vertices.min(axis=0) == pytest.approx([-0.03, 0, 0])
    assert part.vertices.max(axis=0) == pytest.approx([0.02, 0.07, 0.04])
    assert named_area(part, "crown") == pytest.approx(2 * TOP_AREA)
    assert part.vertices[part.triangles[part.groups["crown"]]][..., 2] == pytest.approx(0.04)
    second = part.vertices[
        part.triangles[part.groups["second"]]
    ]  # the underside of the one that was moved
    assert second[..., 2] == pytest.approx(0.0)
    assert second[..., 0].max() <= 1e-12
    assert named_area(part, "second") == pytest.approx(TOP_AREA)


def ball_of(kind: str, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Points [mm] and elements of a ball of radius 10 mm: shells, or tetrahedra to its middle; quadratic: mid nodes."""
    ball = trimesh.creation.icosphere(subdivisions=1, radius=10.0)
    points, rows = list(ball.vertices), ball.faces.tolist()
    if kind == "tetra":
        points.append(np.zeros(3))
        rows = [[*row, len(points) - 1] for row in rows]
    made: dict[tuple[int, int], int] = {}
    edges = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))[: 3 if kind == "triangle" else 6]
    if order == 2:
        for row in rows:
            corners = list(row)
            for i, j in edges:
                key = (min(corners[i], corners[j]), max(corners[i], corners[j]))
                if key not in made:
                    made[key] = len(points)
                    middle = (np.asarray(points[key[0]]) + points[key[1]]) / 2
                    points.append(
                        middle * 10.0 / np.linalg.norm(middle) if 3 not in (i, j) else middle
                    )
                row.append(made[key])
    return np.array(points), np.array(rows)


CARDS = {
    ("triangle", 2): ("CTRIA6", "STRI65"),
    ("tetra", 1): ("CTETRA", "C3D4"),
    ("tetra", 2): ("CTETRA", "C3D10M"),
}


@pytest.mark.parametrize(("kind", "order"), list(CARDS))
@pytest.mark.parametrize("program", ["nastran", "abaqus", "gmsh", "vtk"])
def test_higher_order_and_solid_elements_become_the_triangles_of_their_surface(
    tmp_path: Path, kind: str, order: int, program: str
) -> None:
    """A ball: its mid-edge nodes are on the sphere, so the surface is that of the next finer icosphere."""
    points, rows = ball_of(kind, order)
    nastran, abaqus = CARDS[kind, order]
    if program == "nastran":
        text = "".join(large(k + 1, place) for k, place in enumerate(points))
        text += "".join(small(nastran, n + 1, 1, *(row + 1)) for n, row in enumerate(rows))
        path = written(tmp_path / "ball.bdf", text)
    elif program == "abaqus":
        elements = "".join(
            f"{n + 1}, " + ", ".join(map(str, row + 1)) + "\n" for n, row in enumerate(rows)
        )
        path = written(
            tmp_path / "ball.inp", f"*NODE\n{nodes_text(points)}*ELEMENT, TYPE={abaqus}\n{elements}"
        )
    elif program == "gmsh":
        number = {("triangle", 2): 9, ("tetra", 1): 4, ("tetra", 2): 11}[kind, order]
        turned = rows[:, [*range(8), 9, 8]] if rows.shape[1] == 10 else rows  # Gmsh's own order
        path = tmp_path / "ball.msh"
        path.write_bytes(gmsh_2(points, [(number, (), row) for row in turned], binary=False))
    else:
        import pyvista

        path = tmp_path / "ball.vtu"
        cell = {("triangle", 2): 22, ("tetra", 1): 10, ("tetra", 2): 24}[kind, order]
        pyvista.UnstructuredGrid({cell: rows}, points).save(path)

    part = read_part(path, "mm")

    expected = trimesh.creation.icosphere(subdivisions=order, radius=10.0)
    assert len(part.triangles) == len(expected.faces)
    assert volume(part) == pytest.approx(expected.volume * 1e-9, rel=1e-6)


def gmsh_2(
    points: np.ndarray, elements: list[tuple[int, tuple[int, ...], np.ndarray]], binary: bool
) -> bytes:
    """Gmsh's format 2.2: elements are (type, tags, nodes from 0)."""
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


@pytest.mark.parametrize("binary", [True, False])
def test_gmsh_2s_physical_groups_are_names(tmp_path: Path, binary: bool) -> None:
    elements = [
        (1, (0, 1), np.array([0, 1])),
        *((3, (7 if q is TOP else 8, 1), np.array(q)) for q in QUADS),
    ]
    path = tmp_path / "box.msh"
    path.write_bytes(gmsh_2(CORNERS, elements, binary))

    part = read_part(path, "mm")

    assert_box(part)
    assert named_area(part, "crown") == pytest.approx(TOP_AREA)
    assert part.groups["physical 8"].sum() == 10


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


def test_gmsh_4s_physical_groups_are_names(tmp_path: Path) -> None:
    points = "".join(f"{x} {y} {z}\n" for x, y, z in CORNERS)
    quads = "".join(
        f"{n + 2} {' '.join(str(k + 1) for k in quad)}\n" for n, quad in enumerate(QUADS[1:])
    )

    part = read_part(written(tmp_path / "box.msh", GMSH_4.format(points=points, quads=quads)), "mm")

    assert_box(part)
    assert named_area(part, "crown") == pytest.approx(TOP_AREA)


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("suffix", ["vtp", "vtu", "vtk"])
@pytest.mark.parametrize("grid", [True, False])
def test_vtk_files_with_cell_fields_for_names(
    tmp_path: Path, suffix: str, binary: bool, grid: bool
) -> None:
    import pyvista

    if (suffix, grid) in (("vtp", True), ("vtu", False)):
        pytest.skip("no such file")
    surface = pyvista.PolyData(CORNERS, np.insert(np.array(QUADS), 0, 4, axis=1).ravel())
    surface.cell_data["zone"] = np.array([7] + [8] * 5)
    surface.cell_data["thickness"] = np.full(6, 0.5)
    path = tmp_path / f"box.{suffix}"
    (surface.cast_to_unstructured_grid() if grid else surface).save(path, binary=binary)

    part = read_part(path, "mm")

    assert_box(part)
    assert named_area(part, "zone 7") == pytest.approx(TOP_AREA)
    assert set(part.groups) == {"zone 7", "zone 8"}


def test_content_counts_and_not_the_name(tmp_path: Path) -> None:
    text = OBJ_HEAD + "".join(map(obj_face, QUADS))

    assert_box(read_part(written(tmp_path / "box.stl", text), "mm"))


REFUSED = {
    "unknown": ("part.xyz", "hello", "mesh format is not known.*\\.stl.*\\.bdf"),
    "obj": ("p.obj", "v 0 0 0\nv 1 0 0\nf 1 2 9\n", "a face names a vertex that is not there"),
    "obj number": ("p.obj", "v 0 0 0\nv 1 0 x\n", "line 2: 'v' with no number"),
    "nastran grid twice": (
        "p.bdf",
        "GRID,1,,0.,0.,0.\nGRID,1,,1.,0.,0.\nCTRIA3,5,1,1,1,1\n",
        "line 2: GRID 1 is given",
    ),
    "nastran grid": (
        "p.bdf",
        "GRID,1,,0.,0.,0.\nCTRIA3,5,1,1,2,3\n",
        "line 2: CTRIA3 5 names grid 2",
    ),
    "nastran number": ("p.bdf", "GRID,1,,0.,zero,0.\n", "line 1: a GRID coordinate is 'zero'"),
    "nastran include": (
        "p.bdf",
        "GRID,1,,0.,0.,0.\nINCLUDE 'x.bdf'\n",
        "line 2: INCLUDE is not supported",
    ),
    "nastran system": ("p.bdf", "GRID,1,4,0.,0.,0.\n", "coordinate system 4 is not defined"),
    "nastran corners": (
        "p.bdf",
        "GRID,1,,0.,0.,0.\nCTRIA3,5,1,1,1\n",
        "CTRIA3 5 has fewer than 3 corners",
    ),
    "abaqus include": (
        "p.inp",
        "*HEADING\n*INCLUDE, INPUT=x\n",
        r"line 2: \*INCLUDE.*not supported",
    ),
    "abaqus type": (
        "p.inp",
        "*NODE\n1, 0, 0, 0\n*ELEMENT, TYPE=XYZ4\n1, 1, 1, 1, 1\n",
        "line 3.*type=XYZ4 is not",
    ),
    "abaqus polar": ("p.inp", "*NODE, SYSTEM=C\n1, 0, 0, 0\n", "cylindrical.*not supported"),
    "abaqus node": (
        "p.inp",
        "*NODE\n1, 0, 0, 0\n*ELEMENT, TYPE=S3\n1, 1, 2, 3\n",
        "node 2 in element 1",
    ),
    "abaqus empty": ("p.inp", "*NODE\n1, 0, 0, 0\n", "holds no triangles"),
    "gmsh": (
        "p.msh",
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n",
        "truncated: .Nodes has no .EndNodes",
    ),
    "vtk": (
        "p.vtk",
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n1 2\n",
        "as VTK",
    ),
    "vtk image": (
        "p.vtk",
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\n"
        "ORIGIN 0 0 0\nSPACING 1 1 1\n",
        "holds STRUCTUREDPOINTS; save a PolyData",
    ),
    "3mf": ("p.3mf", "PK\x03\x04 not a zip", "cannot be read as 3MF"),
}


@pytest.mark.parametrize("case", list(REFUSED))
def test_what_a_format_has_that_is_not_understood_is_refused_by_name(
    tmp_path: Path, case: str
) -> None:
    name, text, said = REFUSED[case]
    path = written(tmp_path / name, text)

    with pytest.raises(InputError, match=said) as caught:
        read_part(path, "mm")
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def whole_files() -> dict[str, bytes]:
    """A box in each format that is not a library's business alone, by the name of its file."""
    quads = [(3, (7, 1), np.array(quad)) for quad in QUADS]
    grids = "".join(large(k + 1, place) for k, place in enumerate(CORNERS))
    shells = "".join(
        small("CQUAD4", n + 1, 1, *(k + 1 for k in quad)) for n, quad in enumerate(QUADS)
    )
    elements = "".join(
        f"{n + 1}, {', '.join(str(k + 1) for k in quad)}\n" for n, quad in enumerate(QUADS)
    )
    return {
        "box.obj": (OBJ_HEAD + "".join(map(obj_face, QUADS))).encode(),
        "box.dat": (grids + shells).encode(),
        "box.inp": f"*NODE\n{nodes_text(CORNERS)}*ELEMENT, TYPE=S4\n{elements}".encode(),
        "text.msh": gmsh_2(CORNERS, quads, binary=False),
        "binary.msh": gmsh_2(CORNERS, quads, binary=True),
        "four.msh": GMSH_4.format(points=nodes_text(CORNERS), quads=elements).encode(),
        "box.stp": step_of_a_box("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))").encode(),
    }


@pytest.mark.parametrize("name", list(whole_files()))
def test_a_damaged_file_is_refused_in_one_line_or_read_never_worse(
    tmp_path: Path, name: str
) -> None:
    """Cut off somewhere, a stretch missing, bytes overwritten."""
    whole, rng = whole_files()[name], np.random.default_rng(3)
    said = []
    for turn in range(3 if name.endswith("stp") else 40):
        at, length = int(rng.integers(len(whole))), int(rng.integers(1, 60))
        noise = rng.integers(256, size=length, dtype=np.uint8).tobytes()
        damaged = (
            whole[:at],
            whole[:at] + whole[at + length :],
            whole[:at] + noise + whole[at + length :],
        )[turn % 3]
        (tmp_path / name).write_bytes(damaged)
        try:
            read_part(tmp_path / name, "mm")
        except InputError as error:
            said.append(str(error))
    assert said
    assert not any("\n" in text for text in said)


def test_step_without_its_library_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "cascadio", None)

    with pytest.raises(InputError, match=r"pip install 'chamberopt\[cad\]'"):
        read_part(written(tmp_path / "part.step", "ISO-10303-21;"))


def test_the_table_in_the_docs_lists_every_format() -> None:
    table = (Path(__file__).parents[4] / "docs" / "parts.md").read_text(encoding="utf-8")
    for one in MESH_FORMATS:
        for suffix in one.suffixes:
            assert f"`{suffix}`" in table, suffix
