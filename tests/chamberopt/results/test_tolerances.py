"""Tolerances in a results folder: they read back, and report and export show them."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.common.record_types import KnownInterval
from chamberopt.design.load import save_design
from chamberopt.documents.report import report
from chamberopt.documents.tolerances import (
    sheet_rows,
    table_rows,
    tolerance_lines,
    tolerance_section,
)
from chamberopt.export.tables import write_tolerance_table
from chamberopt.peening.range_result import Spreads
from chamberopt.peening.tolerance_result import ToleratedFigure
from chamberopt.peening.tolerances import find_tolerances, plan_tolerances
from chamberopt.printers.report_page import write_report
from chamberopt.results.load import load_result
from chamberopt.workflows.save_run import save_simulation
from tests.helpers.results.digests import replace_result
from tests.helpers.synthetic import plate_design, poisson_evaluation

DESIGN = plate_design(process__accuracy__points=1000).changed(
    {"tolerances": {"amplitude_um": 2, "shot.mass_g": ["-10 %", 0]}}
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """More amplitude and more shot make more dents; nothing is simulated."""
    chamber = build_chamber(DESIGN)

    def evaluate(design):
        per_mm2 = 60.0 * design.shot.count / 30.0 * design.sonotrode.amplitude_um / 25.0
        return poisson_evaluation(design, chamber, per_mm2)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
        folder = tmp_path_factory.mktemp("tolerances") / "plate"
        nominal = evaluate(DESIGN)
        found = find_tolerances(DESIGN, plan_tolerances(DESIGN), nominal, evaluate)
        save_simulation(folder, DESIGN, chamber, nominal, spreads=Spreads(found))
        recorded = load_result(folder).record.tolerances
        assert recorded is not None
        assert recorded.figures.keys() == found.figures.keys()
        for name, one in found.figures.items():
            assert recorded.figures[name].q05 == replace(
                one.q05, pseudovalues=(), shared=(), bias=0.0
            )
    return folder


def test_the_report_has_a_section_and_a_chart(folder: Path, tmp_path: Path) -> None:
    (section,) = (one for one in report(load_result(folder)).sections if one.title == "Tolerances")
    _, ranges, figures, *_ = section.content
    assert [row[0] for row in ranges.rows] == ["Sonotrode amplitude [µm]", "Shot mass [g]"]
    assert figures.rows[0][0] == "coverage that 95 % of the area exceeds [%]"
    page = write_report(folder, tmp_path / "page.html")[0].read_text(encoding="utf-8")
    for text in ("<h2>Tolerances</h2>", 'id="tolerances"', "27 to 30 whole balls"):
        assert text in page


def test_the_table_has_a_row_for_each_figure_and_number(folder: Path, tmp_path: Path) -> None:
    write_tolerance_table(folder, tmp_path / "table.csv")
    with (tmp_path / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    data = load_result(folder).record.tolerances
    assert data is not None
    assert len(rows) == 2 * len(data.figures)
    assert float(rows[0]["q05"]) == data.figures[rows[0]["figure"]].q05.value


def test_a_new_interval_of_a_figure_is_shown_everywhere(folder: Path, tmp_path: Path) -> None:
    class Wider(ToleratedFigure):
        q50: KnownInterval

    result = load_result(folder)
    found = result.record.tolerances
    assert found is not None
    figures = {name: Wider(**dict(one), q50=one.q05) for name, one in found.figures.items()}
    wider = found.model_copy(update={"figures": figures})
    result = replace(result, record=result.record.model_copy(update={"tolerances": wider}))
    section = tolerance_section(result)
    assert section is not None
    table = section.content[2]
    assert table.head[-1] == "q50"
    assert table.rows[0][-1] == table.rows[0][2]
    assert "q50" in tolerance_lines(wider)[0]
    assert all("; q50 " in text for _, text in sheet_rows(wider))
    row = next(table_rows(result))
    assert (row["q50"], row["q50_half_width"]) == (row["q05"], row["q05_half_width"])


def test_a_result_without_tolerances_has_no_table(folder: Path, tmp_path: Path) -> None:
    data = json.loads((folder / "result.json").read_text())
    text = json.dumps(data)
    try:
        del data["tolerances"]
        replace_result(folder, data)
        assert "Tolerances" not in {one.title for one in report(load_result(folder)).sections}
        with pytest.raises(InputError, match="without tolerances; simulate a design"):
            write_tolerance_table(folder, tmp_path / "table.csv")
    finally:
        (folder / "result.json").write_text(text)


@pytest.mark.parametrize("key", ["box", "corner", "worst_for", "figures"])
def test_what_no_command_writes_is_refused(folder: Path, key: str) -> None:
    data = json.loads((folder / "result.json").read_text())
    text = json.dumps(data)
    wrong = {"box": {}, "corner": {"shot.mass_g": 3.0}, "worst_for": "beauty"}
    try:
        data["tolerances"][key] = wrong.get(key, {"mean_coverage": {}})
        replace_result(folder, data)
        with pytest.raises(InputError, match="damaged"):
            load_result(folder)
    finally:
        (folder / "result.json").write_text(text)


def test_the_command_refuses_before_any_work(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    save_design(plate_design(), tmp_path / "plate.toml")
    with (tmp_path / "plate.toml").open("a", encoding="utf-8") as file:
        file.write("\n[tolerances]\n")
    out = tmp_path / "out"
    assert main(["simulate", str(tmp_path / "plate.toml"), "--tolerances", "--out", str(out)]) == 2
    assert capsys.readouterr().err.startswith("tolerances: the table is empty; give one")
    assert not out.exists()
