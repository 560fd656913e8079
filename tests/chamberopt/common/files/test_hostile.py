"""What a folder that came by mail may hold beside links: nothing of it reaches out, or hangs."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import chamberopt
from chamberopt.common.child import Child
from chamberopt.common.files import claim_file
from tests.chamberopt.common.files.scene import RUN
from tests.helpers import worker_jobs
from tests.helpers.results.digests import accept_changes, replace_result
from tests.hunt.command import Server, fault, fingerprint

RESUME = "run study.toml --workers 1 --out begun"
Change = Callable[[Path, Path], None]


def hard_link(name: str) -> Change:
    """A second name of a file outside, with the content of what was there."""

    def change(folder: Path, outside: Path) -> None:
        path, victim = folder / name, outside / "victim"
        victim.write_bytes(path.read_bytes() if path.exists() else b"not yours")
        path.unlink(missing_ok=True)
        path.hardlink_to(victim)

    return change


def torn(name: str) -> Change:
    """A log that was cut off, and is a second name of a file outside."""

    def change(folder: Path, outside: Path) -> None:
        (folder / name).write_bytes((folder / name).read_bytes()[:-9])
        hard_link(name)(folder, outside)

    return change


def pipe(name: str) -> Change:
    def change(folder: Path, outside: Path) -> None:
        (folder / name).unlink(missing_ok=True)
        os.mkfifo(folder / name)

    return change


def subfolder(name: str) -> Change:
    def change(folder: Path, outside: Path) -> None:
        (folder / name).unlink(missing_ok=True)
        (folder / name / "in it").mkdir(parents=True)

    return change


def linked(name: str) -> Change:
    """A folder outside, with what was in the one inside."""

    def change(folder: Path, outside: Path) -> None:
        if (folder / name).exists():
            shutil.copytree(folder / name, outside / "there")
            shutil.rmtree(folder / name)
        else:
            (outside / "there").mkdir()
        (folder / name).symlink_to(outside / "there")

    return change


def forged_table(folder: Path, outside: Path) -> None:
    """File names in result.json that lead outside."""
    (outside / "secret").write_text("of somebody else")
    file = folder / "given" / "result.json"
    values = json.loads(file.read_text())
    names = dict.fromkeys(("../../outside/secret", str(outside / "secret")), "0" * 64)
    replace_result(folder / "given", {**values, "files": {**values["files"], **names}})


class Planted:
    """Runs when it is unpickled."""

    def __reduce__(self) -> tuple[Callable[[str], None], tuple[str]]:
        return os.mkdir, ("../outside/planted",)


def pickled(name: str) -> Change:
    def change(folder: Path, outside: Path) -> None:
        pickle.dumps(Planted())
        np.savez(folder / name, first=np.array([Planted()], dtype=object))
        if "given" in name:
            accept_changes(folder / "given")

    return change


CASES: dict[str, tuple[Change, str, int]] = {
    "a second name of a report": (hard_link("given/report.html"), "report given", 0),
    "of a lock of a report": (hard_link("given/.lock-report.html"), "report given", 2),
    "of a lock of a study": (hard_link("begun/.lock"), RESUME, 2),
    "of a study's history": (hard_link("begun/history.jsonl"), RESUME, 0),
    "of a history that was cut off": (torn("begun/history.jsonl"), RESUME, 0),
    "of times that were cut off": (torn("begun/timings.jsonl"), RESUME, 0),
    "of a design of a study": (hard_link("begun/best.toml"), RESUME, 0),
    "a pipe for a result": (pipe("given/result.json"), "report given", 2),
    "a pipe for arrays": (pipe("given/arrays.npz"), "report given", 2),
    "a pipe for a page": (pipe("given/report.html"), "report given", 2),
    "a pipe for a lock": (pipe("given/.lock-report.html"), "report given", 2),
    "a pipe for a lock of a study": (pipe("begun/.lock"), RESUME, 2),
    "a pipe for a history": (pipe("begun/history.jsonl"), RESUME, 2),
    "a pipe for inputs": (pipe("begun/inputs.json"), RESUME, 2),
    "a pipe for a design": (pipe("design.toml"), "check design.toml", 2),
    "a folder for a result": (subfolder("given/result.json"), "report given", 2),
    "a folder for a page": (subfolder("given/report.html"), "report given", 2),
    "a folder for a lock": (subfolder("given/.lock-report.html"), "report given", 2),
    "a folder for a history": (subfolder("begun/history.jsonl"), RESUME, 2),
    "a folder for a design to write": (subfolder("begun/best.toml"), RESUME, 2),
    "a start elsewhere": (linked("study/start"), "report study", 2),
    "a start elsewhere to write to": (linked("begun/start"), RESUME, 2),
    "confirmations elsewhere": (linked("begun/confirm"), RESUME, 2),
    "results elsewhere": (linked("results"), "export given --to fields-vtp", 2),
    "a folder with a link alone": (linked("out/link"), f"{RUN[:-5]}out", 2),
    "names outside in result.json": (forged_table, "report given", 2),
    "a pickle of impacts": (pickled("given/hits.npz"), "export given --to impacts-csv", 2),
    "a pickle of a confirmation": (pickled("begun/confirm/002.npz"), RESUME, 2),
}


@pytest.mark.parametrize("case", CASES)
def test_it_stays_inside(case: str, server: Server, scene: Path, tmp_path: Path) -> None:
    change, words, status = CASES[case]
    folder, outside = tmp_path / "here", tmp_path / "outside"
    shutil.copytree(scene, folder)
    (folder / "out").mkdir()
    outside.mkdir()
    change(folder, outside)
    before = fingerprint(outside)
    ended = server.run(folder, words.split(), seconds=60)
    assert fault(ended) is None, ended
    assert ended.status == status, ended
    assert fingerprint(outside) == before
    assert "of somebody else" not in ended.output + ended.errors


def test_a_file_system_without_locks_keeps_no_lock_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import errno

    from chamberopt.common.errors import InputError
    from chamberopt.common.files import claim_folder, claimed

    def none(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(claimed.fcntl, "flock", none)
    for claim in (claim_folder(tmp_path / "a" / "b"), claim_file(tmp_path / "page.html")):
        with pytest.raises(InputError, match="No locks available; choose another"), claim:
            pass
    assert not list(tmp_path.iterdir())


def test_no_process_imports_what_lies_where_it_is_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "json.py").write_text("raise SystemExit('planted')")
    with Child() as child:
        child.ask(worker_jobs.square, 3)
        assert child.answer() == 9


def test_no_picture_heeds_settings_that_lie_where_it_is_drawn(tmp_path: Path) -> None:
    """With TeX, they could put any file on a picture."""
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\n")
    code = (
        "from chamberopt.pictures.charts.figure_style import new_figure; "
        "print(new_figure(1.0, 1.0).text(0.0, 0.0, 'x').get_usetex())"
    )
    drawn = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(chamberopt.__file__).parents[1])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert drawn.stdout == "False\n", drawn
