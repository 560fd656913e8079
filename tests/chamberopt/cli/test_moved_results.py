"""A results folder is whole: sent elsewhere without its project, every command gives the same.

And it is data: no command that looks at it runs a file that it names.
"""

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

import pytest

from chamberopt.cli import main
from chamberopt.results.records import FORMAT
from chamberopt.workflows import comparison_folder, save_run
from tests.helpers.opengl import needs_opengl
from tests.helpers.results.digests import replace_result
from tests.helpers.results.report_folders import studied
from tests.helpers.synthetic import DESIGNS

CHAMBER = 'shape = "own.py"\nlength_mm = 54\nwidth_mm = 48'
SHORT = "replicas = 3\nsimulated_time_s = 0.2\nwarmup_time_s = 0.05"
EXPORTS = (
    "impacts-csv", "fields-vtp", "fields-abaqus", "fields-nastran", "chamber-stl",
    "chamber-stl-per-tag", "chamber-3mf",
)  # fmt: skip
HOSTILE = "import pathlib\npathlib.Path(__file__).with_name('executed').touch()\n"


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two results of a design with a shape of the user's own, of which both files lie beside it."""
    folder = tmp_path_factory.mktemp("moved") / "project"
    folder.mkdir()
    shutil.copy(DESIGNS / "parts" / "plate.stl", folder)
    shutil.copy(DESIGNS / "shapes" / "oblong.py", folder / "own.py")
    text = (DESIGNS / "plate.toml").read_text(encoding="utf-8")
    text = text.replace("parts/plate.stl", "plate.stl")
    text = text.replace('shape = "cylinder"\ndiameter_mm = 50', CHAMBER)
    text = text.replace("replicas = 8\nsimulated_time_s = 4.0\nwarmup_time_s = 0.2", SHORT)
    text = text.replace("[0, 10]", "[0, 10]\nelement_mm = 2.0")
    assert "own.py" in text
    assert SHORT in text
    for seed in (1, 2):
        design = folder / f"{seed}.toml"
        design.write_text(text.replace("seed = 1", f"seed = {seed}"), encoding="utf-8")
        out = folder / "results" / f"{seed}"
        run("simulate", design, "--no-ranges", "--workers", "1", "--out", out)
    return folder


def run(*arguments: object) -> None:
    assert main([str(one) for one in arguments]) == 0


def looked_at(
    results: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> tuple[dict[str, bytes], dict[str, str]]:
    """What each command that looks at the results writes, and what it prints."""
    out.mkdir()
    one, other = results / "1", results / "2"
    printed = {}

    def look(command: str, *arguments: object) -> None:
        run(command, *arguments)
        said = capsys.readouterr().out
        printed[command] = said.replace(str(out), "OUT").replace(str(results), "RESULTS")

    exports = [word for name in EXPORTS for word in ("--to", name)]
    look("export", one, *exports, "--workers", "1", "--out", out / "export")
    look("compare", one, other, "--json", "--out", out / "compare")
    look("inspect", one, "--json", "--off-screen", "--out", out / "inspect")
    look("dents", one, out / "dents.png", "--at-s", "0.1", "--pixels", "200")
    look("replay", one, out / "film.gif", "--frames", "2", "--span-ms", "2")
    look("report", one, "--out", out / "report.html")
    again = ("--treatment-time-s", "6", "--workers", "1")
    with (
        patch.object(comparison_folder, "draw_coverage", lambda *_: None),
        patch.object(comparison_folder, "draw_difference", lambda *_: None),
        patch.object(save_run, "draw_coverage", lambda *_: None),
    ):
        look("compare", one, other, *again, "--out", out / "again")
    return {
        str(path.relative_to(out)): path.read_bytes()
        for path in sorted(out.rglob("*"))
        if path.is_file() and path.suffix not in (".png", ".json", ".html")
        if path.name != "design.toml"  # names its part relative to itself
    }, printed


@pytest.mark.long
@needs_opengl
def test_a_folder_sent_elsewhere_gives_the_same(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = looked_at(project / "results", tmp_path / "before", capsys)
    archive = shutil.make_archive(str(tmp_path / "sent"), "zip", project / "results")
    there = tmp_path / "another" / "machine"
    shutil.unpack_archive(archive, there / "results")
    (there / "own.py").write_text(HOSTILE, encoding="utf-8")  # where result.json says it is
    (there / "plate.stl").write_bytes(b"another part")
    hidden = project.rename(project.with_name("gone"))
    try:
        after = looked_at(there / "results", tmp_path / "after", capsys)
    finally:
        hidden.rename(project)
    assert set(before[0]) == set(after[0])
    assert len(before[0]) > 20
    assert [name for name in before[0] if before[0][name] != after[0][name]] == []
    assert before[1] == after[1]
    assert not (there / "executed").exists()


@pytest.mark.long
@needs_opengl
def test_a_study_sent_elsewhere_is_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    studied(tmp_path / "study", evaluations=4)
    (tmp_path / "study").rename(tmp_path / "moved")
    best, start = tmp_path / "moved", tmp_path / "moved" / "start"
    run("report", best)
    run("compare", start, best, "--out", tmp_path / "compare")
    for folder, name in ((best, "best"), (start, "start")):
        run("export", folder, "--to", "fields-abaqus", "--out", tmp_path / f"{name}.inp")
    run("export", best, "--to", "study-csv", "--out", tmp_path / "study.csv")
    lengthened(best / "history.jsonl")
    for command in (["report", best], ["export", best, "--to", "study-csv"]):
        assert main([str(one) for one in command]) == 2
        assert "history.jsonl: not the file that was written" in capsys.readouterr().err
    capsys.readouterr()
    shutil.rmtree(start)
    assert main(["report", str(best)]) == 2
    assert f"{start}: not there, and a study has it" in capsys.readouterr().err


def commands(folder: Path, out: Path) -> list[list[object]]:
    """Every command that looks at a result."""
    return [
        ["report", folder, "--out", out / "report.html"],
        *(["export", folder, "--to", name, "--out", out / name] for name in EXPORTS),
        ["inspect", folder, "--off-screen", "--out", out / "inspect"],
        ["compare", folder, folder.with_name("other"), "--out", out / "compare"],
        ["dents", folder, out / "dents.png"],
        ["replay", folder, out / "film.gif"],
    ]


@pytest.fixture
def copied(project: Path, tmp_path: Path) -> Path:
    for name, number in (("one", "1"), ("other", "2")):
        shutil.copytree(project / "results" / number, tmp_path / "results" / name)
    return tmp_path / "results" / "one"


@pytest.mark.parametrize("shape", ["own.py", "/absolute/own.py"])
def test_a_shape_that_a_result_names_is_never_run(
    copied: Path, tmp_path: Path, shape: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    watched = [True]

    def watch(event: str, arguments: tuple) -> None:
        if watched and event == "open" and str(arguments[0]).endswith("own.py"):
            opened.append(str(arguments[0]))

    own = copied.parent / "own.py"
    for path in (own, copied / "own.py", tmp_path / "own.py"):
        path.write_text(HOSTILE, encoding="utf-8")
    data = json.loads((copied / "result.json").read_text(encoding="utf-8"))
    data["design"]["chamber"]["shape"] = shape.replace("/absolute", str(copied.parent))
    replace_result(copied, data)
    monkeypatch.chdir(copied.parent)
    sys.addaudithook(watch)
    try:
        (tmp_path / "out").mkdir()
        for command in commands(copied, tmp_path / "out")[:8]:  # pictures are drawn from the rest
            run(*command)
    finally:
        watched.clear()
    assert opened == []
    assert not list(tmp_path.rglob("executed"))


def lengthened(path: Path) -> None:
    path.write_bytes(path.read_bytes() + b"\n")


# Each data file, and commands that use it, by their places in `commands`.
USERS = {"arrays.npz": tuple(range(12)), "hits.npz": (1, 9, 10, 11), "design.toml": (0,)}


@pytest.mark.parametrize(("name", "used_by"), USERS.items())
@pytest.mark.parametrize(
    ("alter", "said"),
    [
        (lengthened, "not the file that was written with result.json: its sha256 is"),
        (Path.unlink, "not there, result.json names it"),
    ],
)
def test_a_changed_or_missing_file_is_named(
    copied: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    name: str, used_by: tuple[int, ...], alter: Callable[[Path], None], said: str,
) -> None:  # fmt: skip
    alter(copied / name)
    out = tmp_path / "out"
    out.mkdir()
    for number in used_by:
        assert main([str(one) for one in commands(copied, out)[number]]) == 2, number
        error = capsys.readouterr().err.strip().splitlines()[-1]
        assert f"{copied / name}: {said}" in error
        assert "restore the folder" in error
        assert not any(path.is_file() for path in out.rglob("*"))


@pytest.mark.parametrize("found", [2, FORMAT - 1, FORMAT + 1, str(FORMAT), None])
def test_a_result_of_another_version_is_refused(
    copied: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], found: object
) -> None:
    file = copied / "result.json"
    data = json.loads(file.read_text(encoding="utf-8"))
    data |= {"format": found, "versions": {"chamberopt": "7.1"}}
    file.write_text(json.dumps(data), encoding="utf-8")
    for command in commands(copied, tmp_path):
        assert main([str(one) for one in command]) == 2
        error = capsys.readouterr().err.strip().splitlines()[-1]
        assert f"{file}: in format {found!r}, expected {FORMAT}: written by chamberopt 7.1" in error
