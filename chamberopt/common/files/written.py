"""Write files, whole or not at all, and make and remove files and folders."""

from __future__ import annotations

import csv
import io
import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from chamberopt.common.errors import InputError, spreadsheet_cell
from chamberopt.common.files.opened import OpenFolder, require_plain, require_plain_folder

LOCK, WRITING = ".lock", ".writing-"
LEFTOVER_PREFIXES = (LOCK, WRITING)  # prefixes of files that a killed command may leave


@contextmanager
def new_file(path: Path, look: Callable[[Path], None] | None = None) -> Iterator[BinaryIO]:
    """Open a temporary file, which replaces `path` when the block ends without an error.

    The file is on the disk before it gets its name, so that neither a crash nor a power cut leaves
    half a file. It has the permissions of the replaced file. Libraries that need a file name find
    the temporary file's in its attribute `name`. Others cannot foresee this name. It has the suffix
    of `path`.

    Args:
        look: called with the path of a file that holds the replaced content. If it raises an error,
            the replaced content stays in place.
    Raises:
        OSError: if the file cannot be written.
        InputError: if a link, a folder or another thing that is no plain file is at `path`.
    """
    temporary = f"{WRITING}{secrets.token_hex(8)}{path.suffix}"
    try:
        with OpenFolder(path.parent) as folder:
            before = folder.status(path.name)
            if before is not None:
                require_plain(path, before)
            opened = folder.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL)
            try:
                with open(str(path.with_name(temporary)), "w+b", opener=lambda *_: opened) as file:
                    yield file
                    file.flush()
                    if before is not None and hasattr(os, "fchmod"):
                        os.fchmod(opened, stat.S_IMODE(before.st_mode))
                    os.fsync(opened)
                    written = folder.status(temporary)
                    if written is None or not os.path.samestat(written, os.fstat(opened)):
                        raise OSError(f"{temporary} was replaced while it was written")
                _put_in_place(folder, temporary, path, look)
            except BaseException:
                with suppress(OSError):
                    folder.remove(temporary)
                raise
            folder.sync()
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def _put_in_place(
    folder: OpenFolder, temporary: str, path: Path, look: Callable[[Path], None] | None
) -> None:
    """Give a written file its final name, in place of the file that has it.

    `look` checks the replaced file. If it raises an error, the replaced file keeps its name.

    Args:
        temporary: name of the written file in `folder`.
        path: path with the final name.
    """
    if look is None or not folder.swap(temporary, path.name):
        if look is not None:
            look(path)
        folder.rename(temporary, path.name)
        return
    try:
        look(path.with_name(temporary))
    except BaseException:
        folder.swap(temporary, path.name)
        raise
    folder.remove(temporary)


def write_bytes(
    path: Path, content: bytes | memoryview, look: Callable[[Path], None] | None = None
) -> None:
    """Write a file, whole or not at all.

    Args:
        look: called with the path of a file that holds the replaced content. If it raises an error,
            the replaced content stays in place.
    """
    with new_file(path, look) as file:
        file.write(content)


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file, whole or not at all."""
    write_bytes(path, text.encode())


def write_new_texts(texts: Mapping[Path, str]) -> None:
    """Write text files that belong together and do not exist yet, all or none."""
    written = []
    try:
        for path, text in texts.items():
            write_text(path, text)
            written.append(path)
    except BaseException:
        with suppress(OSError):
            for path in written:
                remove_file(path)
        raise


def append_bytes(path: Path, content: bytes, survives_power_cut: bool = True) -> None:
    """Add all of `content`, or nothing, to the end of a file. Make the file if it does not exist.

    Args:
        survives_power_cut: True to wait until the content is on the disk.

    Raises:
        OSError: if the file cannot be written.
        InputError: if it is no plain file, or has a second name (a hard link), which may lie
            anywhere.
    """
    with OpenFolder(path.parent) as folder:
        is_new = folder.status(path.name) is None
        try:
            file = folder.open(path.name, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
            try:
                status = os.fstat(file)
                if status.st_nlink != 1:
                    text = "has a second name elsewhere; put a copy in its place"
                    raise InputError(f"{path}: {text}")
                try:
                    rest = memoryview(content)
                    while rest:
                        rest = rest[os.write(file, rest) :]
                    if survives_power_cut:
                        os.fsync(file)
                except OSError:
                    with suppress(OSError):
                        os.ftruncate(file, status.st_size)
                        if is_new:
                            folder.remove(path.name)
                    raise
            finally:
                os.close(file)
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(path)) from error
        if is_new and survives_power_cut:
            folder.sync()


def remove_file(path: Path) -> None:
    """Remove a file, if it exists. The target of a link stays."""
    with OpenFolder(path.parent) as folder:
        folder.remove(path.name)


def make_folder(path: Path) -> Path:
    """Make a folder if it does not exist, and return its path.

    Raises InputError if a link or a file is in its place.
    """
    with OpenFolder(path.parent) as parent, suppress(FileExistsError):
        parent.make(path.name)
    return require_plain_folder(path)


@contextmanager
def whole_or_nothing(folder: Path) -> Iterator[None]:
    """Empty a folder again if the `with` block that fills it fails.

    The folder must be new or empty before the block.
    """
    try:
        yield
    except BaseException:
        _empty(folder, lambda name: not name.startswith(LOCK))
        raise


def remove_leftovers(folder: Path) -> None:
    """Remove the temporary files of killed commands from a folder that this process has claimed."""
    _empty(folder, lambda name: name.startswith(WRITING))


def _empty(folder: Path, which: Callable[[str], bool]) -> None:
    """Remove the files and folders in a folder whose names `which` selects.

    What cannot be removed stays, without an error.
    """
    with suppress(OSError), os.scandir(folder) as there:
        for one in [one for one in there if which(one.name)]:
            with suppress(OSError):
                if one.is_dir(follow_symlinks=False):
                    shutil.rmtree(one.path, ignore_errors=True)
                else:
                    remove_file(Path(one.path))


def is_leftover(path: Path) -> bool:
    """Return True if this is a plain file with a name as killed commands leave behind."""
    return path.name.startswith(LEFTOVER_PREFIXES) and stat.S_ISREG(path.lstat().st_mode)


def private_folder() -> AbstractContextManager[str]:
    """Make a temporary folder that only this user can enter, for libraries that need a path."""
    return tempfile.TemporaryDirectory(prefix="chamberopt-")


def csv_text(rows: Sequence[Mapping[str, object]]) -> str:
    """Return a table as CSV text, with a header.

    The columns are all names that occur in any row. Values that a row lacks stay empty.
    """
    text = io.StringIO()
    columns = dict.fromkeys(name for row in rows for name in row)
    table = csv.DictWriter(text, list(columns), lineterminator="\n")
    table.writerow({name: spreadsheet_cell(name) for name in columns})
    table.writerows({key: spreadsheet_cell(value) for key, value in row.items()} for row in rows)
    return text.getvalue()
