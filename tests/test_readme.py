"""The README's Python runs as printed, and its commands and files exist."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from chamberopt.output.viewer import missing_opengl

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
SNIPPETS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


@pytest.mark.parametrize("snippet", SNIPPETS, ids=["toolkit", "simulator"])
def test_the_readmes_python_runs_as_printed(snippet: str, tmp_path: Path) -> None:
    for folder in ("designs", "studies"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    if missing_opengl():  # the only line that needs OpenGL
        snippet = re.sub(r"chamberopt\.show\(.*", "", snippet)
    answer = subprocess.run(
        [sys.executable, "-c", snippet], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert answer.returncode == 0, answer.stderr
    assert "±" in answer.stdout or "impacts" in answer.stdout


def test_files_named_in_the_readme_exist() -> None:
    named = re.findall(r"(?:designs|studies|docs)/[\w/.-]+\.(?:toml|png|gif|md)", README)
    assert len(set(named)) >= 5
    assert [name for name in named if not (ROOT / name).is_file()] == []
