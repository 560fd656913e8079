"""3MF files: names of objects, and the unit."""

import re
import zipfile
from pathlib import Path

import pytest
import trimesh

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.geometry.meshes.threemf import _copies
from tests.helpers.mesh_files import SIDES, named_area, volume


def test_a_3mf_names_its_objects_and_states_its_unit(tmp_path: Path) -> None:
    pytest.importorskip("lxml")
    path, inches = tmp_path / "box.3mf", tmp_path / "inches.3mf"
    left, right = trimesh.creation.box(SIDES), trimesh.creation.box(SIDES)
    right.apply_translation([50, 0, 0])
    trimesh.Scene({"left": left, "right": right}).export(path)
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(inches, "w") as new:
        for name in old.namelist():
            new.writestr(name, re.sub(rb'unit="\w+"', b'unit="inch"', old.read(name)))

    part = read_part(path)
    large = read_part(inches)

    assert volume(part) == pytest.approx(48e-6, rel=1e-6)
    assert [named_area(part, name) for name in ("left", "right")] == pytest.approx([5200e-6] * 2)
    assert (part.unit, large.unit) == ("mm", "in")
    assert large.size == pytest.approx(part.size * 25.4)
    with pytest.raises(InputError, match=r"part\.unit is 'mm', but the file says .*'in'"):
        read_part(inches, "mm")


def test_a_3mf_is_read_where_lxml_is_there(tmp_path: Path) -> None:
    pytest.importorskip("lxml")
    path = tmp_path / "box.3mf"
    trimesh.creation.box((20, 20, 20)).export(path)

    assert read_part(path, "mm").size == pytest.approx([0.02] * 3)


def test_bodies_are_counted_in_the_largest_object_also_where_objects_repeat_objects() -> None:
    def model(*objects: tuple[int, ...]) -> bytes:
        """Objects numbered from 1, each of which repeats others; one without any is a body."""
        return "".join(
            f'<object id="{number}">'
            + "".join(f'<component objectid="{one}"/>' for one in repeated)
            + "</object>"
            for number, repeated in enumerate(objects, start=1)
        ).encode()

    assert _copies(b"") == 0
    assert _copies(model((), (1, 1, 1))) == 3
    assert _copies(model((), (1, 1), (2, 2, 1), (2,))) == 5
    assert _copies(model((), *(((number, number)) for number in range(1, 31)))) == 2**30
    assert _copies(model((), *(((number, number)) for number in range(1, 3000)))) >= 2**60
