"""The camera looks where a target is seen, and then at what the first view hides."""

import numpy as np

from chamberopt.pictures.camera import chamber_view, directions, near_views
from tests.helpers.opengl import needs_opengl
from tests.helpers.results.awkward_targets import seen_shares


@needs_opengl
def test_views_show_targets_that_their_parts_hide() -> None:
    found = seen_shares()
    assert set(found) == {"crank pin", "web", "underside", "top"}
    for name, one in found.items():
        assert one["first"] > 0.8, name  # of what the best direction shows
        assert one["both"] > 0.5, name  # of what can be seen from anywhere
    views = {name: np.array(one["eyes"]) for name, one in found.items()}
    assert (np.abs(views["crank pin"][:, 1]) > 0.7).all()  # between the webs, not along the axis
    assert np.ptp(views["crank pin"][:, 1]) > 1.4
    assert (np.sort(np.sign(views["web"][:, 0])) == [-1, 1]).all()
    assert [view[2] < 0.0 for view in views["underside"]] == [True]  # a second one adds nothing
    assert [view[2] > 0.0 for view in views["top"]] == [True]


def test_the_second_view_adds_what_the_first_hides() -> None:
    eyes = directions()
    seen = np.zeros((len(eyes), 3))
    seen[20], seen[21], seen[30] = (5, 5, 0), (5, 3, 0), (0, 0, 3)
    np.testing.assert_array_equal(near_views(seen, eyes), eyes[[20, 30]])
    seen[30] = 0, 0, 0.5
    assert len(near_views(seen, eyes)) == 1


def test_a_chamber_is_seen_from_above_unless_that_hides_its_target() -> None:
    eyes = directions(steep=False)
    seen = np.ones((len(eyes), 1))
    assert chamber_view(seen, eyes)[2] > 0.0
    seen[eyes[:, 2] > 0.0] = 0.1
    assert chamber_view(seen, eyes)[2] < 0.0
    assert np.abs(np.degrees(np.arcsin(eyes[:, 2]))).max() < 40.0
