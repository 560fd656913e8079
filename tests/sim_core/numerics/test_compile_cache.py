"""Compiled code on disk is whole and the user's own, or it is compiled anew."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
CODE = (
    "from sim_core.numerics.roots import first_approach as f\n"
    "print(f(2.0, -3.0, 1.0, 0.1), sum(getattr(f, 'entry', f).stats.cache_hits.values()))"
)


def call(cache: Path | None, **variables: str) -> tuple[list[str], str]:
    """What a process of its own prints: the function's value and its cache hits."""
    own = {} if cache is None else {"NUMBA_CACHE_DIR": str(cache)}
    kept = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    answer = subprocess.run(
        [sys.executable, "-c", CODE],
        env={**kept, "PYTHONPATH": str(ROOT), **own, **variables},
        capture_output=True,
        text=True,
        check=True,
    )
    return answer.stdout.split(), answer.stderr


def cut(content: bytes) -> bytes:
    return content[: len(content) // 2]


def flip(content: bytes) -> bytes:
    """One bit, which leaves a file that numba can read."""
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


def empty(content: bytes) -> bytes:
    return b""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache that a process has made and another has used."""
    folder = tmp_path_factory.mktemp("made")
    assert call(folder) == (["1.0", "0"], "")
    assert call(folder) == (["1.0", "1"], "")
    return folder


@pytest.fixture
def cache(made: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return shutil.copytree(made, tmp_path / "cache")


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", [cut, flip, empty])
def test_a_damaged_cache_is_compiled_anew(
    suffix: str, damage: Callable[[bytes], bytes], cache: Path
) -> None:
    files = list(cache.rglob(f"*.{suffix}"))
    assert files
    for file in files:
        file.write_bytes(damage(file.read_bytes()))
    found, message = call(cache)
    assert found == ["1.0", "0"]
    assert message.count("\n") == 1
    assert "compiled code is damaged; it is compiled anew" in message
    assert call(cache) == (["1.0", "1"], "")


@pytest.mark.skipif(sys.platform == "win32", reason="needs locks")
def test_of_two_processes_one_compiles_and_the_other_waits_for_it(tmp_path: Path) -> None:
    with ThreadPoolExecutor(2) as threads:
        found = [output for output, _ in threads.map(call, [tmp_path] * 2)]
    assert sorted(found) == [["1.0", "0"], ["1.0", "1"]]


def test_the_folder_is_the_users_own(made: Path) -> None:
    (folder,) = made.iterdir()
    assert folder.stat().st_mode & 0o777 == 0o700


def test_a_folder_that_others_can_write_to_is_not_used(cache: Path) -> None:
    (folder,) = cache.iterdir()
    folder.chmod(0o777)
    assert call(cache) == (["1.0", "0"], "")


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() != 0, reason="needs to be root")
def test_a_folder_of_another_user_is_not_used(cache: Path) -> None:
    (folder,) = cache.iterdir()
    os.chown(folder, 12345, 12345)
    assert call(cache) == (["1.0", "0"], "")


def test_without_a_home_nothing_is_kept_in_a_shared_folder(tmp_path: Path) -> None:
    """Path.home() raises RuntimeError for a user without an entry and without HOME."""
    (tmp_path / "sitecustomize.py").write_text(
        "import pathlib\n"
        "def home(cls):\n    raise RuntimeError('no home')\n"
        "pathlib.Path.home = classmethod(home)\n"
    )
    paths = os.pathsep.join([str(tmp_path), str(ROOT)])
    shared = tmp_path / "shared"
    shared.mkdir()
    assert call(None, PYTHONPATH=paths, TMPDIR=str(shared)) == (["1.0", "0"], "")
    assert not list(shared.iterdir())
