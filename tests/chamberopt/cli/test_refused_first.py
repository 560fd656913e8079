"""What is wrong with a call is told before anything is computed, and leaves nothing behind."""

import shutil
import threading
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest

from chamberopt.cli import main
from chamberopt.common.executor import local_executor
from tests.helpers.results.short_plate import plate_result
from tests.hunt.base import write_base


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A design, a study, a result, a folder that holds a file."""
    folder = tmp_path_factory.mktemp("refused")
    write_base(folder)
    plate_result(folder / "result")
    (folder / "taken").mkdir()
    (folder / "taken" / "x").touch()
    measured = (
        'design = "design.toml"\n[[drop]]\nsurface = "wall"\nspeed_m_s = 3\nrestitution = 0.7'
    )
    (folder / "measured.toml").write_text(measured, encoding="utf-8")
    return folder


@pytest.fixture
def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    def work(*_: object, **__: object) -> None:
        raise AssertionError("work was begun")

    for module in ("export", "replay", "dents"):
        monkeypatch.setattr(f"chamberopt.cli.commands.{module}.compile_with_message", work)
    monkeypatch.setattr("chamberopt.cli.teller.compile_with_message", work)
    for module in ("workflows.simulate", "workflows.optimise", "chamber.build"):
        monkeypatch.setattr(f"chamberopt.{module}.build_chamber", work)
    monkeypatch.setattr("chamberopt.workflows.calibrate.prepare", work)
    monkeypatch.setattr("chamberopt.common.child.subprocess.Popen", work)
    monkeypatch.setattr("chamberopt.printers.report_page.report", work)


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("replay result f.gif --from-s 99", "--from-s: given 99"),
        ("replay result f.gif --span-ms 9999", "--span-ms: given 9999"),
        ("replay result f.gif --frames 1", "--frames: given 1"),
        ("dents result f.png --at-s 1e9", "--at-s: given 1e+09"),
        ("dents result nowhere/f.png", "the folder nowhere does not exist; make it first"),
        ("export result --to impacts-csv --to study-csv --out out", "history.jsonl: is not there"),
        ("export result --to impacts-csv --to fields-vtp --to tolerances-csv --out out",
         "this result is without tolerances"),
        ("inspect result --html nowhere/f.html", "the folder nowhere does not exist"),
        ("inspect result --html f.html --screenshot nowhere/f.png", "--screenshot nowhere/f.png"),
        ("inspect result --html f.html --out taken", "already holds files"),
        ("report result --out nowhere/f.html", "the folder nowhere does not exist"),
        ("calibrate measured.toml --out taken", "already holds files"),
    ],
)  # fmt: skip
def test_refused_before_any_work(
    command: str,
    message: str,
    place: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(place)
    before = sorted(place.rglob("*"))
    assert main(command.split()) == 2
    out, err = capsys.readouterr()
    assert message in err
    assert err.count("\n") == 1
    assert not out
    assert sorted(place.rglob("*")) == before


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(
    "command",
    [
        "check design.toml --screenshot f.png",
        "simulate design.toml",
        "accuracy design.toml --out out",
        "run study.toml",
        "sweep study.toml --grid 2",
        "strip design.toml",
        "calibrate measured.toml",
        "compare design.toml result",
        "report result",
        "inspect result --html f.html",
        "dents result f.png",
        "replay result f.gif",
        "export result --to chamber-stl",
        "export result --to impacts-csv --out f.csv",
    ],
)
def test_a_full_disk_is_told_first(
    command: str, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    usage = namedtuple("usage", "total used free")(10**9, 10**9 - 10**6, 10**6)
    monkeypatch.setattr("chamberopt.common.files.claimed.shutil.disk_usage", lambda _: usage)
    monkeypatch.chdir(place)
    before = sorted(place.rglob("*"))
    assert main(command.split()) == 2
    assert "only 1.0 MB of this disk are free, at least 20 are needed" in capsys.readouterr().err
    assert sorted(place.rglob("*")) == before


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(
    "command", ["dents without f.png", "export without --to impacts-csv --out out"]
)
def test_impacts_that_are_not_there_are_missed_first(
    command: str,
    place: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    shutil.copytree(place / "result", tmp_path / "without")
    (tmp_path / "without" / "hits.npz").unlink()
    monkeypatch.chdir(tmp_path)
    assert main(command.split()) == 2
    assert "hits.npz: not there" in capsys.readouterr().err


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("command", ["dents result f.png", "inspect result --screenshot f.png"])
def test_a_picture_that_cannot_be_drawn_is_told_first(
    command: str, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    where = "chamberopt.pictures.subprocess_drawing.missing_opengl"
    monkeypatch.setattr(where, lambda: "no OpenGL library found")
    monkeypatch.chdir(place)
    assert main(command.split()) == 2
    assert "f.png: cannot be drawn: no OpenGL library found" in capsys.readouterr().err


def test_what_several_formats_leave_out_is_said_once(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(place)
    formats = ["--to", "fields-abaqus", "--to", "fields-nastran"]
    assert main(["export", "result", *formats, "--out", "decks"]) == 0
    remarks = capsys.readouterr().err.splitlines()
    assert any(one.startswith("left out ") for one in remarks)
    assert len(set(remarks)) == len(remarks)
    shutil.rmtree("decks")


def test_ctrl_c_does_not_wait_for_what_runs() -> None:
    end = threading.Event()
    executor = local_executor(1)
    running, waiting = executor.submit(end.wait, 60), executor.submit(end.wait, 60)
    executor.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert not running.done()
    assert waiting.cancelled()
    end.set()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (("[1, 0]", "[90, 0]"), "part.offset_mm: given [90.0, 0.0]: the part ("),
        (("rotate_deg = [0, 0, 10]", "rotate_deg = [180, 0, 10]"),
         "check part.rotate_deg (which side faces the sonotrode); the middle of the part's box is "
         "on the chamber's axis unless part.offset_mm moves it"),
    ],
)  # fmt: skip
def test_a_part_that_misses_the_chamber_is_drawn(
    changed: tuple[str, str],
    message: str,
    place: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    drawn = []

    def draw(corners: np.ndarray, title: str, picture: Path, edges: np.ndarray) -> None:
        drawn.append((corners, edges))

    monkeypatch.setattr("chamberopt.pictures.part.draw_part", draw)
    monkeypatch.chdir(place)
    text = Path("design.toml").read_text(encoding="utf-8")
    text = text.replace("height_mm = 30", "height_mm = 14")  # only its lower end is in there
    Path("missed.toml").write_text(text.replace(*changed), encoding="utf-8")
    assert main(["check", "missed.toml"]) == 2
    first, note = capsys.readouterr().err.splitlines()
    assert message in first
    assert note == "to see it: chamberopt check FILE.toml --screenshot PICTURE.png"
    assert main(["check", "missed.toml", "--screenshot", "missed.png"]) == 2
    assert capsys.readouterr().err.splitlines() == ["picture in missed.png", first]
    ((_, edges),) = drawn
    assert np.unique(edges[..., 2].round(9)).tolist() == [0.0, 0.014]  # floor and ceiling
    assert np.hypot(*edges[..., :2].reshape(-1, 2).T) == pytest.approx(0.02)
