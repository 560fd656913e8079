"""Two pages save at once while an editor outside writes: nobody's line is lost unsaid."""

from __future__ import annotations

import random
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from chamberopt.common.errors import InputError
from chamberopt.page.edited_file import EditedFile
from tests.chamberopt.common.files.scene import write_scene

ROUNDS = 40


def save(file: EditedFile, key: str, value: float) -> bool:
    """Whether a page could save its change; it is told if the file was changed meanwhile."""
    try:
        file.save({f"chamber.{key}": value})
    except InputError as error:
        if "changed on disk" in str(error):
            return False
        raise
    return True


def add_line(path: Path, line: str, in_place: bool) -> None:
    if in_place:
        with path.open("a") as file:
            file.write(line)
    else:
        copy = path.with_name("copy")
        copy.write_text(path.read_text() + line)
        copy.rename(path)


@pytest.mark.parametrize("in_place", [True, False])
def test_two_pages_and_an_editor_at_once(in_place: bool, tmp_path: Path) -> None:
    write_scene(tmp_path)
    path, rng = tmp_path / "design.toml", random.Random(1)
    saves, longest = 0, 0.0
    with ThreadPoolExecutor(2) as pages:
        for number in range(ROUNDS):
            file, line = EditedFile(path, trusted=False), f"# line {number}\n"
            began = time.perf_counter()
            values = {"height_mm": 31.0 + number / 100, "diameter_mm": 41.0 + number / 100}
            saved = [pages.submit(save, file, key, value) for key, value in values.items()]
            time.sleep(rng.uniform(0.0, longest))
            add_line(path, line, in_place)
            done = [one.result() for one in saved]
            longest = max(longest, time.perf_counter() - began)  # of a round: so slow is a save
            assert sum(done) <= 1  # the other page had read an older text
            saves += sum(done)
            text = path.read_text()
            assert line in text
            if in_place and any(done):  # an editor that writes its own copy may replace the page's
                key = list(values)[done.index(True)]
                assert f"{key} = {values[key]}" in text
            assert not list(tmp_path.glob(".*"))
    assert saves > 5
