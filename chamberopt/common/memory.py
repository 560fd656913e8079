"""Tell how much memory is free, take less of it, and account for arrays kept only for speed."""

from __future__ import annotations

import ctypes
import math
import os
import sys
import threading
import weakref
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

# share of the free memory that is taken; the rest is for other programs and surprises
OF_FREE = 0.5
# Files with limit and use of a container or a batch job, by the version of the kernel's groups.
GROUPS = Path("/sys/fs/cgroup")
FILES = {
    "": ("memory.max", "memory.current"),
    "memory": ("memory.limit_in_bytes", "memory.usage_in_bytes"),
}
M_ARENA_MAX, HEAPS = -8, 2  # parameter of the GNU C library's mallopt(3), and its value


def keep_few_heaps() -> bool:
    """Let all threads of this process allocate from HEAPS heaps; return whether they will.

    The GNU C library gives each thread its own, and what a thread freed there the others cannot
    use: a study of 8 calibrated gears took 1.7 to 1.9 GB, and takes 1.3. Other C libraries have no
    such setting, and MALLOC_ARENA_MAX is the user's.
    """
    if sys.platform != "linux" or "MALLOC_ARENA_MAX" in os.environ:
        return False
    with suppress(AttributeError, OSError):
        return bool(ctypes.CDLL(None).mallopt(M_ARENA_MAX, HEAPS))
    return False


def free_memory() -> float:
    """Return the bytes of memory that this process can still take.

    Limits of a container or a batch job count. The result is infinite if the computer does not
    tell.
    """
    return min(_free_of_machine(), *_free_of_groups(), math.inf)


def _free_of_machine() -> float:
    """Return the free memory of the computer in bytes.

    It is the whole memory on macOS, and infinity on Windows, because these systems do not tell.
    """
    with suppress(OSError, LookupError, ValueError):
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024.0 * int(line.split()[1])
    # macOS has no such file and tells only its total memory. Windows tells neither.
    if sys.platform == "win32":
        return math.inf
    with suppress(OSError, ValueError):
        pages = os.sysconf("SC_PHYS_PAGES")
        return float(pages * os.sysconf("SC_PAGE_SIZE"))
    return math.inf


def _free_of_groups() -> Iterator[float]:
    """Yield the bytes left of each memory limit of the Linux control groups of this process."""
    with suppress(OSError, ValueError):
        for line in Path("/proc/self/cgroup").read_text().splitlines():
            _, kinds, name = line.split(":", 2)
            kind = "memory" if "memory" in kinds.split(",") else kinds
            if kind in FILES:
                own = Path(name.strip("/"))
                for group in (own, *own.parents):
                    yield _free_of_group(GROUPS / kind / group, *FILES[kind])


def _free_of_group(group: Path, limit: str, used: str) -> float:
    """Return the bytes left of the memory limit of one Linux control group.

    Cached files that the kernel can drop count as free. The result is infinite if the group has no
    limit.

    Args:
        group: folder of the group.
        limit, used: names of its files with the limit and the memory in use.
    """
    with suppress(OSError, ValueError):
        most, taken = int((group / limit).read_text()), int((group / used).read_text())
        rows = (group / "memory.stat").read_text().splitlines()
        droppable = sum(int(row.split()[1]) for row in rows if row.startswith("inactive_file "))
        return float(max(0, most - taken + droppable))
    return math.inf


class MemoryBudget:
    """Account of the bytes that this process may spend on arrays that are only kept for speed.

    The budget is a share of the memory that is free when the first array is kept. The worker
    processes of one command divide the budget among them.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()  # arrays may be freed while the lock is held
        self._left: float | None = None
        self.processes = 1

    def keeps(self, *arrays: np.ndarray) -> bool:
        """Take the size of the arrays from the budget; return False if they are too large for it.

        The size is given back when the first of the arrays is freed.
        """
        size = float(sum(one.nbytes for one in arrays))
        with self._lock:
            if self._left is None:
                self._left = OF_FREE * free_memory() / self.processes
            if size > self._left:
                return False
            self._left -= size
        weakref.finalize(arrays[0], self._give_back, size).atexit = False
        return True

    def _give_back(self, size: float) -> None:
        with self._lock:
            self._left = (self._left or 0.0) + size


MEMORY = MemoryBudget()
