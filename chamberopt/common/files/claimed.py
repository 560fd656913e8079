"""Claim output files and folders, so that each has one writer and overwrites nothing."""

from __future__ import annotations

import errno
import os
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path

from chamberopt.common.errors import InputError, OutputTakenError
from chamberopt.common.files.opened import OpenFolder, require_plain_content, require_plain_folder
from chamberopt.common.files.written import LOCK, is_leftover, remove_leftovers

if sys.platform == "win32":
    import msvcrt

    HELD = (errno.EACCES, errno.EDEADLK)  # error numbers of a lock that another process holds
else:
    import fcntl

    HELD = (errno.EWOULDBLOCK,)

ANOTHER_FOLDER = "choose another folder (out, or --out)"
# Bytes that must be free when a command begins to write. A result of a usual part takes a few MB,
# and on a disk that is nearly full other programs fail too.
LEAST_FREE = 20_000_000
LOCKED_BYTE = 1 << 30  # after the holder's name, because Windows lets nobody read a locked byte


def is_new_or_empty(folder: Path) -> bool:
    """Return True if a folder does not exist or holds nothing, so that it can take results.

    Files that a killed command left do not count.
    """
    if not os.path.lexists(folder):
        return True
    return not folder.is_symlink() and folder.is_dir() and all(map(is_leftover, folder.iterdir()))


def make_output_folder(path: str | Path) -> Path:
    """Make a folder for results, if it does not exist, and return its path.

    Raises:
        OutputTakenError: if it is a file or already holds files.
        InputError: if it is a link or cannot be written.
    """
    folder = Path(path)
    if os.path.lexists(folder) and not os.path.isdir(folder):
        what = "is a file" if os.path.exists(folder) else "is a link that leads nowhere"
        text = f"{what}; results need a folder"
        raise OutputTakenError(f"{folder}: {text}: {ANOTHER_FOLDER}")
    with _writing_in(folder, ANOTHER_FOLDER):
        folder.mkdir(parents=True, exist_ok=True)
        require_plain_folder(folder, "give the folder that it leads to")
        if not is_new_or_empty(folder):
            text = "already holds files, and results are never overwritten"
            raise OutputTakenError(f"{folder}: {text}: {ANOTHER_FOLDER} or remove this one")
        _require_writable(folder)
    return folder


@contextmanager
def claim_folder(
    path: str | Path, is_own: Callable[[Path], bool] = lambda folder: False
) -> Iterator[Path]:
    """Make a folder for results, and keep other processes from it during a `with` block.

    Folders that this function makes and that are empty at the end are removed.

    Args:
        is_own: tells if a folder that holds files may be used all the same.

    Raises:
        OutputTakenError: if the folder is a file, holds other files, or is held by another process.
        InputError: if the folder cannot be written, is a link, or holds a link.
    """
    folder = Path(path)
    made = [one for one in (folder, *folder.parents) if not os.path.lexists(one)]
    try:
        if not os.path.isdir(folder):
            make_output_folder(folder)
        require_plain_folder(folder, "give the folder that it leads to")
        with _only_writer(folder / LOCK, folder, ANOTHER_FOLDER):
            if is_own(folder):
                require_plain_content(folder)
            else:
                make_output_folder(folder)
                remove_leftovers(folder)
            yield folder
    finally:
        for one in made:
            with suppress(OSError):
                one.rmdir()


@contextmanager
def claim_file(path: Path, wait: float = 0.0) -> Iterator[Path]:
    """Keep other processes from writing an output file during a `with` block.

    Args:
        wait: longest time to wait for another writer [s].

    Raises:
        OutputTakenError: if another process writes the file.
        InputError: if its folder cannot be written.
    """
    with _only_writer(path.with_name(f"{LOCK}-{path.name}"), path, "choose another name", wait):
        yield path


@contextmanager
def _only_writer(lock_file: Path, output: Path, remedy: str, wait: float = 0.0) -> Iterator[None]:
    """Hold a lock file during a `with` block, so that no other process writes the same output.

    Raises InputError if the disk is nearly full, and OutputTakenError if another process still
    holds the lock after `wait` seconds. Messages name `output` and end with `remedy`.

    The operating system keeps the lock, and releases it when its process ends in any way. A forked
    child would share the lock until both have ended, so that workers are spawned and not forked.
    The lock file holds the name of the process.
    """
    name, until = lock_file.name, time.monotonic() + wait
    with _writing_in(output, remedy):
        _require_space(lock_file.parent)
        folder = OpenFolder(lock_file.parent)
    with folder:
        with _writing_in(output, remedy):
            while (lock := _locked(folder, name)) is None:
                if time.monotonic() >= until:
                    text = f"is being written by {_holder(folder, name)}; wait until it ends"
                    raise OutputTakenError(f"{output}: {text}, or {remedy}")
                time.sleep(0.01)
        try:
            since = datetime.now().astimezone().isoformat(sep=" ", timespec="seconds")
            with suppress(OSError):  # the important files report a full disk
                os.ftruncate(lock, 0)
                os.write(lock, f"process {os.getpid()} on {platform.node()} since {since}".encode())
            yield
        finally:
            # Removed before the release: a process that opened this file does not get its lock.
            with suppress(OSError):
                folder.remove(name)
            os.close(lock)
            if sys.platform == "win32":  # which removes no open file
                with suppress(OSError):
                    folder.remove(name)


def _locked(folder: OpenFolder, name: str) -> int | None:
    """Lock a file and return its descriptor; None if another process holds the lock.

    Raises InputError for a file with a second name (a hard link). The second name may lie anywhere,
    and the content there would be lost.
    """
    while True:
        file = folder.open(name, os.O_RDWR | os.O_CREAT)
        keep = False
        try:
            if os.fstat(file).st_nlink > 1:
                where = folder.path / name
                raise InputError(f"{where}: has a second name elsewhere; remove this one")
            _lock(file)
            # the previous holder may have removed the file since it was opened here
            there = folder.status(name)
            keep = there is not None and os.path.samestat(there, os.fstat(file))
            if keep:
                return file
        except OSError as error:
            if error.errno in HELD:
                return None
            # the file was made here, because a holder writes its name
            if os.fstat(file).st_size == 0:
                with suppress(OSError):  # Windows removes no open file
                    folder.remove(name)
            raise
        finally:
            if not keep:
                os.close(file)


def _lock(file: int) -> None:
    """Lock an open file for this process alone.

    Raises an OSError with an error number of HELD if another process has locked it.
    """
    if sys.platform == "win32":
        os.lseek(file, LOCKED_BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        finally:
            os.lseek(file, 0, os.SEEK_SET)
    else:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _holder(folder: OpenFolder, name: str) -> str:
    """Return the name of the process that holds a lock, as it wrote it into the lock file."""
    with suppress(OSError, InputError):
        file = folder.open(name, os.O_RDONLY)
        try:
            return os.read(file, 500).decode(errors="replace") or "another process"
        finally:
            os.close(file)
    return "another process"


@contextmanager
def _writing_in(place: Path | str, remedy: str) -> Iterator[None]:
    """Turn an OSError in the `with` block into an InputError: `place` cannot be written.

    The message ends with `remedy`.
    """
    try:
        yield
    except OSError as error:
        text = f"cannot be written: {error.strerror or error}; {remedy}"
        raise InputError(f"{place}: {text}") from None


def check_new_file(path: Path) -> Path:
    """Return `path` if a new file can be written there.

    Raises InputError if the file exists, or if its folder is missing or cannot be written.
    """
    if os.path.lexists(path):
        text = "already exists, and nothing is ever overwritten: choose another name or remove it"
        raise InputError(f"{path}: {text}")
    require_place(path)
    return path


def require_place(path: Path, option: str = "") -> None:
    """Raise InputError unless a file can be written at the path.

    Args:
        option: beginning of the message, such as the option that gave the path.
    """
    folder = path.parent
    if not folder.is_dir():
        text = f"the folder {path.parent} does not exist; make it first"
        raise InputError(f"{option}{path}: {text}")
    if path.is_symlink():
        text = "is a link, which is not followed here; give another name"
        raise InputError(f"{option}{path}: {text}")
    if path.is_dir():
        raise InputError(f"{option}{path}: is a folder; give another name")
    with _writing_in(f"{option}{path}", "choose another place"):
        _require_writable(folder)


def _require_writable(folder: Path) -> None:
    """Raise OSError if no file can be made in the folder, before long work begins in vain."""
    with tempfile.TemporaryFile(dir=folder):
        pass


def _require_space(folder: Path) -> None:
    """Raise OSError if the folder's disk has less than LEAST_FREE bytes free."""
    disk = shutil.disk_usage(folder)
    # some file systems do not tell: all their sizes are 0
    if disk.free < LEAST_FREE and disk.total:
        text = f"only {1e-6 * disk.free:.1f} MB of this disk are free"
        raise OSError(errno.ENOSPC, f"{text}, at least {1e-6 * LEAST_FREE:g} are needed")
