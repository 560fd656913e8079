"""Part files: what is read, what is put right and said, what is refused with a reason and a place."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.errors import InputError
from chamberopt.mesh_io import read_part
from chamberopt.triangles import tetrahedron_volumes


def box_corners(size: float = 20.0, at: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    """Corners (12, 3, 3) of an axis-parallel box, outward."""
    mesh = trimesh.creation.box((size, size, size))
    return mesh.vertices[np.asarray(mesh.faces)] + np.asarray(at)


def write_stl(path: Path, corners: np.ndarray) -> Path:
    record = np.zeros(len(corners), dtype=[("n", "<f4", 3), ("c", "<f4", (3, 3)), ("u", "<u2")])
    record["c"] = corners
    path.write_bytes(b"a box".ljust(80) + np.uint32(len(corners)).tobytes() + record.tobytes())
    return path


def write_ascii_stl(path: Path, corners: np.ndarray, digits: int = 9, end: str = "endsolid box\n") -> Path:
    lines = ["solid box"]
    for triangle in corners:
        lines += ["facet normal 0 0 0", " outer loop"]
        lines += ["  vertex " + " ".join(f"{value:.{digits}g}" for value in corner) for corner in triangle]
        lines += [" endloop", "endfacet"]
    path.write_text("\n".join(lines) + "\n" + end)
    return path


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply"])
def test_a_box_arrives_whole_from_every_format(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"box.{suffix}"
    trimesh.creation.box((20, 30, 40)).export(path)

    part = read_part(path, "mm")

    assert part.size == pytest.approx([0.02, 0.03, 0.04])
    assert part.triangles.shape == (12, 3)
    assert part.triangles.dtype == np.int32
    assert part.vertices.shape == (8, 3)
    assert tetrahedron_volumes(part.vertices, part.triangles).sum() == pytest.approx(24e-6)
    assert part.notes == ()


def test_an_ascii_stl_is_read_too(tmp_path: Path) -> None:
    part = read_part(write_ascii_stl(tmp_path / "box.stl", box_corners()), "mm")

    assert part.size == pytest.approx([0.02] * 3)
    assert part.notes == ()


def test_a_3mf_is_read_where_lxml_is_there(tmp_path: Path) -> None:
    pytest.importorskip("lxml")
    path = tmp_path / "box.3mf"
    trimesh.creation.box((20, 20, 20)).export(path)

    assert read_part(path, "mm").size == pytest.approx([0.02] * 3)


@pytest.mark.parametrize(("unit", "metres"), [("um", 1e-6), ("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("in", 0.0254)])
def test_units(tmp_path: Path, unit: str, metres: float) -> None:
    path = write_stl(tmp_path / "box.stl", box_corners(0.05 / metres))

    assert read_part(path, unit).size == pytest.approx([0.05] * 3, rel=1e-6)


def test_the_users_triangles_keep_their_order_and_corners(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=10)
    corners = ball.vertices[ball.faces][np.random.default_rng(1).permutation(len(ball.faces))]

    part = read_part(write_stl(tmp_path / "ball.stl", corners), "mm")

    assert np.allclose(part.vertices[part.triangles], corners * 1e-3, rtol=1e-6)


def test_an_inside_out_part_is_turned_and_said(tmp_path: Path) -> None:
    part = read_part(write_stl(tmp_path / "box.stl", box_corners()[:, ::-1]), "mm")

    assert tetrahedron_volumes(part.vertices, part.triangles).sum() == pytest.approx(8e-6)
    assert "inside out" in part.notes[0]


def test_one_inside_out_body_of_two_is_turned_and_a_void_is_not(tmp_path: Path) -> None:
    beside = np.r_[box_corners(), box_corners(at=(50, 0, 0))[:, ::-1]]
    hollow = np.r_[box_corners(), box_corners(10)[:, ::-1]]

    two = read_part(write_stl(tmp_path / "two.stl", beside), "mm")
    shell = read_part(write_stl(tmp_path / "hollow.stl", hollow), "mm")

    assert tetrahedron_volumes(two.vertices, two.triangles).sum() == pytest.approx(16e-6)
    assert "body 2 of 2" in two.notes[0]
    assert tetrahedron_volumes(shell.vertices, shell.triangles).sum() == pytest.approx(7e-6)
    assert shell.notes == ()


def test_single_triangles_facing_the_wrong_way_are_turned_and_counted(tmp_path: Path) -> None:
    corners = box_corners()
    corners[[3, 7]] = corners[[3, 7], ::-1]

    part = read_part(write_stl(tmp_path / "box.stl", corners), "mm")

    assert tetrahedron_volumes(part.vertices, part.triangles).sum() == pytest.approx(8e-6)
    assert "turned 2 triangles" in part.notes[0]


def test_triangles_without_area_and_copies_are_dropped_and_said(tmp_path: Path) -> None:
    corners = box_corners()
    flat = corners[:1, [0, 1, 1]]

    part = read_part(write_stl(tmp_path / "box.stl", np.r_[corners, flat, corners[:2]]), "mm")

    assert len(part.triangles) == 12
    assert "dropped 1 triangles without area, the first is triangle 13" in part.notes[0]
    assert "dropped 2 triangles that were there twice" in part.notes[1]


def test_vertices_apart_by_rounding_are_merged_and_said(tmp_path: Path) -> None:
    noise = np.random.default_rng(2).uniform(-2e-6, 2e-6, (12, 3, 3))

    part = read_part(write_ascii_stl(tmp_path / "box.stl", box_corners() + noise, digits=12), "mm")

    assert len(part.vertices) == 8
    assert "merged" in part.notes[0]


def broken(folder: Path, how: str) -> Path:
    """A file that must be refused."""
    path, corners = folder / "part.stl", box_corners()
    if how == "missing":
        return path
    if how == "folder":
        path.mkdir()
        return path
    if how == "step":
        path = folder / "part.step"
        path.write_text("ISO-10303-21;")
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
    return path


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ("missing", r"no such mesh file.*part\.mesh"),
        ("folder", "is a folder"),
        ("step", r"\.step is not supported yet.*\.stl"),
        ("empty", "the file is empty"),
        ("no triangles", "holds no triangles"),
        ("truncated", "truncated.*says 12 triangles and holds 6"),
        ("truncated text", "truncated.*endsolid"),
        ("not an stl", "truncated or not an STL"),
        ("nan", "1 triangles have a corner that is not a number.*triangle 5 of 12"),
        ("open", r"not closed: \d+ open edges in [12] holes?, the first from \(.*\) mm to \(.*\) mm"),
        ("non-manifold", r"not manifold: 1 edges.*the first from \(10, 10, -10\) mm to \(10, 10, 10\) mm"),
        ("too small", r"measures 0\.02 x 0\.02 x 0\.02 mm.*'m' or 'in'"),
        ("too big", r"measures 20000 x 20000 x 20000 mm.*'um'"),
        ("damaged ply", "cannot be read as PLY, it is damaged or truncated"),
    ],
)
def test_what_is_refused_is_named_with_its_place(tmp_path: Path, how: str, said: str) -> None:
    path = broken(tmp_path, how)

    with pytest.raises(InputError, match=said) as caught:
        read_part(path, "mm")
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_an_exporter_put_behind_a_binary_stl_is_ignored(tmp_path: Path) -> None:
    plain, longer = tmp_path / "plain.stl", tmp_path / "longer.stl"
    trimesh.creation.box((20, 20, 20)).export(plain)
    longer.write_bytes(plain.read_bytes() + bytes(40))
    assert (read_part(longer, "mm").vertices == read_part(plain, "mm").vertices).all()
