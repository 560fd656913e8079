"""What inspect shows: every key and option is a change of one ViewState, and a window is what follows from it."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.coverage.part_impacts import save_hits, sort_hits_by_triangle
from chamberopt.output.viewer import ResultInfo, ViewState, missing_opengl, parse_clip, parse_view
from chamberopt.output.viewer.actors import colour_bar_ticks, escape_dollars
from chamberopt.output.viewer.opened_result import OpenedResult, colour_limits, same_part
from chamberopt.output.viewer.plotter import view_of_target
from chamberopt.output.viewer.subprocess_drawing import without_display
from chamberopt.output.viewer.view_state import state_after_key
from chamberopt.output.vtp_files import pyvista, read_surface
from chamberopt.simulation.triangle_fields import QUANTITIES
from tests.helpers.results.sphere_in_sphere import TREATMENT, ball_result

ALL = list(QUANTITIES)
needs_opengl = pytest.mark.skipif(missing_opengl() is not None, reason="no OpenGL library")


@pytest.fixture
def ball(tmp_path: Path) -> ResultInfo:
    return ball_result(tmp_path / "ball")


# The look


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"quantity": "covrage"}, "did you mean coverage"),
        ({"quantity": "xyz"}, "there are coverage, impacts"),
        ({"time_s": -1.0}, "0 or more"),
        ({"time_s": float("nan")}, "0 or more"),
        ({"time_s": 3.0, "quantity": "interval"}, "not supported"),
        ({"below": 0.0}, "up to 100 %"),
        ({"below": 101.0}, "up to 100 %"),
        ({"cut_part": True}, "--clip"),
    ],
)
def test_what_cannot_be_looked_at_is_said(options: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        ViewState(**options)


def test_a_plane_is_said_by_its_axis() -> None:
    assert parse_clip("Z") == ((0.0, 0.0, 1.0), None)
    assert parse_clip("x=-3.5") == ((1.0, 0.0, 0.0), (-3.5, 0.0, 0.0))
    assert parse_clip("Y=2") == ((0.0, -1.0, 0.0), (0.0, 2.0, 0.0))
    for text in ("W", "X=", "X=a", "XY", ""):
        with pytest.raises(InputError, match=r"Z=12\.5"):
            parse_clip(text)


def test_an_eye_is_said_by_a_direction() -> None:
    assert parse_view("1,-1.4,-0.8") == (1.0, -1.4, -0.8)
    for text in ("0,0,0", "1,2", "x", "1,2,inf", "0,0,1e300", "1e-300,0,0"):
        with pytest.raises(InputError, match="direction"):
            parse_view(text)


def test_keys() -> None:
    first = ViewState("speed", below=80.0)
    assert [state_after_key(first, str(n + 1), first, ALL).quantity for n in range(len(ALL))] == ALL
    assert state_after_key(first, "4", first, ["coverage"]) == first  # not there
    look, thresholds = first, []
    for _ in range(6):
        look = state_after_key(look, "b", first, ALL)
        thresholds.append(look.below)
    assert thresholds == [75.0, 50.0, None, 98.0, 90.0, 75.0]
    look = state_after_key(first, "x", first, ALL)
    assert (look.cut is not None, look.cut_part) == (True, True)
    look = state_after_key(look, "c", first, ALL)
    assert (look.cut, look.cut_part) == (None, False)
    assert not state_after_key(first, "g", first, ALL).chamber
    assert state_after_key(state_after_key(first, "h", first, ALL), "h", first, ALL) == first
    assert state_after_key(ViewState(triangle=3, view=0), "u", first, ALL) == ViewState()
    assert state_after_key(ViewState("angle", time_s=3.0), "r", first, ALL) == first
    assert (
        state_after_key(ViewState(time_s=3.0), str(1 + ALL.index("interval")), first, ALL).time_s
        is None
    )


@pytest.mark.parametrize("high", [0.35, 1.5, 2.0, 8.5, 90.0, 100.0, 500.0])
def test_bars_have_round_labels(high: float) -> None:
    steps, written = colour_bar_ticks((0.0, high))
    labels = [high * k / steps for k in range(steps + 1)]
    assert [float(written % label) for label in labels] == pytest.approx(labels)
    assert len({written % label for label in labels}) == len(labels)


# A result


def test_time_moves_what_grows(ball: ResultInfo) -> None:
    seen = OpenedResult(ball)
    now, later = ViewState(), ViewState(time_s=2.0 * TREATMENT)
    bare = 1.0 - seen.part.values(QUANTITIES["coverage"]) / 100.0
    for look, times in ((now, 1.0), (later, 2.0)):
        seen.show(look)
        np.testing.assert_allclose(
            seen.part.target["shown"], 100.0 * (1.0 - bare**times), atol=1e-9
        )
    assert colour_limits([seen], later) == (0.0, 100.0)
    impacts = seen.part.values(QUANTITIES["impacts"])
    seen.show(ViewState("impacts", time_s=2.0 * TREATMENT))
    np.testing.assert_allclose(seen.part.target["shown"], 2.0 * impacts)
    speed = seen.part.values(QUANTITIES["speed"])
    seen.show(ViewState("speed", time_s=2.0 * TREATMENT))
    np.testing.assert_array_equal(seen.part.target["shown"], speed)


def test_marked_dents_have_one_time(tmp_path: Path) -> None:
    subject = ball_result(tmp_path / "ball", marked=True)
    seen = OpenedResult(subject)
    seen.show(ViewState())
    np.testing.assert_allclose(seen.part.target["shown"], 100.0 * seen.part.target["coverage"])
    with pytest.raises(InputError, match="marked one by one, at the treatment time of 10 s"):
        seen.show(ViewState(time_s=3.0))
    seen.show(ViewState("impacts", time_s=3.0))


def test_below_is_of_coverage_whatever_is_shown(ball: ResultInfo) -> None:
    seen = OpenedResult(ball)
    passed = seen.above_threshold(ViewState("speed", below=60.0))
    np.testing.assert_array_equal(passed, seen.part.target["coverage"] >= 0.6)
    assert passed.any()
    later = seen.above_threshold(ViewState("speed", below=60.0, time_s=4.0 * TREATMENT))
    assert (later & ~passed).any()
    assert not seen.above_threshold(ViewState()).any()


def test_a_triangles_numbers(ball: ResultInfo) -> None:
    seen = OpenedResult(ball)
    lines = seen.describe_triangle(404, ViewState())
    text = "\n".join(lines)
    surface = seen.surface
    assert lines[0] == "triangle 404"
    assert f"coverage: {100.0 * surface['coverage'][404]:.4g} %" in lines
    assert f"impacts per area: {surface['impacts_per_mm2'][404]:.4g} 1/mm²" in lines
    assert "mean normal speed: 2.5 m/s" in lines
    assert "simulated: 4 impacts, 20 dents" in lines
    assert "energy" not in text  # not in this result
    assert "mean normal speed: none" in seen.describe_triangle(405, ViewState())
    assert "not in the target" in seen.describe_triangle(
        int(np.argmin(surface["target"])), ViewState()
    )
    np.testing.assert_array_equal(seen.hits.of(404).speed, [1.0, 2.0, 3.0, 4.0])
    surface["element"] = np.arange(surface.n_cells) + 1000
    assert seen.describe_triangle(404, ViewState())[0] == "triangle 404, element 1404"
    with pytest.raises(InputError, match="triangles 0 to 1279"):
        seen.describe_triangle(1280, ViewState())


def test_files_of_another_result_are_noticed(tmp_path: Path, ball: ResultInfo) -> None:
    other = ball_result(tmp_path / "other", lost=7)
    folder = Path(ball.folder)
    (tmp_path / "hits.npz").write_bytes((folder / "hits.npz").read_bytes())
    save_hits(folder / "hits.npz", sort_hits_by_triangle([OpenedResult(other).hits.hits], 1280))
    with pytest.raises(InputError, match="not those of the coverage"):
        _ = OpenedResult(ball).hits
    (folder / "hits.npz").unlink()
    assert OpenedResult(ball).hits is None
    (folder / "coverage.vtp").write_bytes(Path(other.folder, "coverage.vtp").read_bytes())
    with pytest.raises(InputError, match=r"of another result than result\.json"):
        OpenedResult(ball)
    (folder / "coverage.vtp").write_bytes((folder / "chamber.vtp").read_bytes())
    with pytest.raises(InputError, match="has no coverage"):
        OpenedResult(ball)


def test_what_an_older_result_lacks_is_said(ball: ResultInfo) -> None:
    seen = OpenedResult(ball)
    assert seen.quantities == ["coverage", "impacts", "speed", "p90-speed"]
    with pytest.raises(InputError, match=r"--quantity energy.*simulate again"):
        seen.show(ViewState("energy"))


def test_a_damaged_surface_is_one_sentence(
    ball: ResultInfo, capfd: pytest.CaptureFixture[str]
) -> None:
    file = Path(ball.folder) / "coverage.vtp"
    whole = file.read_bytes()
    for damaged in (whole[: len(whole) // 2], b"nothing of the kind" * 50):
        file.write_bytes(damaged)
        with pytest.raises(InputError, match="damaged"):
            read_surface(file)
    assert capfd.readouterr() == ("", "")


def test_only_views_of_the_same_part_are_linked(tmp_path: Path, ball: ResultInfo) -> None:
    moved, other = (
        ball_result(tmp_path / "moved", moved=1.0),
        ball_result(tmp_path / "other", lost=7),
    )
    assert same_part([OpenedResult(ball), OpenedResult(moved)])
    assert not same_part([OpenedResult(ball), OpenedResult(other)])


def test_a_target_that_looks_down_is_seen_from_below() -> None:
    for looks, side in ((-1.0, -1.0), (1.0, 1.0)):
        plate = (
            pyvista()
            .Plane(direction=(0.0, 0.0, looks), i_resolution=2, j_resolution=2)
            .triangulate()
        )
        plate["exposed_area_mm2"] = np.full(plate.n_cells, 0.125)
        assert np.sign(view_of_target(plate)[2]) == side
    ball = pyvista().Sphere()
    ball["exposed_area_mm2"] = np.ones(ball.n_cells)
    assert view_of_target(ball)[2] > 0.0


def test_a_dollar_in_a_name_is_no_formula() -> None:
    assert escape_dollars("x$y$_{z}") == r"x\$y\$_{z}"


# The window, driven without a display


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
    subprocess.run(command, check=True, env=without_display(), cwd=Path(__file__).parents[4])
    return {
        one["step"]: one for one in json.loads((folder / "steps.json").read_text(encoding="utf-8"))
    }


@needs_opengl
def test_a_window_shows_what_its_keys_say(steps: dict[str, dict[str, Any]]) -> None:
    def first(step: str) -> dict[str, Any]:
        return steps[step]["views"][0]

    assert "coverage [%]" in first("opened")["words"]
    assert "mean normal speed\n[m/s]" in first("3")["words"]
    assert any("[3 speed]" in text for text in first("3")["words"])
    assert (first("b")["drawn"].count(-2.0), first("opened")["drawn"].count(-2.0)) == (0, 0)
    assert first("slid")["drawn"].count(-2.0) > 100  # above 98 % by then: pale
    assert any("below 98 %: 100.0 %" in text for text in first("b")["words"])
    second = {step: steps[step]["views"][1]["planes"] for step in ("opened", "c", "x", "g")}
    assert second == {"opened": [0] * 5, "c": [0, 0, 1, 1, 1], "x": [1] * 5, "g": [1, 1]}
    assert any("deselect the triangle" in text for text in first("h")["words"])


@needs_opengl
def test_handles_are_there_when_they_do_something(steps: dict[str, dict[str, Any]]) -> None:
    slider = {step: steps[step]["slider"] for step in ("opened", "3", "1", "r", "marked")}
    assert slider == {"opened": True, "3": False, "1": True, "r": True, "marked": False}
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
        assert one["drawn"] == other["drawn"]
        assert one["eye"] == pytest.approx(other["eye"])
        assert one["charts"] == other["charts"] == 0
    assert before["views"][0]["eye"] == before["views"][1]["eye"]  # linked
