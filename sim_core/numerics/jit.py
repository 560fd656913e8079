"""The one way this package compiles: numba, cached on disk, never stale.

numba's own cache notices an edit only in the file of the cached function. A helper changed in another file would go
on giving the old answer, so the cache lives in a folder named by a digest of every source file of the package: any
edit, anywhere, starts a fresh one.
"""

import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

_settings: Any = numba.config  # both are untyped, or typed without what is used here
_njit: Any = numba.njit

KEPT_DIGESTS = 4  # older folders are removed: each holds a few MB that nothing will read again


def _cache_root() -> Path:
    """Where compiled code is kept: NUMBA_CACHE_DIR if the user set one, else the user's cache folder."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return Path(chosen)
    try:
        Path.home()
    except RuntimeError:  # a user without a home, as in some containers
        return Path(tempfile.gettempdir()) / "chamberopt"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "chamberopt"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home()) / "chamberopt" / "cache"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "chamberopt"


def _sources_digest() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    package = Path(__file__).parents[1]
    for source in sorted(package.rglob("*.py")):
        digest.update(source.relative_to(package).as_posix().encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


CACHE_FOLDER = _cache_root() / f"sim_core-{_sources_digest()}"


def _remove_old_caches() -> None:
    """Keep the newest few folders; a folder in use by another process is simply made again there."""
    folders = sorted(
        CACHE_FOLDER.parent.glob("sim_core-*"), key=lambda f: f.stat().st_mtime, reverse=True
    )
    for folder in folders[KEPT_DIGESTS:]:
        shutil.rmtree(folder, ignore_errors=True)


def _cache_is_usable() -> bool:
    """True when the folder can be written; where it cannot, every process compiles for itself."""
    try:
        if not CACHE_FOLDER.exists():
            CACHE_FOLDER.mkdir(parents=True, exist_ok=True)
            _remove_old_caches()
    except OSError:
        return False
    return os.access(CACHE_FOLDER, os.W_OK)


_CACHED = _cache_is_usable() and not _settings.DISABLE_JIT


def _compiled(function: Callable[..., Any], inline: bool) -> Callable[..., Any]:
    before = _settings.CACHE_DIR
    _settings.CACHE_DIR = str(
        CACHE_FOLDER
    )  # read when the decorator runs; other packages keep theirs
    try:
        return _njit(
            cache=_CACHED,
            nogil=True,
            error_model="numpy",
            fastmath=False,
            _nrt=False,
            forceinline=inline,
        )(function)
    finally:
        _settings.CACHE_DIR = before


def jit(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile for nopython mode: no fastmath (bits are promised), GIL released, cached by source digest.

    ``_nrt=False``: compiled code may not make arrays, and in return does not count references to them. Counting is
    atomic and took half of the event loop's time. Everything the loop works on is made before it starts.
    """
    return _compiled(function, inline=False)


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same, for a step of the event loop that is called at one place: it becomes part of its caller.

    A call hands over every array as seven words and more, a hundred for a step; that took a fifth of the loop's time.
    """
    return _compiled(function, inline=True)
