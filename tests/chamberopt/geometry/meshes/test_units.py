"""Units: given by the design, stated by the file, or guessed from the size."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.geometry.meshes.units import MAX_SIZE, METRES_PER, MIN_SIZE, find_unit
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


@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("m", 1.0)])
def test_a_part_has_a_size_that_parts_have(tmp_path: Path, unit: str, metres: float) -> None:
    for size, is_part in ((1.01 * MIN_SIZE, True), (0.99 * MIN_SIZE, False),
                          (0.99 * MAX_SIZE, True), (1.01 * MAX_SIZE, False)):  # fmt: skip
        corners = np.array(box_corners(size / metres))
        if is_part:
            assert find_unit(tmp_path, b"", corners, unit, None) == (unit, [])
        else:
            with pytest.raises(InputError, match="allowed: longest side") as refused:
                find_unit(tmp_path, b"", corners, unit, None)
            for other, its_metres in METRES_PER.items():
                fits = MIN_SIZE <= size / metres * its_metres <= MAX_SIZE
                assert (f"{other!r}" in str(refused.value).partition("; unit = ")[2]) == fits


def test_a_unit_that_the_file_states_is_told_unless_it_is_asked_for(tmp_path: Path) -> None:
    corners = np.array(box_corners(20.0))
    assert find_unit(tmp_path, b"", corners, "mm", "mm") == ("mm", [])
    unit, (note,) = find_unit(tmp_path, b"", corners, "guess", "mm")
    assert (unit, note.partition(":")[0]) == ("mm", "unit stated by the file")
    with pytest.raises(InputError, match="the file says"):
        find_unit(tmp_path, b"", corners, "in", "mm")
