"""Records that take seconds to make, kept in the user's cache folder for the next command."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import TypeVar

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import make_folder, remove_file
from chamberopt.common.npz_files import load_record, save_record
from chamberopt.common.versions import sources_digest
from sim_core import user_cache

Record = TypeVar("Record")
MOST = 40  # records that are kept: each holds a few MB


def key_of(values: Iterable[object]) -> str:
    """A digest of arrays and other values, and of this program's sources."""
    digest = hashlib.sha256(sources_digest().encode())
    for value in values:
        if isinstance(value, np.ndarray):
            digest.update(f"{value.dtype} {value.shape}".encode())
            digest.update(np.ascontiguousarray(value).tobytes())
        else:
            digest.update(repr(value).encode())
    return digest.hexdigest()[:32]


def kept(
    kind: type[Record], others: Sequence[type], key: str, make: Callable[[], Record]
) -> Record:
    """The record of a key, made only if it is not kept yet.

    Args:
        kind: its class.
        others: classes of what it holds.
    """
    cache = user_cache()
    if cache is None:
        return make()
    folder = cache / "kept"
    with suppress(InputError):  # not there, or damaged: it is made again
        return load_record(folder / f"{key}.npz", kind, others, "")
    record = make()
    with suppress(InputError, OSError):  # such as a full disk: every command makes its own
        make_folder(folder)
        save_record(folder / f"{key}.npz", record)
        found = sorted(folder.glob("*.npz"), key=lambda path: path.stat().st_mtime)
        for path in found[:-MOST]:
            remove_file(path)
    return record
