"""A study is followed in a real browser: new candidates appear, and each one's chamber is shown."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.chamberopt.page.browser_page import Page
from tests.chamberopt.page.conftest import Served
from tests.helpers.results.browser import WAIT, chromium, expect, needs_chromium
from tests.helpers.results.followed_study import followed_study

pytestmark = needs_chromium
HEIGHT = "chamber.height_mm"
# Where the highest point of the walls is on the screen.
TOP = """async () => {
    const { view } = await import("/browser/scene.js"), mesh = view.get("walls");
    const at = mesh.geometry.getAttribute("position"), tops = [];
    for (let k = 0; k < at.count; k++)
      tops.push(view.onScreen(new THREE.Vector3().fromBufferAttribute(at, k))[1]);
    return Math.min(...tops);
}"""
FIRST = 4  # candidates that are there when the page is opened


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return followed_study(tmp_path_factory.mktemp("followed"))


@pytest.fixture(scope="module")
def opened(out: Path) -> Iterator[Page]:
    study = out.parents[1] / "study.toml"
    asked = study.read_text()
    served = Served(out.parents[1], "design.toml")
    study.write_text(asked)  # the page's own folder begins with another study
    with chromium() as browser:
        yield Page(browser, served)
    served.process.kill()
    served.process.communicate()


def test_a_study_is_followed_and_a_candidate_taken(opened: Page, out: Path) -> None:
    page, log = opened.page, out / "history.jsonl"
    rows = log.read_text().splitlines(keepends=True)
    log.write_text("".join(rows[:FIRST]))
    # the form of the search has the study's limits, and goes on with what was searched
    opened.tab("run")
    page.select_option("#of", "study.toml")
    expect(page.locator("#go-on")).to_contain_text("new chambers after results/study.")
    limits = page.locator("#limits li")
    expect(limits).to_have_count(1)
    page.click("#add-limit")
    expect(limits).to_have_count(2)
    page.click("#search-sliders")
    expect(page.locator("#search-fault")).to_contain_text("mean coverage of the target")
    limits.last.locator("button").click()
    expect(limits).to_have_count(1)

    opened.tab("results")
    page.click("text=see its candidates")
    opened.wait(f"data-followed='{FIRST}'")
    expect(page.locator("#study-of")).to_contain_text("too few to tell")
    assert page.locator("#study-of .curve").count() == 0
    with log.open("a") as file:  # as the study goes on
        file.writelines(rows[FIRST:])
    opened.wait(f"data-followed='{len(rows)}'")
    assert "refused by geometry before any simulation" in page.locator("#tried").text_content()
    order = page.locator("#study-of figure").first
    assert order.locator(".candidate").count() == len(rows)
    assert page.locator("#study-of .curve").count() > 0
    assert page.locator("#study-of .band").count() == page.locator("#study-of .curve").count()
    assert "[mm]" in page.locator("#study-of .slices").text_content()
    assert "height_mm" not in page.locator("#study-view").text_content()

    # a row for each, in which a confirmation has the number of its candidate
    listed = page.locator("#study-of .rows tbody tr")
    assert listed.count() == len(rows)
    named = listed.locator("td:first-child").all_text_contents()
    again = [one for one in named if one.endswith(" again")]
    assert len(again) == 2
    assert all(named[named.index(one) - 1] == one.split()[0] for one in again)
    assert "a gap of 2.1 mm, in which balls jam" in " ".join(listed.all_text_contents())
    best = page.locator("#study-of .rows tr.best")
    expect(best).to_have_count(1)
    expect(best).to_contain_text("the best so far")
    expect(order.locator(".marks")).to_contain_text("the best so far")
    repeated = next(k for k, one in enumerate(named) if one.endswith(" again"))
    listed.nth(repeated).click()
    expect(page.locator("#unsaved")).to_have_text(f"candidate {named[repeated]} is shown")
    listed.nth(0).click()
    opened.wait("data-candidate='1'")
    order.locator(".candidate[data-number='2'] .target").click()
    opened.wait("data-candidate='2'")
    card = page.locator("#chosen-candidate")
    expect(card).to_contain_text("Chamber height [mm]")
    expect(card).to_contain_text("±")
    opened.wait("data-checked=reach")
    height = float(card.locator("td").first.text_content())
    assert height != 30
    # its chamber is shown, and the design stays as it is until the numbers are taken
    assert any(" can touch " in fact for fact in opened.facts())
    expect(page.locator("#unsaved")).to_have_text("candidate 2 is shown")
    shown = page.evaluate(
        """async () => {
        const { view } = await import("/browser/scene.js");
        const at = view.get("walls").geometry.getAttribute("position");
        return Math.max(...Array.from({ length: at.count }, (_, k) => at.getZ(k)));
    }"""
    )
    assert shown == pytest.approx(height, abs=1e-3)
    assert float(page.locator('[id="chamber.height_mm"]').input_value()) == 30
    tallest = max(range(len(rows)), key=lambda k: json.loads(rows[k])["parameters"][HEIGHT])
    listed.nth(named.index(str(tallest + 1))).click()
    opened.wait(f"data-candidate='{tallest + 1}'")
    opened.wait("data-checked=reach")
    over = page.locator("#tools > .tools").bounding_box()
    assert page.evaluate(TOP) > over["y"] + over["height"]  # it is seen as a whole
    order.locator(".candidate[data-number='2'] .target").click()
    opened.wait("data-candidate='2'")
    page.click("#take")
    expect(page.locator("#unsaved")).to_have_text("not saved yet")
    assert float(page.locator('[id="chamber.height_mm"]').input_value()) == height
    assert opened.saved().chamber.height_mm == height
    beside_study = page.locator("#view").bounding_box()
    page.click("#close-study")
    expect(page.locator("#study-view")).to_be_hidden(timeout=WAIT)
    alone = page.locator("#view").bounding_box()
    assert beside_study["width"] > 0.85 * alone["width"]  # the view keeps its room
    assert beside_study["height"] == alone["height"]
    page.click("text=see its candidates")
    opened.tab("numbers")  # which is in the place of the study
    expect(page.locator("#study-view")).to_be_hidden()
    assert opened.errors == []


def test_a_study_that_runs_is_seen_in_the_tab_run_after_a_reload(opened: Page) -> None:
    page = opened.page
    status = {"command": "chamberopt run study.toml", "result": "results/study", "kept": False}
    status |= {"steps": [], "held": None, "seconds": 3, "printed": [], "exit": None}
    page.route("**/status", lambda route: route.fulfill(json=status))
    page.reload()
    opened.wait("data-ready=yes")
    expect(page.locator("#study-view")).to_be_visible()
    expect(page.locator("nav [aria-selected=true]")).to_have_text("Run")
    status["exit"] = 130
    opened.wait("data-ended='130'")
    page.unroute("**/status")
