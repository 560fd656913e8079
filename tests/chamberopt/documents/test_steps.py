"""A result of a design with steps says what each step does, and keeps it on disk."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chamberopt.chamber.build import TARGET, build_chamber
from chamberopt.chamber.checks.facts import describe
from chamberopt.chamber.checks.warning import WarningKind
from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor
from chamberopt.design.load import Design, load_design
from chamberopt.documents.answer import answer_lines
from chamberopt.documents.document import Table
from chamberopt.documents.sheet import AsBuilt, process_sheet
from chamberopt.documents.zones import changes_in_words, steps_section
from chamberopt.printers.sheet_page import draw_sheet
from chamberopt.results.arrays_file import load_chamber
from chamberopt.results.load import Result, load_result
from chamberopt.results.rebuild import rebuild_chamber
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate
from chamberopt.workflows.accuracy import measure_accuracy
from chamberopt.workflows.save_run import save_simulation
from chamberopt.workflows.simulate import SimulationSettings, Teller, simulate_design
from tests.helpers.synthetic import DESIGNS

SHORT = {"replicas": 4, "simulated_time_s": 0.4, "warmup_time_s": 0.0, "points": 1000}
TURNED = "Step 2, turned, 5 s, part turned 180° about x; alone: mean coverage of the target "


def short_design() -> Design:
    values = {f"process.accuracy.{name}": value for name, value in SHORT.items()}
    return load_design(DESIGNS / "plate_both_sides.toml").changed(values)


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    design, folder = short_design(), tmp_path_factory.mktemp("steps") / "result"
    chamber = build_chamber(design)
    evaluation = evaluate(design, chamber, SerialExecutor(), plan=ReplicaPlan(wide_windows=False))
    save_simulation(folder, design, chamber, evaluation)
    return load_result(folder)


def test_the_record_has_the_steps(result: Result) -> None:
    assert result.design == short_design()
    assert result.record.steps == pytest.approx({"first_side": 0.5, "turned": 0.5}, abs=0.01)
    both = [result.metrics[f"steps.{name}.impacts_per_mm2_s"] for name in result.record.steps]
    # A step's rate is over its half of the target and of the time.
    mean = 0.25 * sum(one.value for one in both)
    assert result.metrics["impacts_per_mm2_s"].value == pytest.approx(mean, rel=1e-6)
    assert any("peened in steps, first_side, turned" in note for note in result.notes)
    target = load_chamber(result).part.target
    assert np.array_equal(target, build_chamber(result.design).part.target)


def test_answer_report_and_sheet_have_a_line_for_each_step(result: Result) -> None:
    lines = [one.text for one in answer_lines(result) if one.about == "step"]
    assert lines[0].startswith("Step 1, first side, 5 s, as the design; alone: mean coverage of ")
    assert lines[1].startswith(TURNED)
    section = steps_section(result)
    assert section is not None
    _, table = section.content
    assert isinstance(table, Table)
    assert table.head == ("", "first side", "turned")
    assert table.rows[0] == ("time [s]", "5", "5")
    first_page = process_sheet(result, AsBuilt((50.0,))).sections[0].content
    rows = [row for one in first_page if isinstance(one, Table) for row in one.rows]
    assert ("", lines[1]) in rows
    assert ("peening time", "10 s, all steps together") in rows


def test_the_sheet_has_a_drawing_of_each_pose(result: Result) -> None:
    """The part is turned over in the second step; with finer balls alone it would not be."""
    sheet, chamber = process_sheet(result, AsBuilt((50.0,))), load_chamber(result)
    one, two = chamber.steps
    for steps, more in (((one, two), 1), ((one, one), 0), ((one, two, two), 1)):
        pages = draw_sheet(sheet, replace(chamber, steps=steps))
        texts = [[text.get_text() for text in page.axes[0].texts] for page in pages]
        assert sum("Step 2" in page for page in texts) == more
        assert sum(any(text.startswith("A–A") for text in page) for page in texts) == 1 + more
    rows = [
        row for table in sheet.sections[0].content if isinstance(table, Table) for row in table.rows
    ]
    assert ("3 peen", "10 s: 5 s as step 1, then 5 s as step 2 (see Steps)") in rows


def test_changes_are_told_in_words() -> None:
    fine = {
        "name": "fine", "chamber": {"height_mm": 25.0}, "shot": {"diameter_mm": 2.0},
        "holder": "none", "mask": {"at": {"direction": (0.0, 0.0, 1.0), "angle_deg": (0.0, 5.0)}},
    }  # fmt: skip
    design = short_design().changed({"steps": ({"name": "one"}, fine)})
    assert [changes_in_words(step) for step in design.steps or ()] == [
        "as the design",
        "chamber height 25 mm, balls of 2 mm, no holder, mask at: see the design",
    ]


def test_what_needs_one_chamber_refuses_steps(result: Result, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^steps: simulating a result again is not supported"):
        rebuild_chamber(result)
    with pytest.raises(InputError, match=r"^steps: a convergence study is not supported"):
        measure_accuracy(result.design, 1.0, tmp_path, SerialExecutor(), Teller())
    analytic = SimulationSettings(analytic=True)
    with pytest.raises(InputError, match=r"^steps: an exact cavity in place of the mesh"):
        simulate_design(result.design, tmp_path, SerialExecutor(), Teller(), analytic)


def test_check_tells_of_each_step_and_of_what_no_step_reaches() -> None:
    design = short_design()
    facts = describe(design, build_chamber(design))
    assert facts["steps"]["turned"]["target_exposed_area_mm2"] == pytest.approx(672.0)
    assert facts["target"]["exposed_area_mm2"] == pytest.approx(1344.0)
    assert facts["replicas"]["simulated_s_in_all"] == pytest.approx(4 * 0.4)
    assert not any(one.kind is WarningKind.UNTOUCHED for one in facts["warnings"])
    wide = design.changed({"part.target.box_mm": ((-13.0, -13.0, -0.1), (30.1, 13.0, 10.1))})
    warned = describe(wide, build_chamber(wide))["warnings"]
    (said,) = (one for one in warned if one.kind is WarningKind.UNTOUCHED)
    assert (said.about, said.step) == ((TARGET,), "")
    assert "of the target" in said.text
    assert "3 mm in any step" in said.text
