"""Where one candidate covers more than another.

The place is found where the difference was put, seldom where there is no difference, and is shown
in the colour of that candidate.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from chamberopt.chamber.build import build_chamber
from chamberopt.geometry.triangles import rotation_matrix
from chamberopt.pictures.difference import draw_difference, write_differences
from chamberopt.pictures.subprocess_drawing import missing_opengl
from chamberopt.results.compare.local_difference import (
    TargetSurface,
    _averaged,
    _radii,
    local_difference,
    read_target_surface,
)
from chamberopt.results.load import load_result
from chamberopt.results.vtp_files import pyvista
from chamberopt.workflows.save_run import save_simulation
from tests.helpers.synthetic import evaluation_of, plate_design, random_dents

PLATE = plate_design(part__offset_mm__0=0.5)  # beside the axis: no two places are alike
CHAMBER = build_chamber(PLATE)
DIAMETER = 1.5e-4  # m, of dents
REPLICAS = 4


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("chamberopt.workflows.save_run.draw_coverage", lambda *_: None)


def peened(folder: Path, per_mm2: np.ndarray | float, seed: int) -> TargetSurface:
    """A result whose dents fell at random, so many in all on each mm² of a triangle."""
    rng = np.random.default_rng(seed)
    mean = per_mm2 * 1e6 * CHAMBER.exposed_area / REPLICAS
    hits = [random_dents(PLATE, CHAMBER, mean, rng, DIAMETER) for _ in range(REPLICAS)]
    save_simulation(folder, PLATE, CHAMBER, evaluation_of(PLATE, CHAMBER, hits))
    return read_target_surface(load_result(folder))


def on_the_right() -> np.ndarray:
    return np.asarray(CHAMBER.part.vertices[CHAMBER.part.triangles].mean(axis=1)[:, 0] > 0.0)


def covered(per_mm2: float) -> float:
    """Coverage after the treatment by dents of which so many were simulated on each mm²."""
    process = PLATE.process
    times = process.treatment_time_s / (REPLICAS * process.accuracy.simulated_time_s)
    return float(-np.expm1(-per_mm2 * 1e6 * np.pi / 4.0 * DIAMETER**2 * times))


def test_more_on_one_half_is_found_there_and_not_elsewhere(tmp_path: Path) -> None:
    first = peened(tmp_path / "a", 30.0, 1)
    found = local_difference(first, peened(tmp_path / "b", np.where(on_the_right(), 90.0, 30.0), 2))
    x = first.place[:, 0]
    right, left = x > 2.0, x < -2.0  # mm; windows reach across the middle
    area = first.area
    wanted = covered(90.0) - covered(30.0)
    assert np.average(found.value[right], weights=area[right]) == pytest.approx(wanted, abs=0.02)
    assert np.average(found.value[left], weights=area[left]) == pytest.approx(0.0, abs=0.02)
    assert area[right & found.real].sum() > 0.9 * area[right].sum()
    assert area[left & found.real].sum() < 0.1 * area[left].sum()
    assert 0.48 < found.more < 0.5 + 2.0 / 26.0 + 0.03  # discs reach up to 2 mm across the middle
    assert found.less < 0.05


@pytest.mark.parametrize(
    "per_mm2",
    [15.0, pytest.param(80.0, marks=pytest.mark.long)],
    ids=["averaged over discs", "window by window"],
)
def test_nothing_is_real_where_nothing_differs(tmp_path: Path, per_mm2: float) -> None:
    """Of single places a twentieth is beyond its interval; together they are known as chance."""
    beyond, shares = [], []
    for k in range(4):
        first, other = (
            peened(tmp_path / f"{name}{k}", per_mm2, 2 * k + seed) for seed, name in enumerate("ab")
        )
        found = local_difference(first, other)
        shares.append(found.more + found.less)
        coverage, interval, _ = other.at(first)
        radius = _radii(first, other)[0]
        assert (radius > 0.0) == (per_mm2 < 60.0)
        gap, width = coverage - first.coverage, np.hypot(interval, first.interval)
        value, half_width = _averaged(first, gap, width, radius)
        beyond.append(first.area[np.abs(value) > half_width].sum())
    assert 0.005 < np.mean(beyond) < 0.07
    assert max(shares) < 0.01


def test_too_few_dents_and_places_out_of_reach(tmp_path: Path) -> None:
    first = peened(tmp_path / "a", 60.0, 1)
    few = replace(first, resolved=np.zeros(len(first.area), dtype=bool))
    none = replace(
        first, coverage=0.0 * first.coverage, interval=0.0 * first.interval,
        resolved=np.ones(len(first.area), dtype=bool),
    )  # fmt: skip
    more = replace(first, coverage=np.minimum(first.coverage + 0.5, 1.0))
    assert local_difference(first, more).more > 0.9
    assert not local_difference(few, more).real.any()
    assert not local_difference(more, few).real.any()
    lost = local_difference(first, none)
    assert lost.value.mean() == pytest.approx(-first.coverage.mean(), abs=0.02)
    assert lost.less > 0.9


def test_a_part_that_stands_elsewhere_is_compared_place_by_place(tmp_path: Path) -> None:
    first = peened(tmp_path / "a", 60.0, 1)
    turn = rotation_matrix((20.0, 30.0, 40.0))
    shift = np.array([5.0, 6.0, 7.0])
    moved = replace(
        first, corners=first.corners @ turn.T + shift, place=first.place @ turn.T + shift,
        normal=first.normal @ turn.T,
    )  # fmt: skip
    assert local_difference(first, moved).value == pytest.approx(0.0, abs=1e-6)
    assert local_difference(moved, first).value == pytest.approx(0.0, abs=1e-6)


@pytest.mark.skipif(missing_opengl() is not None, reason="no OpenGL library")
def test_the_picture_is_violet_where_more_orange_where_less_and_pale_between(
    tmp_path: Path,
) -> None:
    """Colours by their hue, shares of the picture; greys are bluish by up to 12 of 255."""
    one = peened(tmp_path / "a", 20.0, 1)
    right = one.place[:, 0] > 0.0
    value = np.where(right, 0.3, -0.3)
    shares = []
    for name, real in (("all", np.ones(len(right), dtype=bool)), ("right", right)):
        vtp = tmp_path / f"{name}.vtp"
        write_differences(vtp, tmp_path / "a", [(value, real, np.ones_like(real))])
        written = pyvista().read(vtp)
        on_target = np.unique(written.regular_faces[written["target"] > 0])
        assert written["difference_1"][on_target] == pytest.approx(100.0 * value)
        picture = tmp_path / f"{name}.png"
        assert (
            draw_difference(
                tmp_path / "a", [(value, real, np.ones_like(real))], ["b less a"], picture
            )
            is None
        )
        image = imread(tmp_path / f"{name}.png")[..., :3]
        view = image[:-110, :-150]  # without the axes and the colour bar, which has all colours
        violet, orange = (view[..., i] - view[..., j] > 16 / 255 for i, j in ((2, 1), (0, 2)))
        shares.append((violet.mean(), orange.mean()))
    (violet, orange), (violet_alone, orange_alone) = shares
    assert min(violet, orange) > 0.05
    assert violet_alone == pytest.approx(violet, rel=0.02)
    assert orange_alone < 1e-3
