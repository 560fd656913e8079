"""What notebooks show of a design, a study and a result: all of it, and nothing that files smuggle.

Names of files may hold markup. Pictures are not drawn here, but their bytes must arrive.
"""

import base64
import html
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import pytest

import chamberopt.api
from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.common.notebook import html_of
from chamberopt.documents.wording import metric_label
from chamberopt.printers import notebook
from chamberopt.results.compare.comparison import compare
from chamberopt.search.run_sweep import SweepResult, plan_sweep
from chamberopt.search.study import Study
from chamberopt.search.trial_log import Trial
from chamberopt.workflows.save_run import save_simulation
from tests.helpers.opengl import needs_opengl
from tests.helpers.synthetic import DESIGNS, plate_design, poisson_evaluation

HOSTILE = "<script>alert(1)<b onload='x'>&"
DRAWN = notebook.PNG + b"drawn"


class Tags(HTMLParser):
    """The elements of a text that holds only closed ones, and where pictures come from."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.names, self.sources, self.open, self.words = set(), [], [], ""
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.names.add(tag)
        assert all(not name.startswith("on") for name, _ in attributes)
        self.sources += [str(value) for name, value in attributes if name in ("src", "href")]
        if tag != "img":
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += f" {data}"


def shown(value: object) -> Tags:
    """What a notebook shows, which must hold no script and fetch nothing."""
    found = Tags(value._repr_html_())  # type: ignore[attr-defined]
    assert not {"script", "b", "iframe", "link", "style"} & found.names
    assert all(one.startswith("data:image/png;base64,") for one in found.sources)
    return found


@pytest.fixture
def hostile(tmp_path: Path) -> Path:
    """The plate's file, under a name that a browser would run."""
    mesh = tmp_path / f"{HOSTILE}.stl"
    if sys.platform == "win32":
        mesh = tmp_path / "'&.stl"
    shutil.copyfile(DESIGNS / "parts" / "plate.stl", mesh)
    return mesh


@pytest.fixture
def pictures(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """The titles of the pictures that were asked for, in the place of drawing them."""
    titles: list[str] = []

    def draw(_: object, title: object, file: Path, *__: object, **___: object) -> None:
        titles.append(str(title))
        file.write_bytes(DRAWN)

    monkeypatch.setattr(notebook, "draw_part", draw)
    monkeypatch.setattr(notebook, "draw_coverage", draw)
    monkeypatch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: "no picture")
    return titles


def test_a_design_with_its_numbers_and_its_picture(hostile: Path, pictures: list[str]) -> None:
    design = plate_design(shot__mass_g=6.0).changed({"part.mesh": hostile})
    found = shown(design)
    assert pictures == [hostile.name]
    (source,) = found.sources
    assert base64.b64decode(source.partition(",")[2]) == DRAWN
    assert f"Design: {hostile.stem}" in found.words
    assert f"{design.shot.count:,} balls, 6 g together" in found.words
    assert f"{design.process.treatment_time:g} s" in found.words
    assert "zero-to-peak" in found.words


def test_a_design_that_cannot_be_built_says_why(pictures: list[str]) -> None:
    found = shown(plate_design().changed({"part.mesh": f"{HOSTILE}nowhere.stl"}))
    assert "The chamber cannot be built:" in found.words
    assert "no such mesh file" in found.words
    assert not found.sources
    assert not pictures


def test_where_nothing_can_be_drawn_a_line_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(notebook, "draw_part", lambda *_, **__: "part.png skipped: <no> OpenGL")
    found = shown(plate_design())
    assert "part.png skipped: <no> OpenGL" in found.words
    assert not found.sources


def test_a_study_says_what_varies(hostile: Path, pictures: list[str]) -> None:
    study = Study(
        design=plate_design(shot__mass_g=4.0).changed({"part.mesh": hostile}),
        vary={"shot.mass_g": (3.0, 6.5)},
        constraints={"mean_coverage": {"min": 0.9}},
    )
    found = shown(study)
    assert re.search(r"Shot mass \[g\]\s+3 to 6\.5\s+4", found.words)
    assert "mean coverage of the target ≥ 90 %" in found.words
    assert len(found.sources) == 1


def saved_result(hostile: Path, tmp_path: Path) -> chamberopt.Result:
    """A result of a part with a hostile name, in a folder with one."""
    folder = tmp_path / (HOSTILE.replace("/", "") if sys.platform != "win32" else "a result")
    design = plate_design().changed({"part.mesh": hostile})
    chamber = build_chamber(design)
    save_simulation(folder, design, chamber, poisson_evaluation(design, chamber))
    return chamberopt.load_result(folder)


def test_a_result_gives_its_figures_with_intervals(
    hostile: Path, tmp_path: Path, pictures: list[str]
) -> None:
    result = saved_result(hostile, tmp_path)
    folder = result.folder
    found = shown(result)
    assert f"Result: {folder.name}" in found.words
    mean = metric_label("mean_coverage").number(result.metrics["mean_coverage"])
    assert "±" in mean
    assert mean in found.words.replace("\u00a0", " ")
    assert all(note[:40] in found.words for note in result.notes)
    assert len(pictures) == 1  # it is drawn where the folder has none
    (folder / "coverage.png").write_bytes(DRAWN + b" before")
    (source,) = shown(result).sources
    assert base64.b64decode(source.partition(",")[2]) == DRAWN + b" before"
    (folder / "coverage.png").write_text("<script>", encoding="utf-8")
    assert shown(result).sources
    assert len(pictures) == 2


def test_the_view_in_3d_is_kept_in_its_frame(
    hostile: Path, tmp_path: Path, pictures: list[str]
) -> None:
    frame = chamberopt.view(saved_result(hostile, tmp_path))._repr_html_()
    found = Tags(frame)
    assert found.names == {"iframe"}
    assert 'sandbox="allow-scripts" ' in frame  # not allow-same-origin
    page = html.unescape(frame.partition('srcdoc="')[2].rpartition('"')[0])
    assert page.startswith("<!DOCTYPE html>")
    assert "default-src 'none'" in page
    assert "<script>alert(1)" not in page
    assert "&lt;script&gt;alert(1)" in page
    with pytest.raises(InputError, match="view: given no result"):
        chamberopt.view()


def test_objects_nobody_told_of_are_shown_as_text() -> None:
    """A lower package alone knows no pictures: its objects have their text."""
    assert html_of(3.0) is None
    code = (
        "from chamberopt.design.load import load_design as load; import sys; "
        f"print(load({str(DESIGNS / 'plate.toml')!r})._repr_html_(), "
        "'chamberopt.printers' in sys.modules)"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert answer.stdout.split() == ["None", "False"]


def test_a_comparison_and_a_sweep_give_their_best_and_their_figures(
    hostile: Path, tmp_path: Path, pictures: list[str]
) -> None:
    first = saved_result(hostile, tmp_path)
    other = tmp_path / "other"
    shutil.copytree(first.folder, other)
    found = shown(compare([first.folder, other]))
    assert "Comparison with" in found.words
    assert ": the uniform coverage of both is" in found.words
    assert metric_label("mean_coverage").text in found.words
    study = Study(design=plate_design(), vary={"shot.mass_g": (3.0, 6.5)})
    values = {"shot.mass_g": 4.0}, (Estimate(0.4, 0.01),), {"mean_coverage": Estimate(0.5, 0.01)}
    trial = Trial(0, "sweep", (0.5,), *values, 0.0, 0.4, True, "", 4)
    found = shown(SweepResult(study, plan_sweep(study, 2, None), tmp_path, (trial,), 3.0))
    assert "The best of 1 candidates" in found.words.replace("\u00a0", " ")


def test_charts_and_plotters_are_there_to_be_changed(
    hostile: Path, tmp_path: Path, pictures: list[str]
) -> None:
    result = saved_result(hostile, tmp_path)
    (axes,) = chamberopt.chart(result, result).axes
    assert len([line for line in axes.lines if line.get_color() != "none"]) >= 4
    assert axes.get_xlabel() == "peening time [s]"
    for function in (chamberopt.chart, chamberopt.plotter):
        with pytest.raises(InputError, match=f"^{function.__name__}: given no result"):
            function()


@needs_opengl
def test_a_plotter_holds_the_part(hostile: Path, tmp_path: Path, pictures: list[str]) -> None:
    drawn = chamberopt.plotter(saved_result(hostile, tmp_path), quantity="coverage")
    assert drawn.actors
    drawn.screenshot(tmp_path / "drawn.png")
    drawn.close()
    assert (tmp_path / "drawn.png").read_bytes().startswith(notebook.PNG)
