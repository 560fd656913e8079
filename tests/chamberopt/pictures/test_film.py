"""Films play back as they were written; what no player shows is refused."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from chamberopt.common.errors import InputError
from chamberopt.common.files import claimed
from chamberopt.pictures import film
from chamberopt.pictures.film import film_path, lately_hit, write_film


def test_films_play_back_as_they_were_written(tmp_path: Path) -> None:
    """A bright spot of four pixels keeps its colour beside a large grey gradient."""
    grey = np.tile(np.linspace(100, 200, 64, dtype=np.uint8)[None, :, None], (48, 1, 3))
    frames = [grey.copy() for _ in range(7)]
    for k, frame in enumerate(frames):
        frame[10:12, 5 * k + 4 : 5 * k + 6] = (255, 46, 154)
    write_film(tmp_path / "spot.gif", frames, fps=20)
    with Image.open(tmp_path / "spot.gif") as image:
        pages = [
            (np.array(page.convert("RGB")), page.info["duration"])
            for page in ImageSequence.Iterator(image)
        ]
        assert image.info["loop"] == 0
    assert [duration for _, duration in pages] == [50] * 7
    for (page, _), frame in zip(pages, frames, strict=True):
        assert np.abs(page.astype(int) - frame).max() < 12
    pytest.importorskip("imageio_ffmpeg")
    imageio = pytest.importorskip("imageio.v2")
    write_film(tmp_path / "spot.mp4", frames, fps=20)
    again = imageio.mimread(tmp_path / "spot.mp4")
    assert len(again) == 7
    assert all(
        np.abs(page.astype(int) - frame).mean() < 8
        for page, frame in zip(again, frames, strict=True)
    )


def test_where_no_film_can_be_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(
        InputError, match=r"shot\.avi: films are written as \.gif or \.mp4; give such a name"
    ):
        film_path(tmp_path / "shot.avi")
    with pytest.raises(InputError, match="nowhere does not exist; make it first"):
        film_path(tmp_path / "nowhere" / "shot.gif")
    (tmp_path / "shot.gif").mkdir()
    with pytest.raises(InputError, match=r"shot\.gif: is a folder"):
        film_path(tmp_path / "shot.gif")

    def refuse(**_: object) -> None:
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr(claimed.tempfile, "TemporaryFile", refuse)
        with pytest.raises(InputError, match=r"a\.gif: cannot be written: Permission"):
            film_path(tmp_path / "a.gif")
    for missing in ("imageio", "imageio_ffmpeg"):
        monkeypatch.setattr(film, "find_spec", lambda name, gone=missing: name != gone or None)
        with pytest.raises(InputError, match=rf"needs {missing}: pip install 'chamberopt\[mp4\]'"):
            film_path(tmp_path / "shot.mp4")
    for fps, size, frames, name, said in (
        (0, (64, 64), 9, "a.gif", "--fps"),
        (20, (10, 64), 9, "a.gif", "--size"),
        (20, (100, 64), 9, "a.mp4", "multiples of 16"),
        (
            20,
            (2000, 1500),
            101,
            "a.gif",
            "--frames: given 101; at most 100 are supported at 2000 x 1500 pixels",
        ),
    ):
        with pytest.raises(InputError, match=said):
            film.require_playable(fps, size, frames, Path(name))


def test_balls_are_marked_for_a_while_after_they_hit() -> None:
    flight = {
        "hit_time": np.array([0.1, 0.2, 0.3, 0.4]),
        "hit_ball": np.array([0, 1, 2, 1]),
        "diameter": np.ones(4),
    }
    for now, balls in ((0.05, []), (0.1, [0]), (0.25, [0, 1]), (0.32, [1, 2]), (0.9, [])):
        assert np.flatnonzero(lately_hit(flight, now, 0.2)).tolist() == balls
