"""Read files with libraries in C++ in a process of its own: a damaged file can end the process."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

TIMEOUT_S = 1800.0
BEGIN = "import sys; from chamberopt.common.limits import limit_memory; limit_memory(); "


@contextmanager
def converted(
    content: bytes, source: str, target: str, code: str, *arguments: object
) -> Iterator[Path | None]:
    """Yield the file that Python code makes of a file with this content, or None.

    Args:
        source, target: names of the two files, in a temporary folder.
        code: finds the paths of both, then the arguments, as texts in sys.argv[1:].
    Raises:
        subprocess.TimeoutExpired: it took too long.
    """
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder) / source, Path(folder) / target
        given.write_bytes(content)
        command = [sys.executable, "-c", BEGIN + code, *map(str, (given, made, *arguments))]
        run = subprocess.run(command, capture_output=True, timeout=TIMEOUT_S, check=False)
        yield made if run.returncode == 0 and made.is_file() else None
