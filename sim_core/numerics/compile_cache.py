"""Checked files of compiled code.

A damaged file would run as it is, or end in a traceback each time, because numba does not check its
files.
"""

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from pathlib import Path

from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    UserProvidedCacheLocator,
)

DIGEST_BYTES = 32


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

    def save_overload(self, sig: object, data: object) -> None:
        with suppress(OSError):  # such as a full disk: every process compiles for itself
            super().save_overload(sig, data)


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
