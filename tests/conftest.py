"""Settings of all tests."""

import gc
import os
import sys

# Python's collector of garbage looks through what the compiler keeps again and again. It took a
# sixth of compiling the simulator.
gc.set_threshold(100_000, 50, 1000)

# They fork, make pipes and devices, and send signals that Windows lacks.
if sys.platform == "win32":
    collect_ignore = ["hunt", "chamberopt/common/files", "chamberopt/page"]
    collect_ignore += [f"chamberopt/cli/test_{name}.py" for name in ("refused_first", "interrupt")]


def pytest_xdist_auto_num_workers() -> int:
    """One worker more than cores: tests wait for commands, browsers and clusters they started."""
    return (os.cpu_count() or 1) + 1
