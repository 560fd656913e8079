"""The notebooks of docs/ run as they stand, in a copy of the clone's folders.

Their code cells run one after another in a plain process, so that no kernel has to be installed.
The last expression of a cell is shown as a notebook shows it.
"""

import ast
import inspect
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import chamberopt

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
START = """
import matplotlib; matplotlib.use("Agg")
def show(value):
    html = getattr(value, "_repr_html_", lambda: None)()
    print("SHOWN", type(value).__name__, len(html or repr(value)))
"""


def cells_of(notebook: Path) -> list[dict]:
    return json.loads(notebook.read_text(encoding="utf-8"))["cells"]


def code_of(notebook: Path) -> str:
    """The code of a notebook, with the last expression of each cell shown."""
    parts = [START]
    for cell in cells_of(notebook):
        if cell["cell_type"] != "code":
            continue
        source = "".join(cell["source"])
        tree = ast.parse(source)
        last = tree.body[-1]
        if isinstance(last, ast.Expr) and not source.rstrip().endswith(";"):
            last.value = ast.Call(ast.Name("show", ast.Load()), [last.value], [])
        parts.append(ast.unparse(ast.fix_missing_locations(tree)))
    return "\n".join(parts)


CASES = pytest.mark.parametrize("notebook", NOTEBOOKS, ids=[one.stem for one in NOTEBOOKS])


@CASES
def test_the_notebook_calls_what_there_is(notebook: Path) -> None:
    """In a moment, beside the programs of README and docs/how_to/python.md, which run."""
    called = 0
    for node in ast.walk(ast.parse(code_of(notebook))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            if ast.unparse(node.func.value) != "chamberopt":
                continue
            given = {str(one.arg): None for one in node.keywords}
            inspect.signature(getattr(chamberopt, node.func.attr)).bind(*node.args, **given)
            called += 1
    assert called > 1


@pytest.mark.long  # half a minute each
@CASES
def test_the_notebook_runs_as_it_stands(notebook: Path, tmp_path: Path) -> None:
    code = code_of(notebook)
    if ".impacts(" in code or ".fields(" in code:
        pytest.importorskip("pandas")
    for name in ("designs", "studies"):
        shutil.copytree(ROOT / name, tmp_path / name)
    place = tmp_path / "docs" / "notebooks"
    place.mkdir(parents=True)
    answer = subprocess.run(
        [sys.executable, "-c", code],
        cwd=place, capture_output=True, text=True, check=False,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )  # fmt: skip
    assert answer.returncode == 0, answer.stderr
    assert "SHOWN" in answer.stdout or "±" in answer.stdout


def test_notebooks_are_committed_without_what_they_printed() -> None:
    assert len(NOTEBOOKS) == 3
    for notebook in NOTEBOOKS:
        for cell in cells_of(notebook):
            assert not cell.get("outputs")
            assert cell.get("execution_count") is None
