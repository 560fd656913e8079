"""What a release needs: the command that makes one, the citation, the recipe, the workflow."""

import importlib.util
import shutil
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CONDA_NAMES = {"matplotlib-base": "matplotlib"}


def read_yaml(name: str) -> Any:
    return yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def make() -> Any:
    spec = importlib.util.spec_from_file_location("make_release", ROOT / "release/make.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def clone(make: Any, tmp_path: Path) -> Path:
    """A clone with the files that a release changes, and two packages with almost nothing."""
    for name in (*make.PLACES, "LICENSE", "README.md", ".gitignore"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    changelog = (tmp_path / "CHANGELOG.md").read_text(encoding="utf-8")
    changed = changelog.replace(make.UNRELEASED, f"{make.UNRELEASED}\n- A change.\n", 1)
    (tmp_path / "CHANGELOG.md").write_text(changed, encoding="utf-8")
    for package in ("chamberopt", "sim_core", "designs", "studies"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").touch()
    git(tmp_path, "init", "--quiet")
    for name, value in {"name": "nobody", "email": "nobody@localhost"}.items():
        git(tmp_path, "config", f"user.{name}", value)
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "--quiet", "--message", "All")
    return tmp_path


def git(folder: Path, *words: str) -> str:
    return subprocess.run(
        ["git", *words], cwd=folder, check=True, capture_output=True, text=True
    ).stdout.strip()


def test_a_release_is_made_by_one_command(make: Any, clone: Path) -> None:
    before = (clone / "CHANGELOG.md").read_text(encoding="utf-8").partition(make.UNRELEASED)[2]
    assert make.main(["9.0.0"], clone) == 0
    assert git(clone, "status", "--porcelain") == ""
    assert git(clone, "rev-list", "-n", "1", "v9.0.0") == git(clone, "rev-parse", "HEAD")
    text = (clone / "pyproject.toml").read_text(encoding="utf-8")
    assert tomllib.loads(text)["project"]["version"] == "9.0.0"
    for name in ("CITATION.cff", "release/recipe.yaml"):
        assert "9.0.0" in (clone / name).read_text(encoding="utf-8")
    after = (clone / "CHANGELOG.md").read_text(encoding="utf-8").partition("## 9.0.0 (")[2]
    assert after.partition("\n")[2] == before
    names = {one.name for one in (clone / "dist").iterdir()}
    assert names == {"chamberopt-9.0.0-py3-none-any.whl", "chamberopt-9.0.0.tar.gz"}


@pytest.mark.parametrize(
    ("version", "why"),
    [("9.0", "three numbers"), (PROJECT["version"], "must be larger than"), ("9.0.0", "committed")],
)
def test_what_cannot_be_released_changes_nothing(
    version: str, why: str, make: Any, clone: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if version == "9.0.0":
        (clone / "README.md").write_text("changed")
    before = git(clone, "diff")
    assert make.main([version], clone) == 2
    assert why in capsys.readouterr().err
    assert git(clone, "diff") == before


def test_a_build_that_fails_changes_nothing(
    make: Any, clone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(*_: object) -> list[Path]:
        raise subprocess.CalledProcessError(1, "build")

    monkeypatch.setattr(make, "_build", failing)
    assert make.main(["9.0.0"], clone) == 1
    assert git(clone, "status", "--porcelain") == "" == git(clone, "tag")


def test_the_citation_has_what_its_format_asks_for() -> None:
    citation = read_yaml("CITATION.cff")
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]
    assert citation["authors"] == PROJECT["authors"]
    assert citation["keywords"] == PROJECT["keywords"]


def test_the_recipe_has_the_dependencies_of_the_project() -> None:
    recipe = read_yaml("release/recipe.yaml")
    assert recipe["context"]["version"] == PROJECT["version"]
    assert f">={recipe['context']['python_min']}" == PROJECT["requires-python"]
    of_recipe = set()
    for one in recipe["requirements"]["run"][1:]:  # after Python
        name, _, limit = one.partition(" ")
        of_recipe.add(f"{CONDA_NAMES.get(name, name)}{limit}")
    assert of_recipe == set(PROJECT["dependencies"])


def test_the_image_runs_the_first_command_of_the_readme() -> None:
    image = (ROOT / "release/Dockerfile").read_text(encoding="utf-8")
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    command = next(line for line in readme.splitlines() if line.startswith("    python3 -m venv"))
    made, installed, run = command.strip().split(" && ")
    built = _line(image, "RUN python3").replace("--no-cache-dir ", "")
    assert built == f"RUN {made} && {installed}"
    assert _line(image, "CMD") == "CMD [" + ", ".join(f'"{one}"' for one in run.split()) + "]"


def _line(text: str, start: str) -> str:
    return next(line for line in text.splitlines() if line.startswith(start))


def test_the_workflow_takes_the_versions_of_python_that_are_named() -> None:
    matrix = read_yaml(".github/workflows/tests.yml")["jobs"]["systems"]["strategy"]["matrix"]
    label = "Programming Language :: Python :: "
    named = [one.removeprefix(label) for one in PROJECT["classifiers"] if one.startswith(label)]
    assert matrix["python"] == [one for one in named if "." in one]
    assert {one.partition("-")[0] for one in matrix["os"]} == {"ubuntu", "macos", "windows"}


def test_the_extra_all_has_all_that_users_want() -> None:
    extras = PROJECT["optional-dependencies"]
    (everything,) = extras["all"]
    named = set(everything.removeprefix("chamberopt[").removesuffix("]").split(","))
    assert named == set(extras) - {"all", "bench", "docs", "test"}
