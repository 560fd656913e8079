"""What a part is clamped by outside of its chamber."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from chamberopt.chamber.layout.target import Surface
from chamberopt.chamber.propose import proposed_clamp
from chamberopt.chamber.propose.proposed_clamp import (
    _clamp,
    _is_cut_all_round,
    _round_end,
    _round_radius,
    bore_clearance_mm,
)
from chamberopt.design.fixture import tight_gap_mm


def test_what_is_buried_in_another_body_is_no_jaw(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two triangles that the shot does not meet, one lies above the ceiling."""
    vertices = np.array([[0, 0, 2], [1, 0, 2], [0, 1, 2], [0, 0, 0.5], [1, 0, 0.5], [0, 1, 0.5]])
    part = SimpleNamespace(
        vertices=vertices,
        triangles=np.arange(6).reshape(2, 3),
        area=np.array([0.5, 0.5]),
        target=np.zeros(2, dtype=bool),
    )
    box = np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 1.0]])
    chamber = SimpleNamespace(vertices=box, part=part, exposed_area=np.zeros(2))
    known = [
        Surface(name, {"surface": [name]}, np.arange(2) == k, "")
        for k, name in enumerate(("SHAFT", "KEY"))
    ]
    monkeypatch.setattr(
        proposed_clamp, "rows_of", lambda _, keys: np.array(["SHAFT", "KEY"]) == keys["surface"][0]
    )
    made = SimpleNamespace(design=None, chamber=chamber, known=known)
    assert _clamp(made).text == "SHAFT (500000 mm² of it)"  # type: ignore[arg-type]


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_journal_is_round_and_splines_and_bores_are_not(axis: int) -> None:
    tube = trimesh.creation.annulus(12.0, 20.0, 15.0, sections=48)
    turned = np.roll(tube.triangles, axis - 2, axis=2)
    radius = np.linalg.norm(tube.triangles_center[:, :2], axis=1)
    level = np.abs(tube.face_normals[:, 2]) > 0.9
    area = 1e-6 * tube.area_faces
    for marked, is_round in [
        (~level & (radius > 15.0), True),
        (~level & (radius < 15.0), False),  # a bore
        (level, False),
        (~level & (radius > 15.0) & (tube.triangles_center[:, 0] > 0.0), False),  # half of it
    ]:
        outside = np.where(marked, area, 0.0)
        radius_mm = 1e3 * _round_radius(1e-3 * turned, outside, axis)
        assert radius_mm == pytest.approx(20.0 if is_round else 0.0, rel=1e-3)
    shank = ~level & (radius > 15.0)
    low = np.where(np.arange(3) == axis, 0.3, 1.0) * 1e-3  # 4.5 mm long
    assert not _round_radius(low * turned, np.where(shank, 0.3 * area, 0.0), axis)


def test_a_shank_with_a_key_and_an_end_face_is_held_by_its_diameter() -> None:
    """A shank of 20 x 30 mm along z with a key of 6 x 6 x 15 mm on it."""
    shank = trimesh.creation.cylinder(10.0, 30.0, sections=64)
    key = trimesh.creation.box((6.0, 6.0, 15.0))
    key.apply_translation((9.0, 0.0, 0.0))
    body = trimesh.boolean.union([shank, key], engine="manifold")
    outside = np.where(body.triangles_center[:, 2] > -14.0, 1e-6 * body.area_faces, 0.0)
    vertices, triangles = 1e-3 * body.vertices, np.asarray(body.faces)
    assert 1e3 * _round_end(vertices, triangles, outside, [2]) == pytest.approx(10.0, rel=1e-3)
    assert _round_end(vertices, triangles, outside, [0]) == 0.0
    square = trimesh.creation.box((20.0, 20.0, 30.0))
    sides = 1e-6 * square.area_faces
    assert _round_end(1e-3 * square.vertices, np.asarray(square.faces), sides, [2]) == 0.0


@pytest.mark.parametrize(
    ("sides", "closed", "is_cut"),
    [
        (["+x", "-x"], (), False),
        (["+x", "+z"], (), False),
        (["+x", "+y"], (), True),
        (["+x", "+y", "-x"], ("-x", "y"), False),
        (["+x", "-x", "+y", "-y"], ("x",), True),
        (["+x", "-x", "+y", "-y"], ("z",), False),  # a lid
    ],
)
def test_a_part_that_goes_out_beside_each_other_is_cut_all_round(
    monkeypatch: pytest.MonkeyPatch, sides: list[str], closed: tuple[str, ...], is_cut: bool
) -> None:
    monkeypatch.setattr(proposed_clamp, "_sides_out", lambda _: sides)
    names = np.array(["the wall", "the ceiling"])
    monkeypatch.setattr(proposed_clamp, "surface_names", lambda _: names)
    made = SimpleNamespace(chamber=None, closed=closed)
    assert _is_cut_all_round(made) == is_cut  # type: ignore[arg-type]
    names[1] = "the part"  # it is the lid
    assert not _is_cut_all_round(made)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("ball_mm", "clearance"),
    [(0.3, 0.05), (0.5, 0.1), (0.7, 0.1), (1.0, 0.1), (1.5, 0.2), (4, 0.2)],
)
def test_a_wall_is_cut_out_no_wider_than_its_sheet_allows(ball_mm: float, clearance: float) -> None:
    given = bore_clearance_mm(1e-3 * ball_mm)
    assert given == clearance
    assert given <= min(tight_gap_mm(ball_mm), 0.25 * ball_mm)
