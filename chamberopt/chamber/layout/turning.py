"""Find the axis about which a part may turn, so that all of its target passes the shot.

A part turns on an arbor through a bore, or by its own ends, which go out through the walls.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from chamberopt.chamber.layout.pose import Turns, square_to_walls, turns_down
from chamberopt.geometry.outline import frame_along
from chamberopt.geometry.triangles import area_vectors, unit_vectors

if TYPE_CHECKING:
    from chamberopt.chamber.layout.arbor import Bore
    from chamberopt.geometry.meshes.part_mesh import PartMesh

# A target looks the same all round an axis: largest difference of the spread of its normals over
# their mean, their mean along any way, and the middle's distance from the axis over its radius.
ALIKE, MEAN, CENTRAL = 0.05, 0.03, 0.03
FLAT = 1e-9  # spread of the normals of flat rings, which all look along the axis
OUTSIDE = 0.6  # of a part's radius, outside of which the target is for which it takes an arbor
SHORT = 1.0  # largest length along an arbor over the diameter: longer parts stand or lie
RPM = 60.0
# A part so many times as long as wide that turned would stand high on end, and is turned by shops;
# up to this mean cosine with its axis a target looks to both of its ends, or to neither.
SLENDER, BOTH_WAYS = 1.5, 0.5


class Spindle(NamedTuple):
    """An axis about which a part turns, in the part file's frame."""

    point: np.ndarray  # on it, (3,) [m]
    axis: np.ndarray  # unit vector, (3,)


class _Ring(NamedTuple):
    """Places of a target, by which areas and their first two moments are summed exactly."""

    weight: np.ndarray  # of each, (k,), 1 in all
    normal: np.ndarray  # unit normals there, (k, 3)
    place: np.ndarray  # middles of the triangles' sides, (k, 3) [m]

    @staticmethod
    def of(mesh: PartMesh, target: np.ndarray) -> _Ring:
        vectors = area_vectors(mesh.vertices, mesh.triangles)[target]
        area = np.linalg.norm(vectors, axis=1)
        corners = mesh.vertices[mesh.triangles[target]]
        sides = 0.5 * (corners + np.roll(corners, 1, axis=1))
        weight, normal = area / (3.0 * area.sum()), unit_vectors(vectors)
        return _Ring(np.repeat(weight, 3), np.repeat(normal, 3, axis=0), sides.reshape(-1, 3))

    def goes_round(self, one: Spindle) -> bool:
        """Return whether it looks the same all round an axis."""
        frame = frame_along(one.axis)
        across, places = self.normal @ frame[:2].T, (self.place - one.point) @ frame[:2].T
        weight, radius = self.weight, self.radius(one)
        low, high = np.linalg.eigvalsh((weight[:, None] * across).T @ across)
        near, far = np.linalg.eigvalsh((weight[:, None] * places).T @ places)
        return bool(
            high - low <= ALIKE * (high + low) + FLAT
            and far - near < ALIKE * (far + near)
            and np.linalg.norm(weight @ across) < MEAN
            and np.linalg.norm(weight @ places) < CENTRAL * radius
        )

    def is_one_end(self, one: Spindle) -> bool:
        """Return whether all of it looks one way along an axis, as one end of a ring does."""
        return bool(abs(self.weight @ (self.normal @ one.axis)) > 1.0 - FLAT)

    def radius(self, one: Spindle) -> float:
        """Return its mean distance from an axis [m]."""
        places = (self.place - one.point) @ frame_along(one.axis)[:2].T
        return float(self.weight @ np.linalg.norm(places, axis=1))


def turning_bore(bores: Sequence[Bore], mesh: PartMesh, target: np.ndarray) -> Bore | None:
    """Return the bore about whose axis a part turns on an arbor.

    It is None unless the target is a ring at the outside of a short part, alike all round, such as
    the teeth of a gear, the slots of a disc or both sides of one.

    Args:
        target: marks the triangles to be peened, (m,).
    """
    ring = _Ring.of(mesh, target)
    for bore in bores:
        one = Spindle(bore.point, bore.axis)
        whole = (mesh.vertices - one.point) @ frame_along(one.axis).T
        outer = float(np.linalg.norm(whole[:, :2], axis=1).max())
        is_outside = ring.radius(one) > OUTSIDE * outer
        is_short = np.ptp(whole[:, 2]) < SHORT * 2.0 * outer
        if is_outside and is_short and not ring.is_one_end(one) and ring.goes_round(one):
            return bore
    return None


def find_spindle(mesh: PartMesh, target: np.ndarray) -> Spindle | None:
    """Return the axis round which a target looks the same, as the fillets of a shaft do.

    Args:
        target: marks the triangles to be peened, (m,).
    """
    ring = _Ring.of(mesh, target)
    found = (Spindle(ring.weight @ ring.place, axis) for axis in _axes(ring))
    return next((one for one in found if ring.goes_round(one)), None)


def slenderness(mesh: PartMesh, target: np.ndarray, one: Spindle) -> float:
    """Return a part's length over its largest diameter, if shops turn one that is long; else 0.

    They do not if its target looks to one end, as a flange's fillet does: that is peened on end.

    Args:
        target: marks the triangles to be peened, (m,).
        one: the axis round which the target looks the same.
    """
    ring, places = _Ring.of(mesh, target), (mesh.vertices - one.point) @ frame_along(one.axis).T
    if abs(ring.weight @ (ring.normal @ one.axis)) > BOTH_WAYS:
        return 0.0
    return float(np.ptp(places[:, 2]) / (2.0 * np.linalg.norm(places[:, :2], axis=1).max()))


def _axes(ring: _Ring) -> Iterator[np.ndarray]:
    """Yield unit vectors (3,) round which a target may go: axes of the file, then its own."""
    yield from np.eye(3)
    aside = ring.place - ring.weight @ ring.place
    for vectors in (ring.normal, aside):
        for axis in np.linalg.eigh((ring.weight[:, None] * vectors).T @ vectors)[1].T:
            axis = np.round(axis * np.sign(axis[np.abs(axis).argmax()]), 6)
            yield axis / np.linalg.norm(axis)


def turning_pose(one: Spindle | Bore, mesh: PartMesh) -> tuple[Turns, dict[str, Any]]:
    """Return turns that lay an axis level along the room's width, and effects.part_turn."""
    down = np.eye(3)[np.abs(one.axis).argmin()]
    down = unit_vectors((one.axis @ down) * one.axis - down)
    turns = square_to_walls(mesh.vertices, turns_down(down))
    axis = [round(float(x), 6) + 0.0 for x in one.axis]
    through = [round(1e3 * float(x), 4) + 0.0 for x in one.point]
    return turns, {"rpm": RPM, "axis": axis, "through_mm": through}
