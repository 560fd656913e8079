"""Single impacts on the part against counts by hand, and their file."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.coverage.dents import dent_diameter
from chamberopt.coverage.part_impacts import (
    Hits,
    hits_on_part,
    load_hits,
    save_hits,
    sort_hits_by_triangle,
)
from tests.helpers.synthetic import impact_log, patchwork, plate_design

DESIGN = plate_design()


def hits_of(rng: np.random.Generator, count: np.ndarray) -> Hits:
    """So many hits (m,) of a triangle each, in no order."""
    triangle = rng.permutation(np.repeat(np.arange(len(count), dtype=np.int32), count))
    columns = rng.uniform(0.1, 5.0, (4, len(triangle))).astype(np.float32)
    return Hits(triangle, *columns)


def test_hits_are_the_impacts_on_the_part_with_their_size_and_energy() -> None:
    chamber = patchwork(np.full(3, 1e-6))
    log = impact_log([2, 0, 2], [[0, 0, -3.0], [3.0, 0, -3.0], [0, 0, -0.1]], [3.0, 3.0, 0.1])
    hits = hits_on_part(log, chamber, DESIGN)
    material, shot = DESIGN.materials.part, DESIGN.shot
    np.testing.assert_array_equal(hits.triangle, [2, 0, 2])
    np.testing.assert_allclose(hits.angle, [90.0, 45.0, 90.0], rtol=1e-5)
    mass = shot.density * np.pi / 6 * shot.diameter**3
    np.testing.assert_allclose(hits.energy, 0.5 * mass * np.array([9.0, 9.0, 0.01]), rtol=1e-5)
    size = dent_diameter(
        np.array([3.0]),
        shot.diameter,
        shot.density,
        material.hardness,
        material.restitution,
        material.yield_speed,
    )
    np.testing.assert_allclose(hits.dent, [size[0], size[0], 0.0], rtol=1e-5)


def test_hits_come_back_from_their_file_by_triangle(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    parts = [hits_of(rng, np.array([3, 0, 5, 1])), hits_of(rng, np.array([2, 0, 0, 4]))]
    save_hits(tmp_path / "hits.npz", sort_hits_by_triangle(parts, 4))
    found = load_hits(tmp_path / "hits.npz")
    assert [len(found.of(t)) for t in range(4)] == [5, 0, 5, 5]
    assert len(found.on(np.array([True, False, False, True]))) == 10
    for t in range(4):
        for column in ("speed", "angle", "dent", "energy"):
            whole = np.concatenate([getattr(part, column)[part.triangle == t] for part in parts])
            np.testing.assert_array_equal(getattr(found.of(t), column), whole)


def test_a_damaged_or_missing_hits_file_is_said(tmp_path: Path) -> None:
    path = tmp_path / "hits.npz"
    with pytest.raises(InputError, match=r"older version.*simulate again"):
        load_hits(path)
    save_hits(path, sort_hits_by_triangle([hits_of(np.random.default_rng(1), np.array([3, 4]))], 2))
    whole = path.read_bytes()
    for damaged in (b"", whole[: len(whole) // 2], b"PK" + bytes(200)):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match="damaged"):
            load_hits(path)
