"""One writer to a folder: a second process is told which process holds it."""

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
    """Hold the folder during a `with` block.

    The lock belongs to the operating system and ends with its process, however that ends, so no
    lock is left behind. A forked child would share it until both have ended; workers are spawned.
    InputError if another process holds the folder.
    """
    from filelock import FileLock, Timeout

    lock, holder = FileLock(folder / LOCK), folder / HOLDER
    try:
        lock.acquire(timeout=0)
    except Timeout:
        try:
            name = holder.read_text(encoding="utf-8")
        except (OSError, ValueError):
            name = "another process"
        remedy = "wait until it ends, or give another folder (--out)"
        raise InputError(f"{folder}: is being written by {name}; {remedy}") from None
    try:
        since = datetime.now().astimezone().isoformat(sep=" ", timespec="seconds")
        with suppress(OSError):  # a full disk is reported by the files that matter
            name = f"process {os.getpid()} on {platform.node()} since {since}"
            holder.write_text(name, encoding="utf-8")
        yield
    finally:
        with suppress(OSError):
            holder.unlink(missing_ok=True)
        lock.release()
