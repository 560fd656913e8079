"""A page of the program, opened in a real browser, with its errors and requests."""

from typing import Any

from chamberopt.design.load import load_design
from tests.chamberopt.page.conftest import Served
from tests.helpers.results.browser import WAIT, expect

# Number of a triangle and the place of its middle on the screen.
FIND = """async (wanted) => {
  const { view } = await import("/browser/scene.js"), mesh = view.get("part");
  const corners = mesh.geometry.getAttribute("position");
  const box = view.renderer.domElement.getBoundingClientRect();
  mesh.updateWorldMatrix(true, false);
  for (let k = wanted ?? 0; k < corners.count / 3; k++) {
    const at = new THREE.Vector3();
    for (let i = 0; i < 3; i++) at.add(new THREE.Vector3().fromBufferAttribute(corners, 3 * k + i));
    at.divideScalar(3).applyMatrix4(mesh.matrixWorld).project(view.camera);
    const clientX = box.left + (at.x + 1) / 2 * box.width;
    const clientY = box.top + (1 - at.y) / 2 * box.height;
    if (view.at({ clientX, clientY }, ["part"])?.triangle === k) return [k, clientX, clientY];
  }
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

    def facts(self) -> dict[str, str]:
        """Names of the facts and their exact values, which are tips of what is shown."""
        tips = "all => all.map((one) => one.title)"
        names = self.page.locator("#facts dt:not(.of)").evaluate_all(tips)
        return dict(zip(names, self.page.locator("#facts dd").evaluate_all(tips), strict=True))

    def saved(self) -> Any:
        self.page.click("#save")
        expect(self.page.locator("#message")).to_contain_text("saved in design.toml", timeout=WAIT)
        return load_design(self.served.folder / "design.toml")

    def click_side(self, triangle: int | None = None) -> int:
        """Click the middle of a triangle of the part, by default of one that can be seen."""
        found, x, y = self.page.evaluate(FIND, triangle)
        self.page.mouse.click(x, y)
        return int(found)
