"""Writing without regret: a folder that was not in use, and files that appear whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from chamberopt.common.errors import InputError

# What a killed run may leave beside its files: a file half written, and the mark of who was writing (lock.py).
LEFTOVER_PREFIXES = (".writing-", ".lock")


def is_new_or_empty(folder: Path) -> bool:
    """Whether results can go there: it is not there, or a folder with nothing in it."""
    if not os.path.lexists(folder):
        return True
    return folder.is_dir() and all(
        file.name.startswith(LEFTOVER_PREFIXES) for file in folder.iterdir()
    )


def make_output_folder(path: str | Path) -> Path:
    """The folder, made if need be; InputError when something is in it: results are never overwritten."""
    folder = Path(path)
    if os.path.lexists(folder) and not os.path.isdir(folder):
        raise InputError(
            f"{folder}: is a file; results need a folder: choose another folder (out, or --out)"
        )
    try:
        if not is_new_or_empty(folder):
            raise InputError(
                f"{folder}: already holds files, and results are never overwritten: choose "
                "another folder (out, or --out) or remove this one"
            )
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):  # better now than after an hour's work
            pass
    except OSError as error:
        why = (
            f"{folder}: cannot be written: {error.strerror}; choose another folder (out, or --out)"
        )
        raise InputError(why) from None
    return folder


def check_new_file(path: Path) -> Path:
    """The path, where a file can be made in a folder that is there; InputError for one that is there: nothing is ever
    overwritten.
    """
    if os.path.lexists(path):
        raise InputError(
            f"{path}: is there already, and nothing is ever overwritten: choose another name or remove it"
        )
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist; make it first")
    try:
        with tempfile.TemporaryFile(dir=path.parent):  # better now than after an hour's work
            pass
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written: {error.strerror}; choose another place"
        ) from None
    return path


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """A temporary path beside `path`, with the same suffix, that takes its place when the block ends well.

    It is on the disk before it does, so that neither a crash nor a power cut leaves half a file.
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


def sync_folder(folder: Path) -> None:
    """Make the names in a folder outlast a power cut, where the system can."""
    with suppress(OSError):  # Windows opens no folders
        _sync(folder)


def _sync(path: Path) -> None:
    file = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(file)
    finally:
        os.close(file)
