"""Triangles keep the element numbers of their file, in every format and through healing."""

import re
from pathlib import Path

import numpy as np
import pytest
import pyvista
import trimesh

from chamberopt.design.shapes.cad_setup import read_setup
from chamberopt.geometry.meshes.part_mesh import PartMesh, close_surface, read_part, read_triangles
from tests.helpers.mesh_files import (
    CORNERS,
    GMSH_4,
    OBJ_HEAD,
    QUADS,
    TOP,
    gmsh_2,
    nastran_text,
    node_list,
    nodes_text,
    obj_face,
    written,
)

NUMBERS = (907, 3, 512, 11, 10, 77)  # of the six quadrilaterals: gaps, not rising


PARTS = Path(__file__).resolve().parents[4] / "designs" / "parts"


def quads_of(part: PartMesh) -> np.ndarray:
    """Index into QUADS of the face in which each triangle of the box lies, by its position."""
    middles = 1e3 * part.vertices[part.triangles].mean(axis=1)
    off = []
    for quad in QUADS:
        at = CORNERS[list(quad)]
        across = np.cross(at[1] - at[0], at[2] - at[0])
        off.append(np.abs((middles - at[0]) @ (across / np.linalg.norm(across))))
    return np.argmin(off, axis=0)


def assert_numbered(part: PartMesh, numbers: tuple[int, ...], own: bool) -> None:
    assert len(part.triangles) == 12
    assert part.elements.dtype == np.int64
    np.testing.assert_array_equal(part.elements, np.array(numbers)[quads_of(part)])
    assert part.numbering.own is own
    assert not part.numbering.faces.any()


def test_nastran(tmp_path: Path) -> None:
    cards = [
        f"CQUAD4,{n},1,{node_list(quad)}" for n, quad in zip(NUMBERS[:4], QUADS[:4], strict=True)
    ]
    for number, (a, b, c, d) in zip(
        (10, 77), QUADS[4:], strict=True
    ):  # triangles are kept apart from quadrilaterals
        cards += [
            f"CTRIA3,{number},1,{node_list((a, b, c))}",
            f"CTRIA3,{number + 1000},1,{node_list((a, c, d))}",
        ]
    part = read_part(written(tmp_path / "box.bdf", nastran_text(cards)), "mm")
    part.elements[part.elements > 1000] -= 1000
    assert_numbered(part, NUMBERS, own=True)


def abaqus_text(instances: int) -> str:
    quads = "".join(f"{n}, {node_list(quad)}\n" for n, quad in zip(NUMBERS, QUADS, strict=True))
    mesh = "*Node\n" + nodes_text(CORNERS) + "*Element, type=S4\n" + quads
    if not instances:
        return "*Heading\n" + mesh
    placed = "".join(
        f"*Instance, name=Box-{k}, part=Box\n{50 * k}, 0, 0\n*End Instance\n"
        for k in range(instances)
    )
    return f"*Heading\n*Part, name=Box\n{mesh}*End Part\n*Assembly, name=A\n{placed}*End Assembly\n"


def test_abaqus(tmp_path: Path) -> None:
    flat = read_part(written(tmp_path / "flat.inp", abaqus_text(0)), "mm")
    one = read_part(written(tmp_path / "one.inp", abaqus_text(1)), "mm")
    two = read_part(written(tmp_path / "two.inp", abaqus_text(2)), "mm")

    assert_numbered(flat, NUMBERS, own=True)
    assert_numbered(one, NUMBERS, own=True)
    assert (flat.numbering.instance, one.numbering.instance) == ("", "BOX-0")
    # Two that count alike: a number would stand for two elements, so the places count.
    assert not two.numbering.own
    assert two.elements.tolist() == np.repeat(np.arange(1, 13), 2).tolist()


@pytest.mark.parametrize("binary", [True, False])
def test_gmsh_2(tmp_path: Path, binary: bool) -> None:
    """Elements are read group by group and keep their numbers, here 1 for a line and 2 to 7."""
    elements = [
        (1, (0, 1), np.array([0, 1])),
        *((3, (7 + k % 2, 1), np.array(quad)) for k, quad in enumerate(QUADS)),
    ]
    (tmp_path / "box.msh").write_bytes(gmsh_2(CORNERS, elements, binary))
    assert_numbered(read_part(tmp_path / "box.msh", "mm"), (2, 3, 4, 5, 6, 7), own=True)


def test_gmsh_4(tmp_path: Path) -> None:
    points = "".join(f"{x} {y} {z}\n" for x, y, z in CORNERS)
    quads = "".join(
        f"{n} {node_list(quad).replace(',', ' ')}\n"
        for n, quad in zip(NUMBERS[1:], QUADS[1:], strict=True)
    )
    text = GMSH_4.format(points=points, quads=quads)
    top = int(re.search(rf"^(\d+) {node_list(TOP).replace(',', ' ')}$", text, re.M)[1])  # type: ignore[index]
    assert_numbered(
        read_part(written(tmp_path / "box.msh", text), "mm"), (top, *NUMBERS[1:]), own=True
    )


def test_files_without_numbers_go_by_place(tmp_path: Path) -> None:
    text = OBJ_HEAD + "".join(map(obj_face, QUADS))
    assert_numbered(
        read_part(written(tmp_path / "box.obj", text), "mm"), (1, 2, 3, 4, 5, 6), own=False
    )

    surface = pyvista.PolyData(
        CORNERS, np.insert(np.array(QUADS), 0, 4, axis=1).ravel(), lines=[2, 0, 1]
    )
    surface.save(tmp_path / "box.vtp")
    # A cell's place counts lines too.
    assert_numbered(read_part(tmp_path / "box.vtp", "mm"), (2, 3, 4, 5, 6, 7), own=False)

    box = trimesh.creation.box((20, 30, 40))
    box.export(tmp_path / "box.stl")
    part = read_part(tmp_path / "box.stl", "mm")
    assert part.elements.tolist() == list(range(1, 13))
    np.testing.assert_allclose(1e3 * part.vertices[part.triangles], box.triangles, atol=1e-5)


@pytest.mark.parametrize("program", ["nastran", "abaqus"])
def test_a_solids_faces_have_its_number_but_a_shell_on_it_comes_first(
    tmp_path: Path, program: str
) -> None:
    """Two bricks, 44 on top of 9; a quadrilateral 300 lies on the uppermost face."""
    points = np.concatenate([CORNERS, CORNERS[4:] + np.array([0.0, 0.0, 40.0])])
    low, high, top = range(8), (*range(4, 8), *range(8, 12)), (8, 9, 10, 11)
    if program == "nastran":
        cards = [
            f"CHEXA,{n},1,{node_list(k[:6])}\n+,{node_list(k[6:])}"
            for n, k in ((9, tuple(low)), (44, high))
        ]
        text = nastran_text([*cards, f"CQUAD4,300,2,{node_list(top)}"], points)
    else:
        bricks = "".join(f"{n}, {node_list(tuple(k))}\n" for n, k in ((44, high), (9, low)))
        skin = f"*Element, type=M3D4\n300, {node_list(top)}\n"
        text = f"*Heading\n*Node\n{nodes_text(points)}*Element, type=C3D8\n{bricks}{skin}"

    part = read_part(written(tmp_path / "bricks.inp", text), "mm")

    middles = 1e3 * part.vertices[part.triangles].mean(axis=1)
    is_top, is_bottom = middles[:, 2] > 79.9, middles[:, 2] < 0.1
    assert set(part.elements[is_top].tolist()) == {300}
    assert set(part.elements[~is_top & (middles[:, 2] > 40)].tolist()) == {44}
    assert set(part.elements[middles[:, 2] < 40].tolist()) == {9}
    faces = part.numbering.faces
    assert set(faces[is_top].tolist()) == {0}
    assert set(faces[is_bottom].tolist()) == {1}  # Abaqus: nodes 1 2 3 4
    assert set(faces[middles[:, 1] < 0.1].tolist()) == {3}  # nodes 1 2 6 5
    assert len(part.triangles) == 20
    assert part.numbering.own


def test_numbers_stay_with_their_triangles_through_healing(tmp_path: Path) -> None:
    """A ball in random order: one triangle is missing, one is given twice, one has no area."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=10.0)
    order = np.random.default_rng(1).permutation(len(ball.faces))
    numbers = 10 * np.arange(len(order)) + 3
    given = {int(n): tuple(ball.faces[k]) for n, k in zip(numbers, order, strict=True)}
    missing = given.pop(503)
    a, b, c = given[1003]
    given |= {99_999: (b, c, a), 99_998: (a, a, b)}
    cards = [f"CTRIA3,{n},1,{node_list(nodes)}" for n, nodes in given.items()]

    part = read_part(written(tmp_path / "ball.bdf", nastran_text(cards, ball.vertices)), "mm")

    found = dict(
        zip(part.elements.tolist(), part.vertices[part.triangles].mean(axis=1), strict=True)
    )
    assert len(found) == len(part.triangles) == len(ball.faces)
    expected = {
        n: 1e-3 * ball.vertices[list(nodes)].mean(axis=0)
        for n, nodes in given.items()
        if n < 99_998
    }
    expected[0] = 1e-3 * ball.vertices[list(missing)].mean(axis=0)
    assert sorted(found) == sorted(expected)
    for number, place in expected.items():
        np.testing.assert_allclose(found[number], place, atol=1e-9)


def test_one_body_of_several_keeps_its_numbers(tmp_path: Path) -> None:
    points = np.concatenate([CORNERS, CORNERS + np.array([100.0, 0.0, 0.0])])
    cards = [
        f"CQUAD4,{n + shift},{1 + shift // 2000},{node_list(tuple(k + shift // 250 for k in quad))}"
        for shift in (0, 2000)
        for n, quad in zip(NUMBERS, QUADS, strict=True)
    ]
    read = read_triangles(written(tmp_path / "two.bdf", nastran_text(cards, points)), "mm")

    part = close_surface(read, read.groups["PID 2"])

    part.vertices[:, 0] -= 0.1
    assert_numbered(part, tuple(n + 2000 for n in NUMBERS), own=True)


def test_the_part_of_a_drawn_set_up_keeps_its_numbers() -> None:
    path = PARTS / "plate_setup.bdf"
    text = path.read_text()
    points = {
        int(n): [float(v) for v in row.split(",")]
        for n, row in re.findall(r"^GRID,(\d+),,(.*)$", text, re.M)
    }
    own = {
        int(n): np.mean([points[int(k)] for k in row.split(",")], axis=0)
        for n, row in re.findall(r"^CTRIA3,(\d+),1,(.*)$", text, re.M)
    }

    part = read_setup(path, "mm", ("PART",), ("SONOTRODE",)).part

    assert sorted(part.elements.tolist()) == sorted(own)
    for number, triangle in zip(part.elements.tolist(), part.triangles, strict=True):
        np.testing.assert_allclose(
            1e3 * part.vertices[triangle].mean(axis=0), own[number], atol=1e-9
        )
