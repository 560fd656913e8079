"""The Python of the README and of two pages of docs/ runs as printed, and named files exist.

The README's gear has fewer and larger balls and replicas here, so that it takes seconds.
"""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from chamberopt.pictures.subprocess_drawing import missing_opengl

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCK = r"```{}\n(.*?)```"
SNIPPETS = re.findall(BLOCK.format("python"), README, re.DOTALL)
NUMBER = r"-?\d+\.?\d*"
SMALLER = {"replicas = 8": "replicas = 3", "diameter_mm = 1.5 ": "diameter_mm = 4 "}


def run(code: str, folder: Path) -> str:
    """What a program prints."""
    answer = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )
    assert answer.returncode == 0, answer.stderr
    return answer.stdout


@pytest.mark.parametrize(
    "snippet", [pytest.param(SNIPPETS[0], marks=pytest.mark.long, id="toolkit"), *SNIPPETS[1:]]
)
def test_the_readmes_python_runs_as_printed(snippet: str, tmp_path: Path) -> None:
    designs = tmp_path / "designs"
    designs.mkdir()
    (designs / "parts").symlink_to(ROOT / "designs" / "parts")
    gear = (ROOT / "designs" / "gear.toml").read_text(encoding="utf-8")
    for usual, small in SMALLER.items():
        assert usual in gear
        gear = gear.replace(usual, small)
    (designs / "gear.toml").write_text(gear, encoding="utf-8")
    if missing_opengl():  # the only line that needs OpenGL
        snippet = re.sub(r"chamberopt\.show\(.*", "", snippet)
    printed = run(snippet, tmp_path)
    assert "±" in printed or "impacts" in printed


@pytest.mark.long
def test_the_page_for_science_prints_what_it_shows(tmp_path: Path) -> None:
    """Words as shown, and numbers within a tenth: on another processor a gas takes other paths."""
    page = (ROOT / "docs/how_to/science.md").read_text(encoding="utf-8")
    blocks, shown = (
        "".join(re.findall(BLOCK.format(kind), page, re.DOTALL)) for kind in ("python", "text")
    )
    printed = run(blocks, tmp_path)
    assert re.sub(NUMBER, "", printed).split() == re.sub(NUMBER, "", shown).split()
    seen, expected = (np.array(re.findall(NUMBER, text), float) for text in (printed, shown))
    np.testing.assert_allclose(seen, expected, rtol=0.1, atol=0.02)


@pytest.mark.long
def test_the_page_on_python_runs_as_one_program(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    for name in ("designs", "studies"):
        (tmp_path / name).symlink_to(ROOT / name)
    page = (ROOT / "docs/how_to/python.md").read_text(encoding="utf-8")
    printed = run("".join(re.findall(BLOCK.format("python"), page, re.DOTALL)), tmp_path)
    for expected in ("±", "mean_normal_speed", "m/s", "replica", "ring.ply"):
        assert expected in printed


def test_files_named_in_the_readme_exist() -> None:
    named = re.findall(r"(?:designs|studies|docs)/[\w/.-]+\.(?:toml|png|gif|md)", README)
    assert len(set(named)) >= 5
    assert [name for name in named if not (ROOT / name).is_file()] == []
