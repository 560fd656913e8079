"""Where one candidate covers more than another.

The place is found where the difference was put, seldom where there is no difference, and is shown
in the colour of that candidate.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.output import viewer
from chamberopt.output.compare.local_difference import local_difference
from chamberopt.output.compare.target_surface import TargetSurface, read_target_surface
from chamberopt.output.results.load import load_result
from chamberopt.output.save_run import save_simulation
from chamberopt.output.viewer import draw_difference, missing_opengl, write_differences
from chamberopt.output.vtp_files import read_surface
from tests.helpers.synthetic import equal_dents, evaluation_of, plate_design

PLATE = plate_design()
CHAMBER = build_chamber(PLATE)
TIMES = PLATE.process.treatment_time_s / (4 * PLATE.process.accuracy.simulated_time_s)
DENT = 1e-8  # m²


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer, "draw_coverage", lambda *_: None)


def peened(
    folder: Path, per_mm2: np.ndarray | float, seed: int, chamber: Chamber = CHAMBER
) -> TargetSurface:
    """A result whose dents fell at random, so many in all on each mm² of a triangle."""
    rng = np.random.default_rng(seed)
    mean = per_mm2 * 1e6 * chamber.exposed_area / 4
    tallies = [
        equal_dents(PLATE.process.accuracy.simulated_time, rng.poisson(mean), DENT)
        for _ in range(4)
    ]
    save_simulation(folder, PLATE, chamber, evaluation_of(PLATE, chamber, tallies))
    return read_target_surface(load_result(folder))


def on_the_right() -> np.ndarray:
    return np.asarray(CHAMBER.part.vertices[CHAMBER.part.triangles].mean(axis=1)[:, 0] > 0.0)


def test_more_on_one_half_is_found_there_and_not_elsewhere(tmp_path: Path) -> None:
    right = on_the_right()
    found = local_difference(
        peened(tmp_path / "a", 20.0, 1), peened(tmp_path / "b", np.where(right, 40.0, 20.0), 2)
    )
    target = CHAMBER.part.target
    assert np.isnan(found.value[~target]).all()
    assert not found.real[~target].any()
    away = (
        np.abs(CHAMBER.part.vertices[CHAMBER.part.triangles].mean(axis=1)[:, 0])
        > 1e-3 * found.radius
    )
    wanted = np.exp(-20.0 * 1e6 * DENT * TIMES) - np.exp(-40.0 * 1e6 * DENT * TIMES)
    assert found.value[target & right & away].mean() == pytest.approx(wanted, abs=0.01)
    assert found.value[target & ~right & away].mean() == pytest.approx(0.0, abs=0.01)
    assert found.real[target & right & away].mean() > 0.95
    assert found.real[target & ~right & away].mean() < 0.1
    assert found.more == pytest.approx(0.5, abs=0.08)
    assert found.less < 0.05


@pytest.mark.parametrize(
    "per_mm2", [1.0, 100.0], ids=["averaged over discs", "triangle by triangle"]
)
def test_one_in_twenty_is_real_by_chance_where_nothing_differs(
    tmp_path: Path, per_mm2: float
) -> None:
    shares = []
    for k in range(6):
        pair = [
            peened(tmp_path / f"{name}{k}", per_mm2, 2 * k + seed) for seed, name in enumerate("ab")
        ]
        found = local_difference(pair[0], pair[1])
        shares.append(found.more + found.less)
        assert (found.radius > 0.0) == (per_mm2 < 10.0)
    assert np.mean(shares) < 0.07
    if per_mm2 > 10.0:
        assert np.mean(shares) > 0.02  # ... and the interval is not too wide


def test_what_is_hidden_in_one_is_not_covered_there(tmp_path: Path) -> None:
    hidden = on_the_right()
    half = replace(CHAMBER, exposed_area=np.where(hidden, 0.0, CHAMBER.exposed_area))
    found = local_difference(
        peened(tmp_path / "all", 100.0, 1), peened(tmp_path / "half", 100.0, 2, half)
    )
    lost = hidden & CHAMBER.part.target
    covered_in_first = 1.0 - np.exp(-100.0 * 1e6 * DENT * TIMES)
    assert found.value[lost].mean() == pytest.approx(-covered_in_first, abs=0.02)
    assert found.real[lost].all()


@pytest.mark.skipif(missing_opengl() is not None, reason="no OpenGL library")
def test_the_picture_is_violet_where_more_orange_where_less_and_pale_between(
    tmp_path: Path,
) -> None:
    """Colours by their hue, shares of the picture; greys are bluish by up to 12 of 255."""
    one = peened(tmp_path / "a", 20.0, 1)
    right, target = on_the_right(), one.target
    value = np.where(target, np.where(right, 0.3, -0.3), np.nan)
    shares = []
    for name, real in (("all", target), ("right", target & right)):
        vtp = tmp_path / f"{name}.vtp"
        write_differences(vtp, tmp_path / "a" / "coverage.vtp", [(value, real)])
        assert read_surface(vtp)["difference_1"][target] == pytest.approx(100.0 * value[target])
        assert draw_difference(vtp, ["b less a"], tmp_path / f"{name}.png") is None
        image = imread(tmp_path / f"{name}.png")[..., :3]
        assert image.shape == (900, 1800, 3)
        below = image[:, :900]  # the other view has the colour bar, which has all colours
        violet, orange = (below[..., i] - below[..., j] > 16 / 255 for i, j in ((2, 1), (0, 2)))
        shares.append((violet.mean(), orange.mean()))
    (violet, orange), (violet_alone, orange_alone) = shares
    assert min(violet, orange) > 0.05
    assert violet_alone == pytest.approx(violet, rel=0.02)
    assert orange_alone < 1e-3
