"""Formats are recognised by content; damaged and unsupported files are refused by name."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.formats import MESH_FORMATS
from chamberopt.geometry.meshes.part_mesh import read_part
from tests.helpers.mesh_files import (
    CORNERS,
    GMSH_4,
    OBJ_HEAD,
    QUADS,
    assert_box,
    gmsh_2,
    large,
    nodes_text,
    obj_face,
    small,
    step_of_a_box,
    written,
)


def test_the_content_decides_and_not_the_name(tmp_path: Path) -> None:
    text = OBJ_HEAD + "".join(map(obj_face, QUADS))

    assert_box(read_part(written(tmp_path / "box.stl", text), "mm"))


REFUSED = {
    "unknown": ("part.xyz", "hello", "mesh format is not known.*\\.stl.*\\.bdf"),
    "obj": ("p.obj", "v 0 0 0\nv 1 0 0\nf 1 2 9\n", "a face names a vertex or a normal that"),
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
def test_unsupported_content_is_refused_by_name(tmp_path: Path, case: str) -> None:
    name, text, message = REFUSED[case]
    path = written(tmp_path / name, text)

    with pytest.raises(InputError, match=message) as caught:
        read_part(path, "mm")
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def intact_files() -> dict[str, bytes]:
    """File name -> a box in each format that is not read by a library alone."""
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


@pytest.mark.parametrize("name", list(intact_files()))
def test_a_damaged_file_is_read_or_refused_in_one_line(tmp_path: Path, name: str) -> None:
    """Files are cut off, lose some bytes, or have some bytes overwritten."""
    whole, rng = intact_files()[name], np.random.default_rng(3)
    messages = []
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
            messages.append(str(error))
    assert messages
    assert not any("\n" in text for text in messages)


def test_the_table_in_the_docs_lists_every_format() -> None:
    table = (Path(__file__).parents[4] / "docs" / "reference" / "part_files.md").read_text(
        encoding="utf-8"
    )
    for one in MESH_FORMATS:
        for suffix in one.suffixes:
            assert f"`{suffix}`" in table, suffix
