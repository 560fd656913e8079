"""The process that commands on the tiny scene are forked from."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.chamberopt.common.files.scene import RUN, SIMULATE, write_scene
from tests.hunt.command import Server


@pytest.fixture(scope="session")
def server() -> Iterator[Server]:
    with Server() as one:
        one.warm_up("tests.chamberopt.common.files.scene:remember_all")
        yield one


@pytest.fixture(scope="session")
def scene(server: Server, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tiny scene with two results, a finished study and one that has only begun."""
    folder = tmp_path_factory.mktemp("scene")
    write_scene(folder)
    for words in (SIMULATE, "report result", "report result --sheet", RUN):
        assert server.run(folder, words.split()).status == 0
    (folder / "result").rename(folder / "given")
    shutil.copytree(folder / "given", folder / "given2")
    shutil.copytree(folder / "study", folder / "begun")
    (folder / "begun" / "result.json").unlink()
    return folder
