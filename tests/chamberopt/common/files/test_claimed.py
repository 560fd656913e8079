"""Claims of files and folders, also on Windows, which is simulated: locks, no folder descriptor."""

import errno
import os
import sys
import threading
from pathlib import Path

import pytest

from chamberopt.common.errors import OutputTakenError
from chamberopt.common.files import claimed, opened
from chamberopt.common.files.claimed import claim_file, claim_folder
from chamberopt.common.files.written import write_text


class WindowsLocks:
    """Stand-in for the module msvcrt: a byte of a file has one holder."""

    LK_NBLCK = 2

    def __init__(self) -> None:
        self.held: dict[tuple[int, int], int] = {}

    def locking(self, file: int, mode: int, count: int) -> None:
        place = os.fstat(file).st_ino, os.lseek(file, 0, os.SEEK_CUR)
        if place in self.held:
            raise PermissionError(errno.EACCES, "Permission denied")
        self.held[place] = file


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(claimed, "msvcrt", WindowsLocks(), raising=False)
    monkeypatch.setattr(claimed, "HELD", (errno.EACCES, errno.EDEADLK))
    monkeypatch.setattr(opened, "BY_DESCRIPTOR", False)
    monkeypatch.setattr(sys, "platform", "win32")


@pytest.mark.usefixtures("windows")
def test_a_folder_has_one_writer_on_windows(tmp_path: Path) -> None:
    folder = tmp_path / "results"
    with claim_folder(folder):
        write_text(folder / "one.txt", "whole")
        with pytest.raises(OutputTakenError, match="is being written by process"):
            claim_folder(folder, lambda _: True).__enter__()
    assert [one.name for one in folder.iterdir()] == ["one.txt"]


def test_a_writer_waits_until_the_other_ends(tmp_path: Path) -> None:
    path = tmp_path / "one.txt"
    other = claim_file(path)
    other.__enter__()
    with pytest.raises(OutputTakenError), claim_file(path):
        pass
    end = threading.Timer(0.1, other.__exit__, (None, None, None))
    end.start()
    with claim_file(path, wait=60.0):
        pass
    end.join()
