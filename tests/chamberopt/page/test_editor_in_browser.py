"""The editor page in a real browser: numbers, target, pose, runs, results, no foreign request."""

import json
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from chamberopt.chamber.layout.target import surfaces
from chamberopt.chamber.matters import Urgency
from chamberopt.cli import main
from chamberopt.design.load import load_design
from chamberopt.documents.facts import facts_in_words
from chamberopt.geometry.meshes.part_mesh import read_part
from chamberopt.pictures.charts.colours import KINDS
from tests.chamberopt.page.browser_page import FIND, ON_SCREEN, SIDE, Page
from tests.chamberopt.page.conftest import Served
from tests.helpers.eight_parts import KEPT_ASIDE
from tests.helpers.results.browser import WAIT, chromium, expect, needs_chromium

# On a busy machine with two cores the browser is starved beside other tests, and clicks time out.
pytestmark = [needs_chromium, pytest.mark.long]
# Whether walls and part are to be seen, and the way from what is looked at to the eye.
SEEN = """async () => {
  const { view } = await import("/browser/scene.js");
  const way = view.camera.position.clone().sub(view.orbit.target).normalize().toArray();
  return [view.get("walls").visible, view.get("part").visible, way];
}"""
# The first of these triangles that can be seen, and the place of its middle on the screen.
SEEN_OF = """async (triangles) => {
  const { view } = await import("/browser/scene.js"), part = view.get("part");
  const { points, index } = part.userData;
  for (const k of triangles) {
    const at = new THREE.Vector3();
    for (let i = 0; i < 3; i++) at.add(new THREE.Vector3().fromArray(points, 3 * index[3 * k + i]));
    at.divideScalar(3).applyMatrix4(part.matrixWorld);
    const [clientX, clientY] = view.onScreen(at);
    if (view.at({ clientX, clientY }, ["part"])?.triangle === k) return [k, clientX, clientY];
  }
}"""


@pytest.fixture(scope="module")
def opened(served: Served) -> Iterator[Page]:
    with chromium() as browser:
        yield Page(browser, served)


def test_a_number_changes_the_shape_the_facts_and_one_line(opened: Page) -> None:
    opened.wait("data-checked=reach")
    before = (opened.served.folder / "design.toml").read_text()
    opened.put("chamber.height_mm", 36)
    opened.wait("data-checked=reach")
    assert opened.page.locator("#unsaved").text_content() == "not saved yet"
    said = opened.facts()
    opened.saved()
    after = (opened.served.folder / "design.toml").read_text()
    assert [one for one in after.splitlines() if one not in before.splitlines()] == [
        "height_mm = 36"
    ]
    report = opened.served.folder / "checked"
    assert main(["check", str(opened.served.folder / "design.toml"), "--out", str(report)]) == 0
    facts = json.loads((report / "check.json").read_text())
    told = facts_in_words(load_design(opened.served.folder / "design.toml"), facts)
    assert said == [one.text for one in told]


def test_a_change_that_opens_the_ceiling_says_so(opened: Page) -> None:
    """The box of 16 mm, whose top is at 28 mm, goes out through a ceiling at 25 mm."""
    effect = opened.page.locator("#effect")
    opened.wait("data-checked=reach")
    expect(effect).to_be_hidden()
    opened.put("chamber.height_mm", 25)
    told = "With these values the part now goes out through the ceiling, opening "
    expect(effect).to_contain_text(told, timeout=WAIT)
    opened.wait("data-checked=reach")
    opened.page.click("#undo")
    expect(effect).to_be_hidden(timeout=WAIT)
    opened.wait("data-checked=reach")


def test_what_is_drawn_stays_where_no_form_has_changed(opened: Page) -> None:
    page, held, is_held = opened.page, [], True
    drawn = """async () => {
      const { view } = await import("/browser/scene.js");
      return view.get("walls").uuid;
    }"""
    opened.wait("data-checked=reach")
    page.route("**/cavity", lambda route: held.append(route) if is_held else route.continue_())
    for name, value, is_kept in (("shot.mass_g", 4, True), ("chamber.height_mm", 31, False)):
        before, shapes = page.evaluate(drawn), page.evaluate("document.body.dataset.shape")
        opened.put(name, value)
        expect(page.locator("body")).not_to_have_attribute("data-shape", shapes, timeout=WAIT)
        assert (page.evaluate(drawn) == before) == is_kept
        assert page.locator("#said.waiting").count() == 1
    is_held = False
    for route in held:  # before the end of the interception, which would let them go too
        route.continue_()
    page.click("#undo")
    page.click("#undo")
    opened.wait("data-checked=reach")
    page.unroute("**/cavity")


def test_a_slider_has_its_ends_again_after_undo(opened: Page) -> None:
    slider = opened.page.locator("[type=range][aria-label='chamber.height_mm']")
    before = [slider.get_attribute(end) for end in ("min", "max")]
    opened.put("chamber.height_mm", 200)
    assert [slider.get_attribute(end) for end in ("min", "max")] == [before[0], "200"]
    opened.page.click("#undo")
    assert [slider.get_attribute(end) for end in ("min", "max")] == before
    opened.wait("data-checked=reach")


def test_what_was_not_taken_is_said_until_something_else_is(opened: Page) -> None:
    page, name = opened.page, "shot.mass_g"
    row = page.locator(".field", has=page.locator(f'[id="{name}"]'))
    box, wrong = page.locator(f'[id="{name}"]'), row.locator(".wrong")
    before = box.input_value()
    opened.put(name, -3)
    expect(page.locator("#error")).to_contain_text("given -3", timeout=WAIT)
    box.fill("abc")
    box.press("Tab")
    expect(wrong.last).to_have_text("abc is no number: what was there stays.")
    expect(box).to_have_value("-3")  # as the panel says
    page.click("#undo")
    expect(box).to_have_value(before)
    expect(page.locator("#error")).to_be_hidden(timeout=WAIT)
    expect(wrong).to_have_count(0)
    row.hover()
    low = row.locator(".ends input").first
    was = low.input_value()
    low.fill("9999")
    low.press("Tab")
    expect(wrong).to_contain_text("9999 is not less than")
    low.fill(was)
    expect(wrong).to_have_count(0)
    opened.tab("target")
    for crease, words in (("400", "given 400; allowed: from 0.1 to 180°"), ("30", "")):
        page.locator("#crease").evaluate("(one, text) => { one.value = text; }", crease)
        page.locator("#crease").dispatch_event("input")
        expect(page.locator("#crease-fault")).to_have_text(words)
    opened.tab("numbers")
    opened.wait("data-checked=reach")


def test_a_young_run_tells_the_time_that_is_left(opened: Page) -> None:
    """Of 24 replicas 0.2 are done in 8 s, after nothing in 9 s; then half an evaluation in 6 s.

    An evaluation may end before its largest number of replicas, as the first does here: only then
    the pace is known, of which the second has done a half in 10 s.

    The clock is the test's.
    """
    told = """async (looks) => {
      const { bars } = await import("/browser/steps.js"), own = performance.now;
      try {
        return looks.map(([at, steps]) => {
          performance.now = () => 1e3 * at;
          return bars(steps.map((one) => ({ best: null, ...one }))).map((one) => one.textContent);
        });
      } finally { performance.now = own; }
    }"""
    replicas = {"step": "replicas", "total": 24}
    looks = [[at, [replicas | {"done": done}]] for at, done in ((0, 0), (9, 0), (10, 0.1))]
    looks += [[18, [replicas | {"done": 0.3}]], [19, [{"step": "drawing", "done": 0, "total": 0}]]]
    young = {"step": "evaluations", "done": 0, "total": 10}
    looks += [[at, [young, replicas | {"done": done}]] for at, done in ((20, 0), (21, 6), (26, 12))]
    second = young | {"done": 1}
    looks += [[at, [second, replicas | {"done": done}]] for at, done in ((30, 0), (40, 12))]
    assert opened.page.evaluate(told, looks) == [
        ["replicas: 0 of 24"],
        ["replicas: 0 of 24, for 10 s so far"],
        ["replicas: 0 of 24, for 10 s so far"],
        ["replicas: 0 of 24, roughly 16 min left of this step"],
        ["drawing"],
        ["evaluations: 0 of 10", "replicas: 0 of 24"],
        ["evaluations: 0 of 10", "replicas: 6 of 24"],
        ["evaluations: 0 of 10, for 10 s so far", "replicas: 12 of 24"],
        ["evaluations: 1 of 10, for 10 s so far", "replicas: 0 of 24"],
        ["evaluations: 1 of 10, about 3 min left of this step", "replicas: 12 of 24"],
    ]


def test_a_proposal_moves_from_its_start_and_tells_the_time_once_the_part_is_read(
    opened: Page,
) -> None:
    """Three looks in its first stage of seven, which ends after 20 s, and one in the fourth."""
    told = """async (looks) => {
      const { stage } = await import("/browser/steps.js");
      return looks.map(([steps, at, seconds]) => {
        const [head, list] = stage(steps, at, seconds), now = list.querySelector(".now");
        const ended = [...list.querySelectorAll(".done")].map((one) => one.textContent);
        const { value } = head.querySelector("progress");
        return [value, head.textContent.trim(), now.textContent, ended];
      });
    }"""
    names = ["reading", "drawing", "simulating", "trying", "choosing", "further", "writing"]

    def look(number: int, began: dict[int, float], *steps: str) -> list[object]:
        rows = [{"step": one, "done": 0, "total": 0} for one in (names[number - 1], *steps)]
        return [rows, {"number": number, "count": 7, "names": names, "began": began}]

    looks = [
        [*look(1, {1: 1}, "the file"), 2],
        [*look(1, {1: 1}, "faces"), 9],
        [*look(1, {1: 1}, "faces"), 10],
        [*look(4, {1: 1, 2: 20, 4: 24}, "pilot run"), 30],
    ]
    rows = opened.page.evaluate(told, looks)
    values = [one[0] for one in rows]
    assert 0 < values[0] < values[1] == values[2] < 3 < 7 < values[3] < 11
    assert [one[1] for one in rows] == [
        *["how long it takes is told once the part is read"] * 3,
        "50 s to 5 min left, usually",
    ]
    assert [one[2] for one in rows] == [*("reading the file", *["reading faces"] * 2), rows[3][2]]
    assert rows[3][2:] == [
        "trying pilot run",
        ["reading, 20 s", "drawing, 5 s", "simulating, not needed"],
    ]


def test_a_chamber_is_first_seen_open_round_its_whole_part(opened: Page) -> None:
    """Walls and sonotrode are cut through the chamber's middle, and the part is not."""
    opened.wait("data-checked=reach")
    cut = """async () => {
      const { view } = await import("/browser/scene.js"), { section } = view;
      const clipped = (name) => Boolean(view.get(name).material.clippingPlanes);
      return [["walls", "sonotrode", "part"].map(clipped), section.kinds(), section.plane.constant];
    }"""
    clipped, kinds, away = opened.page.evaluate(cut)
    assert clipped == [True, True, False]
    assert sorted(kinds) == ["sonotrode", "wall"]
    assert abs(away) < 0.01
    expect(opened.page.locator(".tools label", has_text="cut the part")).to_be_visible()


def test_a_section_is_filled_in_the_colours_of_the_legend(opened: Page) -> None:
    """The part is a cube of 16 mm in a cylinder of 40 mm, whose wall is 1.7 mm thick there."""
    page, legend = opened.page, opened.page.locator("#legend")
    page.click(".tools >> text=Section")  # the chamber that is open round the whole part
    page.click(".tools >> text=Section")
    page.select_option(".tools select", "x")
    expect(page.locator(".tools input[type=number]")).to_have_value("0")
    page.select_option(".tools select", "z")
    page.fill(".tools input[type=number]", "20")
    kinds = ["not in the target", "target", "sonotrode", "chamber wall"]
    assert legend.locator("li").all_text_contents() == kinds
    page.wait_for_timeout(500)
    within, wall, air = page.evaluate(ON_SCREEN, [[-3, 5, 20], [20.8, 0, 20], [14, 0, 20]])
    colours = {name: np.array(to_rgb(kind.colour)) * 255 for name, kind in KINDS.items()}
    assert opened.pixel(*within) == pytest.approx(colours["rest"], abs=2)
    assert opened.pixel(*wall) == pytest.approx(colours["wall"], abs=2)
    assert np.abs(opened.pixel(*air) - colours["rest"]).max() > 5
    page.click(".tools >> text=Flip")
    page.click(".tools >> text=Section")
    assert page.evaluate(
        """async () => { const { view } = await import("/browser/scene.js");
        const shell = Section.shell(view.get("sonotrode").geometry, 2), { index } = shell;
        const corner = (i) => new THREE.Vector3().fromBufferAttribute(shell.attributes.position, i);
        let volume = 0;
        for (let k = 0; k < index.count; k += 3) {
          const [a, b, c] = [0, 1, 2].map((i) => corner(index.array[k + i]));
          volume += a.dot(b.cross(c)) / 6;
        }
        return volume; }"""
    ) == pytest.approx(2 * np.pi * 20**2, rel=2e-3)


def test_a_parallel_view_shows_equal_lengths_as_equal(opened: Page) -> None:
    """One upright is 40 mm nearer to the eye than the other; the middle keeps its size."""
    page = opened.page
    page.get_by_role("button", name="Front", exact=True).click()
    ends = [[0, y, z] for y in (-20, 20) for z in (5, 35)]

    def heights() -> list[float]:
        page.wait_for_timeout(300)
        (_, a), (_, b), (_, c), (_, d) = page.evaluate(ON_SCREEN, ends)
        return [a - b, c - d]

    near, far = heights()
    assert near > 1.2 * far
    page.get_by_role("button", name="Parallel").click()
    assert heights() == pytest.approx([0.5 * (near + far)] * 2, rel=0.03)
    one, other = heights()
    assert one == pytest.approx(other, rel=2e-3)
    page.get_by_role("button", name="Parallel").click()
    assert heights() == pytest.approx([near, far], rel=1e-3)
    page.locator("#view").dblclick(position={"x": 30, "y": 400})


def test_two_clicks_measure(opened: Page) -> None:
    page, told = opened.page, opened.page.locator(".tools output")
    page.click(".tools >> text=Measure")
    for x, y in page.evaluate(SIDE):
        page.mouse.click(x, y)
        if "click the other" in told.text_content():
            expect(told).to_contain_text("from a corner at ")  # which was near
    expect(told).to_contain_text("16 mm (x ")
    page.keyboard.press("Escape")
    expect(told).to_be_empty()
    two = """(normals) => Measure.words(...normals.map((normal, i) => ({
      place: new THREE.Vector3(3 * i, 4 * i, 0), normal: new THREE.Vector3(...normal) })))"""
    assert page.evaluate(two, [[0, 1, 0], [0, -1, 0]]) == [
        "5 mm (x 3, y 4, z 0)",
        "parallel faces, 4 mm apart",
    ]
    assert page.evaluate(two, [[0, 1, 0], [0.6, 0.8, 0]])[1] == "faces at 36.87°"
    assert page.evaluate(two, [[0, 0, 1], [0, 0, 1]]) == ["5 mm (x 3, y 4, z 0)"]


def test_a_click_measures_what_is_round(opened: Page) -> None:
    """A wall of 40 mm and 64 sides, the disc that it stands on, a tube's bore, and its flat rim."""
    of = """async (clicks) => {
      const { view } = await import("/browser/scene.js");
      const points = [], index = [], sides = 24, ring = [[5, 0], [9, 0], [9, 20], [5, 20]];
      for (let k = 0; k < sides; k++) ring.forEach(([radius, y], i) => {
        const turn = 2 * Math.PI * k / sides, far = (k + 1) % sides, other = (i + 1) % 4;
        points.push(radius * Math.cos(turn), y, radius * Math.sin(turn));
        const [a, b, c, d] = [4 * k + i, 4 * k + other, 4 * far + other, 4 * far + i];
        index.push(a, b, c, a, c, d);
      });
      const mesh = new THREE.Mesh();
      Object.assign(mesh.userData, { points, index });
      const arc = new THREE.Mesh(); // 120 degrees of the tube
      Object.assign(arc.userData, { points, index: index.slice(0, 24 * sides / 3) });
      return clicks.map(([name, place]) => {
        const one = { tube: mesh, arc }[name] ?? view.get(name), { index } = one.userData;
        const near = new THREE.Vector3(...place), away = [];
        for (let k = 0; k < index.length; k += 3) {
          const [a, b, c] = [0, 1, 2].map((i) => Round.corner(one, index[k + i]));
          away.push(a.add(b).add(c).divideScalar(3).distanceTo(near));
        }
        const found = Round.of(one, away.indexOf(Math.min(...away)), near);
        return [found?.diameter ?? 0, Number(found?.isArc ?? false)];
      });
    }"""
    clicks = [["walls", [0, 20, 18]], ["sonotrode", [0, 15, 0]], ["part", [8, 0, 20]]]
    clicks += [["tube", [0, 10, 5]], ["tube", [0, 10, -9]], ["tube", [8.5, 20, 0]]]
    clicks += [["arc", [3, 10, 4]]]
    found = np.array(opened.page.evaluate(of, clicks))
    assert found[:, 0] == pytest.approx([40, 40, 0, 10, 18, 18, 10], rel=1e-3)
    assert found[:, 1].tolist() == [0, 0, 0, 0, 0, 0, 1]


def test_a_click_on_a_fillet_that_goes_round_measures_its_radius(opened: Page) -> None:
    """Round a shaft of 12 mm goes a quarter of a torus of 2.5 mm: 9 by 72 uneven facets."""
    of = """() => {
      const points = [], index = [], ways = 72, bends = 9;
      for (let k = 0; k < ways; k++) for (let i = 0; i <= bends; i++) {
        const shift = i % bends ? 0.3 * Math.sin(17 * k + 5 * i) : 0;
        const turn = 2 * Math.PI * (k + shift) / ways, bend = Math.PI / 2 * (i - shift) / bends;
        const away = 8.5 - 2.5 * Math.cos(bend);
        points.push(away * Math.cos(turn), away * Math.sin(turn), 2.5 - 2.5 * Math.sin(bend));
        if (i === bends) continue;
        const [a, b] = [k, (k + 1) % ways].map((one) => (bends + 1) * one + i);
        index.push(a, b, b + 1, a, b + 1, a + 1);
      }
      const mesh = new THREE.Mesh();
      Object.assign(mesh.userData, { points, index });
      return [60, 69, 78].map((k) => {
        const ends = [0, 1, 2].map((i) => Round.corner(mesh, index[3 * k + i]));
        const middle = ends[0].add(ends[1]).add(ends[2]).divideScalar(3);
        const found = Round.of(mesh, k, middle);
        return found && Measure.across(found);
      });
    }"""
    assert opened.page.evaluate(of) == ["R about 2.5 mm"] * 3


def test_the_radius_of_a_freeform_face_is_told_roughly(opened: Page) -> None:
    """Half an ellipse of 10 and 9 mm, and of 10 and 10 mm: a radius that differs, and one that not.

    The ellipse bends with a radius between 9² / 10 = 8.1 and 10² / 9 = 11.1 mm.
    """
    of = """(high) => {
      const points = [], index = [], sides = 90;
      for (let k = 0; k <= sides; k++) {
        const turn = Math.PI * k / sides, x = 10 * Math.cos(turn), z = high * Math.sin(turn);
        points.push(x, 0, z, x, 20, z);
        if (k < sides) index.push(2 * k, 2 * k + 1, 2 * k + 3, 2 * k, 2 * k + 3, 2 * k + 2);
      }
      const mesh = new THREE.Mesh();
      Object.assign(mesh.userData, { points, index });
      return Measure.across(Round.of(mesh, 90, new THREE.Vector3(0, 10, high)));
    }"""
    assert opened.page.evaluate(of, 10) == "R 10 mm"
    assert opened.page.evaluate(of, 9) in ("R about 11 mm", "R about 10 mm")


def test_the_legend_says_that_a_holder_is_drawn_later(opened: Page) -> None:
    """Until the chamber is built there are but the faces that it clamps."""
    page, legend = opened.page, opened.page.locator("#legend")
    before = legend.text_content() or ""
    page.evaluate(
        """async () => {
          const { view } = await import("/browser/scene.js"), { userData } = view.get("part");
          globalThis.kinds = userData.kinds;
          Object.assign(userData, { kinds: [...userData.kinds, "holder"] });
          view.awaited = ["holder"];
          view.draw();
        }"""
    )
    expect(legend).to_contain_text("the holder is drawn once the chamber is built")
    expect(legend.locator("li", has_text="clamped by the holder")).to_have_count(1)
    expect(legend.locator("[data-kind=holder]")).to_have_count(0)
    page.evaluate(
        """async () => {
          const { view } = await import("/browser/scene.js");
          view.get("part").userData.kinds = globalThis.kinds;
          view.awaited = [];
          view.draw();
        }"""
    )
    expect(legend).to_have_text(before)


def test_the_legend_hides_a_kind_and_the_view_turns_to_an_axis(opened: Page) -> None:
    page, wall = opened.page, opened.page.locator("#legend").get_by_role("button", name="wall")
    way = [0.0, 0.0, 0.0]
    for is_hidden in (True, False):
        wall.click()
        expect(wall).to_have_attribute("aria-pressed", str(not is_hidden).lower())
        opened.put("chamber.height_mm", 37 if is_hidden else 36)  # which draws the walls anew
        opened.wait("data-checked=reach")
        page.get_by_role("button", name="Top", exact=True).click()
        walls, part, way = page.evaluate(SEEN)
        assert (walls, part) == (not is_hidden, True)
    assert way == pytest.approx([0.0, 0.0, 1.0], abs=1e-3)
    page.get_by_role("button", name="Isometric").click()
    page.get_by_role("button", name="Fit").click()  # from the same side
    assert page.evaluate(SEEN)[2] == pytest.approx([3**-0.5, -(3**-0.5), -(3**-0.5)], abs=1e-3)
    page.locator("#view").dblclick(position={"x": 30, "y": 400})
    assert page.evaluate(SEEN)[2][2] < -0.5  # the target faces down
    for _ in range(2):
        page.click("#undo")


def test_the_wheel_zooms_only_after_a_click_or_with_ctrl_where_a_page_scrolls(opened: Page) -> None:
    page = opened.page
    box = page.locator("#view canvas").bounding_box()
    far = """async () => { const { view } = await import("/browser/scene.js");
        return view.camera.position.distanceTo(view.orbit.target); }"""
    place, before = (box["x"] + 30, box["y"] + 400), page.evaluate(far)
    page.click("h1, header", position={"x": 2, "y": 2})
    page.mouse.move(*place)
    page.mouse.wheel(0, -200)
    page.wait_for_timeout(200)
    assert page.evaluate(far) < 0.99 * before  # the editor does not scroll
    page.evaluate(
        """() => {
        const long = Object.assign(document.createElement("div"), { id: "long" });
        long.style = "position: absolute; top: 0; height: 3000px; width: 1px";
        document.body.append(long);
        document.body.style.overflow = "visible"; }"""
    )
    before = page.evaluate(far)
    for click, key in ((False, ""), (False, "Control"), (True, "")):
        if click:
            page.mouse.click(*place)
        page.mouse.move(*place)
        if key:
            page.keyboard.down(key)
        page.mouse.wheel(0, -200)
        page.wait_for_timeout(200)
        if key:
            page.keyboard.up(key)
        now = page.evaluate(far)
        assert (now < 0.99 * before) == (click or bool(key))
        before = now
    page.evaluate("document.getElementById('long').remove(), document.body.style.overflow = ''")
    page.locator("#view").dblclick(position={"x": 30, "y": 400})


def test_a_switch_hides_the_chamber_as_its_legend_does(opened: Page) -> None:
    page, chamber = opened.page, opened.page.get_by_label("show the chamber")
    wall, sonotrode = (
        page.locator(f"#legend [data-kind={kind}]") for kind in ("wall", "sonotrode")
    )
    sonotrode.click()
    expect(chamber).to_be_checked()  # in part
    chamber.uncheck()
    expect(wall).to_have_attribute("aria-pressed", "false")
    assert page.evaluate(SEEN)[:2] == [False, True]
    chamber.check()
    expect(sonotrode).to_have_attribute("aria-pressed", "true")
    assert page.evaluate(SEEN)[:2] == [True, True]


# Opacity of the sonotrode, and the texts that are to be seen in the view, after its next frame.
LOOKED = """async () => {
  await new Promise(requestAnimationFrame);
  const { view } = await import("/browser/scene.js");
  const groups = view.all().map(([, one]) => one).filter((one) => one.userData.isText);
  const seen = groups.flatMap((one) => one.children).filter((one) => one.layers.mask === 1);
  return [view.get("sonotrode").material.opacity, seen.length];
}"""


@pytest.mark.parametrize(
    ("side", "opacity", "texts"), [("Bottom", 0.08, 2), ("Left", 0.9, 3), ("Isometric", 0.08, 4)]
)
def test_what_is_seen_from_a_side(opened: Page, side: str, opacity: float, texts: int) -> None:
    """From below, as isometric of a target that faces down, the part through the sonotrode."""
    opened.page.get_by_role("button", name=side, exact=True).click()
    assert opened.page.evaluate(LOOKED) == [opacity, texts]


def test_texts_of_a_small_view_can_be_read(opened: Page) -> None:
    heights = """async () => {
      const { view } = await import("/browser/scene.js");
      const [text] = view.get("width").children, found = [];
      for (const height of ["", "150px"]) {
        view.element.style.height = height;
        await new Promise((done) => { setTimeout(done, 300); });
        const far = 2 * Math.tan(view.camera.fov * Math.PI / 360);
        found.push(text.scale.y * view.element.clientHeight / far);
      }
      view.element.style.height = "";
      await new Promise((done) => { setTimeout(done, 300); });
      return found;
    }"""
    usual, small = opened.page.evaluate(heights)
    assert small == pytest.approx(min(usual, 15.0), abs=0.1)


def test_the_face_under_the_pointer_lights_up(opened: Page) -> None:
    """A side of a cube is two triangles."""
    opened.tab("target")
    page, view = opened.page, opened.page.locator("#view")
    x, y = page.evaluate(FIND, None)[1:]
    for k in range(60):  # the faces are asked for with the first move over the part
        page.mouse.move(x + k % 2, y)
        page.wait_for_timeout(500)
        if view.get_attribute("data-highlight"):
            break
    expect(view).to_have_attribute("data-highlight", "2", timeout=WAIT)
    opened.tab("numbers")
    page.mouse.move(*page.evaluate(FIND, None)[1:])
    expect(view).not_to_have_attribute("data-highlight", "2")


def test_the_face_of_a_cad_file_lights_up_and_is_taken(opened: Page, tmp_path: Path) -> None:
    """A fillet of a shaft, which goes on into its journal without a crease."""
    pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    served = Served(tmp_path, "design.toml")
    part = KEPT_ASIDE["stepped_shaft"].write(tmp_path)
    new = {"mesh": f'"{part.name}"', "unit": '"in"', "diameter_mm": "80"}
    dropped, lines = ("direction", "angle_deg", "box_mm"), []
    for line in (tmp_path / "design.toml").read_text().splitlines():
        key = line.partition(" =")[0]
        if key not in dropped:
            lines.append(f"{key} = {new.pop(key)}" if key in new else line)
    (tmp_path / "design.toml").write_text("\n".join(lines))
    try:
        page = Page(opened.page.context.browser, served)
        page.wait("data-checked")
        page.tab("target")
        expect(page.page.locator("#of-cad")).to_be_visible(timeout=WAIT)
        expect(page.page.locator("#of-crease")).to_be_hidden()
        mesh = read_part(part, "in")
        fillets = next(one for one in surfaces(mesh) if one.name.startswith("fillets"))
        seen = page.page.evaluate(SEEN_OF, np.flatnonzero(fillets.triangles).tolist())
        page.page.mouse.move(*seen[1:])
        own = mesh.faces(None).of_triangle
        count = str(int((own == own[seen[0]]).sum()))
        expect(page.page.locator("#view")).to_have_attribute("data-highlight", count, timeout=WAIT)
        page.page.mouse.click(*seen[1:])
        expect(page.page.locator("#chosen")).to_contain_text('"cad_face":true', timeout=WAIT)
        assert not page.errors
    finally:
        served.process.kill()
        served.process.communicate()


def test_names_of_the_target_are_marked(opened: Page, tmp_path: Path) -> None:
    """A cube of two names, of which one is the target, and the other is met beside it."""
    served = Served(tmp_path, "design.toml")
    corners = [(x, y, z) for z in (-8, 8) for y in (-8, 8) for x in (-8, 8)]
    sides = "1 3 4 2", "5 6 8 7", "1 2 6 5", "2 4 8 6", "4 3 7 8", "3 1 5 7"
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    lines += ["g WEB", f"f {sides[0]}", "g RIM", *(f"f {one}" for one in sides[1:])]
    (tmp_path / "named.obj").write_text("\n".join(lines))
    dropped, text = ("direction", "angle_deg", "box_mm"), (tmp_path / "design.toml").read_text()
    kept = "\n".join(x for x in text.splitlines() if x.partition(" =")[0] not in dropped)
    kept = kept.replace("box.stl", "named.obj").replace('surface = "all"', 'surface = "WEB"')
    met = "NOT MASKED: the shot also meets RIM (80 mm²); what has to keep its size takes a mask"
    (tmp_path / "design.toml").write_text(f'to_settle = ["{met}"]\n{kept}')
    try:
        page = Page(opened.page.context.browser, served)
        page.tab("target")
        web, rim = (page.page.locator("#names button", has_text=one) for one in ("WEB", "RIM"))
        expect(web).to_have_attribute("aria-pressed", "true", timeout=WAIT)
        expect(rim).to_have_attribute("aria-pressed", "false")
        expect(page.page.locator("#settle li")).to_contain_text("the shot also meets RIM")
        rim.click()
        expect(rim).to_have_attribute("aria-pressed", "true")
        expect(page.page.locator("#settle li")).to_contain_text("RIM is in the target now")
        assert not page.errors
    finally:
        served.process.kill()
        served.process.communicate()


def test_a_slider_moves_and_is_undone_as_one(opened: Page) -> None:
    slider = opened.page.locator(".field", has=opened.page.locator('[id="shot.mass_g"]'))
    slider = slider.locator("input[type=range]")
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    opened.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    opened.page.mouse.down()
    for across in (0.6, 0.7, 0.8):
        opened.page.mouse.move(box["x"] + across * box["width"], box["y"] + box["height"] / 2)
    opened.page.mouse.up()
    slider.press("ArrowRight")  # another move
    opened.page.click("#undo")
    opened.put("shot.mass_g", 7)  # beyond its end
    assert float(slider.get_attribute("max")) == float(slider.input_value()) == 7
    opened.page.click("#undo")
    assert float(opened.page.locator('[id="shot.mass_g"]').input_value()) > 3
    opened.page.click("#undo")
    mass = opened.page.locator('[id="shot.mass_g"]')
    assert float(mass.input_value()) == 3
    assert opened.page.locator("#undo").is_disabled()
    opened.page.click("#redo")
    assert float(mass.input_value()) > 3
    opened.page.click("#redo")
    assert float(mass.input_value()) == 7
    assert opened.page.locator("#redo").is_disabled()
    opened.page.keyboard.press("Control+z")
    opened.page.keyboard.press("Control+z")
    assert float(mass.input_value()) == 3


def test_shape_and_holder_are_chosen_in_words(opened: Page) -> None:
    page, shown = opened.page, lambda name: opened.page.locator(f'[id="{name}"]')
    shown("chamber.shape").select_option(label="box")
    expect(shown("chamber.length_mm")).not_to_have_value("", timeout=WAIT)
    expect(shown("chamber.diameter_mm")).to_have_count(0)
    opened.put("chamber.length_mm", 48)
    opened.put("chamber.width_mm", 44)
    opened.wait("data-checked=reach")
    drawn = page.evaluate(
        """async () => { const { view } = await import("/browser/scene.js");
        const at = view.get("depth, lines").geometry.getAttribute("position");
        return Math.abs(at.getY(1) - at.getY(0)); }"""
    )
    assert drawn == pytest.approx(44, abs=1e-3)
    page.click("#undo")
    rest = page.locator("#unset-of-sonotrode")
    expect(rest.locator("summary")).to_contain_text("more, not set")
    expect(page.locator('[id="sonotrode.amplitude_pv_um"]')).to_be_hidden()
    rest.locator("summary").click()
    expect(page.locator('[id="sonotrode.amplitude_pv_um"]')).to_be_visible()
    page.click("#of-holder summary")
    shown("holder.kind").select_option(label="rod on a face")
    expect(shown("holder.axis.2")).to_have_value("1", timeout=WAIT)
    expect(page.locator("#legend [data-kind=holder]")).to_be_visible(timeout=WAIT)  # it is cut
    assert page.locator("#error").is_hidden()
    shown("holder.kind").select_option(label="none: the part hangs in the air")
    expect(shown("holder.axis.2")).to_have_count(0)
    for _ in range(4):
        page.click("#undo")
    expect(shown("chamber.diameter_mm")).to_have_value("40", timeout=WAIT)
    assert shown("holder.kind").input_value() == ""
    assert page.locator("#undo").is_disabled()


def test_what_is_settled_is_kept_apart_in_the_file(opened: Page) -> None:
    page, file = opened.page, opened.served.folder / "design.toml"
    text = file.read_text()
    many = "MANY BALLS, 5,200, to be dosed and sorted: 2.5 mm would suit 80%"
    file.write_text(f'to_settle = [\n  "{many}",\n  "NOT MASKED: ask",\n]\n{text}')
    page.click("#reload")
    listed = page.locator("#settle li")
    expect(listed).to_have_count(2, timeout=WAIT)
    opened.wait("data-checked=reach")
    assert "to be settled" not in (page.locator("#warnings").text_content() or "")
    assert page.locator("#settle h3").all_text_contents() == [one.in_words for one in Urgency][:2]
    listed.last.get_by_text("take balls of 2.5 mm").click()
    expect(page.locator('[id="shot.diameter_mm"]')).to_have_value("2.5")
    page.click("#undo")
    listed.last.get_by_text("Mark as settled").click()
    expect(listed).to_have_count(1, timeout=WAIT)
    expect(listed).to_contain_text("Not masked: ask")
    opened.saved()
    left, _, kept = file.read_text().partition("settled = [\n    ")
    assert left == 'to_settle = [\n  "NOT MASKED: ask",\n]\n'
    assert kept.startswith('"MANY BALLS, 5,200, to be dosed and sorted')
    assert kept.partition(" (marked as settled on ")[2].endswith(f'",\n]\n{text}')
    file.write_text(f'# proposed by `chamberopt new`\nto_settle = ["LONG: ask"]\n{text}')
    page.click("#reload")
    expect(listed).to_contain_text("Long: ask", timeout=WAIT)
    expect(page.locator("#settle .warning")).to_have_count(0)
    opened.put("shot.diameter_mm", 2.5)
    expect(page.locator("#settle .warning")).to_contain_text("you changed some of it")
    opened.saved()
    expect(listed.first).to_contain_text("diameter of the shot", timeout=WAIT)
    file.write_text(text)
    page.click("#reload")
    expect(listed).to_have_count(0, timeout=WAIT)


def test_a_step_is_added_and_shown(opened: Page) -> None:
    page = opened.page
    page.click("#new-step summary")
    page.fill("#step-name", "second side")
    page.click("#add-step")
    buttons = page.locator("#step-buttons button[aria-pressed]")
    expect(buttons).to_have_count(2, timeout=WAIT)
    expect(buttons.nth(1)).to_have_attribute("aria-pressed", "true")
    expect(buttons.nth(1)).to_contain_text("second side: ")
    opened.put("steps.1.part.rotate_deg.0", 180)
    opened.wait("data-checked=reach")
    assert page.locator("#error").is_hidden()
    page.get_by_role("button", name="Remove the step second side").click()
    expect(buttons).to_have_count(0, timeout=WAIT)
    page.click("#undo")
    expect(buttons).to_have_count(2, timeout=WAIT)
    page.click("#undo")
    page.click("#undo")
    expect(buttons).to_have_count(0, timeout=WAIT)
    opened.wait("data-checked=reach")


def test_what_is_refused_is_said_and_the_newest_counts(opened: Page) -> None:
    opened.put("chamber.height_mm", 4)
    expect(opened.page.locator("#error")).to_contain_text("not below height of the chamber = 4")
    key = opened.page.locator("#error abbr", has_text="height of the chamber").first
    assert key.get_attribute("title") == "chamber.height_mm"
    row = opened.page.locator('.field:has([id="chamber.sonotrode_distance_mm"])')
    expect(row.locator(".wrong")).to_contain_text("not below height of the chamber = 4")
    opened.page.click("#save")
    expect(opened.page.locator("#message")).to_contain_text("sonotrode distance of the chamber")
    assert "height_mm = 36" in (opened.served.folder / "design.toml").read_text()
    opened.page.click("#undo")
    expect(opened.page.locator("#error")).to_be_hidden()


def test_a_click_picks_the_face_and_turns_it_down(opened: Page) -> None:
    opened.tab("target")
    opened.page.click("#whole")
    opened.wait("data-checked=reach")
    opened.page.select_option("#surface", label="what a mask covers")
    opened.click_side()
    expect(opened.page.locator("#legend [data-kind=mask]")).to_be_visible(timeout=WAIT)
    opened.page.click("#undo")
    opened.page.select_option("#surface", label="the target")
    side = opened.click_side()
    expect(opened.page.locator("#chosen")).to_contain_text("faces = [")
    row = opened.page.locator("#picked li")
    expect(row).to_have_count(1, timeout=WAIT)
    expect(row).to_contain_text("256 mm²")
    row.hover()
    expect(opened.page.locator("#view")).to_have_attribute("data-highlight", "2")
    row.get_by_role("button").click()
    expect(opened.page.locator("#message")).to_contain_text("nothing would be left")
    opened.page.mouse.move(*opened.page.evaluate(FIND, side)[1:])
    expect(opened.page.locator("#under")).to_contain_text("flat, 256 mm², target, at ")
    expect(opened.page.locator("#under")).to_contain_text("“takes it away” to click it out")
    opened.page.get_by_role("button", name="Section").dispatch_event("click")
    names = "#tools > .tools", "#steps", "#under", "#legend"
    boxes = [opened.page.locator(one).bounding_box() for one in names]
    assert all(a["y"] + a["height"] <= b["y"] for a, b in pairwise(boxes))  # none over another
    opened.page.get_by_role("button", name="Section").dispatch_event("click")
    assert int(opened.page.evaluate("document.body.dataset.picked")) == side
    opened.tab("pose")
    opened.page.click("#down")
    opened.click_side(side)
    opened.wait("data-checked=reach")
    design = opened.saved()
    assert len(design.part.target.faces) == 1
    assert design.part.target.direction is None
    assert max(map(abs, design.part.rotate_deg)) > 80


def test_a_study_of_the_sliders_is_run_and_seen(opened: Page) -> None:
    page, folder = opened.page, opened.served.folder
    opened.tab("numbers")
    row = page.locator(".field", has=page.locator('[id="shot.mass_g"]'))
    row.hover()
    assert row.locator("input[type=checkbox]").is_checked()  # as in the study beside the design
    opened.tab("run")
    page.click("[aria-label='Leave Chamber height [mm] as it is']")
    most = page.locator("[aria-label='Shot mass [g], largest']")
    most.fill("2.5")
    most.press("Tab")
    expect(most).to_have_value("3")  # that of the design is within
    expect(page.locator("#varied .wrong")).to_have_text(
        "The design has 3, which is to lie between the ends."
    )
    least = page.locator("[aria-label='Shot mass [g], least']")
    before = least.input_value()
    least.fill("70")
    least.press("Tab")
    expect(least).to_have_value(before)
    expect(page.locator("#varied .wrong")).to_have_text(
        "70 is not less than 3: change the other end first."
    )
    page.select_option("#aim", "p05_coverage")
    page.fill("#evaluations", "2")
    page.fill("#study-name", "design.toml")
    page.click("#search-sliders")
    expect(page.locator("#search-fault")).to_contain_text("design.toml")
    expect(page.locator("#search-fault")).to_be_in_viewport()
    page.fill("#evaluations", "3")
    expect(page.locator("#search-fault")).to_be_empty()  # of another question
    page.fill("#evaluations", "2")
    page.fill("#study-name", "stopped")
    page.click("#search-sliders")
    expect(page.locator("#message")).to_contain_text("written: stopped.toml")
    expect(page.locator("#lasts")).to_be_hidden()  # while it runs
    expect(page.locator("#study-progress")).to_contain_text("at work for")
    opened.tab("results")
    expect(page.locator("#study-view")).to_be_hidden()
    opened.tab("run")
    expect(page.locator("#study-view")).to_be_visible()
    page.click("#study-stop")
    expect(page.locator("#progress")).to_contain_text("stopped", timeout=WAIT)
    expect(page.locator("#study-progress")).to_be_empty()
    page.click("#close-study")
    page.locator("#progress").get_by_text("See its candidates").click()
    expect(page.locator("#study-view")).to_be_visible(timeout=WAIT)
    page.click("#close-study")
    words = (
        "the best coverage of the least covered places; varies mass of the shot; tries 2 chambers"
    )
    expect(page.locator("#of-words")).to_have_text(words)
    opened.tab("run")
    page.select_option("#of", "design.toml")
    expect(page.locator("#lasts")).to_be_empty()  # nothing like it was simulated yet
    simulate = page.locator("[data-command=simulate]")
    page.locator('[id="process.treatment_time_s"]').evaluate("one => { one.value = 6; }")
    page.locator('[id="process.treatment_time_s"]').dispatch_event("change")
    expect(simulate).to_have_text("Save and simulate")
    expect(page.locator("#search-sliders")).to_have_text("Save and search for the best")
    simulate.click()
    expect(page.locator("#progress")).to_contain_text("finished", timeout=WAIT)
    expect(simulate).to_have_text("Simulate")
    assert load_design(folder / "design.toml").process.treatment_time_s == 6
    asked = page.locator("#efforts label", has=page.locator("[value=asked]"))
    expect(asked).to_contain_text(re.compile(r"about \d+ to \d+ s"))
    result = json.loads((folder / "results" / "design" / "result.json").read_text())
    out = folder / "by-command"
    assert main(["simulate", str(folder / "design.toml"), "--no-ranges", "--out", str(out)]) == 0
    assert result["metrics"] == json.loads((out / "result.json").read_text())["metrics"]
    opened.tab("results")
    # A study that is stopped as it is written has a result too.
    row = page.locator("#result-list li", has_text="results/design")
    expect(row.locator("small", has_text="on average")).to_have_count(1)
    page.locator("#result-list input").first.check()
    page.click("#show-results")
    opened.wait("data-drawn=yes")
    assert page.locator("#shown #part-0 canvas").count() == 1
    answer, drawn, figures = (
        page.locator(one).bounding_box()["y"]
        for one in ("#shown .answer", "#part-0", "#shown > section:last-of-type")
    )
    view = page.locator("#part-0").bounding_box()
    assert answer < drawn < figures
    assert view["y"] + 0.7 * view["height"] < 800  # most of the map is on the first screen
    too_few = "Almen intensity: not known: too few dents were simulated"
    expect(page.locator("#shown .answer").first).to_contain_text(too_few)  # above the view
    longer = page.locator('[id="process.accuracy.simulated_time_s"]')
    before, times = longer.input_value(), page.locator("#longer").get_attribute("title")
    page.click("#longer")
    assert float(longer.input_value()) == int(times.split()[0]) * float(before)
    expect(page.locator("#run")).to_be_visible()
    expect(page.locator("#close-results")).to_be_hidden()
    page.click("#undo")
    page.locator("#progress").get_by_text("Show the result").click()
    expect(page.locator("#shown #part-0 canvas")).to_have_count(1, timeout=WAIT)
    expect(page.locator("#stale")).to_be_empty()
    assert page.evaluate("document.getElementById('shown').scrollTop") == 0
    button, bar = (page.locator(one).bounding_box() for one in ("#close-results", "#shown"))
    inner = bar["y"] + page.evaluate("document.getElementById('shown').clientTop")
    assert button["y"] + button["height"] <= inner  # nothing is below it
    row.get_by_text("make the report").click()
    expect(row.get_by_text("make the process sheet")).to_be_disabled()
    with page.expect_popup(timeout=WAIT) as report:
        page.locator("#message").get_by_text("open it").click(timeout=WAIT)
    assert report.value.url.endswith("/files/results/design/report.html")
    report.value.close()
    assert row.locator("input").is_checked()
    page.locator("#result-list li", has_text="by-command").locator("input").check()
    page.click("#show-results")
    expect(page.locator("#difference")).to_contain_text("Difference of coverage", timeout=WAIT)
    drawn = page.locator("#difference img, #difference:has-text('OpenGL')")
    expect(drawn).to_have_count(1, timeout=WAIT)
    expect(page.locator("#shown .answer")).to_contain_text(re.compile("of both|No difference is"))
    page.locator('[id="shot.mass_g"]').evaluate("one => { one.value = 2.9; }")
    page.locator('[id="shot.mass_g"]').dispatch_event("change")
    expect(page.locator("#stale")).to_contain_text("It had: mass of the shot 3 g", timeout=WAIT)
    page.locator("#stale [data-take]").first.click()
    assert page.locator('[id="shot.mass_g"]').input_value() == "3"
    expect(page.locator("#stale")).to_be_empty(timeout=WAIT)
    page.click("#undo")
    expect(page.locator("#stale")).to_contain_text("It had: mass of the shot 3 g", timeout=WAIT)
    page.click("#undo")
    expect(page.locator("#stale")).to_be_empty(timeout=WAIT)


@pytest.mark.long
def test_a_study_run_on_the_page_is_that_of_the_command(opened: Page) -> None:
    page, folder = opened.page, opened.served.folder
    opened.tab("run")
    expect(page.locator("#study-name")).to_have_value("study-of-sliders.toml")
    page.click("#search-sliders")
    expect(page.locator("#progress")).not_to_contain_text("finished", timeout=WAIT)  # the last run
    expect(page.locator("#progress")).to_contain_text("finished", timeout=10 * WAIT)
    opened.tab("results")
    expect(page.locator("#result-list")).to_contain_text("study-of-sliders")
    out = folder / "results" / "study-by-command"  # as deep as its own: best.toml names the part
    assert main(["run", str(folder / "study-of-sliders.toml"), "--out", str(out)]) == 0
    own = folder / "results" / "study-of-sliders"
    assert (own / "history.jsonl").read_bytes() == (out / "history.jsonl").read_bytes()
    assert (own / "best.toml").read_text() == (out / "best.toml").read_text()


def test_nothing_foreign_is_asked_and_nothing_failed(opened: Page) -> None:
    assert opened.errors == []
    assert all(url.startswith((opened.served.origin, "data:", "blob:")) for url in opened.requests)
    opened.open(opened.served.origin)  # reloaded, it goes on from the file
    assert not opened.page.locator("#unsaved").text_content()


def test_it_says_that_the_server_has_ended(opened: Page) -> None:
    opened.served.process.kill()
    opened.served.process.wait()
    opened.tab("numbers")  # wherever the tests before it left the page
    opened.put("chamber.height_mm", 37)
    expect(opened.page.locator("#error")).to_contain_text("the server has ended", timeout=WAIT)
