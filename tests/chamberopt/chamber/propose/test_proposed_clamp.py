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
    _is_round,
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
        assert _is_round(1e-3 * turned, outside, axis) == is_round
    low = np.where(np.arange(3) == axis, 0.4, 1.0) * 1e-3  # 6 mm long
    assert not _is_round(low * turned, np.where(~level, area, 0.0), axis)


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
