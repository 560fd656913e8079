"""Patches consist of near triangles and hold enough."""

import numpy as np

from chamberopt.coverage.statistics.triangle_patches import patches


def test_patches_are_near_and_hold_enough() -> None:
    rng = np.random.default_rng(11)
    places, content = rng.random((3000, 3)), rng.uniform(0.0, 0.8, 3000)
    patch = patches(places, content, 2.0)
    held = np.bincount(patch, content)
    assert held.min() >= 2.0
    assert held.mean() < 4.0
    middles = np.column_stack(
        [np.bincount(patch, places[:, k]) / np.bincount(patch) for k in range(3)]
    )
    assert np.linalg.norm(places - middles[patch], axis=1).mean() < 0.1
    np.testing.assert_array_equal(patches(places, content + 2.0, 2.0), np.arange(3000))
    assert set(patches(places, 0.0 * content, 2.0)) == {0}
