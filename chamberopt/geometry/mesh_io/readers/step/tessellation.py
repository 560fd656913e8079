"""Mesh the faces of a STEP file with Gmsh; runs in a process of its own.

The side h of the triangles follows the radius of curvature r of surfaces and edges, so that fillets
are fine and planes coarse:

    h = min(side, sqrt(5 chord r), max(angle r, 4 chord)), where r is 3 chord at least

Neighbours then turn by about the angle, but for radii too small for a ball. The middle of an
equilateral triangle is h² / 6 r below a sphere; 5 instead of 6 leaves room for longer sides than
wanted. Faces with four sides get grids, with cells longer where the face is straight.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from chamberopt.common.npz_files import save_arrays
from chamberopt.geometry.mesh_io.native_reader import allow_more
from chamberopt.geometry.mesh_io.readers.step.grids import lay_grids

SHORTEST_IN_CHORDS, SMALLEST_RADIUS_IN_CHORDS = 4.0, 3.0
LONGEST_IN_DIAGONALS = 1.0 / 40.0  # of the part's box, where no longest side is given
PRECISION = 1e-4  # of the number of sides along an edge
MOST_TRIANGLES = 2e6  # which take minutes
SECONDS_PER_TRIANGLE = 3e-4  # of computing time, at most: ten times what was measured
SAMPLES = 9  # of a face's curvature, in each direction
LIBRARIES = "on Debian: apt-get install libglu1-mesa libxcursor1 libxft2 libxinerama1"
REMEDY = "the file is damaged, or holds no solid; export it again as AP214 or AP242"


class Tessellation(NamedTuple):
    """How fine the triangles of a CAD file are.

    The corner between two facets of a hollow keeps a ball away by 1 / cos(angle / 2) - 1 of its
    radius, 0.25 % by default. The check of what a ball can reach allows for 1 %.
    """

    chord: float = 2e-5  # distance that triangles keep from the surface [m]
    angle: float = math.radians(6.0)  # between neighbours [rad]
    side: float = 0.0  # longest side [m]; 0: a fortieth of the part's diagonal

    def side_at(self, radius: float) -> float:
        """Wanted side of triangles where the radius of curvature is `radius`."""
        radius = max(radius, SMALLEST_RADIUS_IN_CHORDS * self.chord)
        by_angle = max(self.angle * radius, SHORTEST_IN_CHORDS * self.chord)
        return min(self.side, by_angle, math.sqrt(5.0 * self.chord * radius))


def tessellate(source: str, target: str, chord: str, angle: str, side: str) -> None:
    """Write the triangles of a STEP file as numpy arrays; lengths in mm, angle in rad.

    They are: corners (m, 3, 3), the normals of the faces there, up to their sign and 0 where a face
    has none, and face_of (m,); how many faces of no solid are left out; of each
    face its body (-1: none), its colour (r, g, b, and 0 if it has none) and the mean of its corners
    (nan if it has none); of each body its name. Or only `fault`: what is wrong, as a sentence.
    """
    try:
        import gmsh

        gmsh.initialize(readConfigFiles=False, interruptible=False)
        arrays = _mesh(gmsh, source, Tessellation(float(chord), float(angle), float(side)))
    except OSError as error:  # its library was not loaded
        arrays = {"fault": np.array(f"Gmsh cannot be loaded ({error}); {LIBRARIES}")}
    except Exception as error:
        if type(error) is not Exception:  # as Gmsh's are
            raise
        why = str(error).replace(f" file '{source}'", " it")[:160]
        arrays = {"fault": np.array(f"cannot be meshed ({why}); {REMEDY}")}
    save_arrays(Path(target), **arrays)


def _mesh(gmsh: Any, source: str, how: Tessellation) -> dict[str, np.ndarray]:
    for option, value in {
        "General.Verbosity": 0,
        "General.NumThreads": 1,
        "Geometry.OCCImportLabels": 1,
        "Mesh.MeshSizeFromCurvature": 2.0 * math.pi / how.angle,
        "Mesh.MeshSizeFromPoints": 0,
        "Mesh.MeshSizeExtendFromBoundary": 0,
        "Mesh.LcIntegrationPrecision": PRECISION,
        "Mesh.Algorithm": 5,  # Delaunay; the frontal one leaves thinner triangles
    }.items():
        gmsh.option.setNumber(option, value)
    gmsh.open(source)
    model = gmsh.model
    bodies = [tag for _, tag in model.getEntities(3)]
    body_of = {face: k for k, tag in enumerate(bodies) for face in model.getAdjacencies(3, tag)[1]}
    drawn = [tag for _, tag in model.getEntities(2)]
    faces = [tag for tag in drawn if tag in body_of] or drawn  # sketches beside solids are no part
    box = np.array([model.getBoundingBox(2, tag) for tag in faces]).reshape(-1, 2, 3)
    diagonal = np.linalg.norm(box[:, 1].max(axis=0) - box[:, 0].min(axis=0)) if faces else 0.0
    how = how._replace(side=how.side or LONGEST_IN_DIAGONALS * float(diagonal))
    triangles = _TriangleCount(model, faces)
    if not triangles(how) <= MOST_TRIANGLES:
        return {"fault": np.array(triangles.advice(how))}
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


def _normals(model: Any, face: int, nodes: np.ndarray) -> np.ndarray:
    """Normals of a face at the nodes (3 m,) of its triangles, up to their sign, (m, 3, 3)."""
    tags, _, places = model.mesh.getNodes(2, face, True, True)
    first = np.unique(tags, return_index=True)[1]  # a node on a seam comes twice
    normals = np.reshape(model.getNormal(face, places), (-1, 3))[first]
    normals[~np.isfinite(normals).all(axis=1)] = 0.0
    return np.asarray(normals[np.searchsorted(tags[first], nodes)].reshape(-1, 3, 3))


class _TriangleCount:
    """About how many triangles the faces of a model take, by how fine they are."""

    def __init__(self, model: Any, faces: list[int]) -> None:
        self._areas = np.array([model.occ.getMass(2, face) for face in faces])
        self._radii = [_radii(model, face) for face in faces]

    def __call__(self, how: Tessellation) -> float:
        """Number of equilateral triangles of the wanted sides, about."""
        each = [np.mean([how.side_at(one) ** -2.0 for one in own]) for own in self._radii]
        return float(self._areas @ np.array(each)) * 4.0 / math.sqrt(3.0)

    def advice(self, how: Tessellation) -> str:
        """Why there would be too many triangles, with the smallest value that gives fewer."""
        if not math.isfinite(self(how)):
            return f"has a face of no finite area; {REMEDY}"
        is_side = self(how._replace(side=math.inf)) <= MOST_TRIANGLES
        name = "side" if is_side else "chord"
        text = f"about {1e-6 * self(how):.3g} million triangles, at most {1e-6 * MOST_TRIANGLES:g}"
        value = getattr(how, name)
        while self(how._replace(**{name: value})) > MOST_TRIANGLES:
            value *= 1.05
        return f"{text} are made; give part.tessellation.{name}_mm = {value:.2g} or more"


def _radii(model: Any, face: int) -> list[float]:
    """Radii of curvature of a face, at places all over it."""
    low, high = map(np.array, model.getParametrizationBounds(2, face))
    shares = (np.arange(SAMPLES) + 0.5) / SAMPLES
    u, v = np.meshgrid(*(low + shares[:, None] * (high - low)).T)
    bent = model.getCurvature(2, face, np.stack([u, v], axis=-1).ravel())
    return [1.0 / max(abs(one), 1e-9) for one in bent]


def _middle(model: Any, face: int) -> np.ndarray:
    """Mean of a face's corners, (3,); nan if it has none."""
    corners = [tag for dim, tag in model.getBoundary([(2, face)], recursive=True) if dim == 0]
    places = [model.getValue(0, tag, []) for tag in corners]
    return np.mean(places, axis=0) if places else np.full(3, np.nan)
