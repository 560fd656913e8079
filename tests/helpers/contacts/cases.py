"""Bodies to hit and flights that aim at them: at random, and where contact is hardest to tell."""

import numpy as np
import trimesh

from sim_core import TriangleMesh
from sim_core.effects.gravity import STANDARD
from tests.helpers.scenes.cavities import CEILING, SIDES

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
FAR = np.array([1000.0, -730.0, 410.0])  # m: where the shape "far" stands

# ball radius [m] and half side of the room [m] for each shape of body: tetrahedra, and others
SHAPES = {
    "plump": (1.5e-3, 0.05),
    "sliver": (0.3e-3, 0.05),
    "needle": (1.5e-3, 0.05),
    "micro": (1.5e-3, 0.05),
    "huge": (4e-3, 3.0),
    "far": (1.5e-3, 0.05),
}
BODIES = {**SHAPES, "box": (1.5e-3, 0.05), "spiky": (0.5e-3, 0.05), "cone": (1.5e-3, 0.05)}
AIMS = (
    "random",
    "fast",
    "grazing",
    "tangent",
    "touching",
    "overlapping",
    "turning back",
    "at rest",
    "behind",
)
HARD_AIMS = AIMS[1:]


def units(rng: np.random.Generator, count: int) -> np.ndarray:
    """Random directions (count, 3)."""
    directions = rng.normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1)[:, None]


def spread(rng: np.random.Generator, low: float, high: float, count: int) -> np.ndarray:
    """Numbers (count,) whose logarithm is uniform from low to high."""
    return 10.0 ** rng.uniform(np.log10(low), np.log10(high), count)


def tetrahedra(rng: np.random.Generator, shape: str, count: int) -> np.ndarray:
    """Corners (count, 4, 3) [m] about the origin: plump (10 mm), slivers a nm to 10 µm thin,
    needles of 10 mm with a base of 0.1 to 10 µm, micro (1 µm), huge (1 m), far (plump, to be put a
    km away).
    """
    corners = units(rng, 4 * count).reshape(count, 4, 3) * 0.01
    if shape == "sliver":
        height = spread(rng, 1e-9, 1e-5, count)[:, None]
        inside = rng.dirichlet(np.ones(3), count)
        corners[:, 3] = np.einsum("nk,nkd->nd", inside, corners[:, :3]) + height * units(rng, count)
    elif shape == "needle":
        width = spread(rng, 1e-7, 1e-5, count)[:, None]
        for k in (2, 3):
            corners[:, k] = corners[:, 1] + width * units(rng, count)
    elif shape == "micro":
        corners *= 1e-4
    elif shape == "huge":
        corners *= 50.0
    a, b, c, d = np.moveaxis(corners, 1, 0)
    inside_out = np.einsum("nd,nd->n", np.cross(b - a, c - a), d - a) < 0.0
    corners[inside_out, 2], corners[inside_out, 3] = corners[inside_out, 3], corners[inside_out, 2]
    return corners


def body_of(rng: np.random.Generator, shape: str) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3) [m] and outward triangles (m, 3) of one body: a tetrahedron, a box, a star
    with 20 faces and concave edges, or a cone so shallow that its hundred faces are almost one
    plane.
    """
    if shape == "box":
        solid = trimesh.creation.box(rng.uniform(0.002, 0.02, 3))
    elif shape == "spiky":
        solid = trimesh.creation.icosahedron()
        solid.vertices *= 0.006 * np.exp(rng.normal(size=(12, 1)) * 0.5)
    elif shape == "cone":
        angle = np.linspace(0.0, 2 * np.pi, 100, endpoint=False)
        rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(100)], axis=1)
        corners = 0.01 * np.concatenate(
            [rim, [[0.0, 0.0, 10.0 ** rng.uniform(-5.0, -3.0)], [0.0, 0.0, -1.0]]]
        )
        k = np.arange(100)
        up = np.stack([k, (k + 1) % 100, np.full(100, 100)], axis=1)
        down = np.stack([(k + 1) % 100, k, np.full(100, 101)], axis=1)
        return corners @ _turned(rng).T, np.concatenate([up, down])
    else:
        return tetrahedra(rng, shape, 1)[0], TETRAHEDRON
    return np.asarray(solid.vertices), np.asarray(solid.faces)


def _turned(rng: np.random.Generator) -> np.ndarray:
    """A random rotation (3, 3)."""
    turned, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.asarray(turned * np.sign(np.linalg.det(turned)))


def touches(
    rng: np.random.Generator, corners: np.ndarray, triangles: np.ndarray, radius: float, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Centres (count, 3) of balls that touch a body, and the outward normals there: on its faces,
    edges and corners, and in a face's plane just past one of its corners, where nothing is.
    """
    a, b, c = np.moveaxis(corners[triangles], 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    across = {(int(j), int(i)): t // 3 for t, (i, j) in enumerate(edges)}
    chosen = rng.integers(len(triangles), size=count)
    where = rng.dirichlet(np.ones(3), count)
    normal = normals[chosen]
    kind = rng.integers(4, size=count)
    edge = kind == 1
    where[edge, 2] = 0.0
    neighbour = np.array(
        [across[int(triangles[t, 0]), int(triangles[t, 1])] for t in chosen[edge]], dtype=int
    )
    share = rng.uniform(size=(len(neighbour), 1))
    normal[edge] = share * normal[edge] + (1.0 - share) * normals[neighbour]
    corner = kind >= 2
    where[corner] = np.eye(3)[rng.integers(3, size=corner.sum())]
    at = triangles[chosen, where.argmax(axis=1)]
    for k in np.flatnonzero(kind == 2):
        around = normals[(triangles == at[k]).any(axis=1)]
        normal[k] = rng.dirichlet(np.full(len(around), 0.5)) @ around
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    where /= where.sum(axis=1)[:, None]
    foot = np.einsum("nk,nkd->nd", where, corners[triangles[chosen]])
    past = kind == 3
    sides = corners[triangles[chosen[past]]] - foot[past, None]
    sides /= np.maximum(np.linalg.norm(sides, axis=2), 1e-300)[:, :, None]
    out = -sides.sum(axis=1)
    out *= (spread(rng, 1e-9, 1e-3, int(past.sum())) / np.linalg.norm(out, axis=1))[:, None]
    foot[past] += out
    return foot + radius * normal, normal


def room_with(
    corners: np.ndarray, triangles: np.ndarray, half: float, centre: np.ndarray
) -> TriangleMesh:
    """A cube of half side ``half`` [m] about ``centre`` and in it solid bodies (n, vertices, 3),
    all of the same ``triangles`` (m, 3) that wind outward; the bodies are the "part". They may
    overlap: obstacles do not care.
    """
    signs = np.array(
        [[x, y, z] for x in (-half, half) for y in (-half, half) for z in (-half, half)]
    )
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    walls = np.array([[q[0], q[j], q[j + 1]] for q in quads for j in (1, 2)])
    count, size = corners.shape[:2]
    part = (triangles[None, :, ::-1] + size * np.arange(count)[:, None, None]).reshape(-1, 3) + len(
        signs
    )
    tags = np.concatenate([np.full(len(walls), SIDES), np.full(len(part), CEILING)])
    vertices = np.concatenate([signs, corners.reshape(-1, 3)]) + centre
    return TriangleMesh(vertices, np.concatenate([walls, part]), tags)


def falls_for(rng: np.random.Generator, count: int) -> np.ndarray:
    """Accelerations (count, 3) [m/s²]: gravity, none, or a hundred times gravity in any
    direction.
    """
    fall = np.zeros((count, 3))
    kind = rng.integers(4, size=count)
    fall[kind >= 1, 2] = -STANDARD
    fall[kind == 3] = 100.0 * STANDARD * units(rng, int((kind == 3).sum()))
    return fall


def flights_to(
    rng: np.random.Generator,
    aim: str,
    touch: np.ndarray,
    normal: np.ndarray,
    fall: np.ndarray,
    radius: float,
) -> np.ndarray:
    """Flights (n, 9) that bring a centre to the points ``touch`` (n, 3) [m], where it touches a
    surface with this outward ``normal`` (n, 3).

    random        0.1 to 10 m/s, 0.1 to 10 ms before
    fast          20 m/s
    grazing       nearly along the surface, and up to 1 µm above it or below, or 1e-13 m
    tangent       along it to the last bit
    touching      starts there, to 1e-15 m, moving off, on, or along
    overlapping   starts 1e-14 to 1e-6 m deep, moving off, on, or along
    turning back  starts in touch or overlapping, and gravity turns it back, or would
    at rest       starts with no speed, in touch or above
    behind        starts on the surface's other side
    """
    count = len(touch)
    delay = spread(rng, 1e-4, 1e-2, count)
    speed = spread(rng, 0.1, 10.0, count) if aim != "fast" else np.full(count, 20.0)
    above = np.zeros(count)
    direction = units(rng, count)
    facing = np.einsum("nd,nd->n", direction, normal)[:, None]
    sideways = direction - facing * normal
    sideways /= np.linalg.norm(sideways, axis=1)[:, None]
    if aim in ("random", "fast"):
        direction -= np.maximum(2.0 * facing, 0.0) * normal
    elif aim in ("grazing", "tangent"):
        above = spread(rng, 1e-13, 1e-6, count) * rng.integers(-1, 2, count)
        steep = spread(rng, 1e-9, 1e-3, count)[:, None] if aim == "grazing" else 0.0
        direction = sideways - steep * normal
    else:
        delay = np.zeros(count)
        along = rng.integers(3, size=count) == 0
        direction[along] = sideways[along]
        if aim == "touching":
            above = rng.choice([0.0, 1e-16, -1e-16, 1e-15, -1e-15], count)
        elif aim == "overlapping":
            above = -spread(rng, 1e-14, 1e-6, count)
        elif aim == "turning back":
            above = -spread(rng, 1e-15, 1e-6, count) * rng.integers(2, size=count)
            speed = spread(rng, 1e-7, 1e-2, count)
            direction = normal + rng.integers(2, size=(count, 1)) * sideways
        elif aim == "at rest":
            drop = spread(rng, 1e-6, 1e-2, count) * rng.integers(2, size=count)
            above = rng.choice([0.0, 1e-15, -1e-15], count)
            touch = touch - 0.5 * fall * (drop * drop)[:, None]
            speed = np.zeros(count)
        elif aim == "behind":
            above = -radius * rng.uniform(0.6, 3.0, count)
    velocity = (
        speed[:, None] * direction - delay[:, None] * fall
    )  # at the start; ``speed`` is at the touch
    start = (
        touch + above[:, None] * normal - delay[:, None] * (velocity + 0.5 * delay[:, None] * fall)
    )
    return np.concatenate([start, velocity, fall], axis=1)
