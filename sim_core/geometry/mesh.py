"""A closed, tagged triangle mesh: the boundary of the space the shot moves in."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim_core.errors import SceneError

MAX_TAGS = 256


@dataclass(frozen=True, eq=False)  # hashed by identity, so that objects built from it can be cached
class TriangleMesh:
    """Closed surface of the cavity that the balls move in, made of tagged triangles.

        outside      ___________          normals point out of the cavity; a tag is a number
                    |  cavity   |         the user chooses, e.g. 0 part, 1 sonotrode, 2 wall
                    |   o    o  |
                    |___________|

    Args:
        vertices: positions [m], shape (n, 3) float64.
        triangles: vertex indices, shape (m, 3) int32, wound so that the enclosed cavity has
            positive volume: normals point out of the cavity, away from the shot.
        tags: surface of each triangle, shape (m,) uint8; restitution and vibration go by tag.

    Raises:
        SceneError: for wrong shapes, indices or numbers, an open or non-manifold surface, or one
            that is inside out; the message names the triangle or edge.
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
        triangles = _whole_numbers("triangles", triangles).astype(np.int32)
        tags = np.asarray(self.tags)
        if tags.shape != (len(triangles),):
            raise SceneError(
                f"mesh tags must have shape ({len(triangles)},), one a triangle, not {tags.shape}"
            )
        tags = _whole_numbers("tags", tags)
        if tags.min() < 0 or tags.max() >= MAX_TAGS:
            raise SceneError(
                f"mesh tags must lie between 0 and {MAX_TAGS - 1}, not {tags.min()} to {tags.max()}"
            )
        bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
        if len(bad):
            raise SceneError(
                f"mesh vertex {bad[0]} is {vertices[bad[0]].tolist()}: coordinates must be finite"
            )
        bad = np.flatnonzero(((triangles < 0) | (triangles >= len(vertices))).any(axis=1))
        if len(bad):
            raise SceneError(
                f"mesh triangle {bad[0]} names a vertex outside 0 to {len(vertices) - 1}"
            )
        _require_closed(vertices, triangles)
        arrays = {"vertices": vertices, "triangles": triangles, "tags": tags.astype(np.uint8)}
        for name, array in arrays.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @cached_property
    def corners(self) -> np.ndarray:
        """Corner positions [m], shape (m, 3 corners, 3)."""
        return np.ascontiguousarray(self.vertices[self.triangles])

    @cached_property
    def middle(self) -> np.ndarray:
        """Middle of the bounding box [m], shape (3,).

        Coordinates relative to the middle lose no digits where the mesh is far from the origin.
        """
        return np.asarray(0.5 * (self.vertices.min(axis=0) + self.vertices.max(axis=0)))

    @cached_property
    def bounds(self) -> np.ndarray:
        """Lowest and highest corner of the bounding box [m], shape (2, 3)."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def partners(self) -> np.ndarray:
        """For each directed edge the edge that runs the opposite way, as `edge_partners` has it."""
        return edge_partners(self.triangles)

    @property
    def volume(self) -> float:
        """Enclosed volume [m³], by the divergence theorem."""
        return enclosed_volume(self.vertices, self.triangles)


def _whole_numbers(name: str, numbers: np.ndarray) -> np.ndarray:
    """Return the numbers as int64.

    Raises SceneError, with ``name`` in its message, for a number that is not whole or beyond int32.
    """
    try:
        whole = (numbers == np.floor(numbers)) & (np.abs(numbers) <= np.iinfo(np.int32).max)
    except TypeError:
        raise SceneError(f"mesh {name} must be whole numbers, not {numbers.dtype}") from None
    bad = np.flatnonzero(~whole.reshape(len(numbers), -1).all(axis=1))
    if len(bad):
        raise SceneError(
            f"mesh {name} must be whole numbers: triangle {bad[0]} has {numbers[bad[0]].tolist()}"
        )
    return numbers.astype(np.int64)


def enclosed_volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """Return the volume [m³] that a closed surface encloses, negative if it is inside out."""
    a, b, c = np.moveaxis(vertices[triangles] - vertices.mean(axis=0), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def normals_towards_shot(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return unit normals towards the shot and doubled areas of triangles.

    Args:
        corners: corner positions [m], shape (m, 3 corners, 3).

    Returns:
        Normals into the cavity, shape (m, 3), zero where a triangle has no area, and twice the
        areas [m²], shape (m,).
    """
    normals = -np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(normals, axis=1)
    normals[doubled > 0.0] /= doubled[doubled > 0.0, None]
    return normals, doubled


def edge_partners(triangles: np.ndarray) -> np.ndarray:
    """Return, for each directed edge of a closed mesh, the edge that runs the opposite way, (3 m,).

    A directed edge has the number 3 triangle + corner.
    """
    count = int(triangles.max()) + 1
    a = triangles.reshape(-1).astype(np.int64)
    b = np.roll(triangles, -1, axis=1).reshape(-1).astype(np.int64)
    forward, backward = a * count + b, b * count + a
    order = np.argsort(forward)
    return np.asarray(order[np.searchsorted(forward, backward, sorter=order)])


def connected_components(edges: np.ndarray, count: int) -> np.ndarray:
    """Return the number of the connected component that each vertex belongs to, shape (count,).

    Args:
        edges: vertex indices of both ends, shape (n, 2).
        count: number of vertices.
    """
    from scipy.sparse import coo_array, csgraph

    ones = np.ones(len(edges), dtype=np.bool_)
    graph = coo_array((ones, (edges[:, 0], edges[:, 1])), shape=(count, count))
    return np.asarray(csgraph.connected_components(graph, directed=False)[1])


def _require_closed(vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Raise SceneError unless each edge has two triangles and the volume is positive."""
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1)
    edges = ends.reshape(-1, 2).astype(np.int64)
    twice = np.flatnonzero(edges[:, 0] == edges[:, 1])
    if len(twice):
        raise SceneError(f"mesh triangle {twice[0] // 3} uses one vertex twice; remove it")
    forward = edges[:, 0] * len(vertices) + edges[:, 1]
    backward = edges[:, 1] * len(vertices) + edges[:, 0]
    keys = np.sort(forward)
    again = np.flatnonzero(keys[1:] == keys[:-1])
    if len(again):
        edge = np.flatnonzero(forward == keys[again[0]])
        named = f"triangles {edge[0] // 3} and {edge[1] // 3}"
        raise SceneError(
            f"mesh {named} run along a shared edge the same way: flipped or overlapping triangles"
        )
    if not np.array_equal(np.sort(backward), keys):
        lonely = np.flatnonzero(~np.isin(backward, keys))
        where = np.round(vertices[edges[lonely[0]]].mean(axis=0), 6).tolist()
        raise SceneError(
            f"mesh is not closed: {len(lonely)} open edge(s), the first on triangle "
            f"{lonely[0] // 3} at {where} m; merge duplicate vertices or close the hole"
        )
    volume = enclosed_volume(vertices, triangles)
    if not volume > 0.0:
        raise SceneError(
            f"mesh encloses {volume:.3g} m³: it is inside out or flat; reverse every triangle "
            "so that normals point away from the shot"
        )
