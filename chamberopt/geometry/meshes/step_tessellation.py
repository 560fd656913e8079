"""Mesh the faces of STEP files with Gmsh, in a separate process.

The side h of the triangles follows the radius of curvature r of surfaces and edges, so that fillets
are fine and planes coarse:

    h = min(side, sqrt(5 chord r), max(angle r, 4 chord)), where r is 3 chord at least

side is the largest side of a triangle, chord the largest distance of a triangle from the face, and
angle the largest angle between neighbouring triangles. This angle is kept, except at radii too
small for a ball. The middle of an equilateral triangle is h² / 6 r below a sphere. The factor 5
instead of 6 leaves room for sides longer than wanted. Curved faces with four sides get grids, whose
cells are longer in a direction in which the face is straight.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.meshes.native_reader import allow_more

if TYPE_CHECKING:
    import gmsh

# Grids lie on curved faces with four sides. They are fine across a fillet or a tooth and coarse
# along it.
#
# A grid has as many rows in each of its two directions as the curvature of its lines asks for.
# Opposite edges have the same number of rows. Faces that share an edge pass the number on to each
# other.

GRID_SAMPLES = 13  # samples in each direction: enough for the curvature of a fillet or an aerofoil
ON_EDGE = 0.01  # share of a face's parameter range
MOST_TIMES_LONGER = 6.0  # largest ratio of the two sides of a grid's cell
# Largest number of even rows over rows that follow the curvature. Lines with a larger ratio get no
# grid.
MOST_TIMES_MORE = 3.0
# two edges and the number of rows, in each direction
Grid = tuple[tuple[int, int, int], tuple[int, int, int]]


def lay_grids(model: type[gmsh.model], faces: list[int], side_at: Callable[[float], float]) -> None:
    """Make Gmsh lay grids on curved faces with four sides. Other faces get Gmsh's usual triangles.

    Args:
        model: gmsh.model.
        faces: Gmsh's numbers of the faces.
        side_at: function that returns the wanted side of triangles at a radius of curvature [mm].
    """
    curved = (face for face in faces if model.getType(2, face) != "Plane")
    grids = {face: grid for face in curved if (grid := _find_grid(model, face, side_at))}
    rows: dict[int, int] = {}
    is_new = True
    while is_new:
        is_new = False
        for one, other, wanted in (line for grid in grids.values() for line in grid):
            most = max(wanted, rows.get(one, 0), rows.get(other, 0))
            is_new |= (rows.get(one), rows.get(other)) != (most, most)
            rows[one] = rows[other] = most
    for edge, count in rows.items():
        model.mesh.setTransfiniteCurve(edge, count + 1)
    for face in grids:
        model.mesh.setTransfiniteSurface(face, "AlternateLeft")


def _find_grid(
    model: type[gmsh.model], face: int, side_at: Callable[[float], float]
) -> Grid | None:
    """Return the grid that fits a face, or None if none does.

    For each of the two directions, a grid has the two edges at its ends and a number of rows. A
    grid needs four edges at which one of the face's two parameters is smallest or largest.
    """
    edges = [tag for _, tag in model.getBoundary([(2, face)], oriented=False)]
    low, high = map(np.array, model.getParametrizationBounds(2, face))
    at_end: dict[tuple[int, int], int] = {}
    for edge in edges if len(set(edges)) == len(edges) == 4 else ():
        first, last = model.getParametrizationBounds(1, edge)
        along = np.linspace(first[0], last[0], 5)
        places = np.reshape(model.reparametrizeOnSurface(1, edge, along, face), (-1, 2))
        shares = (places - low) / (high - low)
        for axis, end in ((0, 0), (0, 1), (1, 0), (1, 1)):
            if np.abs(shares[:, axis] - end).max() < ON_EDGE:
                at_end[axis, end] = edge
    if len(set(at_end.values())) < 4:
        return None
    u, v = np.meshgrid(*np.linspace(low, high, GRID_SAMPLES).T, indexing="ij")
    flat = np.stack([u, v], axis=-1).ravel()
    points = np.reshape(model.getValue(2, face, flat), (GRID_SAMPLES, GRID_SAMPLES, 3))
    lines = [_line(points, side_at), _line(points.transpose(1, 0, 2), side_at)]
    if any(more > MOST_TIMES_MORE for _, _, more in lines):
        return None
    (along_u, side_u, _), (along_v, side_v, _) = lines
    side_u = min(side_u, MOST_TIMES_LONGER * side_v)
    side_v = min(side_v, MOST_TIMES_LONGER * side_u)
    return (
        (at_end[1, 0], at_end[1, 1], math.ceil(along_u / side_u)),
        (at_end[0, 0], at_end[0, 1], math.ceil(along_v / side_v)),
    )


def _line(points: np.ndarray, side_at: Callable[[float], float]) -> tuple[float, float, float]:
    """Return the length of the longest of several lines on a face, the shortest side of triangles
    that its curvature asks for, and the waste of triangles of one size.

    The waste is the number of rows of triangles of the shortest side over the number of rows of
    triangles of the side that the curvature asks for in each place.

    Args:
        points: points along the lines, (points, lines, 3).
        side_at: function that returns the wanted side of triangles at a radius of curvature.
    """
    steps = np.diff(points, axis=0)
    length = np.maximum(np.linalg.norm(steps, axis=2), 1e-12)
    ahead = steps / length[..., None]
    turn = np.arccos(np.clip((ahead[1:] * ahead[:-1]).sum(axis=2), -1.0, 1.0))
    between = (length[1:] + length[:-1]) / 2
    radius = (between / np.maximum(turn, 1e-9)).min(axis=1)
    side = np.array([side_at(one) for one in radius.tolist()])
    waste = (between.max(axis=1) / side.min()).sum() / (between.max(axis=1) / side).sum()
    return float(length.sum(axis=0).max()), float(side.min()), float(waste)


SHORTEST_IN_CHORDS, SMALLEST_RADIUS_IN_CHORDS = 4.0, 3.0
# share of the diagonal of the part's box, if no longest side is given
LONGEST_IN_DIAGONALS = 1.0 / 40.0
PRECISION = 1e-4  # share of the number of sides along an edge
MOST_TRIANGLES = 2e6  # more triangles take minutes
SECONDS_PER_TRIANGLE = 3e-4  # most computing time: ten times the measured time
SAMPLES = 9  # samples of a face's curvature, in each direction
LIBRARIES = "on Debian: apt-get install libglu1-mesa libxcursor1 libxft2 libxinerama1"
REMEDY = "the file is damaged, or holds no solid; export it again as AP214 or AP242"


class Tessellation(NamedTuple):
    """Fineness of the triangles of a CAD file.

    Where two facets of a hollow meet at an angle, a ball of radius r that touches both is
    r (1 / cos(angle / 2) - 1) away from their edge: 0.14 % of r at 6 degrees. The check of the
    faces that a ball can reach allows a distance of 1 % of r.
    """

    chord: float = 2e-5  # largest distance of triangles from the surface [m]
    angle: float = math.radians(6.0)  # largest angle between neighbours [rad]
    side: float = 0.0  # longest side [m]; 0: a fortieth of the part's diagonal

    def side_at(self, radius: float) -> float:
        """Return the wanted side of triangles at a radius of curvature, in the unit of `chord`."""
        radius = max(radius, SMALLEST_RADIUS_IN_CHORDS * self.chord)
        by_angle = max(self.angle * radius, SHORTEST_IN_CHORDS * self.chord)
        return min(self.side, by_angle, math.sqrt(5.0 * self.chord * radius))


def tessellate(source: Path, chord: float, angle: float, side: float) -> dict[str, np.ndarray]:
    """Mesh a STEP file with triangles. All lengths are in mm.

    Args:
        chord: largest distance of triangles from the surface.
        angle: largest angle between neighbours [rad].
        side: longest side of triangles; 0 for a fortieth of the part's diagonal.

    Returns:
        `corners` of the triangles (m, 3, 3); `normals` of the faces at the corners (m, 3, 3), up to
        their sign, and 0 where a face has none; `face_of` (m,), the face of each triangle;
        `left_out`, how many faces of no solid are left out. Of each face: `body` (-1: none),
        `colour` (r, g, b, and 0 if the face has none), and `middle`, the mean of its corners (nan
        if the face has none). Of each body: `name`.

    Raises:
        InputError: Gmsh cannot be loaded, or does not mesh the file.
    """
    try:
        import gmsh

        gmsh.initialize(readConfigFiles=False, interruptible=False)
        return _mesh(gmsh, str(source), Tessellation(chord, angle, side))
    except OSError as error:  # its library was not loaded
        raise InputError(f"Gmsh cannot be loaded ({error}); {LIBRARIES}") from None
    except Exception as error:
        if type(error) is not Exception:  # errors of Gmsh have the type Exception
            raise
        why = str(error).replace(f" file '{source}'", " it")[:160]
        raise InputError(f"cannot be meshed ({why}); {REMEDY}") from None


def _mesh(gmsh: ModuleType, source: str, how: Tessellation) -> dict[str, np.ndarray]:
    for option, value in {
        "General.Verbosity": 0,
        "General.NumThreads": 1,
        "Geometry.OCCImportLabels": 1,
        "Mesh.MeshSizeFromCurvature": 2.0 * math.pi / how.angle,
        "Mesh.MeshSizeFromPoints": 0,
        "Mesh.MeshSizeExtendFromBoundary": 0,
        "Mesh.LcIntegrationPrecision": PRECISION,
        "Mesh.Algorithm": 5,  # Delaunay, because the frontal algorithm leaves thinner triangles
    }.items():
        gmsh.option.setNumber(option, value)
    gmsh.open(source)
    model = gmsh.model
    bodies = [tag for _, tag in model.getEntities(3)]
    body_of = {face: k for k, tag in enumerate(bodies) for face in model.getAdjacencies(3, tag)[1]}
    drawn = [tag for _, tag in model.getEntities(2)]
    # sketches beside solids are not part of it
    faces = [tag for tag in drawn if tag in body_of] or drawn
    box = np.array([model.getBoundingBox(2, tag) for tag in faces]).reshape(-1, 2, 3)
    diagonal = np.linalg.norm(box[:, 1].max(axis=0) - box[:, 0].min(axis=0)) if faces else 0.0
    how = how._replace(side=how.side or LONGEST_IN_DIAGONALS * float(diagonal))
    triangles = _TriangleCount(model, faces)
    if not triangles(how) <= MOST_TRIANGLES:
        raise InputError(triangles.advice(how))
    allow_more(SECONDS_PER_TRIANGLE * triangles(how))
    lay_grids(model, faces, how.side_at)

    def size(_dim: int, _tag: int, _x: float, _y: float, _z: float, by_angle: float) -> float:
        return how.side_at(by_angle / how.angle)

    model.mesh.setSizeCallback(size)
    model.mesh.generate(2)
    numbers, coordinates, _ = model.mesh.getNodes()
    order = np.argsort(numbers)
    points = coordinates.reshape(-1, 3)[order]
    nodes = [model.mesh.getElementsByType(2, tag)[1] for tag in faces]
    rows = np.searchsorted(numbers[order], np.concatenate([*nodes, np.zeros(0, dtype=np.uint64)]))
    return {
        "corners": points[rows.reshape(-1, 3)],
        "normals": np.concatenate(
            [_normals(model, tag, own) for tag, own in zip(faces, nodes, strict=True)]
            or [np.zeros((0, 3, 3))]
        ),
        "face_of": np.repeat(np.arange(len(faces)), [len(n) // 3 for n in nodes]),
        "left_out": np.array(len(drawn) - len(faces)),
        "body": np.array([body_of.get(tag, -1) for tag in faces], dtype=int),
        "colour": np.array([model.getColor(2, tag) for tag in faces], dtype=int).reshape(-1, 4),
        "middle": np.array([_middle(model, tag) for tag in faces]).reshape(-1, 3),
        "name": np.array([model.getEntityName(3, tag) for tag in bodies], dtype=str),
    }


def _normals(model: type[gmsh.model], face: int, nodes: np.ndarray) -> np.ndarray:
    """Return the normals (m, 3, 3) of a face at the corners of its triangles, up to their sign.

    Args:
        face: Gmsh's number of the face.
        nodes: Gmsh's numbers of the corners, (3 m,).
    """
    tags, _, places = model.mesh.getNodes(2, face, True, True)
    first = np.unique(tags, return_index=True)[1]  # a node on a seam comes twice
    normals = np.reshape(model.getNormal(face, places), (-1, 3))[first]
    normals[~np.isfinite(normals).all(axis=1)] = 0.0
    return np.asarray(normals[np.searchsorted(tags[first], nodes)].reshape(-1, 3, 3))


class _TriangleCount:
    """Estimate of the number of triangles that a model will have, meshed with a given fineness."""

    def __init__(self, model: type[gmsh.model], faces: list[int]) -> None:
        self._areas = np.array([model.occ.getMass(2, face) for face in faces])
        self._radii = [_radii(model, face) for face in faces]

    def __call__(self, how: Tessellation) -> float:
        """Return the number of triangles, as if all were equilateral with the wanted sides."""
        each = [np.mean([how.side_at(one) ** -2.0 for one in own]) for own in self._radii]
        return float(self._areas @ np.array(each)) * 4.0 / math.sqrt(3.0)

    def advice(self, how: Tessellation) -> str:
        """Return a message on too many triangles, with a side or chord that gives few enough."""
        if not math.isfinite(self(how)):
            return f"has a face of no finite area; {REMEDY}"
        is_side = self(how._replace(side=math.inf)) <= MOST_TRIANGLES
        name = "side" if is_side else "chord"
        text = f"about {1e-6 * self(how):.3g} million triangles, at most {1e-6 * MOST_TRIANGLES:g}"
        value = getattr(how, name)
        while self(how._replace(**{name: value})) > MOST_TRIANGLES:
            value *= 1.05
        return f"{text} are made; give part.tessellation.{name}_mm = {value:.2g} or more"


def _radii(model: type[gmsh.model], face: int) -> list[float]:
    """Return the radii of curvature of a face, at points all over it."""
    low, high = map(np.array, model.getParametrizationBounds(2, face))
    shares = (np.arange(SAMPLES) + 0.5) / SAMPLES
    u, v = np.meshgrid(*(low + shares[:, None] * (high - low)).T)
    bent = model.getCurvature(2, face, np.stack([u, v], axis=-1).ravel())
    return [1.0 / max(abs(one), 1e-9) for one in bent]


def _middle(model: type[gmsh.model], face: int) -> np.ndarray:
    """Return the mean of a face's corners, (3,); nan if the face has none."""
    corners = [tag for dim, tag in model.getBoundary([(2, face)], recursive=True) if dim == 0]
    places = [model.getValue(0, tag, []) for tag in corners]
    return np.mean(places, axis=0) if places else np.full(3, np.nan)
