"""A closed, tagged triangle mesh: the boundary of the space the shot moves in."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim_core.errors import SceneError

MAX_TAGS = 256


@dataclass(frozen=True, eq=False)  # hashed by identity: what is built from it can be kept
class TriangleMesh:
    """The cavity's surface.

    ``vertices`` [m], shape (n, 3) float64. ``triangles``, shape (m, 3) int32: indices of vertices, wound so that
    the enclosed cavity has positive volume (normals point out of the cavity, away from the shot). ``tags``, shape
    (m,) uint8: the surface each triangle belongs to; restitution and vibration go by tag.

    Raises SceneError for wrong shapes, indices or numbers, an open or non-manifold surface, or one that is inside
    out; the message names the triangle or edge.

        outside      ___________          normals point out of the cavity; a tag is a number
                    |  cavity   |         the user chooses, e.g. 0 part, 1 sonotrode, 2 wall
                    |   o    o  |
                    |___________|
    """

    vertices: np.ndarray
    triangles: np.ndarray
    tags: np.ndarray

    def __post_init__(self) -> None:
        try:
            vertices = np.array(self.vertices, dtype=np.float64, order="C")
            triangles = np.array(self.triangles, order="C")
        except (TypeError, ValueError):
            raise SceneError(
                "mesh vertices must be numbers of shape (n, 3), triangles indices of shape (m, 3)"
            ) from None
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise SceneError(f"mesh vertices must have shape (n, 3), not {vertices.shape}")
        if triangles.ndim != 2 or triangles.shape[1] != 3 or len(triangles) < 4:
            raise SceneError(
                f"mesh triangles must have shape (m, 3) with m >= 4, not {triangles.shape}"
            )
        triangles = _whole("triangles", triangles).astype(np.int32)
        tags = np.asarray(self.tags)
        if tags.shape != (len(triangles),):
            raise SceneError(
                f"mesh tags must have shape ({len(triangles)},), one a triangle, not {tags.shape}"
            )
        tags = _whole("tags", tags)
        if tags.min() < 0 or tags.max() >= MAX_TAGS:
            raise SceneError(
                f"mesh tags must lie between 0 and {MAX_TAGS - 1}, not {tags.min()} to {tags.max()}"
            )
        bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
        if len(bad):
            raise SceneError(
                f"mesh vertex {bad[0]} is {vertices[bad[0]].tolist()}: coordinates must be finite"
            )
        wrong = np.flatnonzero(
            (triangles < 0).any(axis=1) | (triangles >= len(vertices)).any(axis=1)
        )
        if len(wrong):
            raise SceneError(
                f"mesh triangle {wrong[0]} names a vertex outside 0 to {len(vertices) - 1}"
            )
        _require_closed(vertices, triangles)
        for array in (vertices, triangles):
            array.flags.writeable = False
        tags = tags.astype(np.uint8)
        tags.flags.writeable = False
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "triangles", triangles)
        object.__setattr__(self, "tags", tags)

    @cached_property
    def corners(self) -> np.ndarray:
        """Corner positions [m], shape (m, 3 corners, 3)."""
        return np.ascontiguousarray(self.vertices[self.triangles])

    @cached_property
    def middle(self) -> np.ndarray:
        """Middle of the bounding box [m], (3,): what is computed relative to it loses no digits to a far origin."""
        return np.asarray(0.5 * (self.vertices.min(axis=0) + self.vertices.max(axis=0)))

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest corner of the bounding box [m], (2, 3)."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @property
    def volume(self) -> float:
        """Enclosed volume [m³], by the divergence theorem."""
        return enclosed_volume(self.vertices, self.triangles)


def _whole(name: str, numbers: np.ndarray) -> np.ndarray:
    """The numbers as int64; raises SceneError for one that is not whole, or beyond int32."""
    try:
        whole = (numbers == np.floor(numbers)) & (np.abs(numbers) <= np.iinfo(np.int32).max)
    except TypeError:
        raise SceneError(f"mesh {name} must be whole numbers, not {numbers.dtype}") from None
    wrong = np.flatnonzero(~whole.reshape(len(numbers), -1).all(axis=1))
    if len(wrong):
        raise SceneError(
            f"mesh {name} must be whole numbers: of triangle {wrong[0]}, {numbers[wrong[0]].tolist()}"
        )
    return numbers.astype(np.int64)


def enclosed_volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """Volume [m³] enclosed by a closed surface; negative if it is inside out."""
    a, b, c = np.moveaxis(vertices[triangles] - vertices.mean(axis=0), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def towards_shot(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals into the cavity (m, 3), zero where a triangle has no area, and twice the areas (m,) [m²]."""
    normals = -np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(normals, axis=1)
    normals[doubled > 0.0] /= doubled[doubled > 0.0, None]
    return normals, doubled


def _require_closed(vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Every directed edge once, its reverse once, and the volume positive."""
    edges = (
        np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1)
        .reshape(-1, 2)
        .astype(np.int64)
    )
    twice = np.flatnonzero(edges[:, 0] == edges[:, 1])
    if len(twice):
        raise SceneError(f"mesh triangle {twice[0] // 3} uses one vertex twice; remove it")
    forward = edges[:, 0] * len(vertices) + edges[:, 1]
    backward = edges[:, 1] * len(vertices) + edges[:, 0]
    keys, counts = np.unique(forward, return_counts=True)
    if counts.max() > 1:
        edge = np.flatnonzero(forward == keys[counts > 1][0])
        named = f"triangles {edge[0] // 3} and {edge[1] // 3}"
        raise SceneError(
            f"mesh {named} run along a shared edge the same way: flipped or overlapping triangles"
        )
    lonely = np.flatnonzero(~np.isin(backward, keys))
    if len(lonely):
        where = vertices[edges[lonely[0]]].mean(axis=0)
        raise SceneError(
            f"mesh is not closed: {len(lonely)} open edge(s), the first on triangle {lonely[0] // 3} at "
            f"{np.round(where, 6).tolist()} m; merge duplicate vertices or close the hole"
        )
    volume = enclosed_volume(vertices, triangles)
    if not volume > 0.0:
        raise SceneError(
            f"mesh encloses {volume:.3g} m³: it is inside out or flat; reverse every triangle "
            "so that normals point away from the shot"
        )
