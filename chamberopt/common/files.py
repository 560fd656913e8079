"""Outputs have one writer each, overwrite nothing, and are written whole or not at all."""

import csv
import errno
import io
import os
import platform
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from chamberopt.common.errors import InputError, OutputTakenError, spreadsheet_cell

LOCK, WRITING = ".lock", ".writing-"
LEFTOVER_PREFIXES = (LOCK, WRITING)  # of files that a command that was killed may leave
ANOTHER_FOLDER = "choose another folder (out, or --out)"
# Bytes that must be free where a command begins to write: a result of a usual part takes a few MB,
# and on a disk that is nearly full other programs fail too.
LEAST_FREE = 20_000_000


def is_new_or_empty(folder: Path) -> bool:
    """Whether results can be written to a folder: it does not exist, or holds nothing."""
    if not os.path.lexists(folder):
        return True
    is_folder = folder.is_dir()
    return is_folder and all(one.name.startswith(LEFTOVER_PREFIXES) for one in folder.iterdir())


def make_output_folder(path: str | Path) -> Path:
    """Make a folder for results; InputError if it holds files or cannot be written."""
    folder = Path(path)
    if os.path.lexists(folder) and not os.path.isdir(folder):
        what = "is a file" if os.path.exists(folder) else "is a link that leads nowhere"
        text = f"{what}; results need a folder"
        raise OutputTakenError(f"{folder}: {text}: {ANOTHER_FOLDER}")
    with _writing_in(folder, ANOTHER_FOLDER):
        if not is_new_or_empty(folder):
            text = "already holds files, and results are never overwritten"
            raise OutputTakenError(f"{folder}: {text}: {ANOTHER_FOLDER} or remove this one")
        folder.mkdir(parents=True, exist_ok=True)
        _require_writable(folder)
    return folder


@contextmanager
def claim_folder(
    path: str | Path, is_own: Callable[[Path], bool] = lambda folder: False
) -> Iterator[Path]:
    """Make a folder for results and hold it against other processes during a `with` block.

    Folders that are made here and are empty at the end are removed.

    Args:
        is_own: whether a folder that holds files may be used all the same.

    Raises:
        OutputTakenError: the folder is a file, holds other files, or another process has it.
        InputError: it cannot be written.
    """
    import filelock  # noqa: F401  # here: Ctrl-C ends an import at once, and nothing is made yet

    folder = Path(path)
    made = [one for one in (folder, *folder.parents) if not os.path.lexists(one)]
    if not os.path.isdir(folder):
        make_output_folder(folder)
    try:
        with _only_writer(folder / LOCK, folder, ANOTHER_FOLDER):
            if not is_own(folder):
                make_output_folder(folder)
            yield folder
    finally:
        with suppress(OSError):
            for one in made:
                one.rmdir()


@contextmanager
def claim_file(path: Path) -> Iterator[Path]:
    """Hold a file that is to be written against other processes; errors as claim_folder."""
    with _only_writer(path.with_name(f"{LOCK}-{path.name}"), path, "choose another name"):
        yield path


@contextmanager
def _only_writer(lock_file: Path, output: Path, remedy: str) -> Iterator[None]:
    """Hold the lock of an output for which there is room.

    The lock belongs to the operating system and ends with its process, however that ends. A forked
    child would share it until both have ended; workers are spawned.
    """
    from filelock import FileLock, Timeout

    lock, holder = FileLock(lock_file), lock_file.with_name(f"{lock_file.name}-holder")
    with _writing_in(output, remedy):
        _require_space(lock_file.parent)
        try:
            lock.acquire(timeout=0)
        except Timeout:
            try:
                name = holder.read_text(encoding="utf-8")
            except (OSError, ValueError):
                name = "another process"
            text = f"is being written by {name}; wait until it ends, or {remedy}"
            raise OutputTakenError(f"{output}: {text}") from None
    try:
        since = datetime.now().astimezone().isoformat(sep=" ", timespec="seconds")
        with suppress(OSError):  # a full disk is reported by the files that matter
            name = f"process {os.getpid()} on {platform.node()} since {since}"
            holder.write_text(name, encoding="utf-8")
        yield
    finally:
        # Before the release: who opened the file that is removed here does not get its lock.
        for one in (holder, lock_file):
            with suppress(OSError):
                one.unlink(missing_ok=True)
        lock.release()


@contextmanager
def _writing_in(place: Path | str, remedy: str) -> Iterator[None]:
    """Turn an error of the operating system into an InputError."""
    try:
        yield
    except OSError as error:
        text = f"cannot be written: {error.strerror or error}; {remedy}"
        raise InputError(f"{place}: {text}") from None


def check_new_file(path: Path) -> Path:
    """Return the path of a new file; InputError if it exists or cannot be written."""
    if os.path.lexists(path):
        text = "already exists, and nothing is ever overwritten: choose another name or remove it"
        raise InputError(f"{path}: {text}")
    require_place(path)
    return path


def require_place(path: Path, option: str = "") -> None:
    """Raise InputError, which begins with the option, unless a file can be written there."""
    folder = path.resolve().parent
    if not folder.is_dir():
        text = f"the folder {path.parent} does not exist; make it first"
        raise InputError(f"{option}{path}: {text}")
    if path.is_dir():
        raise InputError(f"{option}{path}: is a folder; give another name")
    with _writing_in(f"{option}{path}", "choose another place"):
        _require_writable(folder)


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path`, which replaces it when the block ends without an error.

    The file is on the disk before it gets its name, so that neither a crash nor a power cut leaves
    half a file. The temporary path has the same suffix.
    """
    temporary = path.with_name(f"{WRITING}{path.name}")
    try:
        yield temporary
        _sync(temporary)
        os.replace(temporary, path)
        sync_folder(path.parent)
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
    finally:
        temporary.unlink(missing_ok=True)


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file, whole or not at all."""
    with atomic_write(path) as temporary:
        temporary.write_bytes(content)


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file, whole or not at all."""
    write_bytes(path, text.encode())


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """A table with a header and the columns of all rows together; what a row lacks stays empty."""
    text = io.StringIO()
    columns = dict.fromkeys(name for row in rows for name in row)
    table = csv.DictWriter(text, list(columns), lineterminator="\n")
    table.writerow({name: spreadsheet_cell(name) for name in columns})
    table.writerows({key: spreadsheet_cell(value) for key, value in row.items()} for row in rows)
    return text.getvalue()


def sync_folder(folder: Path) -> None:
    """Write a folder's names to the disk, so that they survive a power cut."""
    with suppress(OSError):  # Windows cannot open folders
        _sync(folder)


def _require_writable(folder: Path) -> None:
    """Raise OSError now rather than after an hour's work."""
    with tempfile.TemporaryFile(dir=folder):
        pass


def _require_space(folder: Path) -> None:
    """Raise OSError where results will hardly find room."""
    disk = shutil.disk_usage(folder)
    if disk.free < LEAST_FREE and disk.total:  # some file systems do not tell: all is 0
        text = f"only {1e-6 * disk.free:.1f} MB of this disk are free"
        raise OSError(errno.ENOSPC, f"{text}, at least {1e-6 * LEAST_FREE:g} are needed")


def _sync(path: Path) -> None:
    file = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(file)
    finally:
        os.close(file)
