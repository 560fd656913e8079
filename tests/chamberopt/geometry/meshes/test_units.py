"""Units: given by the design, stated by the file, or guessed from the size."""

from pathlib import Path

import pytest
import trimesh

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.part_mesh import read_part
from tests.helpers.mesh_files import box_corners, write_stl


@pytest.mark.parametrize(
    ("unit", "metres"), [("um", 1e-6), ("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("in", 0.0254)]
)
def test_units(tmp_path: Path, unit: str, metres: float) -> None:
    path = write_stl(tmp_path / "box.stl", box_corners(0.05 / metres))

    assert read_part(path, unit).size == pytest.approx([0.05] * 3, rel=1e-6)


@pytest.mark.parametrize(
    ("size", "unit", "metres"),
    [(20.0, "mm", 1e-3), (1200.0, "mm", 1e-3), (0.02, "m", 1.0), (30000.0, "um", 1e-6)],
)
def test_a_unit_is_guessed_from_the_size_with_a_note(
    tmp_path: Path, size: float, unit: str, metres: float
) -> None:
    part = read_part(write_stl(tmp_path / "box.stl", box_corners(size)))

    assert part.unit == unit
    assert part.size == pytest.approx([size * metres] * 3, rel=1e-6)
    assert f"unit guessed as '{unit}' (by its size): the part measures" in part.notes[0]


@pytest.mark.parametrize(
    ("comment", "unit"), [("# units = inch", "in"), ("# Unit: centimeters", "cm")]
)
def test_a_comment_that_states_the_unit_is_believed_before_the_size(
    tmp_path: Path, comment: str, unit: str
) -> None:
    path = tmp_path / "box.obj"
    trimesh.creation.box((2, 2, 2)).export(path)
    path.write_text(f"{comment}\n{path.read_text()}")

    part = read_part(path)

    assert part.unit == unit
    assert "a comment in the file says" in part.notes[0]


def test_a_size_that_fits_no_unit_asks_for_the_unit(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"cannot be guessed from a longest side of 2.*give part\.unit"
    ):
        read_part(write_stl(tmp_path / "box.stl", box_corners(2.0)))
