"""An opened result shows its own values, and refuses files of another result."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.coverage.part_impacts import save_hits, sort_hits_by_triangle
from chamberopt.pictures.quantities import QUANTITIES
from chamberopt.viewer.opened_result import OpenedResult, ResultInfo, colour_limits, same_part
from chamberopt.viewer.view_state import ViewState
from tests.helpers.results.sphere_in_sphere import TREATMENT, ball_result


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


def test_below_is_of_coverage_whatever_is_shown(ball: ResultInfo) -> None:
    seen = OpenedResult(ball)
    passed = seen.above_threshold(ViewState("speed", below=60.0))
    target = seen.part.target
    mean = target["coverage"][target.regular_faces].mean(axis=1)
    np.testing.assert_array_equal(passed, mean >= 0.6)
    assert passed.any()
    later = seen.above_threshold(ViewState("speed", below=60.0, time_s=4.0 * TREATMENT))
    assert (later & ~passed).any()
    assert seen.above_threshold(ViewState()) is None


def test_a_triangles_numbers(ball: ResultInfo) -> None:
    seen = OpenedResult(ball)
    lines = seen.describe_triangle(404, ViewState())
    text = "\n".join(lines)
    surface = seen.surface
    assert lines[0] == "triangle 404, element 1404"
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
    later = seen.describe_triangle(404, ViewState(time_s=2.0 * TREATMENT))
    assert f"coverage: {100.0 * (1.0 - (1.0 - surface['coverage'][404]) ** 2):.4g} %" in later
    with pytest.raises(InputError, match="triangles 0 to 1279"):
        seen.describe_triangle(1280, ViewState())


def test_files_of_another_result_are_noticed(tmp_path: Path, ball: ResultInfo) -> None:
    other = ball_result(tmp_path / "other", lost=7)
    folder = Path(ball.folder)
    save_hits(folder / "hits.npz", sort_hits_by_triangle([OpenedResult(other).hits.hits], 1280))
    with pytest.raises(InputError, match=r"hits\.npz: not the file that was written"):
        _ = OpenedResult(ball).hits
    (folder / "hits.npz").unlink()
    with pytest.raises(InputError, match=r"hits\.npz: not there"):
        _ = OpenedResult(ball).hits
    with (folder / "arrays.npz").open("ab") as file:
        file.write(b" ")
    with pytest.raises(InputError, match=r"arrays\.npz: not the file .*: its sha256 is"):
        OpenedResult(ball)


def test_what_a_file_lacks_is_said(ball: ResultInfo) -> None:
    seen = OpenedResult(ball)
    assert seen.quantities == ["coverage", "impacts", "speed", "p90-speed", "interval"]
    with pytest.raises(InputError, match=r"--quantity energy.*simulate again"):
        seen.show(ViewState("energy"))


def test_only_views_of_the_same_part_are_linked(tmp_path: Path, ball: ResultInfo) -> None:
    moved, other = (
        ball_result(tmp_path / "moved", moved=1.0),
        ball_result(tmp_path / "other", lost=7),
    )
    assert same_part([OpenedResult(ball), OpenedResult(moved)])
    assert not same_part([OpenedResult(ball), OpenedResult(other)])


def test_places_out_of_reach_and_with_few_dents_are_apart(ball: ResultInfo) -> None:
    part = OpenedResult(ball).part
    middle = part.target.cell_centers().points
    resolved = np.asarray(part.target["resolved"])
    assert middle[resolved][:, 2].max() < 9.5
    assert middle[~resolved][:, 2].min() > 6.5
    assert part.unreached.cell_centers().points[:, 2].max() < -7.0
    assert middle[:, 2].min() > -9.0
    together = (part.target, part.unreached, part.rest)
    triangles = np.concatenate([one["triangle"] for one in together])
    np.testing.assert_array_equal(np.sort(triangles), np.arange(1280))
    assert part.whole.n_cells == part.target.n_cells + part.unreached.n_cells


def test_colours_do_not_fade_to_what_has_no_value(tmp_path: Path) -> None:
    part = OpenedResult(ball_result(tmp_path / "ball")).part
    edge = part.target["reachable"] < 0.5
    assert edge.any()
    near = part.target["shown"][~edge].min()
    assert (part.target["shown"][edge] >= near).all()
