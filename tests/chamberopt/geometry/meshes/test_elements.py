"""Solid and higher-order elements become the triangles of their surface."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.geometry.meshes.elements import CORNERS, EDGES, FACES, SHELLS
from chamberopt.geometry.meshes.part_mesh import read_part
from tests.helpers.mesh_files import gmsh_2, large, nodes_text, small, volume, written


def ball_of(kind: str, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Points [mm] and elements of a ball of radius 10 mm, with mid-edge nodes if order is 2.

    The elements are shells, or tetrahedra that meet in the centre.
    """
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
    """Mid-edge nodes lie on the sphere, so that the surface is that of the next finer icosphere."""
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


@pytest.mark.parametrize("kind", FACES)
def test_the_faces_of_an_element_close_it_and_share_its_edges(kind: str) -> None:
    sides = [
        (a, b) for face in FACES[kind] for a, b in zip(face, (*face[1:], face[0]), strict=True)
    ]
    assert len(set(sides)) == len(sides)
    assert {frozenset(one) for one in EDGES[kind]} == {frozenset(one) for one in sides}
    assert len(EDGES[kind]) == len(set(map(frozenset, EDGES[kind])))
    assert {corner for one in sides for corner in one} == set(range(CORNERS[kind]))
    if kind in SHELLS:
        assert list(EDGES[kind]) == sides  # in turn, as its mid-edge nodes are
    else:
        assert {(b, a) for a, b in sides} == set(sides)
        assert CORNERS[kind] - len(EDGES[kind]) + len(FACES[kind]) == 2  # Euler
