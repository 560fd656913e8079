"""Each pixel of a dent map is a point of the surface: seen from the right side, and inside just the dents that hold
it.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from matplotlib.image import imread

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.coverage.dent_marking import SamplePoints, mark_points, marked_share, sample_points
from chamberopt.coverage.dents import Dents, dents_on_part
from chamberopt.design.load import load_design
from chamberopt.geometry.raycast import places, seen, view_of
from chamberopt.output.resimulate.dent_map import (
    REST,
    TARGET,
    DentMap,
    coverage,
    default_views,
    dent_map,
    peened,
    topmost,
)
from chamberopt.output.resimulate.rebuild import rebuild_replica
from chamberopt.output.results.load import Result
from chamberopt.output.viewer.images.dent_map import light_colours
from sim_core import simulate
from tests.helpers.results.short_plate import plate_result
from tests.helpers.synthetic import DESIGNS, plate_design

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return plate_result(tmp_path_factory.mktemp("dents") / "plate")


def thrown(chamber: Chamber, count: int, radius: float, seed: int = 0) -> Dents:
    """Dents of several sizes at random points of the part's exposed surface, evenly over its area."""
    rng = np.random.default_rng(seed)
    surface = sample_points(chamber, 2e-4)
    at = rng.choice(len(surface.area), count, p=surface.area / surface.area.sum())
    sizes = radius * rng.uniform(0.5, 1.0, count)
    return Dents(surface.place[at], surface.normal[at], sizes, np.arange(count, dtype=float))


def test_the_nearest_triangle_is_seen_and_where_on_it() -> None:
    """A small square over a large one, seen from above: which, how large, and where."""
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    square = corner[[[0, 1, 2], [0, 2, 3]]]
    small = 0.3 * square + [0.2, 0.5, 0.1]
    view = view_of(square.reshape(-1, 3), UP, 400)
    which = seen(view, np.concatenate([square, small]))
    pixels = view.pixel**2
    assert (which >= 2).sum() * pixels == pytest.approx(0.09, rel=0.02)
    assert (which >= 0).sum() * pixels == pytest.approx(1.0, rel=0.01)
    row, column = np.nonzero(which >= 2)
    there = places(view, np.concatenate([square, small]), which[row, column], row, column)
    np.testing.assert_allclose(there[:, 2], 0.1, atol=1e-12)
    assert there[:, 0].min() == pytest.approx(0.2, abs=view.pixel)
    assert there[:, 1].max() == pytest.approx(0.8, abs=view.pixel)
    assert row.mean() < 0.5 * view.shape[0]  # y is up
    assert column.mean() < 0.5 * view.shape[1]  # x to the right


def test_a_ball_is_seen_without_cracks_and_its_points_are_on_it() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    corners = np.asarray(ball.triangles)
    view = view_of(corners.reshape(-1, 3), np.array([0.3, -0.5, 0.8]), 300)
    which = seen(view, corners)
    assert (which >= 0).sum() * view.pixel**2 == pytest.approx(np.pi, rel=0.01)
    filled = which >= 0
    assert all(
        np.diff(np.flatnonzero(line)).max(initial=1) == 1 for line in filled
    )  # no crack in any row
    row, column = np.nonzero(filled)
    there = places(view, corners, which[row, column], row, column)
    assert np.abs(np.linalg.norm(there, axis=1) - 1.0).max() < 3e-3  # facets
    assert ((there @ view.towards) > -0.05).all()  # the near half


def test_the_last_dent_lies_on_top_and_bends_round_an_edge() -> None:
    """Points on both faces of a right-angled ridge, dents beside it; against each point asked of each dent."""
    rng = np.random.default_rng(1)
    n, k = 4000, 300
    side = rng.random(n) < 0.5
    run, along = rng.uniform(0, 1, n), rng.uniform(0, 3, n)
    place = np.where(
        side[:, None], np.stack([-run, along, 0 * run], 1), np.stack([0 * run, along, -run], 1)
    )
    normal = np.where(side[:, None], UP, [1.0, 0, 0])
    unrolled = np.where(side, -run, run)
    at, far, own = rng.uniform(0, 1, k), rng.uniform(0, 3, k), rng.random(k) < 0.5
    dents = Dents(
        np.where(own[:, None], np.stack([-at, far, 0 * at], 1), np.stack([0 * at, far, -at], 1)),
        np.where(own[:, None], UP, [1.0, 0, 0]), rng.uniform(0.05, 0.2, k), np.arange(k, dtype=float),
    )  # fmt: skip
    last, off = topmost(place, normal, dents, 0.02)
    distance = np.hypot(unrolled[:, None] - np.where(own, -at, at), along[:, None] - far)
    inside = distance <= dents.radius
    expected = np.where(inside.any(axis=1), k - 1 - inside[:, ::-1].argmax(axis=1), -1)
    np.testing.assert_array_equal(last, expected)
    there = last >= 0
    np.testing.assert_allclose(
        off[there], (distance[np.arange(n), last] / dents.radius[last])[there], atol=1e-5
    )
    samples = SamplePoints(place, normal, np.zeros(n, dtype=int), np.ones(n))
    marked = mark_points(samples, dents.place, dents.normal, dents.radius, dents.time)
    np.testing.assert_array_equal(there, np.isfinite(marked))


def test_no_dents_leave_the_part_bare() -> None:
    nothing = Dents(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    chamber = build_chamber(plate_design())
    found = dent_map(chamber, nothing, (0, 0, -1), 100)
    assert (found.dent == -1).all()
    assert coverage(nothing, chamber, 1e-3) == 0.0


def test_one_dent_is_a_disc_of_its_size() -> None:
    chamber = build_chamber(plate_design())
    middle = np.array([[1e-3, 2e-3, chamber.height]])
    one = Dents(middle, np.array([UP]), np.array([0.4e-3]), np.zeros(1))
    found = dent_map(chamber, one, (0.0, 0.0, -1.0), 1000)
    assert found.area[found.dent == 0].sum() == pytest.approx(np.pi * 0.16e-6, rel=0.02)
    slanted = dent_map(chamber, one, (1.0, -0.5, -1.0), 1000)
    assert slanted.area[slanted.dent == 0].sum() == pytest.approx(np.pi * 0.16e-6, rel=0.02)
    assert (
        slanted.dent == 0
    ).sum() * slanted.view.pixel**2 < 0.75 * np.pi * 0.16e-6  # foreshortened


def share_by_triangle(found: DentMap, triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Seen area [m²] of each part triangle, and the share of it inside dents."""
    there = found.ground == TARGET
    area = np.bincount(found.triangle[there], found.area[there], triangles)
    dented = np.bincount(found.triangle[there], (found.area * (found.dent >= 0))[there], triangles)
    return area, np.divide(dented, area, out=np.zeros(triangles), where=area > 0.0)


@pytest.mark.parametrize("name", ["plate", "gear"])
def test_the_share_of_black_is_what_coverage_says(name: str) -> None:
    """Of every triangle that is seen whole and large, against the sample points of coverage: flat, and with edges."""
    chamber = build_chamber(load_design(DESIGNS / f"{name}.toml"))
    dents = thrown(chamber, 6000 if name == "plate" else 15_000, 0.3e-3)
    samples = sample_points(chamber, 1e-4 if name == "plate" else 7e-5)
    m = len(chamber.part.triangles)
    marked = marked_share(
        samples, mark_points(samples, dents.place, dents.normal, dents.radius, dents.time), 1e9, m
    )
    view = default_views(chamber)[0]
    found = dent_map(chamber, dents, view, 1000 if name == "plate" else 1500)
    area, share = share_by_triangle(found, m)
    pixels = np.bincount(found.triangle[found.ground == TARGET], minlength=m)
    whole = (area > 0.97 * chamber.exposed_area) & chamber.part.target & (pixels > 250)
    assert whole.sum() > 300
    weight = chamber.exposed_area[whole]
    assert 0.2 < (marked[whole] @ weight) / weight.sum() < 0.8
    assert share[whole] @ weight / weight.sum() == pytest.approx(
        marked[whole] @ weight / weight.sum(), abs=0.003
    )
    assert np.abs(share - marked)[whole].max() < 0.1
    if name == "plate":
        assert area[whole].sum() == pytest.approx(weight.sum(), rel=0.01)
        there = found.ground == TARGET
        assert (found.dent[there] >= 0).mean() == pytest.approx(
            coverage(dents, chamber, 1e-4), abs=0.004
        )


def test_a_flat_target_is_seen_face_on_and_a_round_one_from_two_sides() -> None:
    np.testing.assert_allclose(
        default_views(build_chamber(plate_design())), [(0.0, 0.0, -1.0)], atol=1e-12
    )
    one, other = default_views(build_chamber(load_design(DESIGNS / "gear.toml")))
    np.testing.assert_allclose(one, -np.array(other))


def test_a_peening_goes_on_from_the_replica_that_the_result_knows(result: Result) -> None:
    replica = rebuild_replica(result)
    own = dents_on_part(simulate(replica.scene).impacts, replica.chamber, replica.design)
    longer = peened(replica, 0.5)
    assert len(longer) > 1.3 * len(own) > 300
    np.testing.assert_array_equal(longer.place[: len(own)], own.place)
    np.testing.assert_array_equal(longer.time[: len(own)], own.time)
    shorter = peened(replica, 0.1)
    assert shorter.time.max() <= 0.1
    np.testing.assert_array_equal(shorter.radius, own.radius[: len(shorter)])
    for time in (0.0, 601.0, float("nan")):
        with pytest.raises(InputError, match="--at-s"):
            peened(replica, time)


def test_the_picture_has_as_much_black_as_is_bare(
    result: Result, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "dents.png"
    assert (
        main(["dents", str(result.folder), str(picture), "--at-s", "0.5", "--pixels", "400"]) == 0
    )
    said = capsys.readouterr().out
    assert "simulated on from 0.3 s" in said
    image = imread(picture)[..., :3]
    replica = rebuild_replica(result)
    dents = peened(replica, 0.5)
    found = dent_map(replica.chamber, dents, (0, 0, -1), 800)
    assert (found.ground == REST).any()
    bare = (found.dent < 0)[found.ground == TARGET].mean()
    rows = image.shape[0]
    inner = image[rows // 4 : 3 * rows // 4, rows // 4 : 3 * rows // 4]  # the target alone
    assert (inner.max(axis=2) < 0.25).mean() == pytest.approx(bare, abs=0.03)
    assert 0.02 < 1.0 - bare < 0.2
    lightest = light_colours()(1.0)[:3]
    assert (np.abs(image - lightest).max(axis=2) < 0.05).any()
    assert list(tmp_path.iterdir()) == [picture]


def test_on_the_command_line(
    result: Result, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, picture = str(result.folder), str(tmp_path / "a.png")
    for arguments, said in (
        ([folder, str(tmp_path / "a.jpg")], "pictures are written as .png"),
        ([folder, picture, "--at-s", "-1"], "--at-s: given -1"),
        ([folder, picture, "--view", "0,0,0"], "--view 0,0,0: give the direction"),
        ([folder, picture, "--view", "1,0,0", "--at-s", "0.1"], "seen edge on"),
        ([folder, picture, "--pixels", "99"], "--pixels: given 99; 200 to 1500"),
        ([folder, picture, "--replica", "3"], "--replica: given 3"),
        ([str(tmp_path), picture], "not a results folder"),
    ):
        assert main(["dents", *arguments]) == 2
        assert said in capsys.readouterr().err.strip().splitlines()[-1]
        assert not list(tmp_path.iterdir())


def test_a_target_kept_by_a_study_is_the_results_own(result: Result) -> None:
    """What coverage.vtp says is the target holds for target.reachable, not what this chamber alone would say."""
    target = result.design.part.target.model_copy(update={"reachable": True})
    part = result.design.part.model_copy(update={"target": target})
    kept = rebuild_replica(
        replace(result, design=result.design.model_copy(update={"part": part}))
    ).chamber.part.target
    np.testing.assert_array_equal(kept, rebuild_replica(result).chamber.part.target)
