"""Residual stress for other solvers: what is written is read back, and CalculiX agrees."""

import csv
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.coverage.stress_law import arc_height, bending, integrals
from chamberopt.design.almen_strip import STRIPS
from chamberopt.design.flexure import plate_metals
from chamberopt.documents.report import report
from chamberopt.documents.stress import band_text, part_text, stress_sentence
from chamberopt.documents.terminal_lines import result_end
from chamberopt.export.stress import write_shell_layers, write_stress_table
from chamberopt.printers.report_page import write_report
from chamberopt.results.arrays_file import load_result_arrays
from chamberopt.results.load import load_result
from chamberopt.workflows.save_run import save_simulation
from tests.helpers.synthetic import plate_design, poisson_evaluation

HEIGHT = 5.0  # mm
ZONE = {"name": "middle", "target": {"box_mm": [[-15, -15, -1], [15, 15, 1]]}}
PLAIN = plate_design(process__accuracy__points=1000)


def saved(folder: Path, per_mm2: float = 100.0, **changes: Any) -> Path:
    """A result with random dents on a plate of 7075-T6; nothing is simulated."""
    design = PLAIN.changed(
        {"materials.part": {"alloy": "7075-T6"}, "process.treatment_time_s": 100.0, **changes}
    )
    chamber = build_chamber(design)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
        evaluation = poisson_evaluation(design, chamber, per_mm2)
        save_simulation(folder, design, chamber, evaluation)
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("stress") / "plate"
    return saved(place, stress={"thickness_mm": HEIGHT}, zones=[ZONE])


def read_shells(text: str) -> dict[str, np.ndarray]:
    """Thickness and expansion of each layer of each section of a deck, (n, 2), by element set."""
    expansion, sections, last = {}, {}, ""
    lines = [line for line in text.splitlines() if not line.startswith("**")]
    for number, line in enumerate(lines):
        if found := re.match(r"\*MATERIAL, NAME=(\w+)$", line):
            last = found[1]
        elif line.startswith("*EXPANSION"):
            expansion[last] = float(lines[number + 1])
        elif found := re.match(r"\*SHELL SECTION, ELSET=(\w+), COMPOSITE$", line):
            rest = iter(lines[number + 1 :])
            rows = []
            while (row := next(rest, "*")) and not row.startswith("*"):
                thickness, _, material = row.split(", ")
                rows.append((float(thickness), expansion[material]))
            sections[found[1]] = np.array(rows)
    return sections


def balance(layers: np.ndarray) -> tuple[float, float]:
    """Stretch times thickness, and curvature times thickness³ / 12, of free layers."""
    top = np.cumsum(layers[:, 0])
    middle = top - 0.5 * layers[:, 0] - 0.5 * top[-1]
    weight = layers[:, 0] * layers[:, 1]
    return float(weight.sum()), float(weight @ middle)


def test_the_table_has_the_profile_of_each_surface(folder: Path, tmp_path: Path) -> None:
    write_stress_table(folder, tmp_path / "stress.csv")
    with (tmp_path / "stress.csv").open() as file:
        rows = list(csv.DictReader(file))
    record = load_result(folder).record.stress
    assert record is not None
    assert {row["surface"] for row in rows} == {"the target", "middle"} == set(record.profiles)
    own = [row for row in rows if row["surface"] == "middle"]
    stress = [float(row["stress_MPa"]) for row in own]
    assert stress == pytest.approx(record.profiles["middle"].stress_MPa, rel=1e-5)
    for row in rows:
        low, middle, high = (float(row[x]) for x in ("law_low_MPa", "stress_MPa", "law_high_MPa"))
        assert low <= middle * (1 - 1e-5 * np.sign(middle))
        assert middle <= high + 1e-3
        assert float(row["stress_pm_MPa"]) < 0.1 * (high - low)


def test_the_map_is_that_of_the_figure(folder: Path) -> None:
    result = load_result(folder)
    elements = load_result_arrays(result).elements
    inside = (elements["target"] > 0) & ~np.isnan(elements["surface_stress_MPa"])
    area = elements["reachable_area_mm2"][inside]
    mean = elements["surface_stress_MPa"][inside] @ area / area.sum()
    assert mean == pytest.approx(result.metrics["surface_stress_MPa"].value, rel=0.03)
    zone = result.metrics["middle.surface_stress_MPa"]
    assert zone.value == pytest.approx(mean, rel=0.05)
    assert zone.half_width < 0.1 * abs(mean)


@pytest.mark.parametrize("peened", ["one_side", "both_sides"])
def test_the_layers_of_a_shell_are_read_back(peened: str, folder: Path, tmp_path: Path) -> None:
    if peened == "both_sides":
        stress = {"thickness_mm": HEIGHT, "peened": peened}
        folder = saved(tmp_path / "both", stress=stress, zones=[ZONE])
    write_shell_layers(folder, tmp_path / "shells.inp")
    sections = read_shells((tmp_path / "shells.inp").read_text())
    record = load_result(folder).record.stress
    assert record is not None
    assert sections.keys() == {"PEENED_TARGET", "PEENED_MIDDLE"}
    profile = record.profiles["the target"]
    depth, strain = 1e-3 * np.array(profile.depth_um), np.array(profile.eigenstrain)
    layers = sections["PEENED_TARGET"]
    assert layers[:, 0].sum() == pytest.approx(HEIGHT)
    force, moment = balance(layers)
    whole = float(integrals(depth, strain)[0])
    if peened == "both_sides":
        assert force == pytest.approx(2.0 * whole, rel=1e-6)
        assert moment == pytest.approx(0.0, abs=1e-9)
    else:
        assert force == pytest.approx(whole, rel=1e-6)
        exact = float(bending(depth, strain, HEIGHT)) * HEIGHT**3 / 12.0
        assert moment == pytest.approx(exact, rel=1e-3)


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_calculix_bends_the_plate_as_the_closed_form(folder: Path, tmp_path: Path) -> None:
    """A free plate of 120 x 120 mm: w = k r² / 2 about its middle, far from the edges."""
    across = np.linspace(-60.0, 60.0, 9)
    found = sag(folder, tmp_path, (across, across), [(30, 0), (-30, 0), (0, 30), (0, -30)])
    assert found == pytest.approx(bending(*layer_of(folder), HEIGHT) * 30.0**2 / 2.0, rel=1e-3)


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_calculix_bends_an_almen_strip_as_the_arc_height(tmp_path: Path) -> None:
    """A strip of 76.2 x 18.9 x 1.295 mm on the four balls of the gauge."""
    thickness = 1e3 * STRIPS["A"].thickness
    folder = saved(tmp_path / "strip", stress={"thickness_mm": thickness}, zones=[ZONE])
    x = np.array([0.0, 4.0, 8.0, 12.0, 15.875, 22.0, 30.0, 38.1])
    y = np.array([0.0, 4.0, 7.94, 9.45])
    both = [np.r_[-one[:0:-1], one] for one in (x, y)]
    balls = [(i * 15.875, j * 7.94) for i in (-1, 1) for j in (-1, 1)]
    found = sag(folder, tmp_path, (both[0], both[1]), balls)
    depth, strain = layer_of(folder)
    assert found == pytest.approx(
        1e3 * arc_height(1e-3 * depth, strain, 1e-3 * thickness), rel=5e-3
    )


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_calculix_prints_the_stress_once_that_along_the_normal_is_taken_away(
    folder: Path, tmp_path: Path
) -> None:
    """In the middle of a free plate, at the borders of its layers, by depth."""
    across = np.linspace(-30.0, 30.0, 7)
    sag(folder, tmp_path, (across, across), [(30, 0)])
    metals = plate_metals(load_result(folder).design)
    assert metals is not None
    ratio = metals.part.poisson / (1.0 - metals.part.poisson)
    assert f"nu / (1 - nu) = {ratio:.4g}." in (tmp_path / "shells.inp").read_text()
    at, stress = stress_of_middle(tmp_path / "plate.frd")
    depth = 0.5 * HEIGHT - at
    found = stress[:, 0] - ratio * stress[:, 2]
    record = load_result(folder).record.stress
    assert record is not None
    profile = record.profiles["the target"]
    told = np.interp(depth, 1e-3 * np.array(profile.depth_um), profile.stress_MPa)
    inside = (depth > 1e-3) & (depth < 1e-3 * profile.depth_um[-1])
    assert inside.sum() >= 10
    largest = np.abs(profile.stress_MPa).max()
    np.testing.assert_allclose(found[inside], told[inside], atol=0.02 * largest)
    plain = np.abs(stress[inside, 0] - told[inside]).max()
    assert plain > 0.3 * largest  # what is printed is not the stress by itself


def stress_of_middle(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """Heights (n,) [mm] in the middle of a plate, and the mean stress xx, yy, zz there (n, 3)."""
    places: dict[int, list[float]] = {}
    stress: dict[int, list[float]] = {}
    into: dict[int, list[float]] | None = None
    for line in file.read_text().splitlines():
        if line.startswith("    2C"):
            into = places
        elif line.startswith(" -4  STRESS"):
            into = stress
        elif line.startswith((" -3", " -4")):
            into = None
        elif line.startswith(" -1") and into is not None:
            into[int(line[3:13])] = [float(line[k : k + 12]) for k in range(13, len(line) - 11, 12)]
    middle = [one for one, at in places.items() if np.hypot(*at[:2]) < 1e-6 and one in stress]
    heights, which = np.unique([round(places[one][2], 6) for one in middle], return_inverse=True)
    values = np.array([stress[one][:3] for one in middle])
    return heights, np.array([values[which == k].mean(axis=0) for k in range(len(heights))])


def layer_of(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Depths [mm] and eigenstrain below the target of a result."""
    record = load_result(folder).record.stress
    assert record is not None
    profile = record.profiles["the target"]
    return 1e-3 * np.array(profile.depth_um), np.array(profile.eigenstrain)


def sag(
    folder: Path, place: Path, lines: tuple[np.ndarray, np.ndarray], at: list[tuple[float, float]]
) -> float:
    """By how much the middle of a free plate stands out over the mean of places [mm], by CalculiX.

    Args:
        lines: where the corners of its shells are along x and y [mm].
    """
    write_shell_layers(folder, place / "shells.inp")
    text = (place / "shells.inp").read_text().partition("*MATERIAL, NAME=PEENED_MIDDLE")[0]
    (place / "layers.inp").write_text(text)
    deck, points = free_plate(*lines)
    (place / "plate.inp").write_text(deck)
    subprocess.run(["ccx", "plate"], cwd=place, check=True, capture_output=True, timeout=100)
    rows = [line.split() for line in (place / "plate.dat").read_text().splitlines()]
    moved = {int(row[0]): float(row[3]) for row in rows if len(row) == 4 and row[0].isdigit()}
    middle, *beside = (
        moved[min(points, key=lambda node: np.hypot(*np.subtract(points[node], one)))]
        for one in [(0.0, 0.0), *at]
    )
    return middle - float(np.mean(beside))


def free_plate(x: np.ndarray, y: np.ndarray) -> tuple[str, dict[int, tuple[float, float]]]:
    """The deck of a flat plate in shells of 8 nodes with the layers included, and its nodes."""
    along, across = (np.sort(np.r_[one, 0.5 * (one[1:] + one[:-1])]) for one in (x, y))
    number = np.arange(1, len(along) * len(across) + 1).reshape(len(across), len(along))
    corners = [(0, 0), (0, 2), (2, 2), (2, 0), (0, 1), (1, 2), (2, 1), (1, 0)]
    first = [(j, i) for j in range(0, len(across) - 1, 2) for i in range(0, len(along) - 1, 2)]
    elements = [[int(number[j + b, i + a]) for b, a in corners] for j, i in first]
    used = {one for element in elements for one in element}
    points = {
        int(number[j, i]): (along[i], across[j])
        for j in range(len(across)) for i in range(len(along)) if number[j, i] in used
    }  # fmt: skip
    lines = ["*NODE, NSET=NALL", *(f"{k}, {u:g}, {v:g}, 0." for k, (u, v) in points.items())]
    lines.append("*ELEMENT, TYPE=S8R, ELSET=PEENED_TARGET")
    lines += [", ".join(map(str, (k, *one))) for k, one in enumerate(elements, start=1)]
    lines += ["*INCLUDE, INPUT=layers.inp", "*INITIAL CONDITIONS, TYPE=TEMPERATURE", "NALL, 0."]
    lines += ["*STEP", "*STATIC", "*BOUNDARY", "1, 1, 3", f"{len(along)}, 2, 3"]
    lines += [f"{number[-1, 0]}, 3, 3", "*TEMPERATURE", "NALL, 1."]
    lines += ["*NODE PRINT, NSET=NALL", "U", "*EL FILE", "S", "*END STEP"]
    return "\n".join(lines) + "\n", points


def test_the_report_says_how_wide_the_law_is(folder: Path, tmp_path: Path) -> None:
    result = load_result(folder)
    section = next(one for one in report(result).sections if one.title == "Residual stress")
    assert section is not None
    write_report(folder, tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text()
    assert "Residual stress under zone middle, in a plate of 5 mm, peened on one side" in text
    assert "×/÷ 1.9" in text
    record = result.record.stress
    assert record is not None
    assert part_text(record.model_copy(update={"thickness_mm": None})) == "in a thick part"
    known = result.metrics["surface_stress_MPa"]
    assert band_text(known.not_known("coverage below 98 %"), 1.9) == "×/÷ 1.9"


def test_the_end_of_a_simulation_says_the_stress_and_how_wide_its_law_is(folder: Path) -> None:
    said = stress_sentence(load_result(folder))
    assert said.startswith(f"Residual stress in a plate of {HEIGHT:g} mm, peened on one side")
    assert "×/÷ 1.9" in said
    assert "×/÷ 1.6" in said
    assert said in result_end(folder, verbose=False)


def test_what_cannot_be_handed_on_is_said(folder: Path, tmp_path: Path) -> None:
    thick = saved(tmp_path / "thick", stress={})
    with pytest.raises(InputError, match=r"stress\.thickness_mm: not given, and shells have"):
        write_shell_layers(thick, tmp_path / "a.inp")
    without = saved(tmp_path / "without")
    with pytest.raises(InputError, match=r"has no residual stress; add a table \[stress\]"):
        write_stress_table(without, tmp_path / "a.csv")
    bare = saved(tmp_path / "bare", stress={}, **{"process.treatment_time_s": 1.0})
    assert load_result(bare).metrics["surface_stress_MPa"].in_words == "coverage below 98 %"
    with pytest.raises(InputError, match="stress is not told: coverage below 98 %"):
        write_stress_table(bare, tmp_path / "a.csv")
