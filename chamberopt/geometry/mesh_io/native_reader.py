"""Read files with libraries in C++ in a process of its own: a damaged file can end the process."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from chamberopt.common.parallel.lifetime import end_with_stdin

TIMEOUT_S = 1800.0
BEGIN = (
    "import sys; from chamberopt.common.limits import limit_memory; limit_memory(); "
    "from chamberopt.geometry.mesh_io.native_reader import end_with_starter; "
    "end_with_starter(sys.argv[1]); "
)


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
        watched, held = os.pipe()  # it is closed when this process ends, however it ends
        try:
            run = subprocess.run(
                command, stdin=watched, capture_output=True, timeout=TIMEOUT_S, check=False
            )
        finally:
            os.close(watched)
            os.close(held)
        yield made if run.returncode == 0 and made.is_file() else None


def end_with_starter(source: str) -> None:
    """End this process, and remove the folder of its file, with the one that started it."""
    end_with_stdin(lambda: shutil.rmtree(Path(source).parent, ignore_errors=True))
