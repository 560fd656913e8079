"""The picture of docs/how_to/report.md: a results folder's report as a browser shows it.

    python benchmarks/report_picture.py results/quickstart [PICTURE.png]

Writes docs/images/report.png, or the picture given. Needs `pip install playwright` and a Chromium
on PATH (of the operating system, or by `playwright install chromium`).
"""

import shutil
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.pictures import IMAGES
from chamberopt.printers.report_page import write_report

SOFTWARE = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]


def report_picture(folder: Path, picture: Path) -> None:
    """The answer and the chamber, 1280 pixels wide; .png."""
    with tempfile.TemporaryDirectory() as place, sync_playwright() as session:
        page_file, _ = write_report(folder, Path(place) / "report.html")
        browser = session.chromium.launch(executable_path=shutil.which("chromium"), args=SOFTWARE)
        page = browser.new_page(viewport={"width": 1280, "height": 1050})
        page.goto(page_file.as_uri())
        page.wait_for_selector("body[data-drawn=yes]", timeout=60_000)
        page.evaluate("scrollTo(0, document.querySelector('.answer').offsetTop - 15)")
        page.wait_for_timeout(1000)
        page.screenshot(path=picture)
        browser.close()


if __name__ == "__main__":
    written = Path(sys.argv[2]) if len(sys.argv) > 2 else IMAGES / "report.png"
    report_picture(Path(sys.argv[1]), written)
    print(f"picture in {written}")
