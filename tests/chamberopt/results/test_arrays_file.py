"""Chamber and fields come back bit for bit, and a file that would mislead is refused."""

import struct
import zipfile
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.common.errors import InputError
from chamberopt.coverage.field.display_mesh import DisplayField
from chamberopt.design.load import load_design
from chamberopt.results.arrays_file import (
    ARRAYS_FILE,
    ResultArrays,
    load_result_arrays,
    read_result_arrays,
    save_result_arrays,
)
from chamberopt.results.load import load_result
from tests.helpers.results.arrays import change_arrays, plain_arrays
from tests.helpers.results.report_folders import simulated
from tests.helpers.synthetic import DESIGNS, plate_design

PLATE = build_chamber(plate_design())


ARRAYS = plain_arrays(PLATE)


def stored(arrays: ResultArrays, folder: Path) -> Path:
    save_result_arrays(folder, arrays)
    return folder / ARRAYS_FILE


def require_same(one: Any, other: Any) -> None:
    assert type(one) is type(other)
    if is_dataclass(one):
        for field in fields(one):
            require_same(getattr(one, field.name), getattr(other, field.name))
    elif isinstance(one, dict):
        assert list(one) == list(other)
        for name in one:
            require_same(one[name], other[name])
    elif isinstance(one, np.ndarray):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
    else:
        assert one == other


@pytest.mark.parametrize("name", ["plate", "gear_turning", "plate_imported", "blade_oblong"])
def test_it_comes_back_bit_for_bit(name: str, tmp_path: Path) -> None:
    chamber = build_chamber(load_design(DESIGNS / f"{name}.toml"))
    arrays = plain_arrays(chamber)
    require_same(read_result_arrays(stored(arrays, tmp_path)), arrays)


def test_a_part_in_other_triangles_keeps_those_of_its_file(tmp_path: Path) -> None:
    chamber = build_chamber(plate_design(part__target__element_mm=2.0))
    file = read_result_arrays(stored(plain_arrays(chamber), tmp_path)).chamber.part.file
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
    with_groups = replace(file.simulated, groups={"top": part.target})
    return {
        "triangles has a number that is not from 0 to": replace(one, triangles=far),
        "triangles is of type int64": replace(one, triangles=one.triangles.astype(np.int64)),
        "chamber.vertices has a number that is not from": replace(one, vertices=nowhere),
        "source has a number that is not from -1 to": replace(one, source=beyond),
        "tags has the shape": replace(one, tags=one.tags[:-1]),
        "without a sonotrode": replace(one, tags=np.where(one.tags == 1, 2, one.tags).astype("u1")),
        "a value is of another type": replace(one, part=replace(part, target="all")),  # type: ignore[arg-type]
        "target is of type int8": replace(
            one, part=replace(part, target=part.target.astype(np.int8))
        ),
        "simulated.vertices has the shape": replace(
            one, part=replace(part, file=replace(file, simulated=short))
        ),
        "unit 'mile'": replace(one, part=replace(part, unit="mile")),
        "surface of its part is without its name": replace(
            one, part=replace(part, surface=np.zeros(len(part.triangles), dtype=np.int32))
        ),
        "without its part": replace(one, part=replace(part, file=None)),
        "simulated.groups.top' is an array that no result has": replace(
            one, part=replace(part, file=replace(file, simulated=with_groups))
        ),
    }


@pytest.mark.parametrize(("said", "chamber"), wrong_chambers().items())
def test_arrays_that_would_mislead_a_kernel_are_refused(
    said: str, chamber: Chamber, tmp_path: Path
) -> None:
    path = stored(replace(ARRAYS, chamber=chamber), tmp_path)
    with pytest.raises(InputError, match=rf"arrays\.npz: damaged \(.*{said}.*simulate again"):
        read_result_arrays(path)


ELEMENTS, FIELDS, MESH = ARRAYS.elements, ARRAYS.display.fields, ARRAYS.display.mesh
HIDDEN = PLATE.exposed_area == 0.0


def _shown(**fields: np.ndarray) -> DisplayField:
    return replace(ARRAYS.display, fields={**FIELDS, **fields})


def _with_mesh(**columns: np.ndarray) -> DisplayField:
    return replace(ARRAYS.display, mesh=replace(MESH, **columns))


def wrong_fields() -> dict[str, ResultArrays]:
    cover, corners = ELEMENTS["coverage"], MESH.triangles.copy()
    corners[0, 0] = len(MESH.vertices)
    elements = {
        "elements.coverage has the shape": {"coverage": np.stack([cover] * 3, axis=1)},
        "elements.coverage is of type": {"coverage": cover.astype("U9")},
        "elements.coverage has a number that is not from 0 to 1": {"coverage": cover + 1.1},
        "elements.mean_dent_um has a number that is not": {"mean_dent_um": cover + np.inf},
        "elements.other has a number that is not": {"other": cover + 1e300},
        "an exposed triangle has no coverage": {"coverage": cover * np.nan},
        "elements.impacts is of type float64": {"impacts": cover},
        "elements.impacts has a number that is not": {"impacts": ELEMENTS["impacts"] - 1},
        "elements.target is not as in its chamber": {"target": 1 - ELEMENTS["target"]},
        "elements.element is not as in its chamber": {"element": ELEMENTS["element"] + 1},
        "elements.zone_left is of type int64": {"zone_left": ELEMENTS["impacts"]},
    }
    none = FIELDS["coverage"] * np.nan
    display = {
        "display.fields.coverage has a number": _shown(coverage=none),
        "a place on it has no coverage": _shown(
            reachable=np.ones(len(none)), coverage_interval=none
        ),
        "display.fields.resolved has the shape": _shown(resolved=none[:-1]),
        "display.mesh.triangles has a number": _with_mesh(triangles=corners),
        "display.mesh.vertices has a number": _with_mesh(vertices=MESH.vertices * np.nan),
        "display.mesh.normal has the shape": _with_mesh(normal=MESH.normal[:, :2]),
        "leaves out triangles": _with_mesh(part_triangle=MESH.part_triangle * 0),
        "its target has no area": _with_mesh(vertices=MESH.vertices * 0.0),
    }
    return {
        **{k: replace(ARRAYS, elements={**ELEMENTS, **one}) for k, one in elements.items()},
        **{k: replace(ARRAYS, display=one) for k, one in display.items()},
        "without elements.dents": replace(
            ARRAYS, elements={k: one for k, one in ELEMENTS.items() if k != "dents"}
        ),
    }


@pytest.mark.parametrize(("said", "arrays"), wrong_fields().items())
def test_fields_that_no_result_has_are_refused(
    said: str, arrays: ResultArrays, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=rf"arrays\.npz: damaged \(.*{said}.*simulate again"):
        read_result_arrays(stored(arrays, tmp_path))


def test_unknown_values_of_hidden_triangles_are_read(tmp_path: Path) -> None:
    coverage = np.where(HIDDEN, np.nan, 0.5)
    arrays = replace(ARRAYS, elements={**ELEMENTS, "coverage": coverage})
    found = read_result_arrays(stored(arrays, tmp_path)).elements["coverage"]
    assert HIDDEN.any()
    np.testing.assert_array_equal(found, coverage)


def test_a_link_to_arrays_is_refused(tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    link = tmp_path / ARRAYS_FILE
    link.symlink_to(stored(ARRAYS, tmp_path / "own"))
    with pytest.raises(InputError, match=r"arrays\.npz: .*link"):
        read_result_arrays(link)


def test_files_that_hold_no_arrays_are_refused(tmp_path: Path) -> None:
    path = stored(ARRAYS, tmp_path)
    whole = path.read_bytes()
    for wrong in (b"", b"PK", whole[: len(whole) // 2], whole[:50] + bytes(80) + whole[130:]):
        path.write_bytes(wrong)
        with pytest.raises(InputError, match=r"arrays\.npz: damaged"):
            read_result_arrays(path)
    trees = [
        "{}",
        "[]",
        "3",
        '{"is": "Popen", "of": {}}',
        '{"is": "ResultArrays", "of": []}',
        "[" * 9999,
    ]
    for tree in trees:
        np.savez(path, tree=np.frombuffer(tree.encode(), dtype=np.uint8))
        with pytest.raises(InputError, match=r"arrays\.npz: damaged"):
            read_result_arrays(path)
    np.savez(path, tree=np.array({"a": 1}), allow_pickle=True)
    with pytest.raises(InputError, match="allow_pickle=False"):
        read_result_arrays(path)
    np.savez_compressed(path, tree=np.zeros(200_000_000, dtype=np.uint8))
    with pytest.raises(InputError, match="unpacks to 200 MB"):
        read_result_arrays(path)


@pytest.mark.parametrize(
    "header",
    [
        "{'descr': '<f8', 'fortran_order': False, 'shape': (3",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (" + "9" * 30 + ",)}",
        "{'descr': (), 'fortran_order': False, 'shape': (3,)}",
        "  {'descr': '<f8',\n 'fortran_order': False, 'shape': (3,)}",
    ],
)
def test_headers_that_numpy_cannot_read_are_refused(header: str, tmp_path: Path) -> None:
    path = tmp_path / ARRAYS_FILE
    text = header.encode().ljust(117) + b"\n"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("tree.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text)
    with pytest.raises(InputError, match=r"arrays\.npz: damaged"):
        read_result_arrays(path)


def test_encrypted_and_unknown_packing_is_refused(tmp_path: Path) -> None:
    path = stored(ARRAYS, tmp_path)
    whole = bytearray(path.read_bytes())
    local, central = whole.index(b"PK\x03\x04"), whole.index(b"PK\x01\x02")
    for places, value in (((local + 6, central + 8), 1), ((local + 8, central + 10), 14)):
        damaged = bytearray(whole)
        for place in places:
            damaged[place] = value
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"arrays\.npz: damaged"):
            read_result_arrays(path)


def test_arrays_of_another_part_are_refused(tmp_path: Path) -> None:
    """Digests are right: whoever exchanged the file has written them anew."""
    folder, chamber = simulated(tmp_path / "plate")
    part = chamber.part
    assert load_result_arrays(load_result(folder)).part.n_cells == len(part.triangles)
    for wrong in (
        replace(chamber, part=replace(part, sha256="0" * 64)),
        replace(chamber, part=replace(part, zones={"root": part.target})),
    ):
        change_arrays(folder, lambda one, wrong=wrong: replace(one, chamber=wrong))
        with pytest.raises(InputError, match="of another part or other zones"):
            load_result_arrays(load_result(folder))
