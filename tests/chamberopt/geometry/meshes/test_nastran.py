"""Nastran bulk data: field formats, shells, solids, coordinate systems."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.geometry.meshes.part_mesh import read_part
from tests.helpers.mesh_files import (
    CORNERS,
    QUADS,
    TOP,
    TOP_AREA,
    assert_box,
    exponent,
    free,
    large,
    named_area,
    small,
    written,
)


@pytest.mark.parametrize("grid", [large, free, exponent])
@pytest.mark.parametrize("name", ["part.dat", "part.data", "part.bdf", "part.nas", "part.txt"])
def test_nastran_shells_in_every_field_format_and_by_any_name(
    tmp_path: Path, grid, name: str
) -> None:  # type: ignore[no-untyped-def]
    """CATIA V5 exports no BEGIN BULK, as .dat or .data; CTRIA3 may have THETA and ZOFFS."""
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
    """Two hexahedra on top of each other; a shell of property 5 lies on the upper one's top."""
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
    """A box in cylindrical coordinates of a moved system whose z axis is the basic y axis."""
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
