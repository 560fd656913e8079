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
from chamberopt.coverage.stress_law import bending, integrals
from chamberopt.documents.report import report
from chamberopt.documents.stress import band_text, part_text
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
def test_calculix_bends_the_strip_as_the_closed_form(folder: Path, tmp_path: Path) -> None:
    """A free plate of 120 x 120 mm: w = k r² / 2 about its middle, far from the edges."""
    write_shell_layers(folder, tmp_path / "shells.inp")
    record = load_result(folder).record.stress
    assert record is not None
    profile = record.profiles["the target"]
    depth, strain = 1e-3 * np.array(profile.depth_um), np.array(profile.eigenstrain)
    curvature = float(bending(depth, strain, HEIGHT))
    text = (tmp_path / "shells.inp").read_text().partition("*MATERIAL, NAME=PEENED_MIDDLE")[0]
    (tmp_path / "layers.inp").write_text(text)
    (tmp_path / "plate.inp").write_text(free_plate(sides=8, length=120.0))
    subprocess.run(["ccx", "plate"], cwd=tmp_path, check=True, capture_output=True, timeout=100)
    rows = [line.split() for line in (tmp_path / "plate.dat").read_text().splitlines()]
    moved = {int(row[0]): float(row[3]) for row in rows if len(row) == 4 and row[0].isdigit()}
    middle = 17 * 8 + 9
    beside = [moved[middle + step] for step in (-4, 4, -4 * 17, 4 * 17)]  # 30 mm from it
    # the peened face gets longer, so that it is on the outer side of the bend
    assert np.mean(beside) - moved[middle] == pytest.approx(-curvature * 30.0**2 / 2.0, rel=1e-3)


def free_plate(sides: int, length: float) -> str:
    """The deck of a flat plate in shells of 8 nodes, with the layers included."""
    many = 2 * sides + 1
    numbers = np.arange(1, many**2 + 1).reshape(many, many)  # rows along y
    at = np.linspace(0.0, length, many)
    corners = [(0, 0), (0, 2), (2, 2), (2, 0), (0, 1), (1, 2), (2, 1), (1, 0)]
    elements = [(j, i) for j in range(0, many - 1, 2) for i in range(0, many - 1, 2)]
    nodes = [[(numbers[j + b, i + a]) for b, a in corners] for j, i in elements]
    used = sorted({one for element in nodes for one in element})
    place = {numbers[j, i]: (at[i], at[j]) for j in range(many) for i in range(many)}
    lines = ["*NODE, NSET=NALL", *(f"{k}, {place[k][0]:g}, {place[k][1]:g}, 0." for k in used)]
    lines.append("*ELEMENT, TYPE=S8R, ELSET=PEENED_TARGET")
    lines += [", ".join(map(str, (k, *one))) for k, one in enumerate(nodes, start=1)]
    lines += ["*INCLUDE, INPUT=layers.inp", "*INITIAL CONDITIONS, TYPE=TEMPERATURE", "NALL, 0."]
    lines += [
        "*STEP",
        "*STATIC",
        "*BOUNDARY",
        "1, 1, 3",
        f"{many}, 2, 3",
        f"{numbers[-1, 0]}, 3, 3",
    ]
    lines += ["*TEMPERATURE", "NALL, 1.", "*NODE PRINT, NSET=NALL", "U", "*END STEP"]
    return "\n".join(lines) + "\n"


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
