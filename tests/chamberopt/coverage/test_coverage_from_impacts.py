"""Footprints of dents in windows: dented area is conserved, and the limit of small windows."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.executor import SerialExecutor
from chamberopt.coverage.coverage_from_impacts import (
    MAX_BATCHES,
    Batch,
    Footprints,
    coverage_from_dent_density,
    find_footprints,
    in_batches,
    joined,
)
from chamberopt.coverage.coverage_intervals import coverage_estimates
from chamberopt.coverage.field.crease_bands import CREASE_LENGTH
from chamberopt.coverage.field.surface_points import Reach
from chamberopt.coverage.field.target_field import (
    Gauge,
    TargetField,
    WindowSetting,
    find_target_field,
)
from chamberopt.coverage.part_impacts import Hits
from chamberopt.coverage.percentile import sum_dents
from chamberopt.simulation.evaluate import evaluate, prepare_target
from tests.helpers.synthetic import (
    chamber_round,
    dents_at,
    plane_chamber,
    plate_design,
    random_dents,
    triangles_at,
)

DESIGN = plate_design()
PLANE = plane_chamber()
BALL = 3e-3  # m


def field_of(
    chamber: Chamber, gauge_mm2: float = 1.0, points: int = 20_000, dent: float = 1e-3
) -> TargetField:
    setting = WindowSetting(1e-6 * gauge_mm2, points, BALL, dent)
    return find_target_field(chamber, chamber_mesh(chamber), setting)


def area_of_point(field: TargetField, gauge: Gauge) -> float:
    """What each window's middle stands for [m²]."""
    surface = field.surface
    return float((surface.area * surface.touched).sum()) / len(gauge.area)


def booked_area(field: TargetField, gauge: Gauge, hits: Hits) -> float:
    """Dented area that the windows have together [m²]."""
    return float(find_footprints(field, gauge, hits).weight.sum()) * area_of_point(field, gauge)


def sum_of_areas(hits: Hits) -> float:
    return float((np.pi / 4.0 * hits.dent.astype(float) ** 2).sum())


def plane_dents(
    rng: np.random.Generator, count: int, within: float, diameter: float | np.ndarray
) -> Hits:
    """Dents at random on the middle of the plane, at most `within` [m] from it along x and y."""
    place = np.column_stack([rng.uniform(-within, within, (count, 2)), np.zeros(count)])
    return dents_at(DESIGN, triangles_at(PLANE, place), place, diameter)


@pytest.mark.parametrize("gauge_mm2", [0.25, 1.0, 4.0])
def test_dents_in_a_plane_keep_their_area(gauge_mm2: float) -> None:
    rng = np.random.default_rng(1)
    hits = plane_dents(rng, 400, 4e-3, rng.uniform(0.1e-3, 0.5e-3, 400))
    field = field_of(PLANE, gauge_mm2, points=120_000)  # an eighth of them for the wide windows
    for gauge in (field.gauge, field.wide):
        assert booked_area(field, gauge, hits) == pytest.approx(sum_of_areas(hits), rel=0.01)
    found = find_footprints(field, field.gauge, hits)
    assert found.area == pytest.approx(sum_of_areas(hits))
    assert found.area_on_creases == 0.0
    assert found.squares == pytest.approx((np.pi**2 / 16.0 * hits.dent.astype(float) ** 4).sum())


def test_dents_at_the_border_of_the_target_count_by_what_is_inside() -> None:
    """A window at the border is half as large, so an even rain of dents is even up to it."""
    rng = np.random.default_rng(2)
    chamber, field = PLANE, field_of(PLANE)
    mean = np.where(chamber.part.target, 3e8 * chamber.part.area, 0.0)
    hits = random_dents(DESIGN, chamber, mean, rng, 0.1e-3)
    gauge = field.gauge
    found = find_footprints(field, gauge, hits)
    x = np.bincount(found.point, found.weight, len(gauge.area))
    exact = 3e8 * np.pi / 4.0 * 0.1e-3**2
    place = np.abs(gauge.windows.points.place[:, :2]).max(axis=1)
    border, middle = place > place.max() - 0.3e-3, place < 4e-3
    assert x[middle].mean() == pytest.approx(exact, rel=0.01)
    assert x[border].mean() == pytest.approx(exact, rel=0.02)


def test_dents_off_the_target_count_nothing() -> None:
    chamber, field = PLANE, field_of(PLANE)
    rest = np.where(chamber.part.target, 0.0, 1e8 * chamber.part.area)
    hits = random_dents(DESIGN, chamber, rest, np.random.default_rng(3))
    found = find_footprints(field, field.gauge, hits)
    assert len(hits) > 1000
    assert found.area == found.squares == 0.0
    assert len(found.point) == 0


def test_impacts_that_leave_no_dent_count_nothing() -> None:
    rng = np.random.default_rng(4)
    hits = plane_dents(rng, 50, 4e-3, 0.0)
    field = field_of(PLANE)
    assert len(find_footprints(field, field.gauge, hits).point) == 0


# Creases


def bar(splits: int = 0) -> Chamber:
    """A bar of 8 by 8 by 12 mm, all of it target."""
    mesh = trimesh.creation.box((8e-3, 8e-3, 12e-3))
    for _ in range(splits):
        mesh = mesh.subdivide()
    return chamber_round(mesh)


def on_edge(chamber: Chamber, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places at these heights on the edge x = y = 4 mm, and a triangle that has it as a side."""
    place = np.column_stack([np.full_like(z, 4e-3), np.full_like(z, 4e-3), z])
    corners = chamber.part.vertices[chamber.part.triangles]
    at = np.abs(corners[:, :, :2] - 4e-3).max(axis=2) < 1e-9
    sides = np.flatnonzero(at.sum(axis=1) == 2)
    low, high = (
        np.array([bound(corners[t][at[t], 2]) for t in sides]) for bound in (np.min, np.max)
    )
    own = np.argmax((low <= z[:, None]) & (z[:, None] <= high), axis=1)
    return place, sides[own]


def test_dents_on_a_crease_keep_their_area_half_on_each_side() -> None:
    chamber, rng = bar(), np.random.default_rng(5)
    diameter = rng.uniform(0.5e-3, 1.0e-3, 300)
    place, triangle = on_edge(chamber, rng.uniform(-2e-3, 2e-3, 300))
    hits = dents_at(DESIGN, triangle, place, diameter)
    field = field_of(chamber, points=120_000)  # an eighth of them for the wide windows
    gauge = field.gauge
    found = find_footprints(field, gauge, hits)
    assert found.area == found.area_on_creases == pytest.approx(sum_of_areas(hits))
    assert booked_area(field, gauge, hits) == pytest.approx(sum_of_areas(hits), rel=0.02)
    side = gauge.windows.points.normal[found.point].argmax(axis=1)
    shares = np.bincount(side, found.weight, 3) / found.weight.sum()
    assert shares == pytest.approx([0.5, 0.5, 0.0], abs=0.01)


@pytest.mark.parametrize("sides", [9, 10])
def test_dents_on_an_edge_that_is_a_crease_to_some_windows_keep_their_area(sides: int) -> None:
    """The sides of a prism turn by 36 or 40 degrees."""
    mesh, rng = trimesh.creation.cylinder(8e-3, 12e-3, sections=sides), np.random.default_rng(5)
    chamber = chamber_round(mesh, mesh.face_normals[:, 0] > 0.8)  # the two beside the edge
    place = np.array([[8e-3, 0.0, 0.0]]) + np.outer(rng.uniform(-2e-3, 2e-3, 300), [0.0, 0.0, 1.0])
    at_edge = (mesh.triangles[:, :, 0] > 8e-3 - 1e-9).sum(axis=1) == 2
    hits = dents_at(DESIGN, np.full(300, np.flatnonzero(at_edge)[0]), place, 0.5e-3)
    field = field_of(chamber)
    found = find_footprints(field, field.gauge, hits)
    assert 0.1 * found.area < found.area_on_creases < 0.9 * found.area
    assert booked_area(field, field.gauge, hits) == pytest.approx(sum_of_areas(hits), rel=0.02)


def test_the_band_beside_a_crease_is_exact_across_it() -> None:
    """At a distance h from it, 2 sqrt(a² - h²) of each dent over the length of the window."""
    chamber, a = bar(), 0.5e-3
    place, triangle = on_edge(chamber, np.array([0.0]))
    field = field_of(chamber, points=120_000)  # an eighth of them for the wide windows
    gauge = field.gauge
    found = find_footprints(field, gauge, dents_at(DESIGN, triangle, place, 2.0 * a))
    points = gauge.windows.points.place[found.point]
    height = 4e-3 - points[:, :2].min(axis=1)
    length = 2.0 * CREASE_LENGTH * field.radius
    assert height.max() < a
    assert np.abs(points[:, 2]).max() <= 0.5 * length
    assert found.weight == pytest.approx(2.0 * np.sqrt(a**2 - height**2) / length, rel=0.05)


def test_windows_of_the_face_hold_nothing_of_dents_on_its_crease() -> None:
    """Spread over a window they would count as if they covered all of it."""
    chamber = bar()
    place, triangle = on_edge(chamber, np.array([0.0, 1e-3]))
    field = field_of(chamber, points=20_000)
    found = find_footprints(field, field.gauge, dents_at(DESIGN, triangle, place, 0.4e-3))
    points = field.gauge.windows.points.place[found.point]
    assert (4e-3 - points[:, :2].min(axis=1) < 0.2e-3).all()


def test_dents_at_a_corner_belong_to_one_of_its_creases() -> None:
    chamber = bar()
    corner = np.array([[4e-3, 4e-3, 6e-3]])
    own = np.abs(chamber.part.vertices[chamber.part.triangles] - corner).max(axis=2).min(axis=1)
    field = field_of(chamber)
    for triangle in np.flatnonzero(own < 1e-9):
        found = find_footprints(
            field, field.gauge, dents_at(DESIGN, np.array([triangle]), corner, 0.5e-3)
        )
        assert found.area_on_creases == found.area > 0.0


def test_the_same_impacts_on_a_split_mesh_have_the_same_footprints() -> None:
    rng, found = np.random.default_rng(6), {}
    z = rng.uniform(-5e-3, 5e-3, 200)
    for splits in (0, 2):
        chamber = bar(splits)
        field = field_of(chamber, points=120_000)  # an eighth of them for the wide windows
        place, triangle = on_edge(chamber, z)
        hits = dents_at(DESIGN, triangle, place, 0.6e-3)
        assert find_footprints(field, field.gauge, hits).area_on_creases > 0.0
        found[splits] = booked_area(field, field.gauge, hits)
    assert found[2] == pytest.approx(found[0], rel=0.01)


# The limit of small windows: discs on a plane


def in_a_disc(middles: np.ndarray, hits: Hits) -> np.ndarray:
    """Which points of a plane lie in a dent."""
    pairs = cKDTree(hits.place[:, :2].astype(float)).query_ball_point(
        middles[:, :2], 0.5 * float(hits.dent.max())
    )
    return np.array([len(some) > 0 for some in pairs])


def test_windows_as_large_as_a_dent_show_the_dents_themselves() -> None:
    """All dents of a treatment are simulated: covered is what lies in a disc, and no more."""
    rng, diameter = np.random.default_rng(7), 0.6e-3
    hits = plane_dents(rng, 900, 7.499e-3, diameter)
    field = field_of(PLANE, gauge_mm2=1e6 * np.pi / 4.0 * diameter**2)
    found = find_footprints(field, field.gauge, hits)
    batches = [Batch(1, found)]
    sums = sum_dents(batches, len(field.gauge.area))
    mean = coverage_estimates(batches, sums, Reach(1.0), 1.0)["mean_coverage"]
    share = in_a_disc(field.gauge.windows.points.place, hits).mean()
    assert 0.5 < share < 0.8
    assert mean.value == pytest.approx(share, abs=0.01)


@pytest.mark.parametrize("gauge_mm2", [1.0, 4.0])
def test_random_dents_cover_on_average_what_their_discs_cover(gauge_mm2: float) -> None:
    """Sixteen whole treatments; discs that lie over the border are seen in both ways."""
    rng, diameter = np.random.default_rng(8), 0.4e-3
    field = field_of(PLANE, gauge_mm2)
    gauge = field.gauge
    treatments = [plane_dents(rng, rng.poisson(1200), 7.499e-3, diameter) for _ in range(16)]
    batches = [Batch(1, find_footprints(field, gauge, hits)) for hits in treatments]
    found = coverage_estimates(batches, sum_dents(batches, len(gauge.area)), Reach(1.0), 1.0)
    middles = gauge.windows.points.place
    inner = np.abs(middles[:, :2]).max(axis=1) < 7.2e-3
    shares = np.array([in_a_disc(middles[inner], hits).mean() for hits in treatments])
    noise = shares.std(ddof=1) / 4.0
    mean = found["mean_coverage"]
    assert abs(mean.value - shares.mean()) < 2.0 * np.hypot(mean.half_width, noise) + 0.003
    assert mean.half_width < 0.02


def test_the_simulated_plate_is_covered_as_its_dents_show() -> None:
    """Half a second of peening, simulated as a whole in every replica."""
    design = plate_design(
        process__treatment_time_s=0.5,
        process__accuracy__simulated_time_s=0.5,
        process__accuracy__warmup_time_s=0.1,
        process__accuracy__replicas=6,
    )
    chamber = build_chamber(design)
    evaluation = evaluate(design, chamber, SerialExecutor())
    field = prepare_target(design, chamber, chamber_mesh(chamber))
    middles = field.gauge.windows.points.place
    tree, shares = cKDTree(middles), []
    for hits in evaluation.hits:
        covered = np.zeros(len(middles), dtype=bool)
        for place, dent in zip(hits.place.astype(float), hits.dent.astype(float), strict=True):
            covered[tree.query_ball_point(place, 0.5 * dent)] = True
        shares.append(covered.mean())
    mean = evaluation.metrics["mean_coverage"]
    assert mean.value > 0.05
    noise = 2.6 * np.std(shares, ddof=1) / np.sqrt(len(shares))
    assert abs(mean.value - np.mean(shares)) < 1.5 * np.hypot(mean.half_width, noise)


# Small pieces


def test_avrami_at_one_area() -> None:
    # Dents that add up to the area of a window cover 1 - 1/e of it.
    assert coverage_from_dent_density(np.array([0.0, 1.0, 2.0])) == pytest.approx(
        [0.0, 1.0 - np.exp(-1.0), 1.0 - np.exp(-2.0)]
    )


@pytest.mark.parametrize("count", [1, 3, 40, 41, 100, 4000])
def test_replicas_make_at_most_forty_batches_of_about_one_size(count: int) -> None:
    batches = in_batches(range(count))
    assert [number for batch in batches for number in batch] == list(range(count))
    assert len(batches) == min(count, MAX_BATCHES)
    sizes = {len(batch) for batch in batches}
    assert max(sizes) - min(sizes) <= 1


def test_footprints_of_replicas_are_joined_in_order() -> None:
    one = Footprints(np.array([0, 2]), np.array([0.1, 0.2]), 3.0, 1.0, 5.0)
    two = Footprints(np.array([1]), np.array([0.4]), 2.0, 0.5, 4.0)
    both = joined([one, two])
    points, weights = zip(*both.pairs(), strict=True)
    np.testing.assert_array_equal(np.concatenate(points), [0, 2, 1])
    np.testing.assert_array_equal(np.concatenate(weights), [0.1, 0.2, 0.4])
    assert (both.area, both.area_on_creases, both.squares) == (5.0, 1.5, 9.0)
