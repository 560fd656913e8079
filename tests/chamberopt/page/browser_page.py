"""A page of the program, opened in a real browser, with its errors and requests."""

import io
from typing import Any

import numpy as np
from matplotlib.image import imread

from chamberopt.design.load import load_design
from tests.chamberopt.page.conftest import Served
from tests.helpers.results.browser import WAIT, expect

# Number of a triangle and the place of its middle on the screen.
FIND = """async (wanted) => {
  const { view } = await import("/browser/scene.js"), mesh = view.get("part");
  const corners = mesh.geometry.getAttribute("position");
  mesh.updateWorldMatrix(true, false);
  for (let k = wanted ?? 0; k < corners.count / 3; k++) {
    const at = new THREE.Vector3();
    for (let i = 0; i < 3; i++) at.add(new THREE.Vector3().fromBufferAttribute(corners, 3 * k + i));
    at.divideScalar(3).applyMatrix4(mesh.matrixWorld);
    const [clientX, clientY] = view.onScreen(at);
    if (view.at({ clientX, clientY }, ["part"])?.triangle === k) return [k, clientX, clientY];
  }
}"""

# Places on the screen of points in the chamber [mm].
ON_SCREEN = """async (points) => {
  const { view } = await import("/browser/scene.js");
  return points.map((point) => view.onScreen(new THREE.Vector3(...point)));
}"""
# Two corners of the part that can be seen, at the ends of a side of its box.
SIDE = """async () => {
  const { view } = await import("/browser/scene.js"), mesh = view.get("part");
  const corners = [], { points } = mesh.userData, seen = [];
  for (let i = 0; i < points.length; i += 3)
    corners.push(new THREE.Vector3().fromArray(points, i).applyMatrix4(mesh.matrixWorld));
  for (const one of corners) {
    const [clientX, clientY] = view.onScreen(one), hit = Measure.place(view, { clientX, clientY });
    if (hit && hit.place.distanceTo(one) < 0.01) seen.push([one, [clientX, clientY]]);
  }
  for (const [one, a] of seen) for (const [other, b] of seen)
    if (Math.abs(one.distanceTo(other) - 16) < 0.01) return [a, b];
}"""


class Page:
    """The page of a served design, opened, with its errors and requests."""

    def __init__(self, browser: Any, served: Served) -> None:
        self.served = served
        self.errors: list[str] = []
        self.requests: list[str] = []
        context = browser.new_context(viewport={"width": 1300, "height": 800})
        self.page = context.new_page()
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.open(served.address)

    def open(self, address: str) -> None:
        self.page.goto(address)
        self.wait("data-ready=yes")

    def wait(self, state: str) -> None:
        self.page.wait_for_selector(f"body[{state}]", timeout=WAIT)

    def put(self, name: str, value: float) -> None:
        field = self.page.locator(f'[id="{name}"]')
        field.evaluate(
            "one => { const fold = one.closest('details'); if (fold) fold.open = true; }"
        )
        field.fill(f"{value:g}")
        field.press("Tab")

    def tab(self, name: str) -> None:
        self.page.click(f"nav [data-tab={name}]")

    def facts(self) -> list[str]:
        """The facts in words."""
        return list(self.page.locator("#facts dd").all_text_contents())

    def saved(self) -> Any:
        self.page.click("#save")
        expect(self.page.locator("#message")).to_contain_text("saved in design.toml", timeout=WAIT)
        return load_design(self.served.folder / "design.toml")

    def pixel(self, x: float, y: float) -> np.ndarray:
        """Colour on the screen, red, green and blue in 0..255."""
        shot = self.page.screenshot(clip={"x": x, "y": y, "width": 1, "height": 1})
        return np.asarray(255 * imread(io.BytesIO(shot), format="png")[0, 0, :3])

    def click_side(self, triangle: int | None = None) -> int:
        """Click the middle of a triangle of the part, by default of one that can be seen."""
        found, x, y = self.page.evaluate(FIND, triangle)
        self.page.mouse.click(x, y)
        return int(found)
