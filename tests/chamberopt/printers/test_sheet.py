"""The process sheet is one A4 page, says what the result holds, and nothing on it overlaps."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from chamberopt.chamber.build import build_chamber
from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.documents.coverage import figures
from chamberopt.documents.document import Document, Section, Sentence, Table
from chamberopt.documents.sheet import first_checks, setting_tables
from chamberopt.documents.wording import metric_label
from chamberopt.peening.tolerance_result import ToleranceResult, ToleratedFigure
from chamberopt.pictures.section import cut, face_size_mm, inside
from chamberopt.printers.sheet_page import (
    HEIGHT,
    WIDTH,
    _save,
    broken,
    draw_sheet,
    text_width,
    write_sheet,
)
from chamberopt.results.load import Result, load_result
from chamberopt.results.records import ZoneLimit, ZoneRecord
from tests.helpers.results.report_folders import simulated
from tests.helpers.synthetic import machine_values, plate_design

A4 = (595.28, 841.89)  # pt
MIX = ({"diameter_mm": 2.0, "share": 0.25}, {"diameter_mm": 3.0, "share": 0.75})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
        return simulated(tmp_path_factory.mktemp("sheet") / "plate $x_1$")[0]


def rows_of(result: Result) -> dict[str, dict[str, str]]:
    """What the sheet says: value by name by title; sentences under ""."""
    found: dict[str, dict[str, str]] = {}
    for table in setting_tables(result, (50.0,)):
        rows = found[table.caption] = {}
        for name, value in table.rows:
            rows[name] = f"{rows[name]} {value}" if name in rows else value
    return found


def test_its_figures_are_those_of_the_report(folder: Path) -> None:
    rows = rows_of(load_result(folder))
    expected = rows["Peening, and what to expect"]
    for one in figures(load_result(folder), None):
        if one.name in ("mean_coverage", "time_to_98_s", "strength_um"):
            assert expected[one.label.text] == one.label.format(one.result)
    assert expected["peening time"] == "5 s"
    assert "Almen intensity in mmA takes a calibration" in expected[""]
    assert rows["Part and pose"]["sonotrode to lowest point"] == "15 mm"
    assert rows["Sonotrode"]["amplitude"] == "25 µm zero-to-peak = 50 µm peak to valley"
    assert rows["Sonotrode"]["face"] == "Ø 50 mm"
    assert rows["Shot"]["balls"] == "30 of Ø 3 mm"
    assert rows["Chamber"]["diameter"] == "50 mm"
    assert rows["Made with"]["part, sha256"] == load_result(folder).record.part_sha256
    assert "how far its numbers may be off is not known" in rows["Tolerances"][""]
    assert "was not checked" in rows["Warnings"][""]
    assert "Simulated without friction" not in rows["Not in these figures"][""]
    result = load_result(folder)
    smooth = replace(result, design=result.design.changed({"effects.friction": "none"}))
    assert "Simulated without friction" in rows_of(smooth)["Not in these figures"][""]


def test_what_to_measure_first_without_a_calibration(folder: Path) -> None:
    rows = first_checks(load_result(folder)).rows
    checks = {what.split()[0]: expected for what, expected, _ in rows}
    assert checks["amplitude"] == "50 µm peak to valley"
    assert checks["ball"].startswith("sonotrode 0.7")
    assert checks["A"].startswith("not known before")  # no strips, no intensity
    curve = load_result(folder).record.coverage_against_time
    nearest = min(curve, key=lambda row: abs(row.mean_coverage - 0.5)).mean_coverage
    assert float(checks["mean"].split()[0]) == pytest.approx(100.0 * nearest, abs=0.5)
    few = load_result(folder)
    few.metrics["mean_coverage"] = Estimate(0.5, math.inf, in_words="not resolved")
    names = {what.split()[0] for what, *_ in first_checks(few).rows}
    assert names == checks.keys() - {"mean"}  # nothing to compare a measurement with


def test_a_folder_whose_name_is_no_text_has_a_sheet(tmp_path: Path) -> None:
    figure = Figure(figsize=(1, 1))
    _save(tmp_path / "sheet.pdf", figure, "result \udcff")
    assert b"result ?" in (tmp_path / "sheet.pdf").read_bytes()


def test_a_calibrated_mix_with_zones_and_tolerances(folder: Path) -> None:
    """Of a result that is put together here: to simulate one takes long."""
    design = plate_design().changed({
        "shot.diameter_mm": None,
        "shot.mix": MIX,
        "tolerances": {"amplitude_um": 2},
        "calibration": machine_values(amplitude=0.05, K=0.05, beta=0.1),
    })  # fmt: skip
    loaded, intensity = load_result(folder), Estimate(0.2, 0.01)
    limit = {"key": "coverage_min", "limit": 0.9}
    zones = [
        ZoneRecord(
            name=f"z{k}",
            limits=[ZoneLimit(**limit, metric=f"z{k}.p05_coverage", standing=standing)],
            triangles=1,
            exposed_area_mm2=1.0,
            reachable_share=1.0,
        )
        for k, standing in enumerate(3 * ["met"] + 3 * ["not met"])
    ]
    result = replace(
        loaded, design=design, record=loaded.record.model_copy(update={"zones": zones})
    )
    result.metrics["almen_intensity"] = intensity
    for k in range(6):
        result.metrics[f"z{k}.p05_coverage"] = intensity
    rows = rows_of(result)
    assert len(re.findall(r"of Ø [23] mm, [\d.]+ g", rows["Shot"]["balls"])) == 2
    assert rows["Tolerances"]["sonotrode.amplitude_um"] == "23 to 27, as designed 25"
    assert "was not simulated" in rows["Tolerances"][""]
    zones = rows["Zones and limits"][""]
    assert (zones.count("is not met"), zones.count("is met")) == (3, 1)  # the worst first
    assert zones.endswith("2 more zones in the report.")
    assert rows["Peening, and what to expect"]["mean Almen intensity"] == "0.200 ± 0.010 mmA"
    assert "mean peening strength" not in rows["Peening, and what to expect"]
    checks = [expected for _, expected, _ in first_checks(result).rows]
    assert checks[0] == "50 (45.3 to 55.1) µm peak to valley where 50 is set"
    assert "0.200 ± 0.010 mmA" in checks
    ends = dict.fromkeys(("nominal", "q05", "q95", "lowest", "highest"), intensity)
    figure = ToleratedFigure(**ends, effects={}, corner=None)
    found = ToleranceResult.model_construct(worst_for="", figures={"almen_intensity": figure})
    record = result.record.model_copy(update={"tolerances": found})
    label = metric_label("almen_intensity").with_unit
    tolerated = replace(result, record=record)
    tolerated.metrics.update(result.metrics)
    held = rows_of(tolerated)["Tolerances"]
    assert held[label] == "5 % below 0.200 ± 0.010; 5 % above 0.200 ± 0.010"


def boxes_of(sheet: Document, chamber: object) -> list[tuple[str, np.ndarray]]:
    """Each text of a drawn sheet, with its box in pixels."""
    figure = draw_sheet(sheet, chamber)
    figure.set_dpi(72.0)
    draw = FigureCanvasAgg(figure).get_renderer()
    texts = [one for one in figure.axes[0].texts if one.get_text().strip()]
    return [(one.get_text(), one.get_window_extent(draw).extents) for one in texts]


@pytest.mark.parametrize("much", [False, True])
def test_nothing_overlaps_or_is_cut_off(folder: Path, much: bool) -> None:
    result = load_result(folder)
    content = [*setting_tables(result, (50.0,)), first_checks(result)]
    name, answer = "a name", "An answer."
    if much:
        name, answer = 30 * "name ", 40 * "answer "
        long = "words and_a_name_without_an_end_" + 60 * "x" + 40 * " more words"
        rows = [(f"name {k} " + 20 * "y", long) for k in range(3)]
        content = [
            *content[:-1], *(Table(f"block {k}", (), rows) for k in range(2)),
            Table("", content[-1].head, [(long, long, "")] * 5), Sentence(long),
        ]  # fmt: skip
    sheet = Document(name, "kind", answer, (), [Section("Process sheet", content)])
    boxes = boxes_of(sheet, build_chamber(plate_design()))
    for text, (x0, y0, x1, y1) in boxes:
        assert x0 > 0.0, text
        assert y0 > 0.0, text
        assert x1 < WIDTH / 25.4 * 72.0, text
        assert y1 < HEIGHT / 25.4 * 72.0, text
    for k, (text, one) in enumerate(boxes):
        for other_text, other in boxes[k + 1 :]:
            shared = np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2])
            assert shared.min() < 1.5, (text, other_text)


def test_it_is_one_a4_page_and_replaces_only_an_older_one(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    path = tmp_path / "sheet.pdf"
    for _ in range(2):
        assert main(["report", str(folder), "--sheet", "--out", str(path)]) == 0
        assert f"process sheet in {path}" in capsys.readouterr().out
    content = path.read_bytes()
    (box,) = re.findall(rb"/MediaBox \[ ([\d. ]+) \]", content)
    assert tuple(map(float, box.split())) == pytest.approx((0.0, 0.0, *A4), abs=0.02)
    assert len(re.findall(rb"/Type /Page\b", content)) == 1
    assert b"/FontFile2" in content  # letters that can be selected, not their outlines
    precious = tmp_path / "precious.pdf"
    precious.write_bytes(b"%PDF-1.4 of somebody")
    with pytest.raises(InputError, match=r"precious\.pdf: this file exists and is no process sh"):
        write_sheet(folder, precious)
    assert precious.read_bytes() == b"%PDF-1.4 of somebody"
    with pytest.raises(InputError, match=r"one \.pdf file"):
        write_sheet(folder, tmp_path / "sheet.html")


def test_a_section_has_its_area_without_holes() -> None:
    """A box of 6 x 4 mm with a tunnel of 2 x 2 mm along z, cut between and at its corners."""
    outer, hole = trimesh.creation.box((6e-3, 4e-3, 9e-3)), trimesh.creation.box((2e-3, 2e-3, 9e-3))
    vertices = np.concatenate([outer.vertices, hole.vertices])
    triangles = np.concatenate([outer.faces, hole.faces[:, ::-1] + len(outer.vertices)])
    for at in (0.0, 1e-3):
        lines, row = cut(vertices, triangles, 2, at)
        assert len(lines) == len(row) == 16
        (around, tunnel) = inside(1e3 * lines).to_polygons()
        areas = [np.sum(p[:-1, 0] * p[1:, 1] - p[1:, 0] * p[:-1, 1]) / 2 for p in (around, tunnel)]
        assert areas == pytest.approx([24.0, -4.0])  # of opposite sense: not filled
    assert inside(cut(vertices, triangles, 2, 1.0)[0]) is None


def test_bodies_that_overlap_are_filled_everywhere() -> None:
    """Two boxes of 4 x 4 mm, of which 2 x 4 mm are in both."""
    one, other = (trimesh.creation.box((4e-3, 4e-3, 4e-3)) for _ in range(2))
    vertices = np.concatenate([one.vertices, np.add(other.vertices, [2e-3, 0.0, 0.0])])
    triangles = np.concatenate([one.faces, other.faces + len(one.vertices)])
    for axis, area in ((2, 24.0), (1, 24.0), (0, 16.0)):
        at = 0.5e-3 if axis else -1.5e-3
        polygons = inside(1e3 * cut(vertices, triangles, axis, at)[0]).to_polygons()
        found = [np.sum(p[:-1, 0] * p[1:, 1] - p[1:, 0] * p[:-1, 1]) / 2 for p in polygons]
        assert sum(found) == pytest.approx(area)


def test_the_size_of_the_face() -> None:
    chamber = build_chamber(plate_design())
    assert face_size_mm(chamber) == pytest.approx((50.0,))
    stretched = replace(chamber, vertices=chamber.vertices * [2.0, 1.0, 1.0])
    assert face_size_mm(stretched) == pytest.approx((100.0, 50.0), rel=1e-3)


def test_lines_are_broken_to_their_width() -> None:
    text = "the mean is 12.3 ± 0.4 % of it " + 12 * "w"
    lines = broken(text, 30.0, 8.0)
    assert all(text_width(line, 8.0) <= 30.0 for line in lines)
    assert "".join(lines).replace("\u00a0", "").replace(" ", "") == text.replace(" ", "")
    assert any("12.3\u00a0±\u00a00.4\u00a0%" in line for line in lines)
    assert broken(100 * "word ", 20.0, 8.0)[-1].endswith("…")
    assert broken("工 gear\x1b\n1", 30.0, 8.0) == ["? gear? 1"]  # the font has no such letters
