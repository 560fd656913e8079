"""A chamber comes back from its file bit for bit, and a file that would mislead is refused."""

from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.common.errors import InputError
from chamberopt.common.npz_files import save_record
from chamberopt.design.load import load_design
from chamberopt.results.chamber_file import CHAMBER_FILE, load_chamber
from tests.helpers.synthetic import DESIGNS, plate_design

PLATE = build_chamber(plate_design())


def stored(chamber: Chamber, folder: Path) -> Any:
    """A stand-in for a result with this chamber's file."""
    save_record(folder / CHAMBER_FILE, chamber)
    return SimpleNamespace(path=lambda name: folder / name)


def require_same(one: Any, other: Any) -> None:
    assert type(one) is type(other)
    if is_dataclass(one):
        for field in fields(one):
            require_same(getattr(one, field.name), getattr(other, field.name))
    elif isinstance(one, np.ndarray):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
    else:
        assert one == other


@pytest.mark.parametrize("name", ["plate", "gear_turning", "plate_imported", "blade_oblong"])
def test_it_comes_back_bit_for_bit(name: str, tmp_path: Path) -> None:
    chamber = build_chamber(load_design(DESIGNS / f"{name}.toml"))
    require_same(load_chamber(stored(chamber, tmp_path)), chamber)


def test_a_part_in_other_triangles_keeps_those_of_its_file(tmp_path: Path) -> None:
    chamber = build_chamber(plate_design(part__target__element_mm=2.0))
    file = load_chamber(stored(chamber, tmp_path)).part.file
    assert file is not None
    assert file.original is not None
    assert PLATE.part.file is not None
    require_same(file.original, PLATE.part.file.simulated)


def wrong_chambers() -> dict[str, Chamber]:
    one, part, file = PLATE, PLATE.part, PLATE.part.file
    assert file is not None
    far = one.triangles.copy()
    far[3, 1] = len(one.vertices)
    nowhere = one.vertices.copy()
    nowhere[0, 0] = np.nan
    beyond = one.source + len(part.triangles)
    short = replace(file.simulated, vertices=file.simulated.vertices[:-1])
    return {
        "triangles is not from 0 to": replace(one, triangles=far),
        "triangles is of type int64": replace(one, triangles=one.triangles.astype(np.int64)),
        "vertices has a number that is not finite": replace(one, vertices=nowhere),
        "source is not from -1 to": replace(one, source=beyond),
        "tags has the shape": replace(one, tags=one.tags[:-1]),
        "without a sonotrode": replace(one, tags=np.where(one.tags == 1, 2, one.tags).astype("u1")),
        "target is no array": replace(one, part=replace(part, target="all")),  # type: ignore[arg-type]
        "another size than in its file": replace(
            one, part=replace(part, file=replace(file, simulated=short))
        ),
        "unit 'mile'": replace(one, part=replace(part, unit="mile")),
        "without its part": replace(one, part=replace(part, file=None)),
    }


@pytest.mark.parametrize(("said", "chamber"), wrong_chambers().items())
def test_arrays_that_would_mislead_a_kernel_are_refused(
    said: str, chamber: Chamber, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=rf"chamber\.npz: damaged \(.*{said}.*simulate again"):
        load_chamber(stored(chamber, tmp_path))


def test_files_that_are_no_chamber_are_refused(tmp_path: Path) -> None:
    result = stored(PLATE, tmp_path)
    path = tmp_path / CHAMBER_FILE
    whole = path.read_bytes()
    for wrong in (b"", b"PK", whole[: len(whole) // 2], whole[:50] + bytes(80) + whole[130:]):
        path.write_bytes(wrong)
        with pytest.raises(InputError, match=r"chamber\.npz: damaged"):
            load_chamber(result)
    trees = [
        "{}",
        "[]",
        "3",
        '{"is": "Popen", "of": {}}',
        '{"is": "Chamber", "of": []}',
        "[" * 9999,
    ]
    for tree in trees:
        np.savez(path, tree=np.frombuffer(tree.encode(), dtype=np.uint8))
        with pytest.raises(InputError, match=r"chamber\.npz: damaged"):
            load_chamber(result)
    np.savez(path, tree=np.array({"a": 1}), allow_pickle=True)
    with pytest.raises(InputError, match="allow_pickle=False"):
        load_chamber(result)
    np.savez_compressed(path, tree=np.zeros(200_000_000, dtype=np.uint8))
    with pytest.raises(InputError, match="unpacks to 200 MB"):
        load_chamber(result)
