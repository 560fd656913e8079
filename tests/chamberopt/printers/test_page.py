"""A report says what the result holds, and its page needs nothing but itself."""

import base64
import json
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.common.key_words import title_with_unit
from chamberopt.documents.document import Document, Items, Section, Table
from chamberopt.documents.report import report
from chamberopt.documents.wording import with_interval
from chamberopt.pictures.drawn_part import DrawnPart
from chamberopt.pictures.part3d import part_scene
from chamberopt.printers.report_page import write_part_page, write_report
from chamberopt.results.arrays_file import load_result_arrays, read_result_arrays
from chamberopt.results.load import load_result
from tests.helpers.results.digests import replace_result
from tests.helpers.results.report_folders import simulated, studied_once

NASTY = "a <img src=x onerror=alert(1)> & b"


@pytest.fixture(scope="module")
def no_pictures():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
        yield


@pytest.fixture(scope="module")
def simulation(tmp_path_factory: pytest.TempPathFactory, no_pictures: None) -> Path:
    return simulated(tmp_path_factory.mktemp("report") / NASTY)[0]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return studied_once(tmp_path_factory)


class Page(HTMLParser):
    """The elements of a page as a browser sees them, and its text outside scripts and styles."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict]] = []
        self.scripts: list[str] = []
        self.text = ""
        self._inside = ""
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attributes: list) -> None:
        self.elements.append((tag, dict(attributes)))
        self._inside = tag
        if tag == "script":
            self.scripts.append("")

    def handle_data(self, data: str) -> None:
        if self._inside == "script":
            self.scripts[-1] += data
        elif self._inside != "style":
            self.text += data

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def parts(self) -> dict:
        (place,) = (i for i, e in enumerate(self._kind("script")) if e.get("id") == "parts")
        return json.loads(self.scripts[place])

    def _kind(self, tag: str) -> list[dict]:
        return [attributes for name, attributes in self.elements if name == tag]


def unpacked(text: str, kind: str = "<f4") -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def changed(folder: Path, copy: Path, change) -> Path:
    """A copy of a results folder with another result.json."""
    shutil.copytree(folder, copy)
    data = json.loads((copy / "result.json").read_text())
    change(data)
    replace_result(copy, data)
    return copy


def section_of(document: Document, title: str) -> Section:
    (found,) = (one for one in document.sections if one.title == title)
    return found


def rows_of(document: Document, title: str, caption: str) -> list:
    """The rows of a table in a section."""
    tables = (one for one in section_of(document, title).content if isinstance(one, Table))
    return next([*map(tuple, one.rows)] for one in tables if one.caption == caption)


def test_a_simulation_is_answered_in_one_sentence(simulation: Path) -> None:
    document, result = report(load_result(simulation)), load_result(simulation)
    mean = result.metrics["mean_coverage"]
    assert with_interval(100 * mean.value, 100 * mean.half_width, "%") in document.answer
    assert document.answer.startswith("After 5 s the target is covered to ")
    titles = {one.title for one in document.sections}
    assert not titles & {"Which parameters mattered", "How the search went", "Zones", "Tolerances"}
    assert ("gravity", "on") in rows_of(document, "Physical effects", "In this result")
    assert ("part, SHA-256", result.record.part_sha256) in rows_of(document, "Made with", "")


def test_what_is_to_be_settled_stands_beside_the_answer(simulation: Path) -> None:
    result, matter = load_result(simulation), "NOT MASKED: ask the customer"
    titles = [one.title for one in report(result).sections]
    open_one = replace(
        result,
        design=result.design.changed({"to_settle": [matter]}),
        record=result.record.model_copy(update={"warnings": (f"to be settled: {matter}", "thin")}),
    )
    document = report(open_one)
    told = "To be settled before it is built"
    assert [one.title for one in document.sections][1:3] == ["The answer", told]
    assert told not in titles
    assert section_of(document, told).content == [Items(["Not masked: ask the customer."])]
    notes = [getattr(one, "text", "") for one in section_of(document, "Notes and warnings").content]
    assert "Warning: thin" in notes
    assert not any(matter in text for text in notes)


def test_a_study_is_answered_with_its_gain(study: Path, tmp_path: Path) -> None:
    document, about = report(load_result(study)), load_result(study).study
    assert about is not None
    gain = about.gain
    assert with_interval(gain.value, gain.half_width, sign=True) in document.answer
    assert "more than noise" in document.answer
    first = rows_of(document, "Compared with the start", "± 95 % intervals")[0]
    assert first[-2:] == (with_interval(gain.value, gain.half_width, sign=True), "yes")
    text = Page(write_report(study, tmp_path / "page.html")[0]).text
    assert "Constraints: sonotrode distance of the chamber ≥ 9.5 mm." in text
    assert text.count("<b>not</b> this one") == about.failed > 0
    changed = {row[0] for row in rows_of(document, "The design", "What differs from the start")}
    assert changed <= {title_with_unit(name) for name in about.vary}
    assert changed


def test_no_gain_is_reported_as_none(study: Path, tmp_path: Path) -> None:
    folder = tmp_path / "flat"
    shutil.copytree(study, folder)
    best = json.loads((folder / "result.json").read_text())
    best["study"]["best"] = {"searched_as": 0, "parameters": best["study"]["start"]["parameters"]}
    replace_result(folder, best)
    start = json.loads((folder / "start" / "result.json").read_text())
    same = {name: best[name] for name in ("objective", "metrics")}
    replace_result(folder / "start", start | same)
    document = report(load_result(folder))
    assert "No better chamber than the start was found" in document.answer
    rows = rows_of(document, "Compared with the start", "± 95 % intervals")
    assert rows[0][-1] == "exact"


def test_a_front_of_two_objectives_is_listed(study: Path, tmp_path: Path) -> None:
    goals = {
        "uniform_coverage": {"value": 0.5, "half_width": 0.01},
        "minus_time_to_98_s": {"value": -71.3, "half_width": 2.0},
    }

    def add_front(data: dict) -> None:
        best = data["study"]["best"]["parameters"]
        row = {"parameters": best, "standing": "feasible", "objectives": goals}
        data["study"].update(front=[row])

    folder = changed(study, tmp_path / "front", add_front)
    text = Page(write_report(folder)[0]).text
    assert "The study had two objectives" in text
    assert "71.3\u00a0±\u00a02.0" in text  # seconds, not their negative


@pytest.mark.parametrize("kind", ["simulation", "study"])
def test_the_page_needs_nothing_but_itself(
    kind: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    path, _ = write_report(request.getfixturevalue(kind), tmp_path / "page.html")
    page = Page(path)
    for tag, attributes in page.elements:
        assert tag not in ("link", "iframe", "object", "embed", "base", "img"), tag
        for name in ("src", "href", "action", "srcset", "poster"):
            assert attributes.get(name, "data:").startswith(("data:", "#")), (tag, attributes)
    text = path.read_text(encoding="utf-8")
    assert not re.findall(r"@import|url\(\s*['\"]?(?!data:)", text[: text.index("</style>")])
    assert sum(script.startswith("var THREE") for script in page.scripts) == 1
    policy = next(a["content"] for tag, a in page.elements if tag == "meta" and "http-equiv" in a)
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy
    own = [script for script in page.scripts if not script.startswith("var THREE")]
    assert not any("http" in script for script in own)
    assert ("html", {"lang": "en"}) in page.elements
    charts_shown = [a for tag, a in page.elements if tag == "div" and a.get("role") == "img"]
    assert charts_shown
    assert all(a["aria-label"] for a in charts_shown)


def test_markup_in_names_and_notes_stays_text(simulation: Path, tmp_path: Path) -> None:
    note = "</script><script>alert(2)</script>"

    def spoil(data: dict) -> None:
        data["notes"] = [note]
        data["versions"]["<i>python"] = "</style>"

    page = Page(write_report(changed(simulation, tmp_path / NASTY, spoil))[0])
    assert not any(tag in ("img", "i") for tag, _ in page.elements)
    assert not any("alert(2)" in script for script in page.scripts)
    assert page.parts()["scenes"][0]["title"] == NASTY
    for text in (NASTY, note, "<i>python", "</style>"):
        assert text in page.text


def test_the_page_carries_the_columns_of_the_target(simulation: Path, tmp_path: Path) -> None:
    arrays = read_result_arrays(simulation / "arrays.npz")
    part, own = DrawnPart(arrays.field).target, arrays.elements
    carried = Page(write_report(simulation, tmp_path / "page.html")[0]).parts()
    (scene,) = carried["scenes"]
    for name, column, factor in (
        ("coverage", "coverage", 100.0),
        ("p90-speed", "p90_normal_speed", 1.0),
    ):
        np.testing.assert_array_equal(
            unpacked(scene["columns"][name]), (factor * part[column]).astype(np.float32)
        )
    # Each point has the number of a triangle that it belongs to, and that triangle's own figures.
    triangle = unpacked(scene["number"], "<i4")[unpacked(scene["triangle"], "<i4")]
    corners = np.asarray(part.regular_faces)
    belongs = np.zeros(part.n_points, dtype=bool)
    for k in range(3):
        belongs[corners[:, k]] |= triangle[corners[:, k]] == part["triangle"]
    assert belongs.all()
    number = unpacked(scene["number"], "<i4")
    np.testing.assert_array_equal(unpacked(scene["impacts"], "<i4"), own["impacts"][number])
    np.testing.assert_array_equal(unpacked(scene["element"], "<i4"), own["element"][number])
    np.testing.assert_allclose(
        unpacked(scene["own"]["coverage"]), 100.0 * own["coverage"][number], rtol=1e-6
    )
    places = unpacked(scene["surfaces"]["part"]["points"]).reshape(-1, 3)
    np.testing.assert_allclose(places, part.points, atol=1e-4)
    assert "points" not in scene["surfaces"]["few"]
    density = unpacked(scene["columns"]["density"])
    np.testing.assert_allclose(
        -100.0 * np.expm1(-density), unpacked(scene["columns"]["coverage"]), rtol=1e-4
    )
    assert {one["name"] for one in carried["quantities"]} == set(scene["columns"]) - {"density"}
    assert set(carried["scales"]) == {"viridis", "cividis", "magma"}


def test_words_stand_where_there_is_no_number(simulation: Path, tmp_path: Path) -> None:
    def spoil(data: dict) -> None:
        words = {"half_width": None, "in_words": "more than 2,300 s"}
        data["metrics"]["time_to_98_s"] |= words
        data["metrics"]["intensity_uniformity"] |= words | {"in_words": "not resolved"}

    folder = changed(simulation, tmp_path / "words", spoil)
    text = Page(write_report(folder)[0]).text
    assert "covered to 98 % after more than 2,300 s." in text
    assert "not resolved" in text
    for words, told in (("never", "would never be covered"), ("not resolved", "too few dents")):
        folder = changed(
            simulation,
            tmp_path / words,
            lambda data, words=words: data["metrics"]["time_to_98_s"].update(in_words=words),
        )
        assert told in report(load_result(folder)).answer


def test_the_windows_and_what_they_take_are_told(simulation: Path, tmp_path: Path) -> None:
    text = Page(write_report(simulation, tmp_path / "page.html")[0]).text
    field = load_result(simulation).record.field
    assert "in a window of 1 mm² round each point of the target" in text
    assert f"{field.dents_in_median_window:.3g}" in text
    assert "In windows of 4 mm², twice as wide" in text
    wide = field.double_gauge["mean_coverage"]
    assert (
        with_interval(100 * wide.value, 100 * wide.half_width).replace(" ± ", "\u00a0±\u00a0")
        in text
    )


def test_pilot_estimates_of_each_effect_are_shown(simulation: Path, tmp_path: Path) -> None:
    sentence = "drag is on: needed (0.1 of the speed is lost on the way up; pilot: ...)"
    changes = {"mean normal speed": {"value": -0.042, "half_width": 0.004}}
    advice = {
        "effect": "drag",
        "on": True,
        "verdict": "matters",
        "said": sentence,
        "changes": changes,
    }
    folder = changed(simulation, tmp_path / "auto", lambda data: data.update(effects=[advice]))
    page = Page(write_report(folder)[0])
    assert "chosen by a short pilot run" in page.text
    assert "−4.2\u00a0±\u00a00.4 %" in page.text
    assert sentence in page.text


def test_a_part_too_large_for_a_page_is_reduced_with_a_remark(simulation: Path) -> None:
    result = load_result(simulation)
    target = int((load_result_arrays(result).field["target"] > 0).sum())
    less = part_scene(result, "", max_triangles=target)
    assert any("only its target is drawn" in remark for remark in less.remarks)
    assert "rest" not in less.data["surfaces"]
    none = part_scene(result, "", max_triangles=target - 1)
    assert none.data is None
    assert any("chamberopt inspect shows it" in remark for remark in none.remarks)


def test_arrays_of_another_result_is_refused(study: Path, tmp_path: Path) -> None:
    mixed = tmp_path / "mixed"
    shutil.copytree(study, mixed)
    shutil.copy(study / "start" / "arrays.npz", mixed)
    with pytest.raises(InputError, match=r"arrays\.npz: not the file that was written"):
        write_report(mixed)


def test_parts_side_by_side(simulation: Path, study: Path, tmp_path: Path) -> None:
    remarks = write_part_page([study / "start", study], tmp_path / "parts.html")
    page = Page(tmp_path / "parts.html")
    assert [scene["title"] for scene in page.parts()["scenes"]] == [
        "study/start",
        f"{study.parent.name}/study",
    ]
    assert all(remark in page.text for remark in remarks)


def test_only_an_older_report_is_replaced(simulation: Path, tmp_path: Path) -> None:
    path, _ = write_report(simulation, tmp_path / "page.html")
    write_report(simulation, path)
    precious = tmp_path / "precious.html"
    precious.write_text("<p>keep me</p>")
    with pytest.raises(InputError, match=r"precious\.html: this file exists and is no report"):
        write_report(simulation, precious)
    assert precious.read_text() == "<p>keep me</p>"
    with pytest.raises(InputError, match=r"one \.html file"):
        write_report(simulation, tmp_path / "page.pdf")
    with pytest.raises(InputError, match="does not exist; make it first"):
        write_report(simulation, tmp_path / "gone" / "page.html")


def test_the_command(study: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = tmp_path / "study"
    shutil.copytree(study, folder)
    assert main(["report", str(folder)]) == 0
    out = capsys.readouterr().out
    assert f"report in {folder / 'report.html'}" in out
    assert report(load_result(folder)).answer in out
    assert load_result(folder).record == load_result(study).record
    assert main(["report", str(folder), "--json", "--out", str(tmp_path / "r.html")]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["report"] == str(tmp_path / "r.html")
    assert found["answer"] == report(load_result(folder)).answer
    assert [one["title"] for one in found["sections"]] == [
        one.title for one in report(load_result(folder)).sections
    ]
    assert main(["report", str(tmp_path)]) == 2
    assert "not a results folder" in capsys.readouterr().err
