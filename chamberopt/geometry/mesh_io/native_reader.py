"""Read files with libraries in C++ in a process of its own: a damaged file can end the process."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from chamberopt.common.files import private_folder, write_bytes

TIMEOUT_S = 1800.0
BEGIN = (
    "import sys; from chamberopt.common.limits import limit_memory; limit_memory(); "
    "from chamberopt.geometry.mesh_io.native_reader import end_with_parent; "
    "end_with_parent(sys.argv[1]); "
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
    with private_folder() as folder:
        given, made = Path(folder) / source, Path(folder) / target
        write_bytes(given, content)
        command = [sys.executable, "-P", "-c", BEGIN + code, *map(str, (given, made, *arguments))]
        watched, held = os.pipe()  # it is closed when this process ends, however it ends
        try:
            run = subprocess.run(
                command, stdin=watched, capture_output=True, timeout=TIMEOUT_S, check=False
            )
        finally:
            os.close(watched)
            os.close(held)
        yield made if run.returncode == 0 and made.is_file() else None


def end_with_parent(source: str) -> None:
    """End this process, and remove the folder of its file, when the one that started it has ended.

    The other one holds the end of the pipe that this one has as its standard input.
    """

    def watch() -> None:
        os.read(0, 1)
        shutil.rmtree(Path(source).parent, ignore_errors=True)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
