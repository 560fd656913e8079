"""Ranges of what is not calibrated in a results folder: they read back, and all texts say them."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import chamberopt
from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor
from chamberopt.design.ranges import unknowns
from chamberopt.documents.document import Table
from chamberopt.documents.ranges import range_texts
from chamberopt.documents.report import report
from chamberopt.documents.sheet import AsBuilt, cautions, first_checks, process_sheet
from chamberopt.documents.terminal_lines import result_end
from chamberopt.documents.wording import metric_label
from chamberopt.peening.range_result import Spreads
from chamberopt.peening.ranges import EndRuns, find_ranges
from chamberopt.printers import terminal
from chamberopt.results.load import load_result
from chamberopt.search.study import Study
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.workflows.ranges import EndError, study_ranges
from chamberopt.workflows.save_run import save_simulation, save_study
from chamberopt.workflows.simulate import Teller
from tests.helpers.results.digests import replace_result
from tests.helpers.studies import run_in_folder
from tests.helpers.synthetic import judged, plate_design, poisson_evaluation

# One group of numbers alone is not known: v0.
DESIGN = plate_design(process__accuracy__points=1000, process__treatment_time_s=60).changed(
    {"effects.friction": "none", "effects.roughness": "none"}
)
PER_MM2 = 60.0  # dents of the design itself


def ends_of(design: chamberopt.Design, chamber: object, whole: Evaluation, *_: object) -> EndRuns:
    """Half of v0 makes half of the dents, twice of it twice; nothing is simulated."""
    groups = unknowns(design)

    def dented(factor: float) -> Evaluation:
        return poisson_evaluation(design, chamber, factor * PER_MM2, seed=1)  # type: ignore[arg-type]

    ends = {one.name: (dented(0.5), dented(2.0)) for one in groups}
    return EndRuns(groups, [], whole, dented(1.0), ends)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    chamber = build_chamber(DESIGN)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
        folder = tmp_path_factory.mktemp("ranges") / "plate"
        whole = poisson_evaluation(DESIGN, chamber, PER_MM2)
        found = find_ranges(ends_of(DESIGN, chamber, whole))
        save_simulation(folder, DESIGN, chamber, whole, spreads=Spreads(ranges=found))
        recorded = load_result(folder).record.ranges
        assert recorded is not None
        assert recorded == found
    return folder


def test_the_terminal_says_the_range_beside_the_interval(folder: Path) -> None:
    """In words, and with --verbose by the names of code too."""
    found = load_result(folder).record.ranges
    short, long = (terminal.text(result_end(folder, way)) for way in (False, True))
    assert "mean_coverage " not in short
    text = range_texts(found)["mean_coverage"]
    (line,) = [one for one in long.splitlines() if one.startswith("mean_coverage ")]
    assert line.endswith(f" {text}")
    (row,) = [one for one in short.splitlines() if one.startswith("mean coverage of the target")]
    assert re.search(r"\d ± \d.* \d.* to \d", row)


def test_the_report_says_the_range_beside_the_interval(folder: Path) -> None:
    document = report(load_result(folder))
    (line,) = [one.text for one in document.answer_lines if one.about == "ranges"]
    assert line.startswith(
        "Not calibrated: the least speed that dents (0.5 to 2 times). Over their ranges the mean "
        "coverage of the target is "
    )
    assert line.endswith(
        " %; what would narrow it most is the least speed that dents (100 % of it), by ball drops "
        "at 3 m/s on each surface (chamberopt calibrate)."
    )
    sections = {one.title: one for one in document.sections}
    assert sections["Coverage"].content[0].head[-1] == "range"
    figures, folded, named = sections["What is not calibrated"].content[1:4]
    (ends,) = folded.content
    assert ends.caption == "Changes by the least speed that dents, ± 95 % noise of its runs"
    assert ends.head == ("", "at the low end", "at the high end")
    row = dict((one[0], one) for one in figures.rows)["mean exposure, in times to 98 % coverage"]
    low, high = (float(one) for one in row[2].split(" to "))
    assert (low, high) == pytest.approx((0.5 * 2.0 * low, 4.0 * low), rel=0.1)
    assert row[3] == "the least speed that dents 100 %"
    numbers = {one[0]: one[1:] for one in named.rows}
    assert ("0.44", "0.22", "0.88") in numbers.values()
    assert not any("." in name.split(" [")[0] for name in numbers)  # words, no keys
    assert (
        "The ranges hold what is not calibrated: the least speed that dents."
        in sections["The answer"].content[-1].text
    )


def test_the_sheet_says_the_time_at_the_slow_end(folder: Path) -> None:
    result = load_result(folder)
    time = result.metrics["time_to_98_s"]
    slow = result.record.ranges.figures["time_to_98_s"].high
    assert slow.value == pytest.approx(2.0 * time.value, rel=0.1)
    rows = process_sheet(result, AsBuilt((50.0,))).sections[0].content
    expected = next(one for one in rows if getattr(one, "caption", "").startswith("Peening, and"))
    (text,) = [cell for name, cell in expected.rows if name.endswith(", at the slow end")]
    assert text == metric_label("time_to_98_s").format(slow)
    # The yield speed halves or doubles the exposure, as half or twice the time would.
    (covered,) = [cells[1] for cells in first_checks(result).rows if "mean cov" in cells[0]]
    found = re.fullmatch(r".* as designed, ([\d.]+) to ([\d.]+) % before calibration", covered)
    assert found is not None, covered
    curve = result.record.coverage_against_time
    first = min(curve, key=lambda one: abs(one.mean_coverage - 0.5))
    times, shares = [one.time_s for one in curve], [one.mean_coverage for one in curve]
    for told, share in zip(found.groups(), (0.5, 2.0), strict=True):
        expected_share = np.interp(share * first.time_s, [0.0, *times], [0.0, *shares])
        assert float(told) == pytest.approx(100.0 * expected_share, rel=0.1)
    planned = result.design.changed({"process.treatment_time_s": 1.5 * time.value})
    there = [text for text in cautions(replace(result, design=planned)) if "slow end" in text]
    assert there == [
        "It is not enough at the slow end of what is not calibrated (the least speed that dents): "
        f"there 95 % of the target's area is 98 % covered after {text}."
    ]
    ample = result.design.changed({"process.treatment_time_s": 3.0 * time.value})
    assert not [one for one in cautions(replace(result, design=ample)) if "slow end" in one]


def test_a_result_without_ranges_says_nothing_of_them(folder: Path) -> None:
    data = json.loads((folder / "result.json").read_text())
    text = json.dumps(data)
    try:
        del data["ranges"]
        replace_result(folder, data)
        result = load_result(folder)
        assert result.record.ranges is None
        titles = {one.title: one for one in report(result).sections}
        assert "What is not calibrated" not in titles
        assert len(titles["Coverage"].content[0].head) == 2
    finally:
        (folder / "result.json").write_text(text)


def test_a_figure_that_this_version_does_not_know_is_left_out_of_the_report(folder: Path) -> None:
    data = json.loads((folder / "result.json").read_text())
    text = json.dumps(data)
    try:
        figures = data["ranges"]["figures"]
        figures["moon"] = figures["mean_coverage"]
        replace_result(folder, data)
        assert "moon" not in repr(report(load_result(folder)))
    finally:
        (folder / "result.json").write_text(text)


@pytest.mark.parametrize(
    ("key", "wrong"),
    [("groups", {}), ("figures", {"mean_coverage": {}}), ("replicas", "2"), ("cost", -1.0)],
)
def test_what_no_command_writes_is_refused(folder: Path, key: str, wrong: object) -> None:
    data = json.loads((folder / "result.json").read_text())
    text = json.dumps(data)
    try:
        data["ranges"][key] = wrong
        replace_result(folder, data)
        with pytest.raises(InputError, match="damaged"):
            load_result(folder)
    finally:
        (folder / "result.json").write_text(text)


def test_a_study_says_whether_its_best_stays_best(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twice the shot makes twice the dents, at the ends too."""
    monkeypatch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
    monkeypatch.setattr("chamberopt.workflows.save_run._draw_diagrams", lambda *_: None)
    optimizer = {"algorithm": "sobol", "evaluations": 2, "confirm": 1, "confirm_replicas": 3,
                 "confirm_rounds": 1}  # fmt: skip
    study = Study(design=DESIGN, vary={"shot.mass_g": (3.0, 8.0)}, optimizer=optimizer)

    def dents(design: chamberopt.Design, stream: str, replicas: int | None) -> Evaluation:
        chamber = build_chamber(design)
        return poisson_evaluation(design, chamber, 20.0 * design.shot.mass_g, replicas or 3)

    def ends(design: chamberopt.Design, chamber: object, whole: Evaluation, *_: object) -> EndRuns:
        groups, there = unknowns(design), judged(0.1 * design.shot.mass_g + np.linspace(0, 0.01, 3))
        return EndRuns(groups, [], whole, there, {one.name: (there, there) for one in groups})

    result = run_in_folder(study, tmp_path, SerialExecutor(), simulator=dents)
    told: list[str] = []
    teller = Teller()
    monkeypatch.setattr(teller, "tell", told.append)
    monkeypatch.setattr("chamberopt.workflows.ranges.simulate_ends", ends)
    found = study_ranges(result, SerialExecutor(), teller)
    assert found is not None
    assert told[0].startswith(
        "the least speed that dents: not calibrated, so 4 more replicas of each of 2 designs are "
    )
    (rival,) = found.rivals
    assert (rival.rival, len(rival.gains)) == ("start", 2)
    gain = result.best.design.shot.mass_g - result.start.design.shot.mass_g
    assert all(one.gain.value == pytest.approx(0.1 * gain) for one in rival.gains)
    assert all(one.gain.low > 0.0 for one in rival.gains)
    save_study(tmp_path, result, ranges=found)
    read = load_result(tmp_path)
    assert read.study.at_ends == [rival]
    assert load_result(tmp_path / "start").record.ranges == found.start
    sentence = (
        "The best design stays better than the start at both ends of the least speed that dents."
    )
    assert sentence in [one.text for one in report(read).answer_lines]
    said = result_end(tmp_path, verbose=False)
    assert sentence in said
    (table,) = [one for one in said if isinstance(one, Table)]
    assert table.head == ("", "start", "best", "range")
    rows = {name: values for name, *values in table.rows}
    assert rows["Shot mass [g]"][-1] == ""
    of_best = range_texts(read.record.ranges)["time_to_98_s"]
    assert rows[metric_label("time_to_98_s").with_unit][-1] == of_best


def test_an_end_that_cannot_be_simulated_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The figures themselves are kept."""

    def stopped(*_: object) -> None:
        raise EndError("what is not calibrated was not simulated, because ...")

    monkeypatch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
    monkeypatch.setattr("chamberopt.workflows.simulate.simulate_ranges", stopped)
    monkeypatch.setattr(
        "chamberopt.workflows.simulate.evaluate_until_stopped",
        lambda design, chamber, *_: poisson_evaluation(design, chamber, PER_MM2),
    )
    result = chamberopt.simulate(DESIGN, tmp_path / "out", workers=1)
    assert result.record.ranges is None
    assert result.notes[0].startswith("what is not calibrated was not simulated")
