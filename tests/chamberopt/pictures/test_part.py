"""A part is drawn with its target, or with what is wrong with it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from matplotlib.image import imread

from chamberopt.chamber.build import build_chamber
from chamberopt.common.errors import InputError
from chamberopt.design.load import load_design
from chamberopt.pictures import panels
from chamberopt.pictures.panels import ALIKE_CAPTION, chamber_dimensions, part_panels, without_twin
from chamberopt.pictures.part import (
    CLEAR,
    HELD,
    MARKED,
    PLAIN,
    _coloured,
    _further_poses,
    draw_part,
    draw_target,
)
from chamberopt.pictures.picture_page import Panel
from chamberopt.pictures.view import View
from chamberopt.results.vtp_files import MM, cavity_surface
from tests.chamberopt.chamber.checks.test_openings import chamber_of
from tests.helpers.opengl import needs_opengl


@needs_opengl
def test_a_part_is_drawn_with_its_target_or_with_its_fault_in_red(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.01)
    corners, upper = ball.triangles, ball.triangles_center[:, 2] > 0.0
    edges = corners[:80, [0, 1, 1, 2]].reshape(-1, 2, 3)

    assert draw_part(corners, "a ball", tmp_path / "target.png", marked=upper) is None
    assert draw_part(corners, "a hole", tmp_path / "fault.png", edges=edges) is None

    target, fault = (imread(tmp_path / f"{name}.png")[..., :3] for name in ("target", "fault"))
    red = [
        (picture[..., 0] - picture[..., 1:].max(axis=2) > 0.5).mean() for picture in (target, fault)
    ]
    blue = [(picture[..., 2] - picture[..., 0] > 0.3).mean() for picture in (target, fault)]
    assert red[1] > 5e-4 > 10 * red[0]
    assert blue[0] > 0.05 > 10 * blue[1]


@pytest.mark.parametrize("is_held", [False, True])
def test_what_is_held_outside_is_marked_above_the_ceiling_alone(is_held: bool) -> None:
    """The blade of the conformal chamber goes out through the ceiling; its target is inside."""
    chamber = build_chamber(load_design("designs/blade_conformal.toml"))
    part, room = chamber.part, cavity_surface(chamber)
    corners = MM * part.vertices[part.triangles]
    kinds = np.where(part.target, MARKED, PLAIN)
    job = {"corners": corners, "chamber": room, "is_held_outside": is_held}
    (_, outside), (_, inside) = _coloured(job, kinds)[1]
    above = (corners[..., 2] > room.bounds[5] + CLEAR).any(axis=1) & ~part.target
    assert above.any()
    assert ((outside == HELD) == (above & is_held)).all()
    assert HELD not in inside


@needs_opengl
def test_each_pose_of_a_part_has_a_view_in_the_chamber(tmp_path: Path) -> None:
    """A third step in the first pose, with other balls, has none."""
    poses: list[dict[str, object]] = [
        {"name": "first"},
        {"name": "turned", "part": {"rotate_deg": [0.0, 0.0, 90.0]}},
        {"name": "finer", "shot": {"diameter_mm": 2.0}},
    ]
    design = load_design("designs/plate.toml").changed({"steps": poses})
    chamber = build_chamber(design)
    (other,) = _further_poses({"chamber": chamber, "face": None})
    corners = MM * chamber.part.vertices[chamber.part.triangles]
    turned = np.stack([-corners[..., 1], corners[..., 0], corners[..., 2]], axis=2)
    np.testing.assert_allclose(other["corners"], turned, atol=1e-9)
    assert draw_target(design, chamber, tmp_path / "design.png") == (
        f"picture in {tmp_path / 'design.png'}"
    )


def test_the_height_ends_at_a_ceiling_beside_a_part_that_goes_out_just_below_it(
    tmp_path: Path,
) -> None:
    """A bar goes out through two walls 40 mm high, its top 0.3 mm below their ends."""
    bar = trimesh.creation.box((100.0, 20.0, 24.7))
    cavity = cavity_surface(chamber_of(tmp_path, bar))
    texts = [one.text for one in chamber_dimensions(cavity, np.array([0.5, -0.8, 0.3]))]
    assert "40 mm" in texts
    assert "39.7 mm" not in texts


def test_the_height_is_that_of_a_wall_on_which_the_part_lies(tmp_path: Path) -> None:
    """An angle goes down through the ceiling; its arm lies on a wall 0.2 mm below that."""
    leg = trimesh.creation.box((6.0, 20.0, 30.0))
    leg.apply_translation((0.0, 0.0, 15.0))
    arm = trimesh.creation.box((60.0, 20.0, 5.2))
    arm.apply_translation((27.0, 0.0, 27.4))
    angle = trimesh.boolean.union([leg, arm])
    cavity = cavity_surface(chamber_of(tmp_path, angle, offset_mm=(27.0, 0.0)))
    texts = [one.text for one in chamber_dimensions(cavity, np.array([0.5, -0.8, 0.3]))]
    assert "39.8 mm" in texts
    assert "40 mm" not in texts


@pytest.mark.parametrize("has_plugs", [True, False])
def test_plugs_are_in_the_views_from_near_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_plugs: bool
) -> None:
    """In the chamber they are with all else that it has."""
    cavity = cavity_surface(chamber_of(tmp_path, trimesh.creation.box((10.0, 10.0, 10.0))))
    drawn: list[str] = []

    def view(add: Callable[[None], None], *_: object) -> View:
        drawn.append("view")
        add(None)
        return View(np.zeros((4, 4, 3), dtype=np.uint8), np.eye(3), np.zeros(2), 1.0)

    monkeypatch.setattr(panels, "render_view", view)
    monkeypatch.setattr(panels, "add_chamber", lambda *_: drawn.append("chamber"))
    monkeypatch.setattr(panels, "add_body", lambda *one: drawn.append(one[2]))
    eyes = np.array([1.0, 0.0, 0.0]), [np.array([0.0, 1.0, 0.0])]
    part_panels(lambda _: None, cavity, cavity, cavity, eyes, has_plugs)
    assert drawn == ["view", "chamber", "view", *(["mask"] if has_plugs else [])]


def test_a_part_is_drawn_only_where_there_can_be_such_a_file(tmp_path: Path) -> None:
    for name, said in (("part.jpg", r"\.png"), ("nowhere/part.png", "does not exist")):
        with pytest.raises(InputError, match=said):
            draw_part(np.zeros((1, 3, 3)), "a part", tmp_path / name)


def test_views_that_show_the_same_or_its_mirror_image_are_one() -> None:
    image = np.random.default_rng(3).integers(0, 255, (40, 60, 3)).astype(np.uint8)

    def panel(shown: np.ndarray) -> Panel:
        return Panel(View(shown, np.eye(3), np.zeros(2), 1.0), "the target")

    first = panel(image)
    for other in (image, image[:, ::-1]):
        (one,) = without_twin([first, panel(other)])
        assert (one.view, one.caption) == (first.view, ALIKE_CAPTION)
    for other in (image[::-1], image[:, :50]):
        assert len(without_twin([first, panel(other)])) == 2
