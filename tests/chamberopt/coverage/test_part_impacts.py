"""Single impacts on the part against counts by hand, and their file."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.coverage.dents import dent_diameter
from chamberopt.coverage.part_impacts import (
    Hits,
    TargetImpacts,
    hits_on_part,
    load_hits,
    load_matching_hits,
    save_hits,
    sort_hits_by_triangle,
)
from tests.helpers.synthetic import impact_log, no_hits, plane_chamber, plate_design

DESIGN = plate_design()
PLANE = plane_chamber(splits=0)
COLUMNS = ("place", "speed", "angle", "dent", "energy")


def hits_of(rng: np.random.Generator, count: np.ndarray) -> Hits:
    """So many hits (m,) of a triangle each, in no order."""
    triangle = rng.permutation(np.repeat(np.arange(len(count), dtype=np.int32), count))
    columns = rng.uniform(0.1, 5.0, (4, len(triangle))).astype(np.float32)
    return Hits(triangle, rng.random((len(triangle), 3)).astype(np.float32), *columns)


def test_hits_are_the_impacts_on_the_part_with_their_size_and_energy() -> None:
    chamber, wall = PLANE, len(PLANE.part.triangles)
    log = impact_log(
        [2, 0, wall, 2],
        [[0, 0, -3.0], [3.0, 0, -3.0], [0, 0, -3.0], [0, 0, -0.1]],
        [3.0, 3.0, 3.0, 0.1],
    )
    hits = hits_on_part(log, chamber, DESIGN)
    material, shot = DESIGN.materials.part, DESIGN.shot
    np.testing.assert_array_equal(hits.triangle, [2, 0, 2])
    np.testing.assert_allclose(hits.angle, [90.0, 45.0, 90.0], rtol=1e-5)
    mass = shot.density * np.pi / 6 * shot.diameter**3
    np.testing.assert_allclose(hits.energy, 0.5 * mass * np.array([9.0, 9.0, 0.01]), rtol=1e-5)
    size = dent_diameter(np.array([3.0]), shot.diameter, shot.density, material)
    np.testing.assert_allclose(hits.dent, [size[0], size[0], 0.0], rtol=1e-5)


def test_a_contact_is_where_the_ball_touches_its_triangle() -> None:
    """The simulator logs the ball's middle, a radius above the surface."""
    chamber = PLANE
    heights = chamber.part.vertices[chamber.part.triangles][:, :, 2]
    top = int(np.argmax(heights.min(axis=1) == 0.0))
    corners = chamber.part.vertices[chamber.part.triangles[top]]
    inside = np.array([0.2, 0.3, 0.5]) @ corners
    above = inside + np.array([0.0, 0.0, 1.5e-3])
    log = impact_log([top], [[0, 0, -3.0]], [3.0], position=above)
    hits = hits_on_part(log, chamber, DESIGN)
    np.testing.assert_allclose(hits.place, [inside], atol=1e-8)
    # A middle beyond the triangle's side touches the side.
    beyond = impact_log([top], [[0, 0, -3.0]], [3.0], position=3.0 * corners[0] + [0, 0, 1e-3])
    place = hits_on_part(beyond, chamber, DESIGN).place[0]
    np.testing.assert_allclose(place, corners[0], atol=1e-8)


def test_sums_are_over_the_exposed_target() -> None:
    rng = np.random.default_rng(2)
    hits = [hits_of(rng, np.array([3, 2, 4])), hits_of(rng, np.array([1, 5, 0]))]
    exposed = np.array([True, False, True])
    found = TargetImpacts(tuple(one.on(exposed) for one in hits), time=3.0, area=2e-6)
    assert found.count == 8
    assert not any((one.triangle == 1).any() for one in found.hits)
    for column in ("speed", "angle", "dent", "energy"):
        expected = sum(
            float(getattr(one, column)[one.triangle != 1].sum(dtype=float)) for one in hits
        )
        assert found.total(column) == pytest.approx(expected)
    parts = [TargetImpacts((one,), 1.5, 2e-6) for one in found.hits]
    assert sum(part.count for part in parts) == found.count
    assert sum(part.total("speed") for part in parts) == pytest.approx(found.total("speed"))
    nothing = TargetImpacts((no_hits(),), 1.5, 2e-6)
    assert (nothing.count, nothing.total("speed")) == (0, 0.0)


def test_hits_come_back_from_their_file_by_triangle(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    parts = [hits_of(rng, np.array([3, 0, 5, 1])), hits_of(rng, np.array([2, 0, 0, 4]))]
    save_hits(tmp_path / "hits.npz", sort_hits_by_triangle(parts, 4))
    found = load_hits(tmp_path / "hits.npz")
    assert [len(found.of(t)) for t in range(4)] == [5, 0, 5, 5]
    assert len(found.on(np.array([True, False, False, True]))) == 10
    for t in range(4):
        for column in COLUMNS:
            whole = np.concatenate([getattr(part, column)[part.triangle == t] for part in parts])
            np.testing.assert_array_equal(getattr(found.of(t), column), whole)


def test_a_damaged_or_missing_hits_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "hits.npz"
    with pytest.raises(InputError, match=r"hits\.npz: not there.*simulate again"):
        load_hits(path)
    save_hits(path, sort_hits_by_triangle([hits_of(np.random.default_rng(1), np.array([3, 4]))], 2))
    whole = path.read_bytes()
    for damaged in (b"", whole[: len(whole) // 2], b"PK" + bytes(200)):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match="damaged"):
            load_hits(path)


def test_rows_whose_differences_overflow_are_refused(tmp_path: Path) -> None:
    """They would pass a check of the differences, and NumPy would read beyond its arrays."""
    path, most = tmp_path / "hits.npz", np.iinfo(np.int64).max
    save_hits(path, sort_hits_by_triangle([hits_of(np.random.default_rng(1), np.array([3, 4]))], 2))
    with np.load(path) as file:
        arrays = dict(file)
    for first in ([0, 2**62, most, 5 - most, -(2**62), 7], [0, most, 7], [0, -1, 7]):
        np.savez(path, **{**arrays, "first": np.array(first)})
        with pytest.raises(InputError, match="first goes down"):
            load_hits(path)


def test_hits_of_another_result_are_refused(tmp_path: Path) -> None:
    hits = sort_hits_by_triangle([hits_of(np.random.default_rng(3), np.array([3, 4]))], 2)
    save_hits(tmp_path / "hits.npz", hits)
    assert len(load_matching_hits(tmp_path / "hits.npz", np.array([3, 4])).hits) == 7
    with pytest.raises(InputError, match="another result"):
        load_matching_hits(tmp_path / "hits.npz", np.array([4, 3]))
