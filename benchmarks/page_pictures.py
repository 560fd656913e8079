"""The pictures of docs/how_to/page.md: the program's page as a browser shows it.

    python benchmarks/page_pictures.py designs/parts/fir_tree.step FIR_TREE
    python benchmarks/page_pictures.py results/quickstart

A part is dropped on the front page, which proposes a design for one of its surfaces and opens it.
Writes docs/images/page_front.png, page.png, page_target.png and page_section.png. With the results
folder of studies/quickstart.toml: the study's candidates, page_study.png. Needs `pip install
playwright` and a Chromium on PATH, as report_picture.py.
"""

import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.pictures import IMAGES
from benchmarks.report_picture import SOFTWARE

READY, KNOWN, ENDED = "body[data-ready]", "body[data-known=all]", "body[data-ended='0']"
CHECKED = "body[data-checked=reach]"


@contextmanager
def opened(folder: Path, *file: str, height: int = 820) -> Iterator[Any]:
    """The page of a folder, or of a file in it, in a browser."""
    with sync_playwright() as session:
        server = subprocess.Popen(
            [sys.executable, "-m", "chamberopt", "edit", *file],
            cwd=folder, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert server.stdout is not None
        address = server.stdout.readline().split(" is at ")[1].strip()
        browser = session.chromium.launch(executable_path=shutil.which("chromium"), args=SOFTWARE)
        page = browser.new_page(viewport={"width": 1400, "height": height})
        page.goto(address)
        page.wait_for_selector(READY, timeout=120_000)
        yield page
        browser.close()
        server.send_signal(signal.SIGINT)
        server.wait()


def study_picture(study: Path, folder: Path) -> None:
    """The candidates of the quickstart, with the chamber of the best."""
    with TemporaryDirectory() as place:
        here = Path(place) / "gear"
        shutil.copytree("designs", here, ignore=shutil.ignore_patterns("results"))
        shutil.copytree("designs/parts", here / "designs" / "parts")  # where the study has its part
        shutil.copytree(study, here / "results" / study.name)
        with opened(here, "gear.toml", height=1250) as page:
            page.wait_for_selector(CHECKED, timeout=120_000)
            page.click("nav [data-tab=results]")
            page.click("text=see its candidates")
            page.wait_for_selector("body[data-followed]", timeout=120_000)
            page.click("#study-of .rows tr.best")
            page.wait_for_selector("body[data-candidate]")
            page.wait_for_selector(CHECKED, timeout=120_000)
            page.locator("#study-view").evaluate("one => one.scrollTo(0, 0)")
            page.wait_for_timeout(1000)
            page.screenshot(path=folder / "page_study.png")


def page_pictures(part: Path, target: str, folder: Path) -> None:
    """The proposal on the front page, and the page of the design: its numbers, and its target."""
    with TemporaryDirectory() as place, opened(Path(place)) as page:
        page.set_input_files("#file", part)
        page.wait_for_selector(KNOWN, timeout=120_000)
        page.check(f"#names input[value={target}]")
        page.click("#propose")
        page.wait_for_selector(ENDED, timeout=600_000)
        page.wait_for_timeout(1000)
        page.evaluate("document.getElementById('folder').textContent = 'chambers'")
        page.screenshot(path=folder / "page_front.png", full_page=True)
        page.click("#open-made")
        page.wait_for_selector(CHECKED, timeout=120_000)
        page.wait_for_timeout(500)
        page.screenshot(path=folder / "page.png")
        page.click("nav [data-tab=target]")
        page.wait_for_timeout(500)
        page.screenshot(path=folder / "page_target.png")
        page.click("nav [data-tab=numbers]")
        page.check(".tools label:has-text('cut the part') input")
        page.select_option(".tools select", "y")
        page.wait_for_timeout(500)
        page.screenshot(path=folder / "page_section.png")


if __name__ == "__main__":
    if Path(sys.argv[1]).is_dir():
        study_picture(Path(sys.argv[1]), IMAGES)
    else:
        page_pictures(Path(sys.argv[1]), sys.argv[2], IMAGES)
    print(f"pictures in {IMAGES}")
