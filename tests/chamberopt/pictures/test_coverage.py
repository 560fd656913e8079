"""The picture of coverage shows part, sonotrode and colours, of one result or several."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from chamberopt.pictures.camera import view_frame
from chamberopt.pictures.coverage import coverage_bar, draw_coverage
from chamberopt.pictures.panels import seen_marks
from chamberopt.pictures.view import View
from chamberopt.results.vtp_files import pyvista
from tests.helpers.opengl import needs_opengl


@needs_opengl
def test_picture_shows_part_sonotrode_and_scale(case: tuple, tmp_path: Path) -> None:
    picture = tmp_path / "coverage.png"
    assert draw_coverage([case[0]], ["plate"], picture) is None
    image = imread(picture)[..., :3]
    assert 0.2 < (image > 0.99).all(axis=2).mean() < 0.9  # background, and not only background
    orange = image[:, :600, 0] - image[:, :600, 2] > 0.2  # as glass, as it is seen from below
    assert orange.mean() > 0.01  # the sonotrode
    assert (
        len(np.unique((image * 32).astype(int).reshape(-1, 3), axis=0)) > 60
    )  # a scale of colours
    assert [path.name for path in tmp_path.iterdir()] == ["coverage.png"]


@needs_opengl
def test_one_below_the_other(case: tuple, tmp_path: Path) -> None:
    assert draw_coverage([case[0]], ["one"], tmp_path / "one.png") is None
    one_row = imread(tmp_path / "one.png").shape[0]
    assert draw_coverage([case[0]] * 2, ["one", "two"], tmp_path / "both.png") is None
    image = imread(tmp_path / "both.png")
    assert image.shape[0] > 1.4 * one_row
    near = image[:, 600:-160, :3]  # of the targets, without the colour bar
    upper, lower = near[: len(near) // 2], near[len(near) // 2 :]
    amounts = [((half > 0.97).all(axis=2)).mean() for half in (upper, lower)]
    assert abs(amounts[0] - amounts[1]) < 0.1  # the same part on the same scale


def test_numbers_stand_where_their_places_are_seen() -> None:
    """Of a table, the top is seen from above, and under it the foot from the side alone.

    The first place of the top lies inside of it and is never seen.
    """
    top = pyvista().Box((-10.0, 10.0, -10.0, 10.0, 8.0, 10.0)).triangulate()
    table = top + pyvista().Box((-2.0, 2.0, -2.0, 2.0, 0.0, 8.0)).triangulate()
    marks = [
        ("1", np.array([[0.0, 0.0, 8.0, 0.0, 0.0, 1.0], [0.0, 5.0, 10.0, 0.0, 0.0, 1.0]])),
        ("2", np.array([[2.0, 0.5, 4.0, 1.0, 0.0, 0.0]])),
    ]

    def seen_from(eye: tuple[float, float, float]) -> View:
        frame, image = view_frame(np.array(eye)), np.zeros((400, 400, 3), dtype=np.uint8)
        return View(image, frame, np.array([-20.0, 20.0]), 0.1)

    seen = {
        way: [one.text for one in seen_marks(marks, [table], seen_from(eye))]
        for way, eye in {
            "above": (0.0, 0.0, 1.0), "side": (1.0, 0.0, 0.0), "steep": (0.3, 0.0, 0.95),
            "below": (0.0, 0.0, -1.0),
        }.items()
    }  # fmt: skip
    assert seen == {"above": ["1"], "side": ["2"], "steep": ["1"], "below": []}
    # A holder that encloses the top hides it, from inside of which the foot stands out.
    block = pyvista().Box((-15.0, 15.0, -15.0, 15.0, 6.0, 15.0)).triangulate()
    for eye, told in (((0.0, 0.0, 1.0), []), ((1.0, 0.0, 0.0), ["2"])):
        shown = seen_marks(marks, [table, block], seen_from(eye))
        assert [one.text for one in shown] == told


@pytest.mark.parametrize(
    ("shown", "limits", "beyond", "is_told"),
    [
        ([0.0, 50.0, 100.0], (0.0, 100.0), "neither", False),
        ([50.0, 100.0], (50.0, 100.0), "neither", True),
        ([49.0, 100.0, np.nan], (50.0, 100.0), "min", True),
        ([0.0, 91.0], (0.0, 90.0), "max", True),
        ([49.0, 91.0], (50.0, 90.0), "both", True),
    ],
)
def test_a_bar_of_colours_tells_what_lies_beyond_its_ends(
    shown: list[float], limits: tuple[float, float], beyond: str, is_told: bool
) -> None:
    for unit in ("%", "MPa"):
        quantity = SimpleNamespace(title="what", unit=unit, colours="viridis")
        parts: Any = [
            SimpleNamespace(target={"shown": np.array([one])}, quantity=quantity) for one in shown
        ]
        bar = coverage_bar(parts, limits)
        assert (bar.limits, bar.beyond) == (limits, beyond)
        scale = f", scale from {limits[0]:g} to {limits[1]:g} %"
        assert bar.label == "what" + (scale if is_told and unit == "%" else "")
