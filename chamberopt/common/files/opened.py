"""Open plain files and folders without following links that others made.

A folder that came from elsewhere may hold links to any file that its author chose. No such link is
followed. Links on the way to a folder, and links to files that a design names, are the user's own.
"""

from __future__ import annotations

import ctypes
import errno
import os
import stat
from contextlib import suppress
from io import BufferedReader
from pathlib import Path
from typing import Self

from chamberopt.common.errors import InputError

# A pipe would block its reader, and a link may lead anywhere. Windows has neither flag.
PLAIN = sum(
    getattr(os, name, 0)
    for name in ("O_NONBLOCK", "O_NOFOLLOW", "O_CLOEXEC", "O_BINARY", "O_NOINHERIT")
)
NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)
FOLDER = os.O_RDONLY | getattr(os, "O_DIRECTORY", 0)
BY_DESCRIPTOR = os.open in os.supports_dir_fd and bool(NO_FOLLOW)
SWAPS, SWAP = ("renameat2", "renameatx_np"), 2  # of Linux and macOS, which Python lacks
JUNCTION = 0xA0000003  # tag of a Windows folder that is a link to another folder
# files by which the program recognises its own folders
RESULT, INPUTS = "result.json", "inputs.json"


def open_plain(path: Path, follow: bool = False) -> BufferedReader:
    """Open a plain file for reading.

    Args:
        follow: True to follow links, which users may have among their own files.
    Raises:
        OSError: if the file does not exist or cannot be read.
        InputError: if the path is a link, a folder, a pipe or a device.
    """
    status = path.stat() if follow else path.lstat()
    require_plain(path, status)
    file = os.open(path, os.O_RDONLY | (PLAIN & ~NO_FOLLOW if follow else PLAIN))
    try:
        opened = os.fstat(file)
        require_plain(path, opened)
        if not (NO_FOLLOW or follow or os.path.samestat(status, opened)):
            raise InputError(f"{path}: was replaced while it was opened; try again")
        return open(file, "rb")
    except BaseException:
        os.close(file)
        raise


def read_file(path: Path, follow: bool = False) -> bytes:
    """Return the content of a plain file.

    Args:
        follow: True to follow links, which users may have among their own files.
    Raises:
        OSError: if the file does not exist or cannot be read.
        InputError: if the path is a link, a folder, a pipe or a device.
    """
    with open_plain(path, follow) as file:
        return file.read()


def require_plain(path: Path, status: os.stat_result) -> None:
    """Raise InputError, which names `path`, unless `status` is the status of a plain file."""
    if not stat.S_ISREG(status.st_mode):
        raise InputError(f"{path}: {_kind(status)}; put a plain file in its place, or remove it")


def require_plain_folder(path: Path, remedy: str = "put a plain folder in its place") -> Path:
    """Return `path` if it is a folder and no link.

    Raises InputError, which ends with `remedy`, for a link or a file, and OSError for a path that
    does not exist.
    """
    status = path.lstat()
    if is_link(status):
        where = os.path.realpath(path)
        raise InputError(f"{path}: is a link, which is not followed here; {remedy} ({where})")
    if not stat.S_ISDIR(status.st_mode):
        raise InputError(f"{path}: {_kind(status)}; {remedy}")
    return path


def require_plain_content(folder: Path) -> None:
    """Raise InputError unless a folder holds only plain files, and folders of plain files."""
    for one in sorted(folder.iterdir()):
        status = one.lstat()
        if stat.S_ISDIR(status.st_mode) and not is_link(status):
            for inner in sorted(one.iterdir()):
                require_plain(inner, inner.lstat())
        else:
            require_plain(one, status)


def is_link(status: os.stat_result) -> bool:
    return stat.S_ISLNK(status.st_mode) or getattr(status, "st_reparse_tag", 0) == JUNCTION


def is_of_the_program(folder: Path) -> bool:
    """Return True if the folder holds a result or a study, in which no link is followed."""
    return any(os.path.lexists(folder / name) for name in (RESULT, INPUTS))


def _kind(status: os.stat_result) -> str:
    if is_link(status):
        return "is a link, which is not followed here"
    return "is a folder" if stat.S_ISDIR(status.st_mode) else "is not a plain file"


class OpenFolder:
    """An opened folder, for work on the files in it, which follows no link in it.

    On systems with descriptors of folders, the object stays the same folder, even if another folder
    gets its path meanwhile.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = os.open(path, FOLDER) if BY_DESCRIPTOR else None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            os.close(self._file)

    def status(self, name: str) -> os.stat_result | None:
        """Return the status of the file with this name, or None if there is no such file.

        A link gives the status of the link itself, not of its target.
        """
        try:
            return os.stat(self._at(name), dir_fd=self._file, follow_symlinks=False)
        except FileNotFoundError:
            return None

    def open(self, name: str, flags: int) -> int:
        """Open a plain file and return its descriptor. Raises InputError for anything else.

        Args:
            flags: flags of os.open, such as os.O_RDONLY.
        """
        if (there := self.status(name)) is not None:
            require_plain(self.path / name, there)
        file = os.open(self._at(name), flags | PLAIN, 0o666, dir_fd=self._file)
        try:
            require_plain(self.path / name, os.fstat(file))
        except BaseException:
            os.close(file)
            raise
        return file

    def rename(self, name: str, new: str) -> None:
        """Give a file a new name, and replace any file that has the new name already."""
        at = {"src_dir_fd": self._file, "dst_dir_fd": self._file}
        os.replace(self._at(name), self._at(new), **at)

    def swap(self, name: str, other: str) -> bool:
        """Exchange the names of two files in one step.

        Returns False, with nothing changed, if the system cannot do that.
        """
        if self._file is None:
            return False
        library = ctypes.CDLL(None, use_errno=True)
        swap = next((getattr(library, one) for one in SWAPS if hasattr(library, one)), None)
        if swap is None:
            return False
        if swap(self._file, os.fsencode(name), self._file, os.fsencode(other), SWAP) == 0:
            return True
        error = ctypes.get_errno()
        if error in (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP):  # such as network drives
            return False
        raise OSError(error, os.strerror(error))

    def remove(self, name: str) -> None:
        """Remove the file with this name, if it exists. If it is a link, its target stays."""
        with suppress(FileNotFoundError):
            os.unlink(self._at(name), dir_fd=self._file)

    def make(self, name: str) -> None:
        os.mkdir(self._at(name), dir_fd=self._file)

    def sync(self) -> None:
        """Write the folder's list of names to the disk, so that it survives a power cut."""
        if self._file is not None:
            with suppress(OSError):  # some file systems cannot
                os.fsync(self._file)

    def _at(self, name: str) -> str | Path:
        return self.path / name if self._file is None else name
