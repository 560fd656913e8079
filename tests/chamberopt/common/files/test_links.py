"""A link at every name that a command opens leads nothing out of a folder, and nothing in."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import pytest

from tests.chamberopt.common.files.scene import SIMULATE
from tests.hunt.command import Server, fault, fingerprint

HERE = "tests.chamberopt.common.files"
COMMANDS = (
    "check design.toml --out out",
    "check study.toml --out out",
    SIMULATE.replace("result", "out"),
    "run study.toml --workers 1 --out study",
    "report given",
    "report study",
    "report given --out page.html",
    "report given --sheet",
    "inspect given --html page.html",
    "inspect given --screenshot view.png",
    "export given --to fields-vtp",
    "export given --to chamber-stl --to chamber-3mf --to tolerances-csv",
    "export given --to impacts-csv --workers 1 --out impacts.csv",
    "export given --to fields-abaqus --out deck.inp",
    "export study --to study-csv",
    "compare given given2 --out out",
    "example gear",
    "save",
)
SLOW = (
    "simulate design.toml --workers 1",
    "run study.toml --workers 1 --out begun",
    "new box.stl --unit mm --no-pilot --out out",
    "run study.toml --workers 1",
    "sweep study.toml --grid 2 --workers 1",
    "compare given design.toml --workers 1",
    "accuracy design.toml --budget-s 1",
)
OWN = ("box.stl", "design.toml", "study.toml")  # the user's own, which may be links
RANDOM = re.compile(r"\.writing-[0-9a-f]{16}|(^|/)tmp\w{8}$")
SECRET = "of somebody else"


def plant(folder: Path, name: str, outside: Path, leads_nowhere: bool) -> None:
    """Put a link at a name; it leads to a copy of what is there, or to nothing."""
    link, target = folder / name, outside / Path(name).name
    link.parent.mkdir(parents=True, exist_ok=True)
    if leads_nowhere:
        pass
    elif link.is_dir():
        shutil.copytree(link, target)
    elif link.is_file():
        shutil.copy(link, target)
    elif name.startswith("results") or Path(name).suffix == "":
        target.mkdir()
    else:
        target.write_text(SECRET)
    if link.is_dir():
        shutil.rmtree(link)
    link.unlink(missing_ok=True)
    link.symlink_to(os.path.relpath(target, link.parent))


@pytest.mark.parametrize(
    "words", [*COMMANDS, *(pytest.param(words, marks=pytest.mark.long) for words in SLOW)]
)
def test_of_every_name_of_a_command(
    words: str, server: Server, scene: Path, tmp_path: Path
) -> None:
    traced = tmp_path / "traced"
    shutil.copytree(scene, traced)
    outcome = server.run(traced, words.split(), within=f"{HERE}.shim:run_traced")
    lines = re.findall(r"(?m)^traced: (.) (.+)$", outcome.output)
    read = {name for how, name in lines if how == "r" and (scene / name).is_file()}
    # A folder that is given is given by the user, as a link or not.
    given = set(words.split()) - {*OWN, "out", "begun"}
    names = sorted({name for _, name in lines if not RANDOM.search(name)} - given)
    assert names, outcome
    for number, name in enumerate(names):
        folder, outside = tmp_path / "here", tmp_path / "outside"
        shutil.copytree(scene, folder)
        outside.mkdir()
        plant(folder, name, outside, leads_nowhere=number % 2 == 1 and name not in read)
        before = fingerprint(outside)
        ended = server.run(folder, words.split(), within=f"{HERE}.shim:run_drawing")
        told = f"{name}: {ended}"
        assert fault(ended) is None, told
        assert fingerprint(outside) == before, told
        if name in read and name not in OWN:
            assert ended.status == 2, told
            assert f"{name}: is a link" in ended.errors, told
        made = [one for one in folder.rglob("*") if one.is_file() and not one.is_symlink()]
        assert not any(SECRET.encode() in one.read_bytes() for one in made), told
        assert SECRET not in ended.output + ended.errors, told
        shutil.rmtree(folder)
        shutil.rmtree(outside)
