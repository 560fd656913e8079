"""Which program made a figure: versions of Python and packages, and a digest of the project's own sources."""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from chamberopt.common.parallel.executor import core_count

# What takes part in a figure; what only draws or prints does not.
PACKAGES = ("chamberopt", "numpy", "scipy", "numba", "manifold3d", "nlopt", "scikit-learn")


def versions() -> dict[str, str]:
    """Python, system and packages that figures were made with."""
    return {
        "python": platform.python_version(),
        "system": platform.platform(),
        "cores": str(core_count()),
        **packages(),
    }


def program_versions() -> dict[str, str]:
    """All of the program that a candidate's figures depend on, whatever the machine: what a study must go on with."""
    python = ".".join(platform.python_version_tuple()[:2])
    return {"python": python, **packages(), "sources": sources_digest()}


def packages() -> dict[str, str]:
    """The version of each package of PACKAGES."""
    found = {}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed as a package"
    return found


@cache
def sources_digest() -> str:
    """Of every source file of the two packages: tells versions apart that were changed in place."""
    digest = hashlib.sha256()
    for package in ("chamberopt", "sim_core"):
        spec = find_spec(package)  # imports nothing
        folder = Path(spec.origin).parent if spec and spec.origin else Path()
        for source in sorted(folder.rglob("*.py")):
            digest.update(f"{package}/{source.relative_to(folder).as_posix()}\0".encode())
            digest.update(source.read_bytes())
    return digest.hexdigest()[:16]
