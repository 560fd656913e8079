"""Output folders that must be new or empty, and files that are written whole or not at all."""

import csv
import io
import os
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from chamberopt.common.errors import InputError

# A run that was killed may leave these in its folder: a file half written, and its lock (lock.py).
LEFTOVER_PREFIXES = (".writing-", ".lock")
# What reading a damaged .npz file can raise.
UNREADABLE_NPZ = OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, zlib.error


def is_new_or_empty(folder: Path) -> bool:
    """Whether results can be written to a folder: it does not exist, or holds nothing."""
    if not os.path.lexists(folder):
        return True
    is_folder = folder.is_dir()
    return is_folder and all(one.name.startswith(LEFTOVER_PREFIXES) for one in folder.iterdir())


def make_output_folder(path: str | Path) -> Path:
    """Make a folder for results; InputError if it holds files or cannot be written."""
    folder, remedy = Path(path), "choose another folder (out, or --out)"
    if os.path.lexists(folder) and not os.path.isdir(folder):
        raise InputError(f"{folder}: is a file; results need a folder: {remedy}")
    try:
        if not is_new_or_empty(folder):
            text = "already holds files, and results are never overwritten"
            raise InputError(f"{folder}: {text}: {remedy} or remove this one")
        folder.mkdir(parents=True, exist_ok=True)
        _require_writable(folder)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror}; {remedy}") from None
    return folder


def check_new_file(path: Path) -> Path:
    """Return the path of a new file; InputError if it exists or cannot be written."""
    if os.path.lexists(path):
        text = "already exists, and nothing is ever overwritten: choose another name or remove it"
        raise InputError(f"{path}: {text}")
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist; make it first")
    try:
        _require_writable(path.parent)
    except OSError as error:
        text = f"cannot be written: {error.strerror}; choose another place"
        raise InputError(f"{path}: {text}") from None
    return path


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path`, which replaces it when the block ends without an error.

    The file is on the disk before it gets its name, so that neither a crash nor a power cut leaves
    half a file. The temporary path has the same suffix.
    """
    temporary = path.with_name(f".writing-{path.name}")
    try:
        yield temporary
        _sync(temporary)
        os.replace(temporary, path)
        sync_folder(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file, whole or not at all."""
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """A table with a header and the columns of all rows together; what a row lacks stays empty."""
    text = io.StringIO()
    columns = dict.fromkeys(name for row in rows for name in row)
    table = csv.DictWriter(text, list(columns), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return text.getvalue()


def sync_folder(folder: Path) -> None:
    """Write a folder's names to the disk, so that they survive a power cut."""
    with suppress(OSError):  # Windows cannot open folders
        _sync(folder)


def _require_writable(folder: Path) -> None:
    """Raise OSError now rather than after an hour's work."""
    with tempfile.TemporaryFile(dir=folder):
        pass


def _sync(path: Path) -> None:
    file = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(file)
    finally:
        os.close(file)
