"""A window, driven without a display, shows what its keys, clicks and slider ask for."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from chamberopt.common.errors import InputError
from chamberopt.pictures.subprocess_drawing import without_display
from chamberopt.viewer import window
from chamberopt.viewer.opened_result import ResultInfo
from chamberopt.viewer.view_state import ViewState
from chamberopt.viewer.window import inspect
from tests.helpers.opengl import needs_opengl


@pytest.fixture(scope="module")
def steps(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("steps")
    command = [
        sys.executable,
        "-m",
        "tests.helpers.results.sphere_in_sphere",
        "driven",
        str(folder),
    ]
    subprocess.run(command, check=True, env=without_display(), cwd=Path(__file__).parents[3])
    return {
        one["step"]: one for one in json.loads((folder / "steps.json").read_text(encoding="utf-8"))
    }


@pytest.mark.long
@needs_opengl
def test_a_window_shows_what_its_keys_say(steps: dict[str, dict[str, Any]]) -> None:
    def first(step: str) -> dict[str, Any]:
        return steps[step]["views"][0]

    assert "coverage [%]\n10 to 100 %" in first("opened")["words"]
    assert "mean normal\nspeed [m/s]" in first("3")["words"]
    assert any("[3 speed]" in text for text in first("3")["words"])
    assert first("b")["pale"] == first("opened")["pale"] == 0
    assert first("slid")["pale"] > 100  # above 98 % by then
    assert any("below 98 %: 100.0 %" in text for text in first("b")["words"])
    second = {step: steps[step]["views"][1]["planes"] for step in ("opened", "c", "x", "g")}
    part, chamber = 4, 3  # by many and by few dents, out of reach, the rest
    assert second == {
        "opened": [0] * (part + chamber),
        "c": [0] * part + [1] * chamber,
        "x": [1] * (part + chamber),
        "g": [1] * part,
    }
    assert any("deselect the triangle" in text for text in first("h")["words"])


@needs_opengl
@pytest.mark.long
def test_handles_are_there_when_they_do_something(steps: dict[str, dict[str, Any]]) -> None:
    slider = {step: steps[step]["slider"] for step in ("opened", "3", "1", "r")}
    assert slider == {"opened": True, "3": False, "1": True, "r": True}
    assert [step for step in steps if steps[step]["plane"]] == [
        "c",
        "x",
        "g",
        "cut",
        "clicked",
        "h",
        "slid",
        "6",
    ]
    assert steps["cut"]["look"]["cut"] == [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]


@needs_opengl
def test_a_click_is_answered_in_every_view_of_the_part(steps: dict[str, dict[str, Any]]) -> None:
    for view in steps["clicked"]["views"]:
        assert any(text.startswith("triangle 404") for text in view["words"])
        assert view["charts"] == 1
    assert steps["r"]["beside"] is None
    view, triangle = steps["r"]["picked"]
    assert (view, 0 <= triangle < 1280) == (1, True)


@needs_opengl
def test_the_slider_and_reset(steps: dict[str, dict[str, Any]]) -> None:
    assert steps["slid"]["look"]["time_s"] == 25.0
    assert steps["6"]["look"] == steps["slid"]["look"]  # no result has it
    before, after = steps["opened"], steps["r"]
    assert after["look"] == before["look"]
    for one, other in zip(before["views"], after["views"], strict=True):
        assert one["shown"] == other["shown"]
        assert one["eye"] == pytest.approx(other["eye"])
        assert one["charts"] == other["charts"] == 0
    assert before["views"][0]["eye"] == before["views"][1]["eye"]  # linked


def test_screenshot_without_a_display(
    case: tuple, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list = []
    monkeypatch.setattr(window, "draw_in_subprocess", lambda *arguments: drawn.append(arguments))
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    subject, look = (
        ResultInfo(str(case[0]), "a plate", 5.0, 25.0, {"arrays.npz": "0"}),
        ViewState("speed", below=90.0),
    )
    inspect([subject], look, tmp_path / "shot.png")
    job = {"results": [subject], "state": look}
    assert drawn == [(window.render_inspect, job, tmp_path / "shot.png")]
    if sys.platform.startswith("linux"):
        with pytest.raises(InputError, match=r"no display.*--screenshot"):
            inspect([subject], look)
    with pytest.raises(InputError, match=r"\.png"):
        inspect([subject], look, tmp_path / "shot.bmp")
    with pytest.raises(InputError, match="does not exist"):
        inspect([subject], look, tmp_path / "nowhere" / "shot.png")
    monkeypatch.setattr(window, "draw_in_subprocess", lambda *_: "shot.png skipped: install this")
    with pytest.raises(InputError, match="install this"):
        inspect([subject], look, tmp_path / "shot.png")
