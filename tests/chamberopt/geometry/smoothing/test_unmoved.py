"""What has no rounds is left as it is: sharp edges, chamfers, welds, noise."""

from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from chamberopt.geometry.triangles import unit_normals
from tests.chamberopt.geometry.smoothing.measures import require_sound, smoothed
from tests.helpers.scenes.rounded_solids import Mesh, Solid, circle, outline, regular_polygon

MM = 1e-3
RISE = float(np.tan(np.radians(31.0)))
WEDGE = [(0, 0), (30, 0), (30, 5), (20, 5), (10, 5 + 10 * RISE), (0, 5 + 10 * RISE)]
SHARP = {
    "box": [(0, 0), (20, 0), (20, 10), (0, 10)],
    "gusset, 45 degrees": [(0, 0), (30, 0), (30, 5), (20, 5), (5, 20), (5, 30), (0, 30)],
    "wedge, 31 degrees": WEDGE,
    "taper, 5.7 degrees": [(0, 0), (30, 0), (30, 5), (20, 5), (0, 7)],
    "chamfers": [(1, 0), (19, 0), (20, 1), (20, 9), (19, 10), (1, 10), (0, 9), (0, 1)],
    "one-facet fillet": [(0, 0), (20, 0), (20, 5), (7, 5), (5, 7), (5, 15), (0, 15)],
    "T-joint": [(-40, 0), (40, 0), (40, 10), (12, 10), (5, 17), (5, 55), (-5, 55), (-5, 17),
                (-12, 10), (-40, 10)],
}  # fmt: skip
OUTLINES = {name: outline(MM * np.array(one)) for name, one in SHARP.items()}
OUTLINES |= {"hexagon": regular_polygon(6, 10 * MM), "octagon": regular_polygon(8, 10 * MM),
             "9 sides": regular_polygon(9, 10 * MM)}  # fmt: skip


@pytest.mark.parametrize("name", OUTLINES)
def test_sharp_solids_stay(name: str) -> None:
    solid = Solid(OUTLINES[name], 20 * MM)
    require_unmoved(solid.strips(0.1))


@pytest.mark.parametrize("name", OUTLINES)
def test_sharp_solids_in_irregular_triangles_stay(name: str) -> None:
    require_unmoved(Solid(OUTLINES[name], 20 * MM).irregular(2.0 * np.pi, 5 * MM))


def require_unmoved(mesh: Mesh) -> None:
    result = smoothed(mesh)
    assert len(result.finer.triangles) == len(mesh[1])
    require_sound(result)


def test_planes_beside_a_coarse_fillet_stay_plane() -> None:
    """Two facets of 45 degrees between planes of 12 and 7 mm, whose rise was 1 mm."""
    corners = [(0, 0), (20, 0), (20, 5), (8, 5), (5.88, 5.88), (5, 8), (5, 15), (0, 15)]
    mesh = Solid(outline(MM * np.array(corners)), 20 * MM).strips(0.1)
    result = smoothed(mesh)
    require_sound(result)
    sagitta = 3.0 * MM * (1.0 - np.cos(np.radians(22.5)))
    assert result.largest_move < 1.3 * sagitta


SURFACES: dict[str, Callable[[], Mesh]] = {
    "cylinder": lambda: Solid(circle(5 * MM), 10 * MM).irregular(np.radians(15.0), 2 * MM),
    "sphere": lambda: (
        5 * MM * np.asarray(trimesh.creation.icosphere(3).vertices),
        np.asarray(trimesh.creation.icosphere(3).faces),
    ),
    "box": lambda: Solid(OUTLINES["box"], 10 * MM).irregular(2.0 * np.pi, 1.5 * MM),
}
CHORD_ERROR = {"cylinder": 43e-6, "sphere": 16e-6, "box": 20e-6}


@pytest.mark.parametrize("share", [0.005, 0.05, 0.5, 2.0])
@pytest.mark.parametrize("name", SURFACES)
def test_noise_is_not_made_worse(name: str, share: float) -> None:
    """Vertices moved by a share of the facets' chord error: nothing moves, or it gets better."""
    vertices, triangles = SURFACES[name]()
    noise = np.random.default_rng(3).normal(0.0, share * CHORD_ERROR[name], vertices.shape)
    noisy = (vertices + noise, triangles)
    result = smoothed(noisy)
    require_sound(result)
    assert _off(name, result.finer.vertices, result.finer.triangles) <= 1.05 * _off(name, *noisy)


def _off(name: str, vertices: np.ndarray, triangles: np.ndarray) -> float:
    """Distance [m] from the exact surface, root of the mean square over the sides' middles."""
    corners = vertices[triangles]
    normal, area = (
        unit_normals(corners),
        np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        ),
    )
    places = 0.5 * (corners + np.roll(corners, 1, axis=1))
    if name == "sphere":
        away = np.linalg.norm(places, axis=2) - 5 * MM
    elif name == "cylinder":
        away = np.hypot(places[..., 0], places[..., 1]) - 5 * MM
        area = np.where(np.abs(normal[:, 2]) < 0.7, area, 0.0)
    else:
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        low, high = np.round(low, 3), np.round(high, 3)
        away = np.minimum(np.abs(places - low), np.abs(places - high)).min(axis=2)
    return float(np.sqrt((area[:, None] * away**2).sum() / (3.0 * area.sum())))
