"""The process sheet is on A4 pages, says what the result holds, and nothing on it overlaps."""

import hashlib
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.check import matters
from chamberopt.chamber.checks.flat_faces import FlatFace
from chamberopt.chamber.checks.openings import Mounting, Opening, part_is_ceiling
from chamberopt.chamber.checks.strips import StripOfTarget
from chamberopt.chamber.matters import Urgency
from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import NOT_RESOLVED, Estimate
from chamberopt.common.number_text import estimate_text
from chamberopt.coverage.part_impacts import HITS_FILE, load_hits
from chamberopt.design.almen_strip import USUAL_K
from chamberopt.design.design import Design, validate
from chamberopt.design.fixture import LEAST_GAP_MM, joint_in_words, slit_mm, tight_gap_mm
from chamberopt.design.intensity import WantedIntensity
from chamberopt.documents.answer import answer_lines
from chamberopt.documents.coverage import figures
from chamberopt.documents.document import Document, Section, Sentence, Table
from chamberopt.documents.report import SETTLED, open_matters, own_warnings
from chamberopt.documents.sheet import (
    REQUALIFY,
    AsBuilt,
    alarms,
    cautions,
    chamber_limits,
    first_checks,
    limit_tables,
    process_sheet,
    reference_limits,
    setting_tables,
    slit_limits,
    title_block,
)
from chamberopt.documents.sheet.acceptance import acceptance_rows
from chamberopt.documents.sheet.expected import SHOP_NAMES, shop_name
from chamberopt.documents.wording import metric_label, per_cent, plain
from chamberopt.peening.held_strip import HeldStrip
from chamberopt.peening.strip import StripSize
from chamberopt.peening.tolerance_result import ToleranceResult, ToleratedFigure
from chamberopt.pictures.drawing.chamber import Shown, draw_chamber
from chamberopt.pictures.drawing.dimensions import with_limits
from chamberopt.pictures.drawing.section import JAWS
from chamberopt.pictures.subprocess_drawing import missing_opengl
from chamberopt.printers.sheet_page import (
    MARGIN,
    WIDTH,
    _save,
    broken,
    draw_sheet,
    text_width,
    write_sheet,
)
from chamberopt.results.arrays_file import load_result_arrays
from chamberopt.results.load import Result, load_result
from chamberopt.results.looked_places import MOST_PLACES, looked_places
from chamberopt.results.records import FixtureRecord, TrappedRecord, ZoneLimit, ZoneRecord
from chamberopt.results.shot_push import push_of_shot
from chamberopt.simulation.trapped_balls import SHARES
from sim_core import restitution_at
from tests.helpers.drawings import boxes_of, require_apart
from tests.helpers.results.report_folders import simulated
from tests.helpers.synthetic import machine_values, plate_design

A4 = (595.28, 841.89)  # pt
WHOLE = HeldStrip("A", StripSize(), "x", 31.0, 1.7)
PIECE = WHOLE._replace(
    size=StripSize(76e-3, 9e-3), along="y", why_no_whole="too narrow", walls="at −x"
)
MIX = ({"diameter_mm": 2.0, "share": 0.25}, {"diameter_mm": 3.0, "share": 0.75})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
        return simulated(tmp_path_factory.mktemp("sheet") / "plate $x_1$")[0]


def rows_of(result: Result) -> dict[str, dict[str, str]]:
    """What the sheet says: value by name by title; sentences under ""."""
    found: dict[str, dict[str, str]] = {}
    for table in (
        *setting_tables(result, AsBuilt((50.0,))),
        *limit_tables(result, AsBuilt((50.0,))),
    ):
        rows = found[table.caption] = {}
        for name, value in table.rows:
            rows[name] = f"{rows[name]} {value}" if name in rows else value
    return found


def test_its_figures_are_those_of_the_report(folder: Path) -> None:
    rows = rows_of(load_result(folder))
    expected = rows["Peening, and what to expect"]
    for one in figures(load_result(folder), None):
        if one.name in ("mean_coverage", "time_to_98_s", "strength_um"):
            assert expected[shop_name(one)] == one.label.format(one.result)
    assert expected["peening time"] == "5 s to start with, NOT YET SET: see 3 peen"
    assert "uniform coverage" not in expected  # the aim of searches
    assert "Almen intensity in mmA is not known before strips are peened here" in expected[""]
    assert rows["Part and pose"]["sonotrode to lowest point"] == "15 mm"
    assert rows["Sonotrode"]["amplitude"] == "25 µm zero-to-peak = 50 µm peak to valley"
    assert rows["Sonotrode"]["face in the chamber"] == "Ø 50 mm, Ti-6Al-4V"
    assert rows["Shot"]["balls"] == "30 of Ø 3 mm"
    assert rows["Chamber"]["diameter"] == "50 mm"
    assert rows["To peen a part"]["2 fill"].startswith(rows["Shot"]["mass of these balls"][:4])
    time = load_result(folder).metrics["time_to_98_s"]
    told = rows["To peen a part"]["3 peen"]
    assert f"expects {plain(time.low, 2)} s or more. Peen 5 s, look as in 5, peen 5 s more" in told
    assert "Amplitude: 46 to 54 µm, ± 4 µm peak to valley" in rows["Tolerances"][""]
    assert "others are not known" in rows["Tolerances"][""]
    assert "was not checked" in rows["Warnings"][""]
    assert "Not in these figures" not in rows
    result = load_result(folder)
    smooth = replace(result, design=result.design.changed({"effects.friction": "none"}))
    assert "Simulated without friction" in rows_of(smooth)["Not in these figures"][""]


def test_openings_and_the_gap_round_the_part(folder: Path) -> None:
    result = load_result(folder)
    held = result.design.changed({"holder": {"kind": "bore", "clearance_mm": 0.2}})
    bore = replace(result, design=held)
    openings = (
        Opening("the wall", (0.06, 0.08), (0.0, 0.04, 0.0624), 0.0093, (0.0, 1.0, 0.0)),
        Opening("the wall", (0.012, 0.08), (-0.04, 0.0, 0.0624), 0.0, (-1.0, 0.0, 0.0)),
        Opening("the ceiling", (0.012, 0.0), (0.0, 0.0, 0.119), 0.0012, (0.0, 0.0, 1.0)),
    )
    tables = setting_tables(bore, AsBuilt((50.0,), openings))
    rows = next(one for one in tables if one.caption == "Chamber").rows
    assert [text for name, text in rows if name == "opening"] == [
        "60.4 × 80.4 mm in the wall at +y, its middle at (0, 40, 62.4) mm; the "
        "part stands out by 9.3 mm: clamp it there",
        "12.4 × 80.4 mm in the wall at −x, its middle at (−40, 0, 62.4) mm; the part fills it",
        "12 mm of the ceiling, which ends on the part, at (0, 0, 119) mm; the part stands out "
        "by 1.2 mm",
    ]
    alone = setting_tables(bore, AsBuilt((50.0,), openings[:1]))
    (told,) = [text for one in alone for name, text in one.rows if name == "opening"]
    assert told.endswith("clamp it there, so make the wall thin there")
    # Which end of a part that turns is driven is the shop's choice.
    turn = {"effects.part_turn": {"rpm": 60.0, "axis": (0.0, 1.0, 0.0)}}
    turned = replace(bore, design=bore.design.changed(turn))
    for ends, how in ((1, "drive it there"), (2, "drive it by one such end, the shop's choice")):
        built = AsBuilt((50.0,), openings[:1] * ends, clamp="a chuck")
        told = [text for one in setting_tables(turned, built) for _, text in one.rows]
        assert sum(f"stands out by 9.3 mm: {how}" in text for text in told) == ends
        assert any(text.endswith("; turned by a chuck") for text in told)
    first = openings[0]
    sides = np.array([[[-0.03, 0.0], [0.03, 0.0]]])
    below = first._replace(place=(0.0, 0.04, 0.1), outline=sides)
    above = openings[2]._replace(place=(0.0, 0.0393, 0.1), outline=sides)
    rows = next(
        one
        for one in setting_tables(bore, AsBuilt((50.0,), (below, above)))
        if one.rows and one.caption == "Chamber"
    ).rows
    assert dict(rows)["no rib"] == (
        "0.7 mm between those in the wall at +y and the ceiling: so little does not stand, cut "
        "these openings as one"
    )
    forms = [
        first._replace(form="round", size=(0.0604, 0.06041), way=(0.0, 0.89, -0.456)),
        first._replace(form="other", wider=(0.0612, 0.08)),
    ]
    tables = setting_tables(bore, AsBuilt((50.0,), forms))
    told = next(one for one in tables if one.caption == "Chamber").rows
    circle, section = (text.split(" in the wall")[0] for name, text in told if name == "opening")
    assert circle == "round, Ø 60.8 mm,"
    assert dict(told)["opening"].count("in the wall at +y, its middle") == 1
    assert section == "along the part's section, within 60 × 80 mm without clearance,"
    assert "it widens to 61.2 × 80 mm within 10 mm outside" in dict(told)["opening"]
    assert "0.2 mm of clearance all round, in the sizes below" in dict(rows)["holder"]
    assert dict(rows)["cut to"] == (
        "+0.1/0 mm on the sizes of openings, as balls wedge in gaps above 1.5 mm, half a ball; "
        "inner corners at most R 0.4 mm, so wire-cut or filed"
    )
    assert dict(rows)["gaps"].startswith("round the part as above, of all other joints at most 0.4")
    assert rows_of(result)["Chamber"]["gaps"].startswith("of joints and openings at most 0.42 mm")


def test_the_strips_that_close_a_lid_have_sizes(folder: Path) -> None:
    """A bar of 20 mm lies over the walls of a room of 60 x 80 mm, 10 mm off its middle."""
    result = load_result(folder)
    room = {"shape": "box", "length_mm": 60.0, "width_mm": 80.0, "height_mm": 40.0}
    data = result.design.model_dump()
    data["chamber"] = {**room, "sonotrode_distance_mm": 20.0}
    data["holder"] = {"kind": "bore", "clearance_mm": 0.2}
    result = replace(result, design=validate(Design, data))
    over = Opening("the ceiling", (0.06, 0.02), (0.0, 0.01, 0.04), 0.02, (0.0, 0.0, 1.0))
    (told,) = [text for _, text in openings_of(result, over)]
    assert told.endswith(
        "along x it is as long as the room: the part goes on over the walls there, and the ceiling "
        "is the strips beside it, which close 60 × 39.8 mm at −y and 60 × 19.8 mm at +y of the "
        "room, each to go on over the walls"
    )


def openings_of(result: Result, *openings: Opening) -> list[tuple[str, str]]:
    """The rows on openings."""
    return openings_of_rows(setting_tables(result, AsBuilt((50.0,), openings)))


def test_what_a_shop_needs_of_pose_target_strip_and_flanges(folder: Path) -> None:
    result = load_result(folder)
    poses = {
        (0, 0, 0): "as in its file: −z down",
        (180, 0, 0): "180° about x: +z down",
        (0, 90, 30): "90° about y, then 30° about z: +x down",
        (45, 0, 0): "45° about x",
    }
    for turns, told in poses.items():
        design = result.design.changed({"part.rotate_deg": turns})
        rows = rows_of(replace(result, design=design))["Part and pose"]
        assert rows["turned"] == told

    for normal, told in (
        ((0.0, 0.0, 1.0), "looks up, 52.3 mm above the sonotrode"),
        ((-1.0, 0.0, 0.0), "looks to −x"),
        ((0.6, 0.0, -0.8), "looks 37° from straight down"),
        ((0.6, 0.0, 0.8), "looks 37° from straight up"),
    ):
        flat = FlatFace(3.2e-3, normal, 0.0523, is_alone=True)
        turned = dict(setting_tables(result, AsBuilt((50.0,), flat=flat))[0].rows)["turned"]
        assert turned == f"as in its file: −z down; its largest flat face, 3200 mm², {told}"

    faces = ({"at_mm": (1.0, 2.25, -0.04), "alike": True}, {"at_mm": (0.0, 0.0, 0.0)})
    named = result.design.changed({"part.target": {"surface": "root", "faces": faces}})
    rows = rows_of(replace(result, design=named))["Part and pose"]
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    file: Any = SimpleNamespace(rotation=turn, shift=np.array([5e-5, 0.0, 0.01]))
    in_chamber = AsBuilt((50.0,), file=file).chosen_in_words(named.part.target)
    assert "2 faces, such as at (−2.2, 1, 10) mm, with all faces alike" in in_chamber
    assert rows["target, chosen by"] == (
        "the surface root of its file; 2 faces, such as at (1, 2.2, 0) mm of its file, with "
        "all faces alike"
    )
    strip = StripOfTarget(1, 0.0664, 0.1288, 0.004, 0.316)
    table = setting_tables(result, AsBuilt((50.0,), strip=strip))[0]
    assert dict(table.rows)["a strip at a time"].startswith(
        "setting 2 of 5: y 66.4 to 128.8 mm of its file; the part is moved by 62.4 mm along that y"
    )
    for both, ends in ((True, "flanges at both ends"), (False, "a flange at the end")):
        flanges = {"diameter_mm": 61.5, "thickness_mm": 2.0, "both_sides": both}
        holder = {"kind": "arbor", "at": {"faces": faces[1:]}, **flanges}
        made = FixtureRecord(
            kind="arbor", size_mm=[25.0], length_mm=54.0, covered_mm2=9.0, covered_target_mm2=0.0
        )
        chamber = result.record.chamber.model_copy(update={"fixtures": {"holder": made}})
        record = result.record.model_copy(update={"chamber": chamber})
        held = replace(result, record=record, design=result.design.changed({"holder": holder}))
        told = rows_of(held)["Chamber"]["holder"]
        assert f"54 mm long, with {ends} of the part, Ø 61.5 × 2 mm" in told


def test_the_slit_round_the_sonotrode_is_in_the_dimensions(folder: Path) -> None:
    """The wall goes round a face as wide as the floor, and stands on a larger one."""
    result = load_result(folder)
    for face, want in (({"diameter_mm": 50.0}, "Ø 50 +1.5/+0.2"), ({"diameter_mm": 60.0}, "Ø 50")):
        design = result.design.changed({"sonotrode.face": face})
        limits = slit_limits(replace(result, design=design))
        axes = Figure().add_axes((0.0, 0.0, 1.0, 1.0))
        draw_chamber(axes, build_chamber(design), 0.0, 100.0, (180.0, 100.0), Shown(limits))
        assert want in [one.get_text() for one in axes.texts]
        told = rows_of(replace(result, design=design))["Chamber"]["diameter"]
        is_round = "50.2 to 51.5 mm, centred round the face of 50 mm"
        assert told == (is_round if "/" in want else "50 mm")
    assert slit_limits(result) == {}


@pytest.mark.parametrize(("length_mm", "jaws"), [(30.0, 0), (41.0, 0), (90.0, 4)])
def test_jaws_are_drawn_where_the_part_stands_far_enough_out(
    folder: Path, tmp_path: Path, length_mm: float, jaws: int
) -> None:
    """A bar along x in a box of 40 mm: inside, hardly out, and out by 25 mm at both sides."""
    trimesh.creation.box((length_mm, 6.0, 6.0)).export(tmp_path / "bar.stl")
    room = {"shape": "box", "length_mm": 40, "width_mm": 30, "height_mm": 30}
    design = load_result(folder).design.changed({
        "part": {"mesh": str(tmp_path / "bar.stl"), "unit": "mm"},
        "chamber": {**room, "sonotrode_distance_mm": 10},
    })  # fmt: skip
    axes = Figure().add_axes((0.0, 0.0, 1.0, 1.0))
    told = draw_chamber(axes, build_chamber(design), 0.0, 100.0, (180.0, 100.0))
    assert [one.get_hatch() for one in axes.patches].count(JAWS) == jaws
    assert ("White and crossed: jaws" in told) == bool(jaws)


def test_strips_are_peened_after_parts_and_twice_of_their_saturation(folder: Path) -> None:
    result = load_result(folder)
    for time, told in (
        (Estimate(38.0, 12.0), "A strips after 9.5, 19, 38 and 76 s, to"),
        (Estimate(38.0, math.inf, in_words=NOT_RESOLVED), "A strips at 4 or 5 times, to"),
    ):
        metrics = {**result.record.metrics, "saturation_time_s": time}
        record = result.record.model_copy(update={"metrics": metrics})
        rows = first_checks(replace(result, record=record)).rows
        assert any(row[0].startswith(told) for row in rows)


def test_an_intensity_off_the_usual_one_is_told_in_red(folder: Path) -> None:
    usual = WantedIntensity(0.2, 0.3, "usual for steel")
    built = AsBuilt((50.0,), usual=usual)
    for value, want in ((0.1, "below"), (0.24, ""), (0.5, "above")):
        found = load_result(folder)
        found.metrics["strength_um"] = Estimate(1e3 * value / USUAL_K, 0.01)
        sheet = process_sheet(found, built).sections[0].content
        red = [one.text for one in sheet if isinstance(one, Sentence) and one.kind == "warning"]
        off = [one for one in red if "expected Almen intensity" in one]
        assert len(off) == bool(want)
        assert all(f"{value} mmA, is {want} 0.2 to 0.3 mmA, usual for steel" in one for one in off)
        (table,) = (one for one in sheet if isinstance(one, Table) and "expect" in one.caption)
        assert ("Almen intensity, usual", "0.2 to 0.3 mmA, usual for steel") in table.rows
        asked = replace(found, design=found.design.changed({"process.intensity_mmA": (0.1, 0.2)}))
        asked.metrics.update(found.metrics)
        sheet = process_sheet(asked, built).sections[0].content
        assert not [x for x in sheet if isinstance(x, Sentence) and "expected Almen" in x.text]


def test_joints_are_as_tight_on_the_sheet_as_the_proposal_has_them(folder: Path) -> None:
    """By the geometry of fixture.py: in a tight gap a ball sinks by a hundredth of its radius."""
    result = load_result(folder)
    for ball in (0.4, 1.588, 3.0):
        gap = tight_gap_mm(ball)
        sinks = 0.5 * (ball - math.sqrt(ball**2 - gap**2))
        assert sinks <= 0.01 * 0.5 * ball or gap == LEAST_GAP_MM
        assert slit_mm(ball) == pytest.approx(0.5 * ball, abs=0.01)
        design = result.design.changed({"shot.diameter_mm": ball, "shot.mass_g": 1.0})
        told = rows_of(replace(result, design=design))["Chamber"]["gaps"]
        assert f"openings {joint_in_words(ball)}, or sealed" in told


def test_what_the_best_costs_is_on_the_sheet(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = load_result(folder)
    speed = result.metrics["mean_normal_speed_m_s"]
    faster = Estimate(2.0 * speed.value, 0.1 * speed.value)
    start = SimpleNamespace(metrics={"mean_normal_speed_m_s": faster}, seeds=[-1])
    monkeypatch.setattr("chamberopt.documents.sheet.expected.load_start", lambda _: start)
    told = rows_of(result)["Peening, and what to expect"][""]
    assert "It peens less hard than the start: the mean normal speed of the impacts" in told


def test_what_to_measure_first_without_a_calibration(folder: Path) -> None:
    rows = first_checks(load_result(folder)).rows
    checks = {what.split()[0]: expected for what, expected, _ in rows}
    assert checks["amplitude"] == "50 µm peak to valley"
    assert checks["ball"].startswith("sonotrode 0.7")
    assert "mmA, within a factor of 2.5: the target's" in checks["A"]  # no strips: only roughly
    few = load_result(folder)
    few.metrics["strength_um"] = Estimate(5.0, 0.1)  # 0.0675 mmA, too little for strips of type A
    told = next(row for row in first_checks(few).rows if "strips" in row[0])
    assert told[0].startswith("N strips")
    assert told[1].startswith("0.2 mm on N strips, within a factor of 2.5")
    curve = load_result(folder).record.coverage_against_time
    nearest = min(curve, key=lambda row: abs(row.mean_coverage - 0.5))
    share = 100.0 * nearest.mean_coverage
    longer = load_result(folder)
    longer = replace(longer, design=longer.design.changed({"process.treatment_time_s": 1e6}))
    what, expected = next(x for x in first_checks(longer).rows if x[0].startswith("mean"))[:2]
    assert what == f"mean coverage of the target after {plain(nearest.time_s, 3)} s"
    assert float(expected.split()[0]) == pytest.approx(share, abs=0.5)
    at_end = estimate_text(load_result(folder).metrics["mean_coverage"], 100.0, "%")
    assert nearest.time_s > 5.0  # half of it is covered later: no part is peened so long
    assert (rows[2][0].split("after ")[1], checks["mean"]) == ("the peening time, 5 s", at_end)
    few = load_result(folder)
    few.metrics["mean_coverage"] = Estimate(0.5, math.inf, in_words="not resolved")
    names = {what.split()[0] for what, *_ in first_checks(few).rows}
    assert names == checks.keys() - {"mean"}  # nothing to compare a measurement with


def test_strips_are_set_at_the_height_of_the_target(folder: Path) -> None:
    result = load_result(folder)
    for held, told in (
        (WHOLE._replace(size=None), "intensity: no strip has room in the lid; by a coupon, as"),
        (WHOLE, "; in the lid in place of the part, 31 mm from the sonotrode, facing it"),
        (PIECE, "; in the lid in place of the part, along y, 31 mm from the sonotrode, facing it"),
    ):
        rows = first_checks(result, held).rows
        (row,) = (what for what, *_ in rows if told in what)
        assert ("strips after" in row) == (held.size is not None)  # no times without a strip
        assert ("pieces of 76 × 9 mm of A strips" in row) == (held is PIECE)
    told = {what[:8]: expected for what, expected, _ in first_checks(result, WHOLE).rows}
    assert "of 2.5: the target's, not the strip's" in told["A strips"]


def test_the_first_part_sets_the_time_for_the_coverage_that_is_wanted(folder: Path) -> None:
    """200 % is twice the time after which no more dents are seen."""
    result = load_result(folder)
    places = looked_places(load_result_arrays(result), 1e-6 * result.record.field.gauge_mm2)
    built = AsBuilt((50.0,), places=[one._replace(density=2.0) for one in places])
    for percent, told in (
        (None, "set that time."),
        (100.0, "set that time."),
        (200.0, "set twice that time, for the 200 % that are wanted."),
        (150.0, "set 1.5 times that time, for the 150 % that are wanted."),
    ):
        design = result.design.changed({"process.coverage_percent": percent})
        changed = replace(result, design=design)
        assert dict(acceptance_rows(changed, built))["first part"].endswith(told)
        peen = rows_of(changed)["To peen a part"]["3 peen"]
        assert ("twice that sum is the peening time" in peen) == (percent == 200.0)


def test_a_depth_is_told_no_closer_than_its_law_is_known(folder: Path) -> None:
    result = load_result(folder)
    result.metrics["compression_depth_um"] = Estimate(126.7, 1.4)
    told = rows_of(result)["Peening, and what to expect"][metric_label("compression_depth_um").text]
    assert told == "about 130 µm, within a factor of 1.6 by its law"


def test_a_part_is_accepted_by_places_shares_and_strips(folder: Path) -> None:
    """The least covered patches come first, with what is seen there after half the time to 98 %."""
    result = load_result(folder)
    arrays = load_result_arrays(result)
    places = looked_places(arrays, 1e-6 * result.record.field.gauge_mm2)
    assert [one.density for one in places] == sorted(one.density for one in places)
    assert 1 < len(places) <= MOST_PLACES
    target = arrays.chamber.part.vertices[arrays.chamber.part.triangles[arrays.chamber.part.target]]
    low, high = target.reshape(-1, 3).min(axis=0), target.reshape(-1, 3).max(axis=0)
    for one in places:
        axis, share = one.along
        assert high[axis] - low[axis] > 0.25 * (high - low).max()
        assert abs(one.normal[axis]) < 0.75
        exact = (2.0 * one.at - low - high)[axis] / (high - low)[axis]
        assert share == pytest.approx(exact, abs=0.05)
    mean = result.metrics["mean_coverage"].value
    assert places[0].coverage(1.0) < mean
    few = AsBuilt((50.0,), places=[one._replace(density=0.1) for one in places])
    assert "first part" not in dict(acceptance_rows(result, few))
    places = [one._replace(density=2.0 + k) for k, one in enumerate(places)]
    built = AsBuilt((50.0,), held=PIECE, places=places)
    rows = dict(acceptance_rows(result, built))
    half = min(0.5 * result.metrics["time_to_98_s"].value, 5.0)
    assert f"stop it after {plain(half, 2)} s" in rows["first part"]
    tilted = np.array([-0.8, 0.0, -0.6])
    lies = [one._replace(normal=tilted, along=(0, 0.9 * k - 0.9)) for k, one in enumerate(places)]
    told = dict(acceptance_rows(result, built._replace(places=lies, radii=[2e-3])))
    x, y, z = (plain(round(1e3 * x, 1) + 0.0) for x in places[0].at.tolist())
    first = f"1 at ({x}, {y}, {z}) mm, on a fillet that looks to −x and down, near the −x end of"
    assert told["places to look at"].startswith(first)
    assert "down, near the middle of the target" in told["places to look at"]
    assert f"{per_cent(places[0].coverage(half / 5.0))} at 1" in rows["first part"]
    assert f"98 % or more of each of places 1 to {len(places)}" in rows["ACCEPT or REJECT"]
    third = result.metrics["exposure"].value * math.log(50.0) / 3.0  # of the mean's dents
    slow = [one._replace(density=third) for one in places]
    down = [one._replace(normal=np.array([0.0, 0.0, -1.0])) for one in slow]
    up = [one._replace(normal=np.array([0.0, 0.0, 1.0])) for one in slow]
    aside = [one._replace(normal=np.array([0.0, 1.0, 0.0])) for one in slow]
    turned = ", or a second pose in which it looks down, in two steps"
    assert places[0].to_part == math.inf  # a plate, which has nothing of itself before it
    for seen, radii, remedy in (
        (up, (), "it looks up: simulate the part turned over after half of the time, in two steps"),
        (aside, (), f"it looks aside: simulate more room between it and the wall{turned}"),
        (
            [one._replace(to_part=0.02) for one in aside],
            (),
            f"the part itself is before it, 20 mm away: simulate smaller balls{turned}",
        ),
        (down, (), "simulate more room beside it and a larger distance from the sonotrode"),
        (down, (1e-3,), "simulate balls of at most 0.5 mm"),
    ):
        lagging = AsBuilt((50.0,), held=PIECE, places=seen, radii=radii)
        told = dict(acceptance_rows(result, lagging))["slowest place"]
        assert told.startswith("place 1 takes about 3 times as long as the target on average, and")
        assert told.endswith(remedy)
    assert "no whole strip is held in the lid: too narrow. ACCEPT the first" in rows["intensity"]
    assert "by pieces of 76 × 9 mm cut from A strips, held as under" in rows["intensity"]
    assert (
        "whole strips on the room's wall at −x; or by a coupon (SAE AMS 2580A), a flat piece"
        in (rows["intensity"])
    )
    wide = built._replace(held=WHOLE)
    told = dict(acceptance_rows(result, wide))["intensity"]
    assert told.endswith("agree on a range in mmA by A strips in the lid, as under Measure first")
    by_coupon = built._replace(held=WHOLE._replace(size=None, why_no_whole="too small"))
    told = dict(acceptance_rows(result, by_coupon))["intensity"]
    assert "too small. ACCEPT the first part by a coupon" in told
    # A calibration tells the intensity, and yet no whole strip is held in this lid.
    result.metrics.update(almen_intensity=Estimate(0.2, 0.01))
    assert "no whole strip is held" in dict(acceptance_rows(result, built))["intensity"]
    assert dict(acceptance_rows(result, wide))["intensity"].endswith("the times of Measure first")
    # Where the coverage is not told, shares are told for a time up to which it is.
    mean = result.metrics["mean_coverage"].not_known("not resolved")
    few = {**result.record.metrics, "mean_coverage": mean}
    curve = result.record.coverage_against_time
    early = [one for one in curve if one.time_s < 0.8 * half]
    assert 0 < len(early) < len(curve)
    for kept, until in ((early, early[-1].time_s), ([], 0.0)):
        record = result.record.model_copy(update={"coverage_against_time": kept, "metrics": few})
        told = dict(acceptance_rows(replace(result, record=record), built)).get("first part", "")
        share = per_cent(places[0].coverage(until / 5.0))
        assert told.startswith(f"stop it after {plain(until, 2)} s") == bool(kept)
        assert (f"on about {share} at 1" in told) == bool(kept)
        assert ("after 5 s is not proven: simulate longer" in told) == bool(kept)
    none = dict(acceptance_rows(result, AsBuilt((50.0,))))
    assert none["places to look at"].startswith("all of the target")
    assert "first part" not in none


def test_the_holder_of_a_strip_is_described_on_a_page_with_room(folder: Path) -> None:
    """One fact in one place: how high it is, how far its block stands down, and its screws."""
    result = load_result(folder)

    def told(built: AsBuilt) -> dict[str, str]:
        tables = limit_tables(result, built)
        return next((dict(one.rows) for one in tables if one.caption == "Strip holder"), {})

    assert told(AsBuilt((50.0,))) == {}
    rows = told(AsBuilt((50.0,), held=WHOLE))
    assert rows["strip"].startswith("an A strip, 76.2 × 18.8 to 19.05 × 1.29 mm (SAE J442): its")
    assert rows["strip"].endswith("its peened face down, 31 mm from the sonotrode's face")
    assert "no opening. Its lower face, on which the strip lies, is 1.7 mm below" in rows["block"]
    assert rows["screws"].startswith("four, M5, at 20.6 mm along and 12.1 mm across from")
    aside = Opening("the wall", (0.06, 0.04), (0.0, 0.04, 0.03), 0.01, (0.0, 1.0, 0.0))
    rows = told(AsBuilt((50.0,), (aside,), held=PIECE._replace(block_mm=0.0)))
    assert rows["strip"].startswith("a piece of 76 × 9 mm, cut from an A strip")
    assert "is flush with the ceiling" in rows["block"]
    assert "no opening; those that the part leaves in the walls are closed flush" in rows["block"]


def test_plugs_have_a_fit_and_what_lies_on_walls_is_clamped_by_these_alone(folder: Path) -> None:
    """An arm lies on the wall at +x: the opening of the ceiling has no clamp of its own."""
    result = load_result(folder)
    made = FixtureRecord(
        kind="plugs", size_mm=[], length_mm=0.0, covered_mm2=9.0, covered_target_mm2=0.0
    )
    chamber = result.record.chamber.model_copy(update={"fixtures": {"mask": made}})
    record = result.record.model_copy(update={"chamber": chamber})
    held = result.design.changed({"holder": {"kind": "bore", "clearance_mm": 0.2}})
    top = Opening("the ceiling", (0.02, 0.04), (0.0, 0.0, 0.02), 0.01, (0.0, 0.0, 1.0))
    arm = Opening("the wall", (0.04, 4e-4), (0.02, 0.0, 0.0198), 0.02, (1.0, 0.0, 0.0), "edge")
    for openings, is_told in (((top,), True), ((top, arm), False)):
        built = AsBuilt((50.0,), openings, clamp="jaws", screws="3 holes of 7 mm")
        told = setting_tables(replace(result, design=held, record=record), built)
        rows = dict(next(one for one in told if one.caption == "Chamber").rows)
        text = " ".join(cut for name, cut in openings_of_rows(told))
        assert ("clamp it there" in text) == is_told
        assert rows["holder"].endswith("by jaws, or by screws through its 3 holes of 7 mm there")
        assert "of polyamide, turned 0.1 mm larger than the hole, pressed in" in rows["plugs"]


def openings_of_rows(tables: list[Table]) -> list[tuple[str, str]]:
    """The rows on openings of a sheet's tables."""
    rows = next(one for one in tables if one.caption == "Chamber").rows
    return [(row[0], row[1]) for row in rows if row[0] == "opening"]


def test_what_is_to_be_settled_is_told_once(folder: Path) -> None:
    """Iron of the walls is a row of the chamber only where it is no matter to settle."""
    result = load_result(folder)
    metals = {"materials.part": "7075-T6", "materials.wall": "100Cr6"}
    for settle, is_row in (((), True), (("IRON FROM THE WALLS: balls carry it",), False)):
        design = result.design.changed({**metals, "to_settle": settle})
        assert ("iron" in rows_of(replace(result, design=design))["Chamber"]) == is_row


def test_a_part_has_a_longest_time_and_the_shot_a_range_of_its_mass(folder: Path) -> None:
    """Twice the peening time; a time that nobody asked for, and is far too long, is told."""
    result = load_result(folder)
    built = AsBuilt((50.0,))
    assert (
        "for more than twice the peening time, in all"
        in (dict(acceptance_rows(result, built))["ACCEPT or REJECT"])
    )
    design = result.design.changed({"process.treatment_time_s": 300.0})
    long = replace(result, design=design)
    long.metrics["time_to_98_s"] = Estimate(100.0, 3.0)
    told = dict(acceptance_rows(long, built))["ACCEPT or REJECT"]
    assert "peened for more than 600 s, 6 × the time to 98 %, in all: REJECT it" in told
    rows = rows_of(long)
    shorter = rows["Peening, and what to expect"]["shorter"]
    assert shorter.startswith("103 s are enough for 98 %. Peen longer only if the drawing asks")
    assert rows["Shot"]["keep it at"].startswith("3.14 to 3.47 g, as impacts are as many more or")
    asked = replace(long, design=design.changed({"process.coverage_percent": 200.0}))
    asked.metrics["time_to_98_s"] = Estimate(100.0, 3.0)
    assert "shorter" not in rows_of(asked)["Peening, and what to expect"]
    box = {"tolerances": {"shot.mass_g": 0.1}}
    assert "keep it at" not in rows_of(replace(long, design=design.changed(box)))["Shot"]


def test_an_order_in_mmn_is_told_as_it_was_given(folder: Path) -> None:
    """0.15-0.25N are 0.05 to 0.0833 mmA, and N strips measure them."""
    result = load_result(folder)
    low, high = WantedIntensity.parse("0.15-0.25N").low, WantedIntensity.parse("0.15-0.25N").high
    ordered = replace(result, design=result.design.changed({"process.intensity_mmA": (low, high)}))
    told = dict(acceptance_rows(ordered, AsBuilt((50.0,), held=WHOLE)))["intensity"]
    assert told == (
        "not accepted by coverage: ACCEPT 0.15 to 0.25 mmN (roughly 0.05 to 0.083 mmA) by N strips "
        "in the lid, as under Measure first"
    )
    rows = [what for what, *_ in first_checks(ordered, WHOLE._replace(type="N")).rows]
    assert any(one.startswith("N strips") and "calibrate" not in one for one in rows)


def test_what_a_holder_bears_is_the_momentum_of_the_impacts(folder: Path) -> None:
    """Each impact leaves m (1 + e) v along the normal, in all 5 s of all replicas."""
    result = load_result(folder)
    arrays = load_result_arrays(result)
    push = push_of_shot(result, arrays)
    assert push is not None
    part, hits = arrays.chamber.part, load_hits(result.path(HITS_FILE)).hits
    normal = trimesh.Trimesh(part.vertices, part.triangles, process=False).face_normals
    back = 1.0 + restitution_at(hits.speed, result.design.materials.part.restitution)
    each = result.design.shot.ball_mass * back * hits.speed
    seconds = result.record.replicas * result.record.simulated_time_s
    exact = -(each[:, None] * normal[hits.triangle]).sum(axis=0) / seconds
    np.testing.assert_allclose(push, exact, atol=0.1 * np.linalg.norm(exact))
    assert push[2] > 0.9 * np.linalg.norm(push)  # a plate whose lower side is peened
    x, y, z = push
    built = AsBuilt((50.0,), push=(x, y, z), volume=1e-6)
    rows = dict(next(one for one in setting_tables(result, built) if one.caption == "Chamber").rows)
    told = rows["hold it against"]
    assert told.startswith(
        f"the shot pushes the part by about {plain(np.linalg.norm(push), 1)} N net"
    )
    assert "to +z, up" in told
    several = replace(
        result, design=result.design.changed({"shot.diameter_mm": None, "shot.mix": MIX})
    )
    assert push_of_shot(several, arrays) is None


@pytest.mark.parametrize(("half_width", "assumed"), [(50.0, 0), (math.inf, 2)])
def test_what_the_simulation_has_settled_is_told_no_more(
    folder: Path, half_width: float, assumed: int
) -> None:
    """A pilot had not known the time to 98 %. A design without a time says nothing of it."""
    result = load_result(folder)
    texts = [
        "TIME KNOWN ROUGHLY, to ± 57%: simulate",
        "NOT MASKED: ask",
        "TIME NOT MEASURED by a pilot",
    ]
    design = result.design.changed({"to_settle": texts})
    warnings = (*matters(design), "another")
    record = result.record.model_copy(update={"warnings": warnings})
    told = replace(result, design=design, record=record)
    told.metrics["time_to_98_s"] = Estimate(900.0, half_width)
    assert len(open_matters(told)) == 1 + assumed
    assert [text for text in alarms(told) if text.startswith("1 matter")]
    assert own_warnings(told) == ["another"]
    tables = {one.caption: one for one in limit_tables(told, AsBuilt((50.0,)))}
    assert tables[Urgency.BEFORE_BUILDING.in_words].rows == [("", "NOT MASKED: ask.")]
    assert (Urgency.ASSUMED.in_words in tables) is bool(assumed)
    assert SETTLED not in tables
    record = record.model_copy(update={"warnings": matters(design)})
    (table,) = (
        one
        for one in limit_tables(replace(told, record=record), AsBuilt((50.0,)))
        if one.caption == "Warnings"
    )
    assert table.rows == [("", "There are none beside what is to be settled.")]
    kept = replace(told, design=design.changed({"to_settle": [], "settled": ["LONG (by phone)"]}))
    (table,) = (one for one in limit_tables(kept, AsBuilt((50.0,))) if one.caption == SETTLED)
    assert table.rows == [("", "LONG (by phone)")]


def test_the_openings_of_a_later_step_are_told(folder: Path) -> None:
    one = Opening("the ceiling", (0.035, 0.035), (0.0, 0.0, 0.103), 0.05, (0.0, 0.0, 1.0), "round")
    other = one._replace(size=(0.03, 0.03))
    for later, told in (([other], ["opening, step 2"]), ([one], [])):
        built = AsBuilt((50.0,), [one], later=[later])
        tables = {table.caption: table for table in setting_tables(load_result(folder), built)}
        rows = [(name, text) for name, text in tables["Steps"].rows] if "Steps" in tables else []
        assert [name for name, _ in rows if name] == told
        assert all("Ø 30 mm" in text for name, text in rows if name)


def test_a_folder_whose_name_is_no_text_has_a_sheet(tmp_path: Path) -> None:
    figure = Figure(figsize=(1, 1))
    _save(tmp_path / "sheet.pdf", [figure], "result \udcff")
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
    assert rows["Tolerances"]["Sonotrode amplitude [µm]"] == "23 to 27, as designed 25"
    assert "was not simulated" in rows["Tolerances"][""]
    zones = rows["Zones and limits"][""]
    assert (zones.count("is not met"), zones.count("is met")) == (3, 3)
    assert zones.rindex("is not met") < zones.index("is met")  # the worst first
    assert rows["Peening, and what to expect"]["mean Almen intensity"] == "0.200 ± 0.010 mmA"
    assert SHOP_NAMES["strength_um"] not in rows["Peening, and what to expect"]
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


@pytest.mark.parametrize("much", [False, True])
def test_nothing_overlaps_or_is_cut_off(folder: Path, much: bool) -> None:
    result = load_result(folder)
    tables = setting_tables(result, AsBuilt((50.0,)))
    # With all of these in letters that can be read, what is measured first has no room.
    content = [*(one for one in tables if one.caption != "Acceptance"), first_checks(result)]
    name, answer = "a name", "An answer."
    if much:
        name, answer = 30 * "name ", 40 * "answer "
        long = "words and_a_name_without_an_end_" + 60 * "x" + 40 * " more words"
        rows = [(f"name {k} " + 20 * "y", long) for k in range(3)]
        content = [
            *content[:-1], *(Table(f"block {k}", (), rows) for k in range(2)),
            Table("", content[-1].head, [(long, long, "")] * 5), Sentence(long),
        ]  # fmt: skip
    limits = [
        Table("Warnings", (), [("", f"{k}: " + 30 * "words ") for k in range(90 if much else 1)])
    ]
    block = Table("", (), [*title_block(result, name).items()])
    sections = [("Process sheet", content), ("Limits", limits), ("Title block", [block])]
    sheet = Document(name, "kind", answer, (), [Section(*one) for one in sections])
    pages = [boxes_of(one) for one in draw_sheet(sheet, build_chamber(plate_design()))]
    assert len(pages) > 2 if much else len(pages) == 1
    for number, page in enumerate(pages, 1):
        require_apart(page)
        assert {f"{number} of {len(pages)}", "drawing no.", "revision"} < {text for text, _ in page}
    texts = [text for page in pages for text, _ in page]
    told = [text for text in texts if not text.startswith("name name")]  # but in headings
    assert not any(text.endswith("…") for text in told)
    assert all(any(text.startswith(f"{k}: ") for text in texts) for k in range(len(limits[0].rows)))


def test_a_sheet_without_a_page_of_coverage_says_why(folder: Path) -> None:
    sheet = process_sheet(load_result(folder), AsBuilt((50.0,)))
    for coverage, page in (("no OpenGL library", 0), (np.zeros((40, 60, 3)), 1)):
        pages = draw_sheet(sheet, build_chamber(plate_design()), coverage=coverage)
        texts = [text for one in pages for text, _ in boxes_of(one)]
        told = "No page shows the coverage by place: no OpenGL library." in texts
        assert (told, "Coverage by place" in texts) == (not page, bool(page))
        assert len(pages) == 2  # it is under the tables, as it has room there


def test_a_part_that_lies_on_the_walls_leaves_one_tolerance(folder: Path) -> None:
    """A wall ends on it: height and distance differ by a length of the part."""
    result = load_result(folder)
    box = {"chamber.sonotrode_distance_mm": 0.2, "chamber.height_mm": 0.3}
    design = result.design.changed({"tolerances": box})
    result = replace(result, design=design)
    top = Opening("the ceiling", (0.03, 0.04), (0.0, 0.0, 0.02), 0.01, (0.0, 0.0, 1.0))
    edge = Opening("the wall", (0.04, 4e-4), (0.02, 0.0, 0.0198), 0.02, (1.0, 0.0, 0.0), "edge")
    for openings, lid in (
        ((), "the ceiling, which lifts off; balls go in and out there"),
        ((top, edge), "the part, which lifts off; balls go in and out there"),
        ((top,), "the part, or the ceiling with it, which lifts off; balls go in and out there"),
    ):
        ways: dict[str, Mounting] = {"the ceiling": "part goes in", "the wall": "lies on it"}
        built = AsBuilt((50.0,), openings, [ways[one.wall] for one in openings])
        tables = [*setting_tables(result, built), *limit_tables(result, built)]
        rows = {one.caption: dict(one.rows) for one in tables}
        follows = edge in openings
        assert rows["Chamber"]["opened at"] == lid
        assert rows["Chamber"]["height"].startswith(
            "(19.6 mm): follows" if follows else "20 mm (19.7"
        )
        told = rows["Tolerances"]["Chamber height [mm]"]
        assert told.startswith("(19.6): follows" if follows else "19.7 to 20.3")
        mount = rows["To peen a part"]["1 mount" if not openings else "2 mount"]
        assert ("it lies on the walls" in mount) == follows
        cut = [text for one in tables for name, text in one.rows if name == "opening"]
        assert [text.rpartition("; ")[2] for text in cut if "which ends on the part" in text] == (
            ["it lies on the wall"] if follows else []
        )
        assert not any("split" in text for one in tables for _, text in one.rows)
        assert ("it stands 10 mm out" in mount) == (openings == (top,))
        limits = chamber_limits(result) | reference_limits(result, openings)
        assert with_limits("20", 20.0, limits, "height_mm") == ("(19.6)" if follows else "20 ±0.3")
    ceiling = {
        one.caption: dict(one.rows)
        for one in setting_tables(result, AsBuilt((50.0,), is_ceiling=True))
    }
    assert ceiling["Chamber"]["opened at"].startswith("the part, which lifts off")
    assert "it closes the chamber" in ceiling["To peen a part"]["2 mount"]
    assert part_is_ceiling(build_chamber(plate_design()))


def test_what_forbids_to_use_it_is_in_red(folder: Path) -> None:
    """Of a result that is put together here: figures, jammed balls and the time."""
    result, trapped = load_result(folder), dict.fromkeys(SHARES, 0.0)
    assert not any("rattle" in text for text in alarms(result))
    trapped |= {"rattling_time": 0.12, "rattling_impacts": 0.48}
    jammed = TrappedRecord(**trapped, place="at the gutter, around (8.0, -6.7, 35.5) mm")
    record = result.record.model_copy(update={"trapped": jammed})
    (told,) = [text for text in alarms(replace(result, record=record)) if "rattle" in text]
    assert "12 % of the shot at any time, and 48 % of the impacts" in told
    assert "part, e.g. at the gutter, around (8.0, -6.7, 35.5) mm in the chamber's frame." in told
    assert told in [one.text for one in answer_lines(replace(result, record=record)) if one.warns]
    assert not any("settled" in text for text in alarms(result))
    lively = result.record.model_copy(update={"first_half_excess": 0.12})
    (told,) = [text for text in alarms(replace(result, record=lively)) if "not settled" in text]
    assert "dented by 12 % more in the first half" in told
    nearly = replace(result, record=result.record.model_copy(update={"first_half_excess": 0.03}))
    assert not any("settled" in text for text in alarms(nearly))
    (told,) = [text for text in cautions(nearly) if "settled" in text]
    assert told.endswith("So times are about 1.5 % longer than told.")
    for few, words in ((1, "1 matter is to"), (2, "2 matters are to")):
        open_one = result.design.changed({"to_settle": ["NOT MASKED: ask"] * few})
        (told,) = [text for text in alarms(replace(result, design=open_one)) if "matter" in text]
        assert told.startswith(words)
    metrics = result.metrics
    metrics.update(mean_coverage=Estimate(0.57, 0.03), time_to_98_s=Estimate(900.0, 50.0))
    assert [text for text in alarms(result) if "enough" in text.lower()] == [
        "Not enough: 5 s leave 43 ± 3 % of the target bare; they are 0.0056 × the time to 98 % on "
        "95 % of the target's area, 900 ± 50 s."
    ]
    metrics["time_to_98_s"] = Estimate(4.0, 0.1)
    assert not any("enough" in text.lower() for text in alarms(result))
    metrics["p05_coverage"] = Estimate(0.5, math.inf, in_words="not resolved")
    (told,) = [text for text in alarms(result) if "Too few dents" in text]
    assert metric_label("p05_coverage").text in told
    metrics["strength_um"] = metrics["p05_coverage"]
    assert [text for text in alarms(result) if "Too few dents" in text] == [told]  # no strips
    content = process_sheet(result, AsBuilt((50.0,))).sections[0].content
    assert content[0] == Sentence(told, "warning")
    (wide,) = [
        one.text
        for one in process_sheet(result, AsBuilt((130.0,))).sections[0].content
        if isinstance(one, Sentence) and "larger than usual" in one.text
    ]
    assert "The face, Ø 130 mm, is larger than usual sonotrodes" in wide


def test_dimensions_have_the_tolerances_of_the_design(folder: Path) -> None:
    result = load_result(folder)
    box = {"sonotrode_distance_mm": 0.5, "height_mm": 0.5, "diameter_mm": [-0.1, 0.3]}
    tolerances = {f"chamber.{key}": ends for key, ends in box.items()}
    result = replace(result, design=plate_design().changed({"tolerances": tolerances}))
    limits = chamber_limits(result)
    assert limits["height_mm"] == (20.0, 19.5, 20.5)
    axes = Figure().add_axes((0.0, 0.0, 1.0, 1.0))
    draw_chamber(axes, build_chamber(result.design), 0.0, 100.0, (180.0, 100.0), Shown(limits))
    texts = [one.get_text() for one in axes.texts]
    assert "15 ±0.5" in texts
    assert "(15)" in texts  # the plate is the ceiling: this is not height_mm
    assert "Ø 50 +0.3/−0.1" in texts
    rows = rows_of(result)["Chamber"]
    assert rows["diameter"] == "50 mm (49.9 to 50.3)"


def test_the_metal_says_how_surely_its_hardness_is_known(folder: Path) -> None:
    result = load_result(folder)

    def metal(**part: object) -> str:
        design = result.design.changed({"materials.part": part})
        return rows_of(replace(result, design=design))["Part and pose"]["metal"]

    assert "by heart, not verified" in metal(alloy="Waspaloy")
    assert "read in a maker's data sheet" in metal(alloy="54SiCr6")
    assert metal(alloy="54SiCr6", hardness_HB=530) == "54SiCr6, 530 HB, as given"


def test_it_is_an_a4_page_with_a_map_and_replaces_only_an_older_one(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    path, has_map = tmp_path / "sheet.pdf", missing_opengl() is None
    for _ in range(2):
        assert main(["report", str(folder), "--sheet", "--out", str(path)]) == 0
        assert f"process sheet in {path}" in capsys.readouterr().out
    content = path.read_bytes()
    boxes = re.findall(rb"/MediaBox \[ ([\d. ]+) \]", content)
    for box in boxes:
        assert tuple(map(float, box.split())) == pytest.approx((0.0, 0.0, *A4), abs=0.02)
    # The holder of its strip leaves the coverage no room under the tables.
    assert len(re.findall(rb"/Type /Page\b", content)) == len(boxes) == 2 + has_map
    assert (b"/Subtype /Image" in content) or not has_map
    assert b"/FontFile2" in content  # letters that can be selected, not their outlines
    precious = tmp_path / "precious.pdf"
    precious.write_bytes(b"%PDF-1.4 of somebody")
    with pytest.raises(InputError, match=r"precious\.pdf: this file exists and is no process sh"):
        write_sheet(folder, precious)
    assert precious.read_bytes() == b"%PDF-1.4 of somebody"
    with pytest.raises(InputError, match=r"one \.pdf file"):
        write_sheet(folder, tmp_path / "sheet.html")


def test_an_auditor_finds_version_digests_revision_and_what_requalifies(
    folder: Path, capsys: pytest.CaptureFixture
) -> None:
    result = load_result(folder)
    sheet = process_sheet(result, AsBuilt((50.0,)), revision="B")
    fields = dict(sheet.sections[-1].content[0].rows)
    design = hashlib.sha256((folder / "design.toml").read_bytes()).hexdigest()
    assert fields["chamberopt, simulated"].startswith(f"{result.record.versions['chamberopt']}, ")
    assert fields["design, sha256"] == design[:12]
    assert fields["result, sha256"] == result.record.sha256[:12]
    assert (fields["revision"], fields["drawing no."]) == ("B", "")
    assert title_block(result, "a name")["revision"] == ""
    assert sheet.sections[0].content[-1] == Sentence(REQUALIFY)
    assert len(broken(REQUALIFY, WIDTH - 2 * MARGIN, 7.0)) == 1  # one line
    for given, told in (
        (["--revision", "B"], "--revision: it is printed on the process sheet; add --sheet"),
        (["--sheet", "--revision", 21 * "x"], "revision: given "),
        (["--sheet", "--revision", "a\nb"], "at most 20 characters that can be printed"),
    ):
        assert main(["report", str(folder), *given]) == 2
        assert told in capsys.readouterr().err
    assert not (folder / "process_sheet.pdf").exists()


def test_lines_are_broken_to_their_width() -> None:
    text = "the mean is 12.3 ± 0.4 % of it " + 12 * "w"
    lines = broken(text, 30.0, 8.0)
    assert all(text_width(line, 8.0) <= 30.0 for line in lines)
    assert "".join(lines).replace("\u00a0", "").replace(" ", "") == text.replace(" ", "")
    assert any("12.3\u00a0±\u00a00.4\u00a0%" in line for line in lines)
    units = "range 10.6 to 14.6 µm, then 2600 s on 3581 mm² at 5 m/s of 7 parts"
    whole = ("14.6\u00a0µm,", "2600\u00a0s", "3581\u00a0mm²", "5\u00a0m/s")
    for width in range(26, 60):
        text = "\n".join(broken(units, float(width), 8.0, most=20))
        assert all(one in text for one in whole)
        assert "7\u00a0" not in text
    assert broken(100 * "word ", 20.0, 8.0, most=4)[-1].endswith("…")
    assert "…" not in "".join(broken(100 * "word ", 20.0, 8.0))
    assert broken("工 gear\x1b\n1", 30.0, 8.0) == ["? gear? 1"]  # the font has no such letters
