"""The only compiler of this package: numba, with a cache on disk that is never stale.

numba's own cache notices an edit only in the file of the cached function: if a helper in another
file changed, the old machine code would run on. The cache therefore lives in a folder named by a
digest of every source file of the package, so that any edit starts a fresh one.
"""

import hashlib
import os
import shutil
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import event
from numba.core.registry import CPUDispatcher

from sim_core.numerics.compile_cache import CheckedCache, is_private
from sim_core.numerics.step_compiler import StepCompiler

# Both are untyped, or typed without the attributes used here.
_settings: Any = numba.config
_njit: Any = numba.njit

F = TypeVar("F", bound=Callable[..., Any])

MAX_CACHES = 4  # older folders are removed: each holds a few MB that nothing reads any more


def _cache_root() -> Path:
    """Return the folder for compiled code: NUMBA_CACHE_DIR if set, else the user's cache folder."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return Path(chosen)
    try:
        Path.home()
    except RuntimeError:  # a user without a home, as in some containers
        return Path(os.devnull)  # no cache, because a shared folder is open to other users' code
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "chamberopt"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home()) / "chamberopt" / "cache"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "chamberopt"


def _sources_digest() -> str:
    """Return a digest of numba's version and of the path and text of every source file."""
    digest = hashlib.sha256(numba.__version__.encode())
    package = Path(__file__).parents[1]
    for source in sorted(package.rglob("*.py")):
        digest.update(source.relative_to(package).as_posix().encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


CACHE_FOLDER = _cache_root() / f"sim_core-{_sources_digest()}"


def _remove_old_caches() -> None:
    """Remove all but the newest MAX_CACHES folders.

    A process that uses a removed folder makes it again.
    """
    folders = sorted(
        CACHE_FOLDER.parent.glob("sim_core-*"), key=lambda f: f.stat().st_mtime, reverse=True
    )
    for folder in folders[MAX_CACHES:]:
        shutil.rmtree(folder, ignore_errors=True)


def _cache_is_usable() -> bool:
    """Return True if this user, and nobody else, can write to the folder of compiled code."""
    try:
        if not CACHE_FOLDER.exists():
            CACHE_FOLDER.mkdir(0o700, parents=True, exist_ok=True)
            _remove_old_caches()
        return is_private(CACHE_FOLDER) and os.access(CACHE_FOLDER, os.W_OK)
    except OSError:
        return False


_USABLE = _cache_is_usable()
CACHED = _USABLE and not _settings.DISABLE_JIT


def user_cache() -> Path | None:
    """Return this user's own folder for files that can be made again; None if there is none."""
    return CACHE_FOLDER.parent if _USABLE and is_private(CACHE_FOLDER.parent) else None


# Threads take turns: a thread that restored numba's folder while another read it sent compiled code
# to the current folder.
_DECORATING = threading.RLock()


class Step(CPUDispatcher):
    """A compiled function that other compiled functions call.

    numba makes three modules of machine code for each function: the function itself, and two
    wrappers for calls from Python and from C. Nobody runs them for a step of the event loop, since
    its code is linked into its caller, and they took half of the compilation. A step that is called
    from Python after all is compiled a second time, with its wrapper.
    """

    def __call__(self, *arguments: Any) -> Any:
        with _DECORATING:
            if not hasattr(self, "entry"):
                self.entry = _compiled(self.py_func, inline=False, from_python=True)
        return self.entry(*arguments)


def _compiled(function: F, inline: bool, from_python: bool = False) -> F:
    # numba reads the folder when the decorator runs. Other packages keep their own folder. The file
    # names do not tell functions with wrappers from functions without wrappers.
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": False}
    options["_nrt"] = False
    if not from_python:
        options |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        options["pipeline_class"] = StepCompiler
    with _DECORATING:
        before = _settings.CACHE_DIR
        _settings.CACHE_DIR = str(CACHE_FOLDER / ("entries" if from_python else "steps"))
        try:
            compiled = _njit(forceinline=inline, **options)(function)
            if CACHED:
                compiled._cache = CheckedCache(function)
        finally:
            _settings.CACHE_DIR = before
    if not from_python and not _settings.DISABLE_JIT:
        compiled.__class__ = Step
    return cast(F, compiled)


class _Counter(event.Listener):
    def __init__(self, count: Callable[[int], None]) -> None:
        self.compiled, self.count = 0, count

    def on_start(self, event: object) -> None:
        pass

    def on_end(self, event: object) -> None:
        self.compiled += 1
        self.count(self.compiled)


@contextmanager
def compilations_counted(count: Callable[[int], None]) -> Iterator[None]:
    """Call `count` after each compiled function with the number of functions compiled so far."""
    with event.install_listener("numba:compile", _Counter(count)):
        yield


def jit(function: F) -> F:
    """Compile a function in nopython mode, cached by the digest of the sources.

    fastmath is off, because results are promised bit for bit. The GIL is released. With
    ``_nrt=False`` compiled code cannot make arrays and does not count references to them. Counting
    is atomic and took half of the event loop's time. All arrays of the loop are made before it
    starts.
    """
    return _compiled(function, inline=False)


def inlined(function: F) -> F:
    """Compile a step of the event loop into its caller. The step has a single call site.

    A call passes every array as seven machine words or more, about a hundred for a step. These
    calls took a fifth of the event loop's time.
    """
    return _compiled(function, inline=True)
