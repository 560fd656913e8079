"""Checked files of compiled code, which processes make one at a time.

A damaged file would run as it is, or end in a traceback each time, because numba does not check its
files. Two processes that compile the same would do the work twice, and two that save code of one
function at once could save it under each other's name.
"""

import io
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import BinaryIO

from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    UserProvidedCacheLocator,
)

DIGEST_BYTES = 32
MAX_WAIT_S = 60.0  # for a process that compiles the same; it may have been stopped


class _InChosenFolder(CompileResultCacheImpl):
    """Cache whose files are only in the folder that jit.py sets.

    Code in numba's other folders would outlive edits of the sources.
    """

    _locator_classes = [UserProvidedCacheLocator]  # noqa: RUF012


class _CheckedFiles(IndexDataCacheFile):
    """The files of one function's compiled code, each with the digest of its content at its end."""

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[io.BytesIO]:
        content = io.BytesIO()
        yield content
        with super()._open_for_write(filepath) as file:
            file.write(content.getvalue() + sha256(content.getvalue()).digest())

    def _load_index(self) -> dict[object, str]:
        return super()._load_index() if _is_whole(Path(self._index_path)) else {}

    def _load_data(self, name: str) -> object:
        path = self._data_path(name)
        if not _is_whole(Path(path)):
            raise FileNotFoundError(path)  # numba compiles anew
        return super()._load_data(name)


class CheckedCache(FunctionCache):
    """The compiled variants of one function on disk, which are checked for damage on reading."""

    _impl_class = _InChosenFolder

    def __init__(self, function: object) -> None:
        super().__init__(function)
        self._cache_file.__class__ = _CheckedFiles

    def load_overload(self, sig: object, target_context: object) -> object:
        """Load compiled code. While another process compiles it, wait."""
        found = super().load_overload(sig, target_context)
        if found is None:  # until it is saved, others wait
            self._lock(sig)
            found = super().load_overload(sig, target_context)
            if found is not None:
                self._unlock(sig)
        return found

    def save_overload(self, sig: object, data: object) -> None:
        self._lock()
        with suppress(OSError):  # such as a full disk: every process compiles for itself
            super().save_overload(sig, data)
        self._unlock()
        self._unlock(sig)

    def _lock(self, sig: object = None) -> None:
        """Lock the code of a signature, or without one the index of the function's code.

        After MAX_WAIT_S the process goes on without the lock. On Windows there are no locks:
        processes that start together compile the same twice.
        """
        if sys.platform == "win32":
            return
        import fcntl

        file, until = _lock_file(self._cache_file._cache_path), time.monotonic() + MAX_WAIT_S
        while file is not None and time.monotonic() < until:
            try:
                fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, self._byte(sig))
            except (BlockingIOError, PermissionError):  # another process has it
                time.sleep(0.02)
            except OSError:  # such as a file system without locks
                return
            else:
                return

    def _unlock(self, sig: object = None) -> None:
        if sys.platform == "win32":
            return
        import fcntl

        file = _lock_file(self._cache_file._cache_path)
        if file is not None:
            with suppress(OSError):
                fcntl.lockf(file, fcntl.LOCK_UN, 1, self._byte(sig))

    def _byte(self, sig: object) -> int:
        """Place in the file of locks that belongs to the function and the signature."""
        name = f"{self._cache_file._index_path} {sig}"
        return int.from_bytes(sha256(name.encode()).digest()[:7], "big")


@cache
def _lock_file(folder: str) -> BinaryIO | None:
    """Open the empty file whose bytes are locked. None in a removed folder."""
    try:
        return open(Path(folder, "locks"), "ab")
    except OSError:
        return None


def is_private(folder: Path) -> bool:
    """Return True if no other user can put files, whose code would be run, into the folder."""
    if not hasattr(os, "getuid"):
        return True
    found = folder.lstat()
    return found.st_uid == os.getuid() and not found.st_mode & 0o022


def _is_whole(path: Path) -> bool:
    """Return True if a file exists and matches the digest at its end. Remove a damaged file."""
    try:
        content = path.read_bytes()
    except OSError:
        return False
    if sha256(content[:-DIGEST_BYTES]).digest() == content[-DIGEST_BYTES:]:
        return True
    _report_damage(path.parents[2])  # folder of steps and entries alike
    with suppress(OSError):
        path.unlink()
    return False


@cache
def _report_damage(folder: Path) -> None:
    print(f"{folder}: compiled code is damaged; it is compiled anew", file=sys.stderr, flush=True)
