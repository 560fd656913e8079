"""Part files: what is read, what is put right and said, what is refused with a reason and a place."""

import itertools
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.common.errors import InputError
from chamberopt.geometry.mesh_io import SurfaceError, read_part, self_intersection
from chamberopt.geometry.triangles import tetrahedron_volumes


def box_corners(size: float = 20.0, at: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    """Corners (12, 3, 3) of an axis-parallel box, outward."""
    mesh = trimesh.creation.box((size, size, size))
    return mesh.vertices[np.asarray(mesh.faces)] + np.asarray(at)


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


@pytest.mark.parametrize(
    ("unit", "metres"), [("um", 1e-6), ("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("in", 0.0254)]
)
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
    ("how", "said"),
    [
        ("missing", r"no such mesh file.*part\.mesh"),
        ("folder", "is a folder"),
        ("step", r"holds no solid|needs the package cascadio"),
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


def ball_corners(subdivisions: int = 4) -> np.ndarray:
    """Corners (m, 3, 3) of a ball of radius 10."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=10.0)
    return ball.vertices[ball.faces]


def test_a_small_hole_is_closed_and_its_place_said(tmp_path: Path) -> None:
    corners = ball_corners(5)
    gone = np.linalg.norm(corners.mean(axis=1) - [0, 0, 10], axis=1).argsort()[:2]

    part = read_part(write_stl(tmp_path / "ball.stl", np.delete(corners, gone, axis=0)), "mm")

    mesh = trimesh.Trimesh(part.vertices, part.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 1e-6, rel=5e-3)
    assert len(part.triangles) == len(
        corners
    )  # as many as were missing, or the hole would not be closed
    assert len(part.notes) == 1
    assert "closed 1 small hole, the widest 0." in part.notes[0]
    assert ", 9.99" in part.notes[0]


def test_a_crack_is_closed_however_long_and_a_large_hole_is_not(tmp_path: Path) -> None:
    """One side of an edge is divided, the other is not: no room between them, and yet no neighbour."""
    corners = box_corners()
    a, b = corners[0, 0], corners[0, 1]
    middle = (a + b) / 2 + [1e-6, 0, 0]
    halves = np.array([[a, middle, corners[0, 2]], [middle, b, corners[0, 2]]])
    split = np.r_[corners[1:], halves]

    part = read_part(write_ascii_stl(tmp_path / "box.stl", split, digits=12), "mm")

    assert tetrahedron_volumes(part.vertices, part.triangles).sum() == pytest.approx(8e-6, rel=1e-5)
    assert any("closed 1 crack less than" in note for note in part.notes)
    with pytest.raises(SurfaceError, match="3 open edges in 1 hole") as caught:
        read_part(write_ascii_stl(tmp_path / "open.stl", corners[1:]), "mm")
    assert caught.value.edges.shape == (3, 2, 3)
    assert caught.value.corners.shape == (11, 3, 3)


def test_a_body_that_crosses_itself_is_refused_with_its_place(tmp_path: Path) -> None:
    """A ball whose top has been pushed down through its bottom."""
    corners = ball_corners(2)
    corners[np.linalg.norm(corners - [0, 0, 10], axis=2) < 1e-6] = [0.1, 0.2, -12.0]

    with pytest.raises(
        SurfaceError, match=r"crosses itself: \d+ pairs of triangles, the first near \(.*\) mm"
    ) as caught:
        read_part(write_stl(tmp_path / "ball.stl", corners), "mm")
    place = caught.value.edges.reshape(-1, 3)
    assert place[:, 2].min() == pytest.approx(-0.012)


def test_bodies_that_overlap_do_not_cross_themselves(tmp_path: Path) -> None:
    corners = np.r_[
        box_corners(), box_corners(at=(10, 10, 10)), ball_corners() + np.array([40, 0, 0])
    ]

    assert read_part(write_stl(tmp_path / "three.stl", corners), "mm").notes == ()


def segment_meets(triangle: np.ndarray, ends: np.ndarray) -> bool:
    """By signed volumes: the ends are on both sides of the plane, and the segment passes within all three sides."""

    def side(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
        return float(np.linalg.det([b - a, c - a, d - a]))

    (a, b, c), (p, q) = triangle, ends
    around = [side(p, q, *edge) > 0 for edge in ((a, b), (b, c), (c, a))]
    return side(a, b, c, p) * side(a, b, c, q) < 0 and len(set(around)) == 1


def test_crossing_triangles_are_found_as_by_trying_each_edge_against_each_triangle() -> None:
    rng = np.random.default_rng(4)
    corners = rng.uniform(0, 1, (120, 1, 3)) + rng.uniform(-0.2, 0.2, (120, 3, 3))
    expected = set()
    for i, j in itertools.combinations(range(len(corners)), 2):
        for one, other in ((i, j), (j, i)):
            edges = corners[one][[[0, 1], [1, 2], [2, 0]]]
            if any(segment_meets(corners[other], ends) for ends in edges):
                expected.add((i, j))

    found = [
        self_intersection._crossing(corners, a, b, 0.0)
        for a, b in self_intersection._close_pairs(corners)
    ]

    pairs = [
        (min(i, j), max(i, j))
        for a, b in found
        for i, j in zip(a.tolist(), b.tolist(), strict=True)
    ]
    assert len(pairs) == len(set(pairs))
    assert set(pairs) == expected
    assert len(expected) > 20


@pytest.mark.parametrize(
    ("size", "unit", "metres"),
    [(20.0, "mm", 1e-3), (1200.0, "mm", 1e-3), (0.02, "m", 1.0), (30000.0, "um", 1e-6)],
)
def test_a_unit_is_guessed_from_the_size_and_said(
    tmp_path: Path, size: float, unit: str, metres: float
) -> None:
    part = read_part(write_stl(tmp_path / "box.stl", box_corners(size)))

    assert part.unit == unit
    assert part.size == pytest.approx([size * metres] * 3, rel=1e-6)
    assert f"unit guessed as '{unit}' (by its size): the part measures" in part.notes[0]


@pytest.mark.parametrize(
    ("said", "unit"), [("# units = inch", "in"), ("# Unit: centimeters", "cm")]
)
def test_a_comment_that_states_the_unit_is_believed_before_the_size(
    tmp_path: Path, said: str, unit: str
) -> None:
    path = tmp_path / "box.obj"
    trimesh.creation.box((2, 2, 2)).export(path)
    path.write_text(f"{said}\n{path.read_text()}")

    part = read_part(path)

    assert part.unit == unit
    assert "a comment in the file says" in part.notes[0]


def test_a_size_that_says_nothing_asks_for_the_unit(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"cannot be guessed from a longest side of 2.*give part\.unit"
    ):
        read_part(write_stl(tmp_path / "box.stl", box_corners(2.0)))


@pytest.mark.long
def test_a_million_triangles_are_read_healed_and_checked(tmp_path: Path) -> None:
    """1.3 million: some 20 s on a 2.5 GHz core; the limit is far above, for machines that do other work too."""
    corners = ball_corners(8)
    gone = np.delete(corners, [5, 700000], axis=0)
    gone[1000:1500] = gone[1000:1500, ::-1]
    start = time.monotonic()

    part = read_part(write_stl(tmp_path / "ball.stl", gone), "mm")

    assert time.monotonic() - start < 180
    assert len(part.triangles) == len(corners) == 1310720
    assert any("closed 2 small holes" in note for note in part.notes)
    assert any("turned 500 triangles" in note for note in part.notes)
