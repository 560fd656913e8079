"""Find camera directions that show most of a target, by drawing it from dozens of directions.

The target is divided into patches, groups of neighbouring triangles that face the same way. In a
small picture every patch has its own colour, and all that may hide it is white. So the pixels tell
the visible area of each patch.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any, NamedTuple

import numpy as np

from chamberopt.geometry.triangles import unit_normals
from chamberopt.results.vtp_files import Surface, pyvista

Vector = tuple[float, float, float]
PATCHES = 20  # along a target
PIXELS = 240  # side of the small pictures
AZIMUTHS = 12
ELEVATIONS = (-60.0, -22.0, 15.0, 35.0, 60.0)  # degrees; middle elevations are preferred
MIDDLE = (-25.0, 40.0)
STEEP = 0.85  # weight of steep views against middle views
FROM_BELOW = 0.6  # weight of views from below, in pictures with the chamber
USUAL = np.array([1.0, -1.6, 0.5])  # direction that is preferred among equal views
NEARNESS = 0.05  # weight of the nearness to the usual direction
VIEW_ANGLE, FILLED = 30.0, 0.97  # degrees; filled share of a view beside the room for text
FLAT = 0.95  # a target is flat if its mean unit normal is at least this long
WORTHWHILE = 0.15  # least area that a second view adds, over the area of the first view


def view_frame(eye: np.ndarray) -> np.ndarray:
    """Return the unit vectors to the right, upwards and to the eye of a picture, shape (3, 3).

    Args:
        eye: direction from the part to the eye. The z axis is upright in the picture unless the eye
            looks along it.
    """
    to_eye = np.asarray(eye, dtype=float) / np.linalg.norm(eye)
    upright = (0.0, 0.0, 1.0) if abs(to_eye[2]) < 0.99 else (0.0, 1.0, 0.0)
    right = np.cross(upright, to_eye)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(to_eye, right), to_eye])


def directions(steep: bool = True) -> np.ndarray:
    """Return directions from which to try to draw a picture: unit vectors to the eye, (e, 3).

    Args:
        steep: whether to include steep directions, which show a chamber badly.
    """
    turn = 2.0 * np.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS
    rows = [
        np.stack([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up) + 0 * turn], 1)
        for up in np.radians([one for one in ELEVATIONS if steep or _is_middle(one)])
    ]
    return np.concatenate(rows)


def near_directions(target: Surface) -> np.ndarray:
    """Return directions from which to try to draw a target from near: vectors to the eye, (e, 3).

    For a flat target one direction is perpendicular to it.
    """
    normal = flat_normal(target)
    return directions() if normal is None else np.vstack([directions(), normal])


def flat_normal(target: Surface) -> np.ndarray | None:
    """Return the unit normal of a flat target, shape (3,), or None if the target is not flat."""
    corners = np.asarray(target.points, dtype=float)[np.asarray(target.regular_faces)]
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    mean = vectors.sum(axis=0) / np.linalg.norm(vectors, axis=1).sum()
    length = float(np.linalg.norm(mean))
    return mean / length if length > FLAT else None


def seen_area(target: Surface, hiding: Sequence[Surface], eyes: np.ndarray) -> np.ndarray:
    """Return the area of each patch of a target that is visible from each direction [mm²].

    The area is measured in the picture, so that oblique surface counts less. The shape of the
    result is (e, patches).

    Args:
        target: at least one triangle. Neighbouring triangles that face the same way are a patch.
        hiding: surfaces that may hide the target, such as the rest of the part.
        eyes: unit vectors, (e, 3).
    """
    hiding = [one for one in hiding if one.n_cells]
    low, high = (
        reduce(ends, (np.reshape(one.bounds, (3, 2))[:, k] for one in (target, *hiding)))
        for k, ends in ((0, np.minimum), (1, np.maximum))
    )
    pixel = np.linalg.norm(np.subtract(*np.reshape(target.bounds, (3, 2)).T)) / PIXELS
    middle = np.reshape(target.bounds, (3, 2)).mean(axis=1)
    plotter = pyvista().Plotter(off_screen=True, window_size=[PIXELS, PIXELS])
    plotter.render_window.SetMultiSamples(0)
    plotter.set_background("white")
    number = _patches(target)
    count = int(number.max()) + 1
    code = np.stack([number >> 16, number >> 8, number], axis=1) & 255
    shown = target.copy(deep=False)
    shown.clear_data()
    shown.cell_data["code"] = code.astype(np.uint8)
    style = {"lighting": False, "render": False, "reset_camera": False}
    plotter.add_mesh(shown, scalars="code", rgb=True, **style)
    for one in hiding:
        pushed_back(plotter.add_mesh(one, color="white", **style))
    plotter.camera.parallel_projection = True
    found = np.zeros((len(eyes), count))
    for row, eye in zip(found, eyes, strict=True):
        plotter.camera_position = [
            middle + np.linalg.norm(high - low) * eye, middle, view_frame(eye)[1],
        ]  # fmt: skip
        plotter.camera.parallel_scale = 0.5 * PIXELS * pixel
        plotter.renderer.ResetCameraClippingRange()
        plotter.render()
        image = np.asarray(plotter.screenshot(None, return_img=True), dtype=np.int64)
        seen = image[..., :3].reshape(-1, 3) @ [1 << 16, 1 << 8, 1]
        row += pixel**2 * np.bincount(seen[seen < count], minlength=count)
    plotter.close()
    return found


def _patches(surface: Surface) -> np.ndarray:
    """Return the number of the patch to which each triangle belongs, shape (n,).

    A patch is a group of neighbouring triangles that face the same way.
    """
    corners = np.asarray(surface.points, dtype=float)[np.asarray(surface.regular_faces)]
    cell = np.linalg.norm(np.ptp(surface.points, axis=0)) / PATCHES
    key = np.hstack([corners.mean(axis=1) // cell, np.rint(2.0 * unit_normals(corners))])
    return np.unique(key, axis=0, return_inverse=True)[1].reshape(-1)


def pushed_back(actor: Any) -> None:
    """Let VTK draw an actor behind other actors that lie at the same depth."""
    mapper = actor.mapper
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(2.0, 2.0)


def target_in_chamber(part: Surface) -> tuple[Surface, Surface]:
    """Return the target inside the chamber, and the rest of the part, which may hide it.

    Args:
        part: surface with cell data "target" and "exposed_area_mm2".
    """
    chosen = (np.asarray(part["target"]) > 0) & (np.asarray(part["exposed_area_mm2"]) > 0.0)
    return cells_of(part, chosen), cells_of(part, ~chosen)


def cells_of(surface: Surface, chosen: np.ndarray) -> Surface:
    """Return the chosen triangles of a surface as a surface of their own."""
    return surface.extract_cells(chosen).extract_surface(algorithm="dataset_surface")


def near_views(seen: np.ndarray, eyes: np.ndarray) -> list[np.ndarray]:
    """Return the direction that shows most of a target, and a direction that shows the rest.

    Args:
        seen: visible area of each patch from each direction, shape (e, patches). The columns hold
            the patches of the first result, then of the next.
        eyes: unit vectors, (e, 3).
    Returns:
        One direction if a second would add little, else two.
    """
    worth = _worth(eyes)
    first = int(np.argmax(worth * seen.sum(axis=1)))
    added = np.maximum(seen - seen[first], 0.0).sum(axis=1)
    second = int(np.argmax(worth * added))
    if added[second] < WORTHWHILE * seen[first].sum():
        return [eyes[first]]
    return [eyes[first], eyes[second]]


def chamber_view(seen: np.ndarray, eyes: np.ndarray) -> np.ndarray:
    """Return the direction to the eye that shows most of a target in its chamber.

    Args:
        seen: visible area of each patch from each direction, shape (e, patches).
        eyes: unit vectors, (e, 3).
    """
    worth = _worth(eyes) * np.where(eyes[:, 2] < 0.0, FROM_BELOW, 1.0)
    return np.asarray(eyes[int(np.argmax(worth * seen.sum(axis=1)))])


def _worth(eyes: np.ndarray) -> np.ndarray:
    """Return the weight of visible area from each direction, shape (e,).

    Directions near the usual direction weigh more, and steep directions less.
    """
    nearness = eyes @ USUAL / np.linalg.norm(USUAL)
    is_middle = _is_middle(np.degrees(np.arcsin(eyes[:, 2])))
    return np.asarray(np.where(is_middle, 1.0, STEEP) * (1.0 + NEARNESS * nearness))


def _is_middle(height: float | np.ndarray) -> bool | np.ndarray:
    return np.greater(height, MIDDLE[0]) & np.less(height, MIDDLE[1])


class Room(NamedTuple):
    """Widths of the sides of a view that stay free for text [pixels]."""

    left: float
    right: float
    below: float
    above: float


def fit_camera(
    plotter: Any, points: np.ndarray, eye: np.ndarray, size: tuple[int, int], room: Room
) -> None:
    """Point the camera of a plotter at points so that they fill a view beside its text.

    Args:
        points: points to show [mm], (k, 3).
        eye: direction to the eye.
        size: width and height of the view [pixels].
        room: sides of the view that stay free for text.
    """
    frame = view_frame(eye)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    distance = 4.0 * float(np.linalg.norm(np.ptp(points, axis=0)))
    plotter.camera_position = [middle + distance * frame[2], middle, frame[1]]
    plotter.camera.view_angle = VIEW_ANGLE  # set each time, because zoom() narrows it
    x, y, z = ((points - middle) @ frame.T).T
    half = np.tan(np.radians(0.5 * VIEW_ANGLE)) * (distance - z)
    # In VTK's units the view is from -1 to 1 in both directions.
    shown = np.stack([x / (half * size[0] / size[1]), y / half])
    low = 2.0 * np.array([room.left, room.below]) / size - 1.0
    high = 1.0 - 2.0 * np.array([room.right, room.above]) / size
    zoom = FILLED * float(((high - low) / np.maximum(np.ptp(shown, axis=1), 1e-9)).min())
    plotter.camera.zoom(zoom)
    place = zoom * 0.5 * (shown.min(axis=1) + shown.max(axis=1)) - 0.5 * (low + high)
    plotter.camera.SetWindowCenter(*place)
    plotter.renderer.ResetCameraClippingRange()
