"""Without a clone: a built wheel holds the shipped examples, and its commands work with them."""

import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

from chamberopt.cli import main
from chamberopt.optimize.study import load_study

ROOT = Path(__file__).resolve().parents[3]
NAMES = ("gear", "plate", "blade")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, capture_output=True, check=True)
    (file,) = folder.glob("*.whl")
    return file


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
    tiny = study.read_text(encoding="utf-8").replace("evaluations = 20", "evaluations = 3")
    study.write_text(tiny.replace("confirm_replicas = 8", "confirm_replicas = 3"), encoding="utf-8")
    assert "usable design" in run("chamberopt", "check", "gear.toml", folder=gear)
    run("chamberopt", "run", "gear_study.toml", folder=gear)
    run("chamberopt", "report", "results/gear_study", folder=gear)
    assert (gear / "results/gear_study/report.html").is_file()
