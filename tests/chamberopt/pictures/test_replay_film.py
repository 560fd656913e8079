"""A replay shows balls that move, and which of them have just hit the part."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from chamberopt.cli import main
from chamberopt.pictures.film import draw_replay
from chamberopt.results.flight import simulate_flight
from chamberopt.results.load import Result
from chamberopt.results.rebuild import rebuild_replica
from tests.helpers.opengl import needs_opengl
from tests.helpers.results.short_plate import plate_result


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return plate_result(tmp_path_factory.mktemp("replay") / "plate")


@needs_opengl
def test_a_replay_shows_balls_that_move_and_hits(result: Result, tmp_path: Path) -> None:
    seen = simulate_flight(rebuild_replica(result), 0.02, 0.008, 6)
    assert len(seen.impacts) > 5
    assert draw_replay(result.folder, seen, tmp_path / "plate.gif", 20, (320, 240)) is None
    with Image.open(tmp_path / "plate.gif") as image:
        pages = [
            np.array(page.convert("RGB")).astype(int) for page in ImageSequence.Iterator(image)
        ]
    assert len(pages) == 6
    assert all((np.abs(one - other).max(axis=2) > 40).sum() > 200 for one, other in pairwise(pages))
    last = pages[-1]
    red, green, blue = last.transpose(2, 0, 1)
    assert (red - blue > 50).mean() > 0.03  # the sonotrode, as glass, as it is seen from below
    assert (
        (red > 120) & (green < 0.55 * red) & (blue > 1.3 * green)
    ).sum() > 20  # magenta: balls that have just hit
    assert list(tmp_path.iterdir()) == [tmp_path / "plate.gif"]


def test_on_the_command_line(
    result: Result, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = str(result.folder)
    for arguments, said in (
        (["replay", folder, str(tmp_path / "a.avi")], ".gif or .mp4"),
        (["replay", str(tmp_path), str(tmp_path / "a.gif")], "not a results folder"),
        (["replay", folder, str(tmp_path / "a.gif"), "--span-ms", "1000"], "--span-ms: given 1000"),
        (["replay", folder, str(tmp_path / "a.gif"), "--replica", "9"], "--replica: given 9"),
        (["replay", folder, str(tmp_path / "a.gif"), "--fps", "99"], "--fps: given 99"),
    ):
        assert main(arguments) == 2
        said_there = capsys.readouterr().err.strip().splitlines()
        assert said in said_there[-1]
        assert not list(tmp_path.glob("a.*"))
