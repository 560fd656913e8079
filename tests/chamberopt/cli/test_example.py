"""Without a clone: a built wheel holds the shipped examples, and its commands work with them."""

import os
import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

from chamberopt.cli import main
from chamberopt.search.study import load_study

ROOT = Path(__file__).resolve().parents[3]
NAMES = ("gear", "plate", "blade")


PLANTED = (
    "designs/.env", "designs/results/x/result.json", "designs/notes.txt", "designs/mine.toml",
    "designs/parts/mine.stl", "designs/__pycache__/a.pyc", "studies/results/x", "studies/mine.toml",
    "chamberopt/.env", "chamberopt/notes.txt", "chamberopt/results/x/result.json",
    "sim_core/.env", ".env", "results/x/result.json", "docs/notes.txt",
)  # fmt: skip


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel and the source archive of a checkout in which other files lie."""
    checkout, folder = tmp_path_factory.mktemp("checkout"), tmp_path_factory.mktemp("dist")
    for name in ("chamberopt", "sim_core", "designs", "studies"):
        shutil.copytree(ROOT / name, checkout / name)
    for one in ROOT.iterdir():
        if one.is_file():
            shutil.copy(one, checkout)
    for name in PLANTED:
        (checkout / name).parent.mkdir(parents=True, exist_ok=True)
        (checkout / name).write_text("secret")
    build = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    subprocess.run(build, cwd=checkout, capture_output=True, check=True)
    return folder


@pytest.fixture
def wheel(packed: Path) -> Path:
    (file,) = packed.glob("*.whl")
    return file


def test_nothing_that_lies_beside_the_files_is_packed(packed: Path, wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        held = {name.removeprefix("chamberopt/examples/") for name in archive.namelist()}
    (source,) = packed.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        held |= {name.partition("/")[2] for name in archive.getnames()}
    assert held.isdisjoint(PLANTED)
    assert not [name for name in held if "pycache" in name or name.endswith(".env")]
    # The list in pyproject.toml has all that are tracked, and no others.
    examples = {name for name in held if name.startswith(("designs/", "studies/"))}
    git = ["git", "ls-files", "designs", "studies"]
    tracked = subprocess.run(git, cwd=ROOT, capture_output=True, text=True, check=False).stdout
    if tracked:  # in a clone
        assert examples == set(tracked.split())


@pytest.mark.parametrize("name", NAMES)
def test_the_files_of_an_example_fit_together(name: str, tmp_path: Path) -> None:
    assert main(["example", name, "--out", str(tmp_path / "new")]) == 0
    study = load_study(tmp_path / f"new/{name}_study.toml")
    assert study.design.part.mesh_path.parent == tmp_path / "new/parts"


def test_an_example_overwrites_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["example", "plate"]) == 0
    assert "chamberopt check plate.toml" in capsys.readouterr().out
    assert main(["example", "plate"]) == 2
    assert "plate: already holds files" in capsys.readouterr().err


def test_the_wheel_holds_what_the_commands_need(wheel: Path, tmp_path: Path) -> None:
    """`example` from the wheel's content alone: nothing of the checkout is on the path."""
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "installed")
    installed = tmp_path / "installed"
    sources = {
        one.relative_to(ROOT)
        for package in ("chamberopt", "sim_core")
        for one in (ROOT / package).rglob("*")
        if one.is_file() and "__pycache__" not in one.parts
    }
    assert [one for one in sorted(sources) if not (installed / one).is_file()] == []
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    code = [sys.executable, "-m", "chamberopt", "example", "gear"]
    subprocess.run(code, cwd=tmp_path, env=environment, check=True)
    for shipped, written in {
        "designs/gear.toml": "gear.toml",
        "designs/parts/gear.stl": "parts/gear.stl",
    }.items():
        assert (tmp_path / "gear" / written).read_bytes() == (ROOT / shipped).read_bytes()


@pytest.mark.long
def test_a_fresh_environment_without_a_clone(wheel: Path, tmp_path: Path) -> None:
    """The wheel in an empty environment: example, check, run with a tiny budget, and report."""
    venv.create(tmp_path / "venv", with_pip=True)
    programs = tmp_path / "venv" / ("Scripts" if os.name == "nt" else "bin")
    environment = {name: text for name, text in os.environ.items() if name != "PYTHONPATH"}

    def run(program: str, *arguments: str, folder: Path = tmp_path) -> str:
        command = [str(programs / program), *arguments]
        said = subprocess.run(command, cwd=folder, env=environment, text=True, capture_output=True)
        assert said.returncode == 0, said.stderr
        return said.stdout

    run("pip", "install", "-q", str(wheel))
    assert "chamberopt run gear_study.toml" in run("chamberopt", "example", "gear")
    gear = tmp_path / "gear"
    study = gear / "gear_study.toml"
    tiny = study.read_text(encoding="utf-8").replace("evaluations = 14", "evaluations = 3")
    study.write_text(tiny.replace("confirm_replicas = 8", "confirm_replicas = 3"), encoding="utf-8")
    assert "usable design" in run("chamberopt", "check", "gear.toml", folder=gear)
    run("chamberopt", "run", "gear_study.toml", folder=gear)
    run("chamberopt", "report", "results/gear_study", folder=gear)
    assert (gear / "results/gear_study/report.html").is_file()
