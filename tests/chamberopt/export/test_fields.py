"""Exported fields, in the numbers of the part's file.

They are read back by libraries of other programs or by a reader in this file.
"""

import re
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import pyvista
import tomlkit

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.common.errors import InputError
from chamberopt.design.load import Design, load_design
from chamberopt.export.element_fields import COLUMNS
from chamberopt.export.fields import write_fields
from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.results.arrays_file import ARRAYS_FILE, read_result_arrays
from chamberopt.workflows.save_run import save_simulation
from tests.helpers.results.arrays import change_arrays, change_elements
from tests.helpers.synthetic import plate_design, poisson_evaluation

SIDES = (20.0, 20.0, 8.0)
TOP = 5  # squares along each side of the large faces


def plate_quads() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A plate's corners [mm], its quadrilaterals and their numbers.

    The quadrilaterals face outward and begin with the lower face. Their numbers have gaps and do
    not rise.
    """
    line = np.linspace(0.0, SIDES[0], TOP + 1)
    points = np.array([(x, y, z) for z in (0.0, SIDES[2]) for y in line for x in line])
    node = np.arange(len(points)).reshape(2, TOP + 1, TOP + 1)  # z, y, x
    low, high = node
    flat = [
        (low[j, i], low[j + 1, i], low[j + 1, i + 1], low[j, i + 1])
        for j in range(TOP)
        for i in range(TOP)
    ]
    flat += [
        (high[j, i], high[j, i + 1], high[j + 1, i + 1], high[j + 1, i])
        for j in range(TOP)
        for i in range(TOP)
    ]
    rings = [low[0, :], low[:, -1], low[-1, ::-1], low[::-1, 0]]
    above = [high[0, :], high[:, -1], high[-1, ::-1], high[::-1, 0]]
    for below, up in zip(rings, above, strict=True):
        flat += [(below[k], below[k + 1], up[k + 1], up[k]) for k in range(TOP)]
    quads = np.array(flat)
    numbers = 1000 - 7 * np.arange(len(quads))
    return points, quads, numbers


def nastran_plate(path: Path) -> np.ndarray:
    points, quads, numbers = plate_quads()
    lines = [f"GRID,{k},,{x:.6f},{y:.6f},{z:.6f}" for k, (x, y, z) in enumerate(points, start=1)]
    lines += [
        f"CQUAD4,{n},1," + ",".join(str(k + 1) for k in quad)
        for n, quad in zip(numbers, quads, strict=True)
    ]
    path.write_text("\n".join(["BEGIN BULK", *lines, "ENDDATA"]) + "\n")
    return numbers


def abaqus_plate(path: Path, instance: bool = False) -> np.ndarray:
    points, quads, numbers = plate_quads()
    mesh = ["*Node", *(f"{k}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(points, start=1))]
    mesh.append("*Element, type=S4")
    mesh += [
        f"{n}, " + ", ".join(str(k + 1) for k in quad)
        for n, quad in zip(numbers, quads, strict=True)
    ]
    if instance:
        put = [
            "*Assembly, name=A",
            "*Instance, name=Plate-1, part=Plate",
            "*End Instance",
            "*End Assembly",
        ]
        mesh = ["*Part, name=Plate", *mesh, "*End Part", *put]
    path.write_text("\n".join(["*Heading", *mesh]) + "\n")
    return numbers


def stl_plate(path: Path) -> None:
    points, quads, _ = plate_quads()
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    pyvista.PolyData.from_regular_faces(points, faces).save(path)


def design_with(mesh: Path, **target: float) -> Design:
    values = plate_design().model_dump(mode="json", exclude_none=True)
    values["part"] = {
        "mesh": str(mesh),
        "unit": "mm",
        "target": {"direction": [0, 0, -1], "angle_deg": [0, 10], **target},
    }
    values["process"]["treatment_time_s"] = 3000.0  # coverage from 50 to 98 %
    path = mesh.parent / "design.toml"
    path.write_text(tomlkit.dumps(values))
    return load_design(path)


def simulated(mesh: Path, **target: float) -> tuple[Path, Chamber]:
    """A results folder of that part, made without a simulation.

    Dents, speeds, angles and dent sizes are random.
    """
    design = design_with(mesh, **target)
    chamber = build_chamber(design)
    folder = mesh.parent / "result"
    save_simulation(folder, design, chamber, poisson_evaluation(design, chamber, per_mm2=1.0))
    hit = read_result_arrays(folder / ARRAYS_FILE).elements["dents"] > 0
    names, lots = (
        "mean_normal_speed p90_normal_speed mean_angle_deg mean_dent_um",
        np.random.default_rng(3),
    )
    columns = {
        name: np.where(hit, lots.uniform(1.0, 9.0, len(hit)), np.nan) for name in names.split()
    }
    change_elements(folder, **columns)
    return folder, chamber


@pytest.fixture(autouse=True)
def _no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)


def distributions(text: str) -> dict[str, dict[str, float]]:
    """The *Distribution blocks by name, each a map from the label as written to the value.

    The default value is checked and left out.
    """
    found: dict[str, dict[str, float]] = {}
    for block in re.split(r"(?m)^(?=\*[A-Za-z])", text):
        head, *rows = [line for line in block.splitlines() if not line.startswith("**")] or [""]
        if head.lower().startswith("*distribution,"):
            options = dict(word.strip().split("=") for word in head.split(",")[1:])
            assert options["location"] == "ELEMENT"
            assert f"*Distribution Table, name={options['table']}\nRATIO\n" in text
            assert [float(word or "nan") for word in rows[0].split(",")][1] == 0.0
            assert not rows[0].split(",")[0].strip()
            found[options["name"]] = {
                row.split(",")[0].strip(): float(row.split(",")[1]) for row in rows[1:]
            }
    return found


def pressures(text: str) -> dict[str, dict[int, float]]:
    """PLOAD4 of large field format by the quantity that the comments give to their SID."""
    names = dict(re.findall(r"^\$ SID (\d+) (\w+)$", text, re.M))
    found: dict[str, dict[int, float]] = {name: {} for name in names.values()}
    lines = text.splitlines()
    for at, line in enumerate(lines):
        assert len(line) <= 72 or line.startswith("$")
        if line.startswith("PLOAD4*"):
            sid, element, value = line[8:24], line[24:40], line[40:56]
            assert lines[at + 1] == "*"
            assert "." in value
            assert int(element) not in found[names[sid.strip()]]
            found[names[sid.strip()]][int(element)] = float(value)
    return found


def means_by_hand(folder: Path) -> dict[str, dict[int, float]]:
    """Some columns of each element from its triangles, one by one."""
    surface = read_result_arrays(folder / ARRAYS_FILE).part
    names = ("COVERAGE", "MEAN_NORMAL_SPEED", "MEAN_DENT_UM", "DENTS")
    found: dict[str, dict[int, float]] = {name: {} for name in names}
    for number in np.unique(surface["element"]):
        rows = [k for k in range(surface.n_cells) if surface["element"][k] == number]
        area = sum(surface["exposed_area_mm2"][k] for k in rows)
        if area > 0:
            exposed = [k for k in rows if surface["exposed_area_mm2"][k] > 0]
            whole = sum(surface["coverage"][k] * surface["exposed_area_mm2"][k] for k in exposed)
            found["COVERAGE"][int(number)] = whole / area
        impacts = [
            surface["dents"][k] for k in rows
        ]  # every impact of the made-up evaluation leaves a dent
        found["DENTS"][int(number)] = float(sum(impacts))
        for name in names[1:3] if sum(impacts) else ():
            sums = [surface[name.lower()][k] * n for k, n in zip(rows, impacts, strict=True) if n]
            found[name][int(number)] = sum(sums) / sum(impacts)
    return found


def assert_same(found: dict[int, float], expected: dict[int, float]) -> None:
    assert sorted(found) == sorted(expected)
    assert [found[k] for k in sorted(found)] == pytest.approx(
        [expected[k] for k in sorted(expected)], rel=1e-8
    )


def test_a_nastran_parts_elements_get_their_own_numbers_back(tmp_path: Path) -> None:
    numbers = nastran_plate(tmp_path / "plate.bdf")
    folder, chamber = simulated(tmp_path / "plate.bdf")
    assert sorted(set(chamber.part.elements.tolist())) == sorted(numbers.tolist())

    remarks = write_fields(folder, tmp_path / "fields.bdf", "nastran")

    text = (tmp_path / "fields.bdf").read_text()
    found, expected = pressures(text), means_by_hand(folder)
    assert "GRID" not in text
    assert len(expected["COVERAGE"]) < len(numbers)
    hidden = len(numbers) - len(expected["COVERAGE"])
    assert [remark.split(":")[0] for remark in remarks] == [
        f"left out {hidden} of {len(numbers)} elements, not exposed or never hit"
    ]
    for name, values in expected.items():
        assert_same(found[name], values)
    # The treated face's elements, by where the file has them: the first 25 of it.
    assert {k for k, value in found["TARGET"].items() if value} == set(
        numbers[: TOP * TOP].tolist()
    )


def test_an_abaqus_parts_elements_get_their_own_numbers_back(tmp_path: Path) -> None:
    abaqus_plate(tmp_path / "plate.inp")
    folder, _ = simulated(tmp_path / "plate.inp")

    write_fields(folder, tmp_path / "fields.inp", "abaqus")

    text = (tmp_path / "fields.inp").read_text()
    found, expected = distributions(text), means_by_hand(folder)
    for name, values in expected.items():
        assert_same({int(k): value for k, value in found[name].items()}, values)
    # Put into the deck it came from, its sets are names of the part; the part is the same.
    (tmp_path / "whole.inp").write_text((tmp_path / "plate.inp").read_text() + text)
    part, whole = read_part(tmp_path / "plate.inp", "mm"), read_part(tmp_path / "whole.inp", "mm")
    np.testing.assert_array_equal(whole.vertices, part.vertices)
    np.testing.assert_array_equal(whole.elements, part.elements)
    bands = {name: set(part.elements[mask].tolist()) for name, mask in whole.groups.items()}
    assert len(bands) > 1
    for low, high in ((0, 50), (50, 90), (90, 98), (98, 100)):
        inside = {
            number for number, value in expected["COVERAGE"].items() if low <= 100 * value < high
        }
        assert bands.get(f"COVERAGE_{low}_TO_{high}", set()) == inside
    assert sum(map(len, bands.values())) == len(expected["COVERAGE"])


def test_labels_of_an_abaqus_instance_carry_its_name_and_sets_are_for_its_assembly(
    tmp_path: Path,
) -> None:
    abaqus_plate(tmp_path / "plate.inp", instance=True)
    folder, _ = simulated(tmp_path / "plate.inp")

    remarks = write_fields(folder, tmp_path / "fields.inp", "abaqus")

    text, sets = (tmp_path / "fields.inp").read_text(), (tmp_path / "fields_sets.inp").read_text()
    assert any("fields_sets.inp" in remark and "*Assembly" in remark for remark in remarks)
    found, expected = distributions(text), means_by_hand(folder)
    assert_same(
        {int(k.removeprefix("PLATE-1.")): value for k, value in found["COVERAGE"].items()},
        expected["COVERAGE"],
    )
    assert all(label.startswith("PLATE-1.") for label in found["COVERAGE"])
    assert "*Elset" not in text
    whole = (tmp_path / "plate.inp").read_text().replace(
        "*End Assembly\n", sets + "*End Assembly\n"
    ) + text
    (tmp_path / "whole.inp").write_text(whole)
    groups = read_part(tmp_path / "whole.inp", "mm").groups
    assert sum(mask.sum() for mask in groups.values()) == 2 * len(
        expected["COVERAGE"]
    )  # two triangles a square


@pytest.mark.parametrize(("to", "suffix"), [("abaqus", "inp"), ("nastran", "bdf")])
def test_a_part_without_element_numbers_is_written_along(
    tmp_path: Path, to: str, suffix: str
) -> None:
    stl_plate(tmp_path / "plate.stl")
    folder, _ = simulated(tmp_path / "plate.stl")

    remarks = write_fields(folder, tmp_path / f"fields.{suffix}", to)

    assert any("no unique element numbers" in remark and "in mm" in remark for remark in remarks)
    part, back = (
        read_part(tmp_path / "plate.stl", "mm"),
        read_part(tmp_path / f"fields.{suffix}", "mm"),
    )
    np.testing.assert_allclose(
        back.vertices[back.triangles], part.vertices[part.triangles], rtol=1e-11, atol=1e-15
    )
    assert back.elements.tolist() == list(range(1, len(part.triangles) + 1))
    text, surface = (
        (tmp_path / f"fields.{suffix}").read_text(),
        read_result_arrays(folder / ARRAYS_FILE).part,
    )
    found = {
        int(k): v
        for k, v in (distributions if to == "abaqus" else pressures)(text)["COVERAGE"].items()
    }
    known = np.flatnonzero(np.isfinite(surface["coverage"]))
    assert_same(found, {int(k) + 1: surface["coverage"][k] for k in known})


@pytest.mark.parametrize("element_mm", [1.0, 9.0])
def test_where_the_target_was_meshed_anew_elements_get_what_lies_on_them(
    tmp_path: Path, element_mm: float
) -> None:
    """Square elements of 4 mm are covered with triangles finer and coarser than themselves.

    Coverage that rises along x tells the elements apart.
    """
    numbers = nastran_plate(tmp_path / "plate.bdf")
    folder, _ = simulated(tmp_path / "plate.bdf", element_mm=element_mm)
    surface = read_result_arrays(folder / ARRAYS_FILE).part
    x, y = surface.cell_centers().points[:, :2].T - [[surface.bounds[0]], [surface.bounds[2]]]
    row, column = ((TOP * at / SIDES[0]).astype(int) for at in (y, x))
    treated = surface["target"] > 0
    np.testing.assert_array_equal(surface["element"][treated], numbers[TOP * row + column][treated])
    coverage = np.where(surface["exposed_area_mm2"] > 0, x / SIDES[0], np.nan)
    change_elements(folder, coverage=coverage)

    remarks = write_fields(folder, tmp_path / "fields.bdf", "nastran")

    found = pressures((tmp_path / "fields.bdf").read_text())
    assert any("element_mm" in remark for remark in remarks)
    assert "DENTS" not in found
    points, quads, _ = plate_quads()
    middles = dict(zip(numbers.tolist(), points[quads].mean(axis=1)[:, 0] / SIDES[0], strict=True))
    lower = numbers[: TOP * TOP].tolist()
    assert set(lower) <= set(found["COVERAGE"])
    off = [abs(found["COVERAGE"][k] - middles[k]) * SIDES[0] for k in lower]
    assert max(off) < (
        0.5 if element_mm == 1.0 else 6.0
    )  # mm: where a triangle's middle may lie from its element's


def test_vtkhdf_and_vtp_hold_every_field(tmp_path: Path) -> None:
    stl_plate(tmp_path / "plate.stl")
    folder, _ = simulated(tmp_path / "plate.stl")
    given = read_result_arrays(folder / ARRAYS_FILE).part

    for to in ("vtp", "vtkhdf"):
        assert write_fields(folder, tmp_path / f"fields.{to}", to) == []
        back = pyvista.read(tmp_path / f"fields.{to}")
        np.testing.assert_array_equal(back.points, given.points)
        np.testing.assert_array_equal(back.regular_faces, given.regular_faces)
        assert set(back.cell_data) == set(given.cell_data)
        for name in given.cell_data:
            np.testing.assert_array_equal(back[name], given[name])
    with h5py.File(tmp_path / "fields.vtkhdf") as file:
        root = file["VTKHDF"]
        assert root.attrs["Type"] == b"PolyData"
        np.testing.assert_array_equal(root["CellData"]["element"], given["element"])
        assert len(root["Polygons"]["Offsets"]) == given.n_cells + 1


def test_every_column_of_a_result_is_handed_on(tmp_path: Path) -> None:
    stl_plate(tmp_path / "plate.stl")
    folder, _ = simulated(tmp_path / "plate.stl")
    surface = read_result_arrays(folder / ARRAYS_FILE).part
    assert set(surface.cell_data) - {"element"} <= set(COLUMNS)


def test_what_cannot_be_handed_on_is_said(tmp_path: Path) -> None:
    nastran_plate(tmp_path / "plate.bdf")
    folder, _ = simulated(tmp_path / "plate.bdf")
    with pytest.raises(
        InputError, match="not written as 'ansys'; use one of vtp, vtkhdf, abaqus, nastran"
    ):
        write_fields(folder, tmp_path / "a.cdb", "ansys")
    with pytest.raises(InputError, match=r"name it fields\.vtkhdf"):
        write_fields(folder, tmp_path / "fields.h5", "vtkhdf")
    with pytest.raises(InputError, match="nowhere does not exist; make it first"):
        write_fields(folder, tmp_path / "nowhere" / "a.inp", "abaqus")
    with pytest.raises(InputError, match="part's own file"):
        write_fields(folder, tmp_path / "plate.bdf", "nastran")
    with pytest.raises(InputError, match="not a results folder"):
        write_fields(tmp_path, tmp_path / "a.bdf", "nastran")

    (tmp_path / "plate.bdf").unlink()
    for to in ("nastran", "vtp"):
        write_fields(folder, tmp_path / f"a.{to}", to)

    change_arrays(
        folder,
        lambda one: replace(
            one, elements={k: v for k, v in one.elements.items() if k != "element"}
        ),
    )
    for to in ("vtp", "vtkhdf", "abaqus", "nastran"):
        said = r"arrays\.npz: damaged \(without elements\.element\); .*simulate again"
        with pytest.raises(InputError, match=said):
            write_fields(folder, tmp_path / f"b.{to}", to)


def test_nastran_takes_no_fields_on_solids(tmp_path: Path) -> None:
    corners = [(x, y, z) for z in (0, 8) for x, y in ((0, 0), (20, 0), (20, 20), (0, 20))]
    lines = [f"GRID,{k},,{x}.,{y}.,{z}." for k, (x, y, z) in enumerate(corners, start=1)]
    (tmp_path / "block.bdf").write_text(
        "\n".join(["BEGIN BULK", *lines, "CHEXA,77,1,1,2,3,4,5,6", "+,7,8", "ENDDATA"])
    )
    folder, _ = simulated(tmp_path / "block.bdf")

    with pytest.raises(InputError, match="solid elements are not supported as Nastran loads"):
        write_fields(folder, tmp_path / "a.bdf", "nastran")
    write_fields(folder, tmp_path / "a.inp", "abaqus")

    assert list(distributions((tmp_path / "a.inp").read_text())["COVERAGE"]) == ["77"]
