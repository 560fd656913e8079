"""At which edges a part is parted into faces, from which its target is chosen."""

import numpy as np
import pytest
from manifold3d import CrossSection, Manifold

from chamberopt.chamber.propose.proposed_target import (
    BY_SHAPE,
    BY_SIZE,
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


def rim(count: int, deep: float) -> np.ndarray:
    """Corners of the outline of a wheel of 10 mm radius with rounded teeth, (60 count, 2)."""
    angle = 2.0 * np.pi * np.arange(60 * count) / (60 * count)
    radius = 10.0 + deep * np.cos(count * angle)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def toothed(count: int, deep: float) -> Manifold:
    """A wheel whose rim of teeth, 8 mm wide, is one face, on a hub whose side is larger."""
    wheel = Manifold.extrude(CrossSection([rim(count, deep)]), 8.0)
    return wheel + Manifold.cylinder(60.0, 4.0, 4.0, 90)


@pytest.mark.parametrize("count", [7, 24])
@pytest.mark.parametrize("turn", [[0.0, 0.0, 0.0], [35.0, 70.0, 10.0]])
def test_a_rim_of_teeth_is_chosen_though_the_hub_is_larger(count: int, turn: list[float]) -> None:
    mesh, body = part_of(toothed(count, 0.5).rotate(turn))
    known = surfaces(mesh)
    largest = propose_target(mesh, known, [known[0].name])
    target = propose_target(mesh, known, [])
    assert f"it repeats {count} times round an axis, as teeth do" in target.reason
    assert target.reason.endswith(BY_SHAPE)
    assert not (target.triangles & largest.triangles).any()
    corners = rim(count, 0.5)
    length = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).sum()
    assert body.area_faces[target.triangles].sum() == pytest.approx(8.0 * length, rel=1e-4)


@pytest.mark.parametrize(("count", "deep"), [(5, 0.5), (24, 0.05)])
def test_few_lobes_or_shallow_waves_are_no_teeth(count: int, deep: float) -> None:
    mesh, _ = part_of(toothed(count, deep))
    assert propose_target(mesh, surfaces(mesh), []).reason.endswith(BY_SIZE)
