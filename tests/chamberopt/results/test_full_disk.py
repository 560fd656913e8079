"""A file that finds no room: an OSError that names it, never a signal, and no half of a file."""

import errno
import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.files import write_text
from chamberopt.pictures.charts.figure_style import new_figure, save_picture
from chamberopt.pictures.film import write_film
from chamberopt.results.load import Result
from chamberopt.results.vtp_files import pyvista, save_surface, write_stl
from tests.helpers.results.short_plate import plate_result

resource = pytest.importorskip("resource", reason="needs limits on the size of files")
fork = multiprocessing.get_context("fork")


def surface() -> object:
    sphere = pyvista().Sphere(theta_resolution=100, phi_resolution=100)
    sphere.point_data["noise"] = np.random.default_rng(1).normal(size=sphere.n_points)
    return sphere


def picture(path: Path) -> None:
    figure = new_figure(5.0, 5.0)
    figure.subplots().imshow(np.random.default_rng(1).normal(size=(200, 200)))
    save_picture(figure, path)


def film(path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 255, (8, 160, 160, 3)).astype(np.uint8)
    write_film(path, list(noise), 20)


WRITERS: dict[str, Callable[[Path], None]] = {
    "surface.vtp": lambda path: save_surface(path, surface()),
    "surface.vtkhdf": lambda path: save_surface(path, surface()),
    "surface.stl": lambda path: write_stl(
        path,
        surface().points,
        surface().regular_faces,  # type: ignore[attr-defined]
    ),
    "picture.png": picture,
    "film.gif": film,
    "film.mp4": film,
    "page.html": lambda path: write_text(path, "x" * 100_000),
}
ROOM = 20_000  # bytes
# Other processes would read half of a file of compiled code.
NO_BYTECODE = {"PYTHONPATH": str(Path(__file__).parents[3]), "PYTHONDONTWRITEBYTECODE": "1"}


def limited(write: Callable[[Path], None], path: Path) -> None:
    sys.dont_write_bytecode = True
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, ROOM))
    try:
        write(path)
    except OSError as error:
        os._exit(7 if path.name in str(error) else 8)
    os._exit(0)


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_is_whole_or_not_there(name: str, tmp_path: Path) -> None:
    WRITERS[name](tmp_path / name)
    assert (tmp_path / name).stat().st_size > ROOM
    folder = tmp_path / "full"
    folder.mkdir()
    child = fork.Process(target=limited, args=(WRITERS[name], folder / name))
    child.start()
    child.join(60)
    assert child.exitcode == 7
    assert not list(folder.iterdir())


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return plate_result(tmp_path_factory.mktemp("plate") / "result")


def test_a_simulation_that_finds_no_room_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("chamberopt.workflows.save_run.write_result", full)
    with pytest.raises(OSError, match="No space left"):
        plate_result(tmp_path / "result")
    assert not list((tmp_path / "result").iterdir())


@pytest.mark.parametrize("name", ["fields-vtp", "chamber-3mf", "impacts-parquet"])
def test_an_export_is_one_message(name: str, result: Result, tmp_path: Path) -> None:
    resource_limit = (
        f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({ROOM // 10},) * 2); "
        "from chamberopt.cli import main; raise SystemExit(main())"
    )
    command = ["export", str(result.folder), "--to", name, "--workers", "1", "--out", "out"]
    ended = subprocess.run(
        [sys.executable, "-c", resource_limit, *command],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **NO_BYTECODE},
    )
    assert ended.returncode in (1, 2)
    assert "Traceback" not in ended.stderr
    assert "File too large" in ended.stderr.splitlines()[-1]
    assert not [one for one in tmp_path.rglob("*") if one.is_file()]
