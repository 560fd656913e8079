"""A mesh of trimesh or PyVista becomes the file of a part, or is refused as its file would be."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

import chamberopt
from chamberopt.common.errors import InputError
from chamberopt.design.load import load_design, save_design
from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.results.vtp_files import pyvista
from chamberopt.workflows.part_file import write_part
from tests.helpers.synthetic import plate_design


def ring() -> trimesh.Trimesh:
    """A ring of 20 mm, whose coordinates [mm] are not numbers of single precision."""
    return trimesh.creation.annulus(7.0 + 1e-9, 10.0, 5.0)


def in_quads() -> Any:
    """The box of 10 x 20 x 30 mm, of PyVista, in quadrilaterals."""
    return pyvista().Box((0.0, 10.0, 0.0, 20.0, 0.0, 30.0), quads=True)


@pytest.mark.parametrize(
    ("mesh", "volume"),
    [(ring(), ring().volume), (pyvista().wrap(ring()), ring().volume), (in_quads(), 6000.0)],
    ids=["trimesh", "pyvista", "quadrilaterals"],
)
def test_the_file_holds_the_mesh_to_the_last_bit(mesh: Any, volume: float, tmp_path: Path) -> None:
    file = write_part(mesh, tmp_path / "part.ply", "mm")
    part = read_part(file, "mm")
    points = mesh.vertices if isinstance(mesh, trimesh.Trimesh) else mesh.points
    points = np.asarray(points, dtype=float)
    assert {tuple(one) for one in part.vertices} == {tuple(one) for one in points * 1e-3 + 0.0}
    corners = part.vertices[part.triangles]
    found = np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert found == pytest.approx(volume * 1e-9)
    assert read_part(file).unit == "mm"  # as its comment says
    before = file.stat().st_mtime_ns
    assert write_part(mesh, file, "mm") == file  # a cell that is run again
    assert file.stat().st_mtime_ns == before


def test_a_design_with_the_mesh_is_a_file_like_any_other(tmp_path: Path) -> None:
    design = plate_design()
    found = chamberopt.with_part(design, ring().apply_scale(1e-3), tmp_path / "ring.ply", unit="m")
    assert (Path(found.part.mesh), found.part.unit) == (tmp_path / "ring.ply", "m")
    assert found.shot == design.shot
    save_design(found, tmp_path / "design.toml")
    assert 'mesh = "ring.ply"' in (tmp_path / "design.toml").read_text(encoding="utf-8")
    assert load_design(tmp_path / "design.toml") == found


def opened() -> trimesh.Trimesh:
    mesh = ring()
    mesh.update_faces(np.arange(len(mesh.faces)) > 20)
    return mesh


@pytest.mark.parametrize("mesh", [opened(), trimesh.Trimesh()], ids=["open", "empty"])
def test_what_is_no_surface_is_refused_as_its_file_is(
    mesh: trimesh.Trimesh, tmp_path: Path
) -> None:
    given = tmp_path / "given.ply"
    if len(mesh.faces):
        mesh.export(given, vertex_normal=False)
    else:
        header = "ply\nformat ascii 1.0\nelement vertex 0\nelement face 0\nend_header\n"
        given.write_text(header, encoding="utf-8")
    with pytest.raises(InputError) as of_file:
        read_part(given, "mm")
    with pytest.raises(InputError) as of_mesh:
        write_part(mesh, tmp_path / "part.ply", "mm")
    assert str(of_mesh.value) == str(of_file.value).replace("given.ply", "part.ply")
    assert not getattr(of_mesh.value, "__notes__", [])
    assert not (tmp_path / "part.ply").exists()


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda at: write_part(ring(), at / "part.stl", "mm"), "written as .ply"),
        (lambda at: write_part(ring(), at / "part.ply", "ft"), "unit: given 'ft'; give one of um"),
        (lambda at: write_part("gear.stl", at / "part.ply", "mm"), "mesh: given str; give a trime"),
        (lambda at: write_part(in_quads(), at / "there.ply", "mm"), "already exists"),
        (lambda at: write_part(ring(), at / "part.ply", "m"), "allowed: longest side"),
        (
            lambda at: write_part(
                trimesh.Trimesh([[np.nan] * 3] * 3, [[0, 1, 2]], process=False),
                at / "part.ply",
                "mm",
            ),
            "a corner that is not a number",
        ),
    ],
    ids=["ending", "unit", "kind", "another", "size", "nan"],
)
def test_other_mistakes_are_named(
    call: Callable[[Path], object], said: str, tmp_path: Path
) -> None:
    there = write_part(ring(), tmp_path / "there.ply", "mm").read_bytes()
    with pytest.raises(InputError, match=said):
        call(tmp_path)
    assert [one.name for one in tmp_path.iterdir()] == ["there.ply"]
    assert (tmp_path / "there.ply").read_bytes() == there


@pytest.mark.parametrize("name", ["points", "regular_faces", "vertices", "faces"])
def test_what_has_half_of_what_a_mesh_has_is_refused(name: str, tmp_path: Path) -> None:
    half = SimpleNamespace(**{name: np.zeros((3, 3), dtype=int)})
    with pytest.raises(InputError, match=r"given SimpleNamespace; give a trimesh\.Trimesh or"):
        write_part(half, tmp_path / "part.ply", "mm")
    assert not list(tmp_path.iterdir())
