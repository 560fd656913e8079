"""A set-up from CAD: sonotrode, chamber and part in one mesh; the sonotrode's distance can vary.

 as drawn        farther                nearer
|  part  |      |  part  |             |  part  |
|        |      |        |             |________|  <- cut off where the walls still rise straight
|________|      |        |
 sonotrode      |        |  <- walls carried on straight down from the sonotrode's outline
                |________|
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from chamberopt.common.errors import InputError
from chamberopt.common.toml_fields import File, Names, quantity
from chamberopt.design.shape_surface import TAG_SONOTRODE, TAG_WALL, ShapeSurface
from chamberopt.design.shapes.base import ChamberTable
from chamberopt.design.shapes.cad_setup import Setup, read_setup
from chamberopt.geometry.meshes.units import Unit
from chamberopt.geometry.solids import (
    SolidSurface,
    make_solid,
    overlap_volume,
    snap_to_grid,
    subtract,
    sweep_face,
)
from chamberopt.geometry.triangles import border_edges

# The sonotrode of a CAD set-up can be moved nearer to the part, or farther from it.

VOLUME_TOLERANCE = 1e-6  # relative
SAME_DISTANCE = 1e-9  # m


def move_sonotrode(setup: Setup, distance: float) -> ShapeSurface:
    """Return the room's surface with its sonotrode moved to this distance [m] below the part.

    Raises InputError if the sonotrode cannot be moved there: up, beyond the height to which the
    walls rise straight from it, or down, where another part of the room is in the way.
    """
    room, farther = setup.room, distance - setup.distance
    if abs(farther) < SAME_DISTANCE:
        return room
    lifted = replace(room, vertices=snap_to_grid(room.vertices + np.array([0.0, 0.0, farther])))
    return _extend_down(lifted, setup) if farther > 0.0 else _cut_off(lifted, -farther, setup)


def _extend_down(room: ShapeSurface, setup: Setup) -> ShapeSurface:
    """Return the room with walls continued straight down from the sonotrode's outline to z = 0.

    Raises InputError if another part of the room is in the way.

    Args:
        room: surface of the room, with the sonotrode's face above z = 0.
        setup: the set-up as drawn, for messages.
    """
    on_face = room.tags == TAG_SONOTRODE
    face, count = room.triangles[on_face], len(room.vertices)
    used, numbers = np.unique(face, return_inverse=True)
    floor = room.vertices[used] * [1.0, 1.0, 0.0]
    numbers, marks = numbers.reshape(-1, 3), on_face[on_face]
    up = np.array([0.0, 0.0, room.vertices[used[0], 2]])
    below = SolidSurface(floor, numbers.astype(np.int32), marks, marks)
    shaft = sweep_face(below, up, "the room under the sonotrode as drawn")
    whole = make_solid(room.vertices, room.triangles, "the set-up")
    if overlap_volume(whole, shaft) > VOLUME_TOLERANCE * shaft.volume:
        raise _refused(setup, "farther", "another part of the room is in the way under it")
    a, b = border_edges(face).T
    c, d = (count + np.searchsorted(used, side) for side in (b, a))
    walls = np.concatenate([np.c_[a, b, c], np.c_[a, c, d]])
    triangles = room.triangles.copy()
    triangles[on_face] = count + numbers
    source, none = room.source, np.full(len(walls), -1, dtype=np.int32)
    return ShapeSurface(
        np.concatenate([room.vertices, floor]),
        np.concatenate([triangles, walls]).astype(np.int32),
        np.r_[room.tags, np.full(len(walls), TAG_WALL, dtype=np.uint8)],
        None if source is None else np.r_[source, none],
    )


def _cut_off(room: ShapeSurface, height: float, setup: Setup) -> ShapeSurface:
    """Return the room without its lowest ``height`` [m], which lies below z = 0.

    Raises InputError if the walls do not rise straight from the sonotrode's outline so far.

    Args:
        setup: the set-up as drawn, for messages.
    """
    whole = make_solid(room.vertices, room.triangles, "the set-up")
    face = whole.surface().select(room.tags[whole.surface().source] == TAG_SONOTRODE)
    shaft = sweep_face(face, np.array([0.0, 0.0, height]), "the room over the sonotrode as drawn")
    low, high = room.vertices.min(axis=0) - height, room.vertices.max(axis=0) + height
    # The underside of a box around the room.
    x, y = np.array([low, high])[:, :2].T
    corners = np.c_[x[[0, 1, 1, 0]], y[[0, 0, 1, 1]], np.full(4, low[2])]
    triangles = np.array([[0, 2, 1], [0, 3, 2]], dtype=np.int32)
    underside = SolidSurface(corners, triangles, np.zeros(2), np.zeros(2))
    up = np.array([0.0, 0.0, -low[2]])
    rest = subtract(whole, sweep_face(underside, up, "what lies under the sonotrode"))
    straight = overlap_volume(whole, shaft) > (1.0 - VOLUME_TOLERANCE) * shaft.volume
    if not straight or whole.volume - rest.volume > (1.0 + VOLUME_TOLERANCE) * shaft.volume:
        why = "its walls do not rise straight from the sonotrode's outline so far"
        raise _refused(setup, "nearer", why)
    cut = rest.surface()
    kept = cut.solid == whole.label
    rows = np.where(kept, cut.source, 0)
    tags = np.where(kept, room.tags[rows], TAG_SONOTRODE).astype(np.uint8)
    source = room.source
    source = None if source is None else np.where(kept, source[rows], -1).astype(np.int32)
    return ShapeSurface(cut.vertices, cut.triangles, tags, source)


def _refused(setup: Setup, way: str, why: str) -> InputError:
    return InputError(
        f"chamber.sonotrode_distance_mm: the set-up is drawn with {1e3 * setup.distance:.4g}, and "
        f"the sonotrode cannot be moved {way} by this much: {why}; give a distance closer to the "
        "drawn one, or draw the set-up again"
    )


IMPORTED = "imported"


class Imported(ChamberTable):
    """A chamber drawn with its part in one file. All surfaces but part and sonotrode are wall."""

    shape: Literal["imported"]
    sonotrode_distance_mm: float | None = quantity(  # type: ignore[assignment]
        0.1, 2000, "mm", "mean sonotrode face to lowest point of the part; absent: as drawn", None
    )
    part: Names = Field(description="groups of the file: the part")
    sonotrode: Names = Field(description="groups of the file: the sonotrode's flat face")
    mesh: File = Field(description="the set-up's file: that of [part], so leave it out")
    unit: Unit = Field(
        default="guess", description="of its numbers: that of [part], so leave it out"
    )

    @property
    def sonotrode_distance(self) -> float:  # type: ignore[override]
        """Distance from the mean sonotrode face to the lowest point of the part [m]."""
        given = self.sonotrode_distance_mm
        return self.setup().distance if given is None else given * 1e-3

    def setup(self) -> Setup:
        """Return the set-up as drawn. Its file is read only once.

        Raises InputError if it is no closed room with a flat sonotrode.
        """
        return read_setup(Path(self.mesh), self.unit, self.part, self.sonotrode)

    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """Return the surface of the drawn room, with the sonotrode at the wanted distance."""
        return move_sonotrode(self.setup(), self.sonotrode_distance)
