"""Tell the versions of Python, packages and this program's sources, on which results depend."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Iterable
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from chamberopt.common.executor import core_count
from chamberopt.common.files import read_file

SIMULATION_PACKAGES = ("chamberopt", "numpy", "scipy", "numba", "manifold3d")
# The search depends on two more packages. Packages that only draw or print are left out.
PACKAGES = (*SIMULATION_PACKAGES, "nlopt", "scikit-learn")
# Settings that, besides the sources, decide the results of compiled code.
COMPILER_SETTINGS = (
    "NUMBA_OPT", "NUMBA_ENABLE_AVX", "NUMBA_LOOP_VECTORIZE", "NUMBA_SLP_VECTORIZE",
)  # fmt: skip


def versions() -> dict[str, str]:
    """Return the versions of Python, system and packages, and the number of cores.

    Results record them.
    """
    machine = {"system": platform.platform(), "cores": str(core_count())}
    return {"python": platform.python_version(), **machine, **package_versions()}


def program_versions() -> dict[str, str]:
    """Return the versions of all on which a study's figures depend, except the computer.

    A study can only be resumed where all these versions are the same.
    """
    python = ".".join(platform.python_version_tuple()[:2])
    return {"python": python, **package_versions(), "sources": sources_digest()}


def simulation_versions() -> dict[str, str]:
    """Return the versions and compiler settings on which the figures of a replica depend.

    Two computers with equal versions and settings simulate alike.
    """
    settings = {name: os.environ.get(name, "not set") for name in COMPILER_SETTINGS}
    python = ".".join(platform.python_version_tuple()[:2])
    packages = package_versions((*SIMULATION_PACKAGES, "llvmlite"))
    return {"python": python, **packages, "sources": sources_digest(), **settings}


def package_versions(packages: Iterable[str] = PACKAGES) -> dict[str, str]:
    """Return the installed version of each package, by its name."""
    found = {}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed as a package"
    return found


@cache
def sources_digest() -> str:
    """Return a digest of all source files, which tells programs with edited sources apart."""
    digest = hashlib.sha256()
    for package in ("chamberopt", "sim_core"):
        spec = find_spec(package)  # find_spec finds the package without importing it
        folder = Path(spec.origin).parent if spec and spec.origin else Path()
        for source in sorted(folder.rglob("*.py")):
            digest.update(f"{package}/{source.relative_to(folder).as_posix()}\0".encode())
            digest.update(read_file(source, follow=True))
    return digest.hexdigest()[:16]
