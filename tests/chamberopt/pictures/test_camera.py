"""The camera looks where a target is seen, and then at what the first view hides."""

from types import SimpleNamespace

import numpy as np
import pytest

from chamberopt.pictures.camera import (
    Room,
    chamber_view,
    directions,
    fit_camera,
    near_views,
    view_frame,
)
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


def test_a_view_stands_upright_and_is_no_mirror() -> None:
    eyes = np.vstack([directions(), 3.0 * np.eye(3), -np.eye(3)])
    assert np.linalg.norm(directions(), axis=1) == pytest.approx(1.0)
    for eye in eyes:
        frame = view_frame(eye)
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1.0)
        assert frame[2] == pytest.approx(eye / np.linalg.norm(eye))
        assert frame[1, 2] > 0.0 or abs(eye[2]) == np.linalg.norm(eye)
        assert frame[0, 2] == pytest.approx(0.0)


def test_directions_are_spread_all_round() -> None:
    for eyes in (directions(), directions(steep=False)):
        turns = np.degrees(np.arctan2(eyes[:, 1], eyes[:, 0])) % 360.0
        for height in np.unique(eyes[:, 2].round(9)):
            own = np.sort(turns[np.isclose(eyes[:, 2], height)])
            assert np.diff(own) == pytest.approx(30.0)


@pytest.mark.parametrize("size", [(400, 300), (300, 700)])
@pytest.mark.parametrize("room", [Room(0, 0, 0, 0), Room(40, 10, 60, 0), Room(0, 90, 5, 80)])
def test_what_is_shown_fills_what_texts_leave_of_a_view(size: tuple[int, int], room: Room) -> None:
    """By a pinhole: 97 % of the free width or height, in the middle of both."""

    class Camera(SimpleNamespace):
        def zoom(self, factor: float) -> None:
            self.factor = factor

        def SetWindowCenter(self, *place: float) -> None:  # noqa: N802
            self.place = place

    points = np.random.default_rng(7).normal(size=(60, 3)) * (3.0, 1.0, 2.0) + 5.0
    renderer = SimpleNamespace(ResetCameraClippingRange=lambda: None)
    plotter = SimpleNamespace(camera=Camera(), renderer=renderer)
    fit_camera(plotter, points, np.array([1.0, -1.6, 0.5]), size, room)
    at, middle, up = map(np.array, plotter.camera_position)
    forward = (middle - at) / np.linalg.norm(middle - at)
    depth, right = (points - at) @ forward, np.cross(forward, up)
    half = np.tan(np.radians(0.5 * plotter.camera.view_angle)) * depth
    seen = np.stack([(points - at) @ right / half * size[1] / size[0], (points - at) @ up / half])
    pixels = (plotter.camera.factor * seen.T - plotter.camera.place + 1.0) * np.array(size) / 2.0
    low = np.array([room.left, room.below])
    high = np.array(size) - [room.right, room.above]
    assert (pixels.min(axis=0) + pixels.max(axis=0)) / 2.0 == pytest.approx((low + high) / 2.0)
    assert (np.ptp(pixels, axis=0) / (high - low)).max() == pytest.approx(0.97)
