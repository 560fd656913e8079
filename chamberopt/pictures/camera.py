"""Where a camera shows most of a target: the target is drawn from some dozens of directions.

Every patch of the target has a colour of its own, and what may hide it is white, so that the pixels
of a small picture tell which area of each patch is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any, NamedTuple

import numpy as np

from chamberopt.geometry.triangles import unit_normals
from chamberopt.results.vtp_files import Surface, pyvista

Vector = tuple[float, float, float]
PATCHES = 20  # that a target is long
PIXELS = 240  # side of the small pictures
AZIMUTHS = 12
ELEVATIONS = (-60.0, -22.0, 15.0, 35.0, 60.0)  # degrees; the middle ones are preferred
MIDDLE = (-25.0, 40.0)
STEEP = 0.85  # a steep view shows more than a middle one by this factor, or is not taken
FROM_BELOW = 0.6  # the same for a view from below, where the chamber is drawn too
USUAL = np.array([1.0, -1.6, 0.5])  # of directions that show as much, the nearest to this one
NEARNESS = 0.05  # is worth this share
VIEW_ANGLE, FILLED = 30.0, 0.97  # degrees; of what a view has beside the room for text
FLAT = 0.95  # a target is flat if its mean unit normal is at least this long
WORTHWHILE = 0.15  # a second view adds at least this share of what the first one shows


def view_frame(eye: np.ndarray) -> np.ndarray:
    """Unit vectors (3, 3) to the right, upwards and to the eye, with z upright where it can be."""
    to_eye = np.asarray(eye, dtype=float) / np.linalg.norm(eye)
    upright = (0.0, 0.0, 1.0) if abs(to_eye[2]) < 0.99 else (0.0, 1.0, 0.0)
    right = np.cross(upright, to_eye)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(to_eye, right), to_eye])


def directions(steep: bool = True) -> np.ndarray:
    """Unit vectors to the eyes that are tried, (e, 3); those not steep show chambers well."""
    turn = 2.0 * np.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS
    rows = [
        np.stack([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up) + 0 * turn], 1)
        for up in np.radians([one for one in ELEVATIONS if steep or _is_middle(one)])
    ]
    return np.concatenate(rows)


def near_directions(target: Surface) -> np.ndarray:
    """All directions that are tried for a target seen from near, and face on if it is flat."""
    normal = flat_normal(target)
    return directions() if normal is None else np.vstack([directions(), normal])


def flat_normal(target: Surface) -> np.ndarray | None:
    """The unit vector that a flat target faces, (3,); None for others."""
    corners = np.asarray(target.points, dtype=float)[np.asarray(target.regular_faces)]
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    mean = vectors.sum(axis=0) / np.linalg.norm(vectors, axis=1).sum()
    length = float(np.linalg.norm(mean))
    return mean / length if length > FLAT else None


def seen_area(target: Surface, hiding: Sequence[Surface], eyes: np.ndarray) -> np.ndarray:
    """Area of each patch that is seen from each direction, as it appears [mm²], (e, patches).

    Args:
        target: at least one triangle; those beside one another that face the same way are a patch.
        hiding: what may hide them, such as the rest of the part.
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
    """Number of the patch of each triangle, (n,)."""
    corners = np.asarray(surface.points, dtype=float)[np.asarray(surface.regular_faces)]
    cell = np.linalg.norm(np.ptp(surface.points, axis=0)) / PATCHES
    key = np.hstack([corners.mean(axis=1) // cell, np.rint(2.0 * unit_normals(corners))])
    return np.unique(key, axis=0, return_inverse=True)[1].reshape(-1)


def pushed_back(actor: Any) -> None:
    """Let an actor be hidden by others in the same place."""
    mapper = actor.mapper
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(2.0, 2.0)


def target_in_chamber(part: Surface) -> tuple[Surface, Surface]:
    """What is of the target in the chamber, and the rest of the part, which may hide it.

    Args:
        part: with cell data "target" and "exposed_area_mm2".
    """
    chosen = (np.asarray(part["target"]) > 0) & (np.asarray(part["exposed_area_mm2"]) > 0.0)
    return cells_of(part, chosen), cells_of(part, ~chosen)


def cells_of(surface: Surface, chosen: np.ndarray) -> Surface:
    """Some triangles of a surface, as a surface."""
    return surface.extract_cells(chosen).extract_surface(algorithm="dataset_surface")


def near_views(seen: np.ndarray, eyes: np.ndarray) -> list[np.ndarray]:
    """The direction that shows most of a target, and one that shows what is hidden from there.

    Args:
        seen: as from seen_area; targets of several results stand beside one another.
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
    """The direction that shows most of a target in its chamber; arguments as of near_views."""
    worth = _worth(eyes) * np.where(eyes[:, 2] < 0.0, FROM_BELOW, 1.0)
    return np.asarray(eyes[int(np.argmax(worth * seen.sum(axis=1)))])


def _worth(eyes: np.ndarray) -> np.ndarray:
    """What the same area is worth from each direction, (e,)."""
    nearness = eyes @ USUAL / np.linalg.norm(USUAL)
    is_middle = _is_middle(np.degrees(np.arcsin(eyes[:, 2])))
    return np.asarray(np.where(is_middle, 1.0, STEEP) * (1.0 + NEARNESS * nearness))


def _is_middle(height: Any) -> Any:
    return (MIDDLE[0] < height) & (height < MIDDLE[1])


class Room(NamedTuple):
    """Pixels at the sides of a view that are kept free for text."""

    left: float
    right: float
    below: float
    above: float


def fit_camera(
    plotter: Any, points: np.ndarray, eye: np.ndarray, size: tuple[int, int], room: Room
) -> None:
    """Point the camera at points so that they fill a view but for the room at its sides.

    Args:
        points: [mm], (k, 3).
        eye: direction to the eye.
        size: width and height of the view [pixels].
    """
    frame = view_frame(eye)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    distance = 4.0 * float(np.linalg.norm(np.ptp(points, axis=0)))
    plotter.camera_position = [middle + distance * frame[2], middle, frame[1]]
    plotter.camera.view_angle = VIEW_ANGLE  # zoom() narrows it, so it is set each time
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
