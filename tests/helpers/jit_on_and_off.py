"""A snippet run in two fresh processes, compiled and interpreted."""

import os
import subprocess
import sys
from pathlib import Path


def with_and_without_jit(code: str) -> tuple[str, str]:
    """What the snippet prints with the JIT and without; it may import from tests."""
    return _printed(code, dict(os.environ)), without_jit(code)


def without_jit(code: str) -> str:
    """What the snippet prints without the JIT. Its AssertionError is a CalledProcessError here."""
    return _printed(code, {**os.environ, "NUMBA_DISABLE_JIT": "1"})


def _printed(code: str, env: dict[str, str]) -> str:
    here, command = Path(__file__).parents[2], [sys.executable, "-c", code]
    return subprocess.run(
        command, cwd=here, env=env, check=True, capture_output=True, text=True
    ).stdout
