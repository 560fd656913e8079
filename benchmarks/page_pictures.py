"""The pictures of docs/page.md: the editor page of a design as a browser shows it.

    python benchmarks/page_pictures.py chamber/design.toml

Writes docs/images/page.png and page_target.png. Needs `pip install playwright` and a Chromium on
PATH, as report_picture.py.
"""

import shutil
import signal
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.pictures import IMAGES
from benchmarks.report_picture import SOFTWARE

CHECKED = "body[data-checked=reach]"


def page_pictures(design: Path, folder: Path) -> None:
    """The page with its numbers, and with its target; page.png and page_target.png."""
    command = [sys.executable, "-m", "chamberopt", "edit", str(design)]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    address = server.stdout.readline().split(" is at ")[1].strip()
    with sync_playwright() as session:
        browser = session.chromium.launch(executable_path=shutil.which("chromium"), args=SOFTWARE)
        page = browser.new_page(viewport={"width": 1400, "height": 820})
        page.goto(address)
        page.wait_for_selector(CHECKED, timeout=120_000)
        page.wait_for_timeout(500)
        page.screenshot(path=folder / "page.png")
        page.click("nav [data-tab=target]")
        page.wait_for_timeout(500)
        page.screenshot(path=folder / "page_target.png")
        browser.close()
    server.send_signal(signal.SIGINT)
    server.wait()


if __name__ == "__main__":
    page_pictures(Path(sys.argv[1]), IMAGES)
    print(f"pictures in {IMAGES}")
