"""A snippet run in two fresh processes, compiled and interpreted."""

import os
import subprocess
import sys
from pathlib import Path


def with_and_without_jit(code: str) -> tuple[str, str]:
    """What the snippet prints with the JIT and without; it may import from tests."""
    settings = (dict(os.environ), {**os.environ, "NUMBA_DISABLE_JIT": "1"})
    here = Path(__file__).parents[2]
    compiled, interpreted = (
        subprocess.run(
            [sys.executable, "-c", code],
            cwd=here,
            env=env,
            check=True,
            capture_output=True,
            text=True,
        )
        for env in settings
    )
    return compiled.stdout, interpreted.stdout
