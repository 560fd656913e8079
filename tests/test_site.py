"""The site is built from its pages: no link leads nowhere, and all that is made is in it."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import chamberopt
import sim_core
from chamberopt.cli.command_line import app
from docs.generators.keys import PAGES, every_key

pytest.importorskip("furo", reason="the site needs the extra docs")
pytest.importorskip("myst_parser", reason="the site needs the extra docs")
ROOT = Path(__file__).parents[1]
DESIGN = "docs/reference/design"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the site, built without a warning."""
    folder = tmp_path_factory.mktemp("site")
    words = ["-q", "-W", "--keep-going", "-d", str(folder / "read"), "-c", "docs", ".", "out"]
    words[-1] = str(folder / "out")
    answer = subprocess.run(
        [sys.executable, "-m", "sphinx", *words], cwd=ROOT, capture_output=True, text=True
    )
    assert answer.returncode == 0, answer.stderr
    return folder / "out"


def text_of(site: Path, page: str) -> str:
    return (site / f"{page}.html").read_text(encoding="utf-8")


def test_every_key_can_be_linked_to(site: Path) -> None:
    for page, model in PAGES.items():
        html = text_of(site, page)
        for name, _ in every_key(model):
            assert f">{name.rpartition('.')[2]}</span>" in html, name
    assert 'id="process-treatment-time-s"' in text_of(site, DESIGN)


def test_every_command_and_every_name_is_there(site: Path) -> None:
    commands = text_of(site, "docs/reference/commands")
    for name in app:
        if not name.startswith("-"):
            assert f'id="chamberopt-{name}"' in commands
    python = text_of(site, "docs/reference/python")
    for module in (chamberopt, sim_core):
        for name in module.__all__:
            assert f'id="{module.__name__}.{name}"' in python


def test_a_page_says_for_whom_it_is(site: Path) -> None:
    for page in (ROOT / "docs").rglob("*.md"):
        head = page.read_text(encoding="utf-8").split("\n\n")
        assert re.match(r"For [^.]+\.|For everybody: ", head[1]), page


def test_nothing_is_fetched(site: Path) -> None:
    """Neither scripts nor styles nor pictures, so that search works without a network."""
    for page in site.rglob("*.html"):
        html = page.read_text(encoding="utf-8")
        assert not re.findall(r'<(?:script|img|link)[^>]*(?:src|href)="https?:', html), page
    assert (site / "searchindex.js").stat().st_size > 100_000
    assert "0; url=docs/README.html" in text_of(site, "index")
