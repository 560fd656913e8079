"""A snippet run here, compiled, and in a fresh process, interpreted."""

import io
import os
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path


def with_and_without_jit(code: str) -> tuple[str, str]:
    """What the snippet prints with the JIT and without; it may import from tests."""
    printed = io.StringIO()
    with redirect_stdout(printed):
        exec(code, {})
    return printed.getvalue(), without_jit(code)


def without_jit(code: str) -> str:
    """What the snippet prints without the JIT. Its AssertionError is a CalledProcessError here."""
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).parents[2],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        check=True,
        capture_output=True,
        text=True,
    ).stdout
