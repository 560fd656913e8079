"""Areas of discs on a surface, known by hand: alone, overlapping, across triangles, round edges."""

import numpy as np
import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.common.parallel.executor import SerialExecutor
from chamberopt.coverage.dent_marking import (
    SamplePoints,
    few_points_note,
    first_marked_times,
    marked_share,
    sample_points,
)
from chamberopt.coverage.dents import Dents, dent_diameters
from chamberopt.design.load import load_design
from chamberopt.design.shot import ShotSize
from chamberopt.simulation.evaluate import evaluate
from tests.helpers.synthetic import DESIGNS, impact_log, plate_design

UP = np.array([0.0, 0.0, 1.0])


def square(
    side: float, spacing: float, normal: np.ndarray = UP, corner: tuple[float, ...] = (0, 0, 0)
) -> SamplePoints:
    """Points on a square with a side along y, in 100 patches."""
    along = np.arange(0.5 * spacing, side, spacing)
    u, v = (grid.ravel() for grid in np.meshgrid(along, along))
    across = np.cross([0.0, 1.0, 0.0], normal)
    place = np.asarray(corner) + u[:, None] * across + v[:, None] * [0.0, 1.0, 0.0]
    triangle = (u // (side / 10)).astype(int) * 10 + (v // (side / 10)).astype(int)
    return SamplePoints(place, np.tile(normal, (len(u), 1)), triangle, np.full(len(u), spacing**2))


def together(*parts: SamplePoints) -> SamplePoints:
    return SamplePoints(
        *(
            np.concatenate([getattr(p, f) for p in parts])
            for f in ("place", "normal", "triangle", "area")
        )
    )


def marked_area(
    samples: SamplePoints, places: list, radius: float, normals: list | None = None
) -> float:
    k = len(places)
    normal = np.tile(UP, (k, 1)) if normals is None else np.array(normals, dtype=float)
    place, time = np.array(places, dtype=float), np.arange(k, dtype=float)
    first = first_marked_times(samples, Dents(place, normal, np.full(k, radius), time))
    return float(samples.area[np.isfinite(first)].sum())


def test_one_dent_has_its_area_across_triangles() -> None:
    plane = square(10.0, 0.02)
    for place in (
        [5.5, 5.5, 0.0],
        [5.0, 5.0, 0.0],
        [4.2, 6.1, 0.0],
    ):  # inside one triangle, or over four
        assert marked_area(plane, [place], 0.45) == pytest.approx(np.pi * 0.45**2, rel=0.01)


def test_overlap_counts_once() -> None:
    plane, r, apart = square(10.0, 0.02), 0.5, 0.6
    lens = 2 * r**2 * np.arccos(apart / (2 * r)) - 0.5 * apart * np.sqrt(4 * r**2 - apart**2)
    assert marked_area(plane, [[4, 4, 0], [4, 4, 0]], r) == pytest.approx(np.pi * r**2, rel=0.01)
    assert marked_area(plane, [[4, 4, 0], [4 + apart, 4, 0]], r) == pytest.approx(
        2 * np.pi * r**2 - lens, rel=0.01
    )


@pytest.mark.parametrize(
    "angle", [30.0, 90.0, 150.0, -60.0], ids=["blunt", "right", "sharp", "hollow"]
)
@pytest.mark.parametrize("beside", [0.0, 0.2])
def test_a_disc_bends_round_an_edge_and_keeps_its_area(angle: float, beside: float) -> None:
    """Two half-planes meeting in the line x = 0; unfolded they are one."""
    turn = np.radians(angle)
    normal = np.array([np.sin(turn), 0.0, np.cos(turn)])
    left = square(4.0, 0.02, corner=(-4.0, 0.0, 0.0))
    right = square(4.0, 0.02, normal)
    area = marked_area(together(left, right), [[-beside, 2.0, 0.0]], 0.5)
    assert area == pytest.approx(np.pi * 0.25, rel=0.02)


def test_the_far_side_of_a_blade_and_the_next_wall_of_a_slot_stay_bare() -> None:
    top, below = square(4.0, 0.02), square(4.0, 0.02, -UP, (4.0, 0.0, -0.05))
    assert marked_area(together(top, below), [[2, 2, 0]], 0.4) == pytest.approx(
        np.pi * 0.16, rel=0.01
    )
    above = square(4.0, 0.02, -UP, (4.0, 0.0, 0.05))
    assert marked_area(together(top, above), [[2, 2, 0]], 0.4) == pytest.approx(
        np.pi * 0.16, rel=0.01
    )


def test_random_dents_cover_what_avrami_says_at_any_time() -> None:
    rng = np.random.default_rng(3)
    plane, r, count = square(10.0, 0.05), 0.25, 900
    shares = []
    for _ in range(12):
        place = np.column_stack(
            [rng.uniform(-r, 10 + r, (count, 2)), np.zeros(count)]
        )  # spilling over the rim both ways
        normal, time = np.tile(UP, (count, 1)), np.linspace(0.0, 1.0, count)
        first = first_marked_times(plane, Dents(place, normal, np.full(count, r), time))
        shares.append([np.mean(first <= t) for t in (0.25, 0.5, 1.0)])
    got, error = np.mean(shares, axis=0), np.std(shares, axis=0, ddof=1) / np.sqrt(12)
    density = count * np.pi * r**2 / (10 + 2 * r) ** 2
    expected = -np.expm1(-density * np.array([0.25, 0.5, 1.0]))
    assert (np.abs(got - expected) < 3.5 * error + 1e-3).all(), (got, expected, error)


def test_dents_that_keep_apart_cover_more_than_avrami_says() -> None:
    """The difference between the models: a regular lattice of discs that never overlap."""
    plane, r = square(10.0, 0.02), 0.45
    lattice = [[x + 0.5, y + 0.5, 0.0] for x in range(10) for y in range(10)]
    share = marked_area(plane, lattice, r) / 100.0
    assert share == pytest.approx(np.pi * r**2, rel=0.01)
    assert share > 1.3 * -np.expm1(-np.pi * r**2)


def test_points_cover_the_exposed_part_evenly() -> None:
    chamber = build_chamber(plate_design())
    samples = sample_points(chamber, 0.5e-3)
    area = np.bincount(samples.triangle, samples.area, len(chamber.part.triangles))
    np.testing.assert_allclose(area, chamber.exposed_area, atol=1e-12)
    assert len(samples.area) == pytest.approx(chamber.exposed_area.sum() / 0.25e-6, rel=0.2)
    np.testing.assert_allclose(np.linalg.norm(samples.normal, axis=1), 1.0)
    with pytest.raises(InputError, match="sample_mm"):
        sample_points(chamber, 1e-6)
    nothing = marked_share(samples, np.full(len(samples.area), np.inf), 1.0, len(area))
    assert np.isnan(nothing[chamber.exposed_area == 0]).all()
    assert (nothing[chamber.exposed_area > 0] == 0.0).all()


def test_each_ball_of_a_mix_leaves_dents_of_its_own_size() -> None:
    mix = (ShotSize(diameter_mm=2.0, share=0.4), ShotSize(diameter_mm=3.0, share=0.6))
    shot = plate_design().shot.model_copy(update={"diameter_mm": None, "mix": mix})
    design = plate_design().model_copy(update={"shot": shot})
    ends = np.array([0, shot.count - 1])
    small, large = dent_diameters(
        impact_log([0, 0], np.full((2, 3), 3.0), [3.0, 3.0], ends), design
    )
    assert 0.0 < small == pytest.approx(large * 2.0 / 3.0)


def marking_design(**values: float):  # type: ignore[no-untyped-def]
    """The plate, every dent marked over half a second."""
    design = plate_design(
        process__treatment_time_s=0.5,
        process__accuracy__replicas=4,
        process__accuracy__warmup_time_s=0.1,
        **values,
    )
    accuracy = design.process.accuracy.model_copy(update={"coverage_model": "dents"})
    return design.model_copy(
        update={"process": design.process.model_copy(update={"accuracy": accuracy})}
    )


def test_both_models_agree_on_the_mean_and_the_marks_grow_with_time() -> None:
    design = marking_design()
    chamber = build_chamber(design)
    marked = evaluate(design, chamber, SerialExecutor())
    assert marked.total.simulated_time == pytest.approx(4 * 0.5)  # all of the treatment
    avrami = design.changed({"process.accuracy.coverage_model": "avrami"})
    rates = evaluate(avrami, chamber, SerialExecutor())
    one, other = marked.metrics["mean_coverage"], rates.metrics["mean_coverage"]
    assert one.value > 0.0
    assert abs(one.value - other.value) < 2 * np.hypot(one.half_width, other.half_width)
    curve = [mean.value for _, mean in marked.marked.curve]
    assert (np.diff(curve) >= 0.0).all()
    assert curve[-1] == one.value
    # A part as it comes out has the grain of its dents; the coverage to expect has not.
    assert marked.metrics["std_coverage"].value > rates.metrics["std_coverage"].value


def test_a_treatment_too_long_to_simulate_is_refused(tmp_path) -> None:  # type: ignore[no-untyped-def]
    text = (
        (DESIGNS / "plate.toml")
        .read_text(encoding="utf-8")
        .replace("replicas = 8", 'coverage_model = "dents"')
    )
    text = text.replace('"parts/', f'"{DESIGNS}/parts/').replace(
        "treatment_time_s = 5\n", "treatment_time_s = 5000\n"
    )
    (tmp_path / "long.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"process\.accuracy\.coverage_model.*avrami"):
        load_design(tmp_path / "long.toml")


def test_too_few_sample_points_are_said() -> None:
    chamber = build_chamber(plate_design())
    side = np.sqrt(np.median(chamber.part.area[chamber.part.target]))
    (note,) = few_points_note(sample_points(chamber, side / 2), chamber)
    assert "4 sample points" in note
    assert "sample_mm" in note
    assert few_points_note(sample_points(chamber, side / 8), chamber) == ()
