"""One writer to a folder: a second process is told who the first one is."""

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path

from chamberopt.common.errors import InputError

LOCK = ".lock"
HOLDER = ".lock-holder"


@contextmanager
def only_writer(folder: Path) -> Iterator[None]:
    """Holds the folder for the time of a `with` block. Raises InputError when another process does.

    The lock is the operating system's and ends with its process, however that ends: nothing is left to clear away.
    (A forked child shares it until both have ended: workers are spawned.)
    """
    from filelock import FileLock, Timeout

    lock, holder = FileLock(folder / LOCK), folder / HOLDER
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise InputError(
            f"{folder}: {_said(holder)}; wait until it ends, or give another folder (--out)"
        ) from None
    try:
        since = datetime.now().astimezone().isoformat(sep=" ", timespec="seconds")
        with suppress(OSError):  # a full disk is said by what needs it more
            holder.write_text(
                f"process {os.getpid()} on {platform.node()} since {since}", encoding="utf-8"
            )
        yield
    finally:
        with suppress(OSError):
            holder.unlink(missing_ok=True)
        lock.release()


def _said(holder: Path) -> str:
    try:
        return f"is being written by {holder.read_text(encoding='utf-8')}"
    except (OSError, ValueError):
        return "is being written by another process"
