"""The page in a real browser without a display: it draws, reacts, and fetches nothing."""

import io
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from chamberopt.chamber.build import build_chamber
from chamberopt.printers.report_page import write_part_page, write_report
from chamberopt.workflows.save_run import save_simulation
from tests.helpers.results.browser import WAIT, chromium, expect, needs_chromium
from tests.helpers.results.report_folders import DESIGN, studied_once
from tests.helpers.synthetic import poisson_evaluation

pytestmark = needs_chromium
DRAWN = "body[data-drawn=yes]"


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return studied_once(tmp_path_factory)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as browser:
        yield browser


class OpenPage:
    """An open page, with its errors and requests."""

    def __init__(self, browser: Any, path: Path, width: int = 1280) -> None:
        self.errors: list[str] = []
        self.requests: list[str] = []
        self.page = browser.new_page(viewport={"width": width, "height": 800})
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on(
            "console",
            lambda message: self.errors.append(message.text) if message.type == "error" else None,
        )
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(path.as_uri())
        self.page.wait_for_selector(DRAWN, timeout=WAIT)

    def pixels(self, place: str = "#part-0") -> np.ndarray:
        """What is on the screen there, (rows, columns, 3) in 0..1."""
        self.page.wait_for_timeout(600)  # drawn in the next frame
        return imread(io.BytesIO(self.page.locator(place).first.screenshot()), format="png")[
            ..., :3
        ]


@pytest.fixture(scope="module")
def shown(browser: Any, study: Path, tmp_path_factory: pytest.TempPathFactory) -> OpenPage:
    path, _ = write_report(study, tmp_path_factory.mktemp("page") / "report.html")
    return OpenPage(browser, path)


def coloured(pixels: np.ndarray) -> float:
    """Share of pixels with a strong colour; only the part's map and its colour bar have any."""
    return float((np.ptp(pixels, axis=2) > 0.25).mean())


def test_the_page_is_drawn_and_fetches_nothing(shown: OpenPage, tmp_path: Path) -> None:
    shown.page.screenshot(path=tmp_path / "report.png", full_page=True)
    assert (tmp_path / "report.png").stat().st_size > 50_000
    assert shown.errors == []
    assert all(url.startswith(("file:", "data:", "blob:")) for url in shown.requests)
    assert len([url for url in shown.requests if url.startswith("file:")]) == 1
    assert coloured(shown.pixels()) > 0.02
    for name in ("convergence", "slices", "histogram", "against-time"):
        assert shown.page.locator(f"#{name} svg text").count() > 5
    assert shown.page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_the_contents_lead_to_every_section(shown: OpenPage) -> None:
    titles = shown.page.locator("section > h2").all_text_contents()
    assert shown.page.locator(".contents a").all_text_contents() == titles
    shown.page.locator(".contents a").last.click()
    last = shown.page.locator("section").last
    assert last.get_attribute("id") == shown.page.evaluate("location.hash.slice(1)")
    shown.page.evaluate("scrollTo(0, 0)")


def test_another_quantity_has_its_own_bar(shown: OpenPage) -> None:
    bar = shown.page.locator("#part-0 .bar")
    assert "coverage [%]" in bar.text_content()
    before = shown.pixels()
    shown.page.select_option("#quantity", label="impacts per area")
    expect(bar).to_contain_text("1/mm²")
    assert "coverage [%]" not in bar.text_content()
    assert not shown.page.locator("#times").is_visible()
    assert np.abs(shown.pixels() - before).max() > 0.2
    shown.page.select_option("#quantity", label="coverage")
    expect(bar).to_contain_text("coverage [%]")


def test_the_slider_shows_coverage_at_other_times(shown: OpenPage) -> None:
    before = shown.pixels()
    slider, ticks = shown.page.locator("#time"), shown.page.locator("#part-0 .bar em")
    data = json.loads(shown.page.locator("#parts").text_content())
    ends = data["scenes"][0]["limits"]  # those of the picture beside the page
    told = ticks.all_text_contents()[::4]
    assert [float(one.lstrip("≤≥ ")) for one in told] == ends[::-1]
    marked = shown.page.locator("#part-0 .bar i").get_attribute("class").split()
    assert [("≥" in told[0]), ("≤" in told[1])] == [name in marked for name in ("above", "below")]
    slider.focus()
    slider.press("Home")
    expect(ticks.last).to_have_text("0")
    expect(ticks.first).to_have_text("100")
    begun = "0 s: the target is covered to 0.0 %"
    expect(shown.page.locator("#at")).to_contain_text(begun)
    after = shown.pixels()
    assert np.abs(after - before).max() > 0.2
    slider.press("End")
    expect(shown.page.locator("#at")).not_to_contain_text(begun)
    assert np.abs(shown.pixels() - after).max() > 0.2


def told_at_the_target(shown: OpenPage) -> str:
    """What is said of a place of the target, at which the pointer then is."""
    shown.page.evaluate("document.getElementById('part-0').scrollIntoView({block: 'center'})")
    box = shown.page.locator("#part-0").bounding_box()
    label = shown.page.locator("#label")
    for across in np.linspace(0.35, 0.6, 6):
        for down in np.linspace(0.3, 0.6, 4):
            shown.page.mouse.move(box["x"] + across * box["width"], box["y"] + down * box["height"])
            shown.page.wait_for_timeout(150)
            if label.is_visible():
                return str(label.inner_text())
    pytest.fail("no triangle of the target answered to the pointer")


def test_pointing_at_the_target_shows_its_numbers_and_the_triangles(shown: OpenPage) -> None:
    told = told_at_the_target(shown)
    assert len(told.splitlines()) < 8
    assert "surface" not in told  # the file has no names
    for unit in ("%", "1/mm²", "m/s", "time to 98 % there"):
        assert unit in told
    shown.page.mouse.down()  # a click keeps all
    shown.page.mouse.up()
    assert shown.page.locator("#places tbody tr").count() == 1
    assert shown.page.locator("#places").is_visible()
    head = shown.page.locator("#places th:visible")
    first = [
        "mark",
        "coverage after",
        "width of coverage's 95 %",
        "mean normal",
        "impacts per area",
    ]
    for told, name in zip(head.all_inner_texts(), first, strict=False):
        assert told.startswith(name)
    kept = shown.page.locator("#places").inner_text()
    assert "90° is head on" in kept
    assert "element" not in kept
    shown.page.click("#places >> text=more numbers")
    kept = shown.page.locator("#places").inner_text()
    assert "place x, y, z" in kept
    assert "simulated impacts on the triangle" in kept
    assert "element" in kept
    shown.page.click("#places >> text=the first numbers alone")


@pytest.mark.long
def test_a_saturated_target_begins_with_what_tells_places_apart(
    browser: Any, tmp_path: Path
) -> None:
    chamber = build_chamber(DESIGN)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
        save_simulation(tmp_path / "all", DESIGN, chamber, poisson_evaluation(DESIGN, chamber, 1e3))
    opened = OpenPage(browser, write_report(tmp_path / "all")[0])
    assert opened.page.input_value("#quantity") == "time to 98 % there"
    expect(opened.page.locator("#part-0 .bar")).to_contain_text("[s]")
    assert opened.page.locator("#histogram").count() == 0
    assert "one bar of a histogram" in opened.page.content()
    assert opened.errors == []


def test_pointing_names_the_surface(browser: Any, tmp_path: Path) -> None:
    chamber = build_chamber(DESIGN)
    numbers = np.where(chamber.part.target, 1, -1).astype(np.int32)
    part = replace(chamber.part, names=("body", "FLANK"), surface=numbers)
    evaluation = poisson_evaluation(DESIGN, chamber, 60.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)
        save_simulation(tmp_path / "named", DESIGN, replace(chamber, part=part), evaluation)
    write_part_page([tmp_path / "named"], tmp_path / "part.html")
    assert "surface\tFLANK" in told_at_the_target(OpenPage(browser, tmp_path / "part.html"))


def test_a_section_shows_the_inside_of_the_part(shown: OpenPage) -> None:
    shown.page.mouse.move(1, 1)  # away from the target, whose numbers would lie over it
    before = shown.pixels()
    shown.page.click(".tools >> text=Section")
    cut = shown.pixels()
    assert np.abs(cut - before).max() > 0.2
    assert "chamber wall" in shown.page.locator("#kinds").inner_text()
    shown.page.click(".tools >> text=Section")
    # The first row is half the page's, as it scrolls by parts of a pixel.
    assert np.abs(shown.pixels() - before)[1:].max() < 0.02


def test_the_chamber_can_be_hidden_and_folded_text_opens(shown: OpenPage) -> None:
    before = shown.pixels()
    chamber, wall = (
        shown.page.get_by_label("show the chamber"),
        shown.page.locator("#kinds [data-kind=wall]"),
    )
    chamber.uncheck()
    assert np.abs(shown.pixels() - before).max() > 0.05
    expect(wall).to_have_attribute("aria-pressed", "false")
    wall.click()  # the legend and the switch are one
    expect(chamber).to_be_checked()
    fold = shown.page.locator("details", has_text="best.toml").last
    assert not fold.locator("pre").is_visible()
    fold.locator("summary").click()
    assert "[sonotrode]" in fold.locator("pre").inner_text()


def test_a_narrow_window_needs_no_scrolling_sideways(
    browser: Any, study: Path, tmp_path: Path
) -> None:
    """Two parts, side by side where there is room, turn together."""
    write_part_page([study / "start", study], tmp_path / "parts.html")
    narrow = OpenPage(browser, tmp_path / "parts.html", 800)
    assert narrow.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    first, second = (narrow.pixels(f"#part-{i}") for i in range(2))
    narrow.page.locator("#part-0").hover(position={"x": 200, "y": 200})
    narrow.page.mouse.down()
    narrow.page.locator("#part-0").hover(position={"x": 300, "y": 150})
    narrow.page.mouse.up()
    assert np.abs(narrow.pixels("#part-0") - first).max() > 0.2
    assert np.abs(narrow.pixels("#part-1") - second).max() > 0.2
    assert narrow.errors == []


def test_a_notebook_shows_the_same_view_in_a_frame(
    browser: Any, study: Path, tmp_path: Path
) -> None:
    """Jupyter inserts what `_repr_html_` returns into its own page."""
    from chamberopt.api import load_result, view

    cell = tmp_path / "cell.html"
    frame = view(load_result(study / "start"), load_result(study))._repr_html_()
    cell.write_text(f"<body><div>{frame}</div></body>", encoding="utf-8")
    errors, requests = [], []
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    page.goto(cell.as_uri())
    inside = page.frame_locator("iframe")
    expect(inside.locator(DRAWN)).to_be_visible(timeout=WAIT)
    expect(inside.locator(".part canvas")).to_have_count(2)
    picture = imread(io.BytesIO(page.locator("iframe").screenshot()), format="png")[..., :3]
    assert len(np.unique(np.round(picture.reshape(-1, 3), 1), axis=0)) > 20
    assert [one for one in requests if not one.startswith(("file:", "about:"))] == []
    assert errors == []
    page.close()


# Layers of the marks at x = 0 and x = 10 mm of a surface, of which a section leaves x < 5 mm.
MARKS = """() => {
    const place = document.createElement("div");
    place.style.cssText = "width: 100px; height: 100px";
    document.body.append(place);
    const view = new View3D(place), points = new Float32Array([0, 0, 0, 10, 0, 0, 0, 10, 0]);
    view.surface("part", { points, triangles: new Uint32Array([0, 1, 2]), open: true });
    view.look({ middle: [5, 0, 0], eye: [5, 0, 60], size: 20 });
    const marks = view.texts("kept", [["1", [0, 0, 0]], ["2", [10, 0, 0]]]);
    marks.userData.on = "part";
    const seen = () => { view.image(); return marks.children.map((one) => one.layers.mask); };
    const before = seen();
    view.section.cut([-1, 0, 0], -5);
    const found = [before, seen()];
    view.dispose();
    place.remove();
    return found;
}"""


def test_the_mark_of_a_place_is_cut_away_with_the_part(shown: OpenPage) -> None:
    before, cut = shown.page.evaluate(MARKS)
    assert before == [1, 1]  # the camera sees the layer 0
    assert cut == [1, 2]
