"""The front page in a real browser: from a part's file to an open design, without a terminal."""

import re
from pathlib import Path

import pytest
import trimesh

from tests.chamberopt.page.browser_page import Page
from tests.chamberopt.page.conftest import Served
from tests.helpers.results.browser import chromium, expect, needs_chromium

pytestmark = needs_chromium
# Where the corner at x = 1 of a marked surface is drawn after the surface was turned and moved.
MARKED_BEFORE_POSED = """() => {
    const place = document.createElement("div");
    place.style.cssText = "width: 100px; height: 100px";
    document.body.append(place);
    const view = new View3D(place), points = new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]);
    view.surface("part", { points, triangles: new Uint32Array([0, 1, 2]), kind: "rest" });
    view.highlight("part", [0], "#00ff00");
    view.pose("part", [0, 1, 0, -1, 0, 0, 0, 0, 1], [0, 0, 5]);
    const drawn = view.get("highlight");
    drawn.updateWorldMatrix(true, false);
    const at = new THREE.Vector3(1, 0, 0).applyMatrix4(drawn.matrixWorld).toArray();
    view.dispose();
    place.remove();
    return at;
}"""


IS_LOADED = "document.querySelector('#picture img').naturalWidth > 0"


def test_a_part_dropped_on_the_front_page_becomes_an_open_design(tmp_path: Path) -> None:
    served = Served(tmp_path)
    dropped = tmp_path / "elsewhere" / "my part.stl"
    dropped.parent.mkdir()
    dropped.write_bytes((tmp_path / "box.stl").read_bytes())
    try:
        with chromium() as browser:
            opened = Page(browser, served)
            page = opened.page
            assert page.locator("#alloys option[label=titanium][value='Ti-6Al-4V']").count() == 1
            page.set_input_files("#file", dropped)
            opened.wait("data-known=sizes")  # an STL states no unit
            assert page.locator("#propose").is_disabled()
            opened.wait("data-drawn='my part.stl'")  # before its unit is known
            page.click("#sizes button >> text=in inches)")
            expect(page.locator("#known")).to_contain_text("measures 406.4 x 406.4 x 406.4 mm")
            page.click("#sizes button >> text=in mm)")  # it can be chosen anew
            expect(page.locator("#sizes [aria-pressed=true]")).to_contain_text("in mm)")
            opened.wait("data-known=all")
            expect(page.locator("#known")).to_contain_text("my part.stl measures 16 x 16 x 16 mm")
            opened.wait("data-choosable='my part.stl'")
            page.locator("#view").click()  # a face of the part, before anything is proposed
            picked = page.locator("#names input:checked")
            expect(picked).to_have_value(re.compile(r"face 1\.[1-6]"))
            expect(picked.locator("..")).to_have_text(re.compile(r"face 1\.[1-6]: 256 mm²"))
            expect(page.locator("#under")).to_contain_text("256 mm²: a click leaves it out")
            expect(page.locator("#view")).to_have_attribute("data-highlight", "2")  # triangles
            page.check("#names input[value='face 1']")
            expect(page.locator("#view")).to_have_attribute("data-highlight", "14")
            page.uncheck("#names input[value='face 1']")
            page.locator("#view").click()
            expect(picked).to_have_count(0)
            box = page.locator("#propose").bounding_box()
            assert box["y"] + box["height"] < 800  # all that is needed is on the first screen
            page.click("#more summary")
            page.uncheck("#pilot")
            page.fill("#coverage", "50")
            page.click("#propose")
            wrong = page.locator("#coverage + .wrong")
            expect(wrong).to_have_text("given 50; allowed: from 100 to 1000 %")
            assert page.locator("#made").is_hidden()
            page.fill("#coverage", "200")
            page.fill("#material", "Ti-6Al-4W")
            page.click("#propose")
            wrong = page.locator("#material + .wrong")
            expect(wrong).to_contain_text("did you mean 'Ti-6Al-4V'")
            page.fill("#material", "Ti-6Al-4V")
            expect(wrong).to_have_count(0)  # as soon as it is corrected
            assert page.locator("#material").get_attribute("aria-invalid") is None
            page.fill("#ball-mm", "1,2")
            page.click("#propose")
            opened.wait('data-ended="0"')
            expect(page.locator("#sentence")).to_contain_text("Peen face 1 (")
            page.wait_for_function(IS_LOADED)
            opened.wait("data-chamber=proposal")  # it is seen in 3D too
            sentence, drawn = (page.locator(one).bounding_box() for one in ("#sentence", "#view"))
            assert sentence["y"] + sentence["height"] <= drawn["y"]  # what is proposed comes first
            kinds = {"target", "sonotrode", "chamber wall"}
            expect(page.locator("#legend")).to_contain_text("chamber wall")  # at the next frame
            assert set(page.locator("#legend li").all_text_contents()) >= kinds
            page.click("#rows-fold summary")
            shown = page.locator("#rows tr:has(th:text-is('Balls'))")
            expect(shown).to_contain_text("1.2 mm")
            page.click("#another summary")
            expect(page.locator("#choices button[aria-pressed=true]")).to_contain_text("face 1")
            side = page.locator("#choices button", has_text="face 1").first
            before = page.locator("#view").screenshot()
            side.hover()
            expect(page.locator("#view")).to_have_attribute("data-highlight", "12")  # triangles
            assert page.locator("#view").screenshot() != before
            page.mouse.move(0, 0)
            expect(page.locator("#view")).not_to_have_attribute("data-highlight", "12")
            assert page.evaluate(MARKED_BEFORE_POSED) == [0, -1, 5]
            page.reload()
            opened.wait("data-chamber=proposal")  # round the part, in the unit that was chosen
            expect(page.locator("#sentence")).to_contain_text("my part.stl")
            assert page.locator("#part").input_value() == "my part.stl"
            page.click("#open-made")
            opened.wait("data-checked=reach")
            label = page.locator('label[for="chamber.height_mm"]')
            expect(label).to_contain_text("Height")
            expect(label).to_contain_text("sonotrode to ceiling")  # the reason of its number
            opened.put("chamber.height_mm", 77)
            proposed = page.locator('label[for="chamber.height_mm"] .past')
            expect(proposed).to_contain_text("sonotrode to ceiling")  # which is of another number
            expect(label).to_contain_text("changed by you; proposed was ")
            page.click("#undo")
            expect(proposed).to_have_count(0)
            assert page.locator('[id="process.coverage_percent"]').input_value() == "200"
            page.click("#front")
            expect(page.locator("#designs")).to_contain_text("my part/design.toml")
            assert not opened.errors
            assert all(one.startswith(f"http://{served.host}/") for one in opened.requests)
    finally:
        served.process.kill()
        served.process.communicate()


@pytest.mark.long
def test_a_proposal_takes_the_place_of_what_was_seen_of_the_part(tmp_path: Path) -> None:
    """The ticked name is lit no more, and a distance is not measured from a place on the part."""
    body = trimesh.creation.box((30.0, 20.0, 10.0))
    lines = [f"v {x} {y} {z}" for x, y, z in body.vertices]
    looks_down = body.face_normals[:, 2] < -0.5
    for name, own in (("REST", ~looks_down), ("FACE", looks_down)):
        rows = body.faces[own] + 1
        lines += [f"g {name}", *(f"f {a} {b} {c}" for a, b, c in rows)]
    (tmp_path / "block.obj").write_text("\n".join(lines) + "\n")
    served = Served(tmp_path, "block.obj")
    try:
        with chromium() as browser:
            opened = Page(browser, served)
            page = opened.page
            opened.wait("data-drawn='block.obj'")
            page.click("#sizes button >> text=in mm)")
            opened.wait("data-known=all")
            page.check("#names input[value=FACE]")
            view = page.locator("#view")
            expect(view).to_have_attribute("data-highlight", re.compile(r"\d+"))
            page.click(".tools >> text=Measure")
            view.click()
            told = page.locator(".tools output")
            expect(told).to_contain_text("click the other point")
            page.click("#more summary")
            page.uncheck("#pilot")
            for wish, text in (("#intensity", "banana"), ("#ball-mm", "-3")):
                page.fill(wish, text)
            page.click("#propose")
            for wish in ("#intensity", "#ball-mm"):  # both at once
                expect(page.locator(f"{wish} + .wrong")).to_contain_text("given ")
                page.fill(wish, "")
            expect(page.locator(".wrong")).to_have_count(0)
            page.click("#propose")
            opened.wait('data-ended="0"')
            opened.wait("data-chamber=proposal")
            expect(view).not_to_have_attribute("data-highlight", re.compile(r"\d+"))
            expect(told).to_contain_text("click two points")
            page.reload()
            opened.wait("data-chamber=proposal")
            expect(page.locator("#names input[value=FACE]")).to_be_checked()
            assert not opened.errors
    finally:
        served.process.kill()
        served.process.communicate()


def test_a_tab_without_the_token_says_what_to_do(tmp_path: Path) -> None:
    served = Served(tmp_path, "design.toml")
    try:
        with chromium() as browser:
            opened = Page(browser, served)
            other = opened.page.context.new_page()
            other.goto(served.origin)  # has the cookie, but no key
            expect(other.locator("body")).to_contain_text("This tab cannot use the program")
            expect(other.locator("body")).to_contain_text("open the whole address")
            assert other.locator("#busy, #view, .wrong").count() == 0
    finally:
        served.process.kill()
        served.process.communicate()
