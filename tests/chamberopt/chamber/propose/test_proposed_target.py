"""At which edges a part is parted into faces, from which its target is chosen."""

import numpy as np
import pytest
from manifold3d import CrossSection, Manifold

from chamberopt.chamber.propose.proposed_target import (
    CREASE_DEG,
    crease_deg,
    propose_target,
    surfaces,
)
from tests.chamberopt.chamber.propose.test_proposed_arbor import drum, part_of

FLUTES = 1300


def fluted(turn_deg: float) -> Manifold:
    """A drum of 10 mm radius whose facets turn by so much to and fro."""
    angle = 2.0 * np.pi * np.arange(2 * FLUTES) / (2 * FLUTES)
    deep = 0.5 * np.tan(np.radians(0.5 * turn_deg)) * np.pi * 10.0 / FLUTES
    radius = 10.0 + deep * np.where(np.arange(2 * FLUTES) % 2, 1.0, -1.0)
    outline = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return Manifold.extrude(CrossSection([outline]), 20.0)


@pytest.mark.parametrize(("turn_deg", "crease"), [(20.0, 30.0), (40.0, 45.0), (55.0, 60.0)])
def test_a_side_of_facets_that_turn_is_one_face(turn_deg: float, crease: float) -> None:
    mesh, body = part_of(fluted(turn_deg))
    assert crease_deg(mesh) == crease
    known = surfaces(mesh)
    assert len(known) == 2
    target = propose_target(mesh, known, [])
    side = np.abs(body.face_normals[:, 2]) < 0.5
    assert (target.triangles == side).all()
    assert target.keys["faces"][0]["crease_deg"] == crease


def test_facets_that_turn_too_much_for_any_face_are_not_listed() -> None:
    """They are no surface to choose; both ends are, alike."""
    mesh, _ = part_of(fluted(80.0))
    assert crease_deg(mesh) == 60.0
    (ends,) = surfaces(mesh)
    assert ends.text.startswith("2 faces alike")


def test_sharp_edges_part_a_plain_part() -> None:
    mesh, _ = part_of(drum(10.0, 20.0))
    assert crease_deg(mesh) == CREASE_DEG
