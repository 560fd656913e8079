"""Reading a part: the same solid from every format, refusals with reason and place."""

import time
from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.part_mesh import TriangleSoup, close_surface, read_part
from chamberopt.geometry.meshes.raw_mesh import number_by_position
from chamberopt.geometry.triangles import tetrahedron_volumes, unit_vectors
from tests.helpers.mesh_files import ball_corners, box_corners, write_ascii_stl, write_stl


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply"])
def test_a_box_arrives_intact_from_every_format(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"box.{suffix}"
    trimesh.creation.box((20, 30, 40)).export(path)

    part = read_part(path, "mm")

    assert part.size == pytest.approx([0.02, 0.03, 0.04])
    assert part.triangles.shape == (12, 3)
    assert part.triangles.dtype == np.int32
    assert part.vertices.shape == (8, 3)
    assert tetrahedron_volumes(part.vertices, part.triangles).sum() == pytest.approx(24e-6)
    assert part.notes == ()


def test_the_users_triangles_keep_their_order_and_corners(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=10)
    corners = ball.vertices[ball.faces][np.random.default_rng(1).permutation(len(ball.faces))]

    part = read_part(write_stl(tmp_path / "ball.stl", corners), "mm")

    assert np.allclose(part.vertices[part.triangles], corners * 1e-3, rtol=1e-6)


def broken(folder: Path, how: str) -> Path:
    """Write a file that must be refused."""
    path, corners = folder / "part.stl", box_corners()
    if how == "missing":
        return path
    if how == "folder":
        path.mkdir()
        return path
    if how == "step":
        path = folder / "part.step"
        path.write_text("ISO-10303-21;")  # cut off after its first line
        return path
    if how == "empty":
        path.write_bytes(b"")
    elif how == "no triangles":
        write_stl(path, corners[:0])
    elif how == "truncated":
        write_stl(path, corners)
        path.write_bytes(path.read_bytes()[:400])
    elif how == "truncated text":
        write_ascii_stl(path, corners, end="facet normal 0 0 1")
    elif how == "not an stl":
        path.write_bytes(b"hello, this is not a mesh at all")
    elif how == "nan":
        corners[4, 1, 2] = np.nan
        write_stl(path, corners)
    elif how == "open":
        write_stl(path, np.delete(corners, [2, 9], axis=0))
    elif how == "non-manifold":
        write_stl(path, np.r_[corners, box_corners(at=(20, 20, 0))])
    elif how == "too small":
        write_stl(path, box_corners(0.02))
    elif how == "too big":
        write_stl(path, box_corners(20000))
    elif how == "damaged ply":
        path = folder / "part.ply"
        trimesh.creation.box((20, 20, 20)).export(path)
        path.write_bytes(path.read_bytes()[:-60])
    elif how == "short text ply":
        path = folder / "part.ply"
        trimesh.creation.box((20, 20, 20)).export(path, encoding="ascii")
        path.write_bytes(
            path.read_bytes().rstrip().rpartition(b"\n")[0] + b"\n"
        )  # the last face is gone
    return path


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("missing", r"no such mesh file.*part\.mesh"),
        ("folder", "is a folder"),
        ("step", r"export it again as AP214|needs the package gmsh"),
        ("empty", "the file is empty"),
        ("no triangles", "holds no triangles"),
        ("truncated", "truncated.*says 12 triangles and holds 6"),
        ("truncated text", "truncated.*endsolid"),
        ("not an stl", "truncated or not an STL"),
        ("nan", "1 triangles have a corner that is not a number.*triangle 5 of 12"),
        (
            "open",
            r"not closed: \d+ open edges in [12] holes?, the first from \(.*\) mm to \(.*\) mm",
        ),
        (
            "non-manifold",
            r"not manifold: 1 edges.*the first from \(10, 10, -10\) mm to \(10, 10, 10\) mm",
        ),
        ("too small", r"measures 0\.02 x 0\.02 x 0\.02 mm.*'m' or 'in'"),
        ("too big", r"measures 20000 x 20000 x 20000 mm.*'um'"),
        ("damaged ply", "cannot be read as PLY, it is damaged or truncated"),
        ("short text ply", "truncated: its header counts 20 lines and 19 are there"),
    ],
)
def test_what_is_refused_is_named_with_its_place(tmp_path: Path, how: str, message: str) -> None:
    path = broken(tmp_path, how)

    with pytest.raises(InputError, match=message) as caught:
        read_part(path, "mm")
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.long
def test_a_million_triangles_are_read_healed_and_checked(tmp_path: Path) -> None:
    """Takes some 20 s on a 2.5 GHz core; the limit is far higher, for busy machines."""
    corners = ball_corners(8)
    gone = np.delete(corners, [5, 700000], axis=0)
    gone[1000:1500] = gone[1000:1500, ::-1]
    start = time.monotonic()

    part = read_part(write_stl(tmp_path / "ball.stl", gone), "mm")

    assert time.monotonic() - start < 180
    assert len(part.triangles) == len(corners) == 1310720
    assert any("closed 2 small holes" in note for note in part.notes)
    assert any("turned 500 triangles" in note for note in part.notes)


def test_normals_of_the_file_stay_at_their_corners_whichever_way_a_triangle_is_turned() -> None:
    """A ball of radial normals, of which some triangles and normals look inwards, and two slant."""
    ball = trimesh.creation.icosphere(2)
    corners, radial, row = 1e-2 * ball.triangles, ball.triangles.copy(), np.arange(len(ball.faces))
    for k, degrees in ((1, 58.0), (2, 62.0)):  # what leaves its facet by 60 degrees is not meant
        along = corners[k, 1] - corners[k, 0]
        along *= np.tan(np.radians(degrees)) / np.linalg.norm(along)
        radial[k, 0] = unit_vectors(ball.face_normals[k] + along)
    wanted = radial.copy()
    wanted[2, 0] = ball.face_normals[2]
    turned, inwards = row % 3 == 0, row % 5 == 0
    normals = np.where(inwards[:, None, None], -radial, radial)
    at = corners.copy()
    at[turned], normals[turned] = corners[turned, ::-1], normals[turned, ::-1]

    soup = TriangleSoup(
        Path("ball"), at, number_by_position(len(row)), {}, (), "", "m", 0 * row, normals
    )
    part = close_surface(soup)
    corner = part.vertices[part.triangles]
    same = (corner[:, :, None] == corners[:, None]).all(axis=3)  # of the file's, (m, 3, 3)
    assert (same.sum(axis=(1, 2)) == 3).all()
    np.testing.assert_allclose(part.normals, np.einsum("mab,mbi->mai", same, wanted))


def test_minus_zero_is_the_place_of_zero(tmp_path: Path) -> None:
    corners = box_corners()
    corners[corners == corners.min()] = 0.0
    every_second = np.arange(len(corners)) % 2 == 0
    signed = np.where((corners == 0.0) & every_second[:, None, None], -0.0, corners)
    part = read_part(write_stl(tmp_path / "box.stl", signed), "mm")
    assert len(part.vertices) == 8
    assert not np.signbit(part.vertices).any()
