"""What a part is clamped by outside of its chamber."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from manifold3d import Manifold

from chamberopt.chamber.layout import grip
from chamberopt.chamber.layout.end import DEEP
from chamberopt.chamber.layout.target import Surface
from chamberopt.chamber.propose import proposed_clamp
from chamberopt.chamber.propose.first_design import propose
from chamberopt.chamber.propose.proposal import Wanted
from chamberopt.chamber.propose.proposed_clamp import (
    FREE,
    OFF_AXIS,
    _clamp,
    _is_cut_all_round,
    bore_clearance_mm,
    why_not_turned,
)
from chamberopt.design.fixture import tight_gap_mm
from tests.helpers.mesh_files import write_stl
from tests.helpers.turned_parts import stepped_shaft


class Pretended(SimpleNamespace):
    """A chamber that can be remembered, as it may be referred to weakly."""


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
    chamber = Pretended(vertices=box, part=part, exposed_area=np.zeros(2))
    known = [
        Surface(name, {"surface": [name]}, np.arange(2) == k, "")
        for k, name in enumerate(("SHAFT", "KEY"))
    ]
    monkeypatch.setattr(
        proposed_clamp, "rows_of", lambda _, keys: np.array(["SHAFT", "KEY"]) == keys["surface"][0]
    )
    monkeypatch.setattr(grip, "find_openings", lambda _: [])
    design = SimpleNamespace(effects=SimpleNamespace(part_turn=None))
    made = SimpleNamespace(design=design, chamber=chamber, known=known)
    assert _clamp(made).text == ("SHAFT (500000 mm² of it), in jaws of that form or potted")  # type: ignore[arg-type]


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
    monkeypatch.setattr(proposed_clamp, "sides_out", lambda _: sides)
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


TURNED = np.roll(np.eye(3), 1, axis=0)  # x to y, y to z, z to x


@pytest.mark.parametrize("turn", [np.eye(3), TURNED, -np.eye(3)])
@pytest.mark.parametrize(
    ("reach", "aside", "beyond", "form", "why"),
    [
        (-1e-6, 0.0, 1.01 * DEEP, "round", ""),
        (1e-6, 0.0, 1.01 * DEEP, "round", "nearer to a wall"),
        (-1e-6, 0.99 * OFF_AXIS, 1.01 * DEEP, "round", ""),
        (-1e-6, 1.01 * OFF_AXIS, 1.01 * DEEP, "round", "not round"),
        (-1e-6, 0.0, 0.99 * DEEP, "round", "none of its ends"),
        (-1e-6, 0.0, 1.01 * DEEP, "long", "not round"),
    ],
)
def test_a_part_turns_where_it_is_round_held_and_clear_of_the_walls(
    turn: np.ndarray, reach: float, aside: float, beyond: float, form: str, why: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """A part along an axis 10 mm from the nearest wall; what is outside of the room may be wide."""
    ball, at = 2e-3, np.array([0.0, 1e-3, 10e-3])
    radius = 10e-3 + reach - FREE * ball
    ring = np.array([[0.0, 0.6, 0.8], [0.0, -1.0, 0.0]])
    inside = at + np.vstack([radius * ring, radius * ring + [15e-3, 0.0, 0.0]])
    part = np.vstack([inside, at + [50e-3, 0.0, 0.0] + 30e-3 * ring])
    room = np.array([[-20e-3, -11e-3, 0.0], [20e-3, 12e-3, 21e-3]])
    openings = [
        SimpleNamespace(place=turn @ np.add(at, [20e-3, aside, 0.0]), form=form, beyond=beyond),
        SimpleNamespace(place=turn @ np.add(at, [-20e-3, 0.0, 0.0]), form="round", beyond=0.0),
    ]
    for way in (1.0, -1.0):
        line = turn @ at, way * turn @ [1.0, 0.0, 0.0]
        monkeypatch.setattr(proposed_clamp, "turning_axis", lambda *_, line=line: line)
        monkeypatch.setattr(proposed_clamp, "find_openings", lambda _: openings)
        chamber = SimpleNamespace(
            vertices=room @ turn.T, part=SimpleNamespace(vertices=part @ turn.T)
        )
        shot = SimpleNamespace(shot=SimpleNamespace(diameters=(1e-3, ball)))
        found = why_not_turned(SimpleNamespace(chamber=chamber, design=shot))
        assert why in found
        assert bool(why) == bool(found)
    monkeypatch.setattr(proposed_clamp, "turning_axis", lambda *_: None)
    assert why_not_turned(SimpleNamespace(chamber=chamber, design=shot)) == "no axis is given"


def test_bolt_holes_outside_of_the_walls_are_offered_for_screws(tmp_path: Path) -> None:
    """A flange of 120 mm, of which the fillet at its hub is peened, with four bolt holes."""
    body = stepped_shaft([(60.0, 12.0), (25.0, 30.0)], 3.0, sides=48)
    hole = Manifold.cylinder(20.0, 4.5, circular_segments=24)
    for x, y in ((47, 0), (0, 47), (-47, 0), (0, -47)):
        body -= hole.translate([x, y, -1])
    mesh = body.to_mesh()
    path = write_stl(tmp_path / "flange.stl", mesh.vert_properties[mesh.tri_verts])
    made = propose(path, Wanted("mm", ball_mm=1.5), lambda _: [])
    assert made.tables["holder"]["kind"] == "bore"
    assert (
        ", or by screws through its 4 holes of 9 mm there; the wall"
        in (made.reasons["holder.kind"])
    )
