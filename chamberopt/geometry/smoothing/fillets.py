"""Find the fillets of a part: faces of its CAD file, or rounds that the facets of its file make.

A file of facets does not say where a fillet begins. Its fillets are found by the curvature of the
smooth surface behind the facets. They are of like curvature all over.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.geometry.face_shapes import find_fillets, least_curvature
from chamberopt.geometry.faces import Border, Faces
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.smoothing.normals import plane_facets
from chamberopt.geometry.smoothing.part import Rule, has_points_in_facets, kept, key_of
from chamberopt.geometry.smoothing.rounds import find_edges
from chamberopt.geometry.smoothing.smooth import find_surfaces
from chamberopt.geometry.solids import simplify_planes
from chamberopt.geometry.triangles import areas, connected_pieces, side_pairs

# Curvature of a face beside its fillets over theirs, from which on these are patches of a hollow
# face, such as of a bore in the mesh of a grid.
BESIDE, CREASE_DEG = 0.25, 30.0
BOWL = 0.25  # of a fillet's curvature: what is as hollow across it is a bowl
# A fillet turns by so much over its mean width. Patches of a bore in a grid's mesh turn by 15 to 30
# degrees, and the fillets of five parts by 44 and more.
LEAST_BEND = np.radians(35.0)
ALIKE = 1.5  # largest ratio of the curvatures of neighbours in one fillet
LEAST = 0.01  # share of the area of all fillets, below which a round is none, as where two meet
LEAST_IN_ALL = 0.005  # share of the part's area: less is a patch of a scan
LEAST_TURN = np.radians(1.0)  # of facets that make a round
MOST_TRIANGLES = 100_000  # of a scan, which takes minutes and has no fillets that are like all over
MOST_PARTS = 4  # whose fillets are kept in memory


@dataclass(frozen=True)
class FilletNumbers:
    """The fillets of a part's triangles.

    Attributes:
        of_triangle: number of the fillet of each triangle, -1 for none, (m,).
        curvature: of each fillet [1/m], (k,).
    """

    of_triangle: np.ndarray
    curvature: np.ndarray


def faces_of(mesh: PartMesh, border: Border) -> Faces:
    """Return the faces of a part. Raises InputError if its file has no such faces."""
    if border == "fillet":
        return Faces(mesh.vertices, mesh.triangles, fillets_of(mesh).of_triangle)
    return mesh.faces(None if border == "cad_face" else border)


def face_at(mesh: PartMesh, faces: Faces, border: Border, place: np.ndarray) -> tuple[int, float]:
    """Return the number of the face closest to a point (3,) [m], and its distance [m].

    Raises InputError if a fillet is asked for, and there is none.
    """
    face, away = faces.at(place)
    if border == "fillet" and (fillets_of(mesh).of_triangle[faces.of_triangle == face] < 0).any():
        many = len(mesh.triangles) > MOST_TRIANGLES
        why = f", or the part has over {MOST_TRIANGLES:,} triangles" if many else ""
        raise InputError(f"the surface is no fillet there{why}; take a crease_deg in its place")
    return face, away


@lru_cache(maxsize=MOST_PARTS)
def fillets_of(mesh: PartMesh) -> FilletNumbers:
    """Return the fillets of a part, loaded if an earlier command has found them."""
    if mesh.numbering.cad_face is not None and mesh.normals is not None:
        faces = mesh.faces(None)
        found = find_fillets(faces, mesh.vertices, mesh.triangles, mesh.normals)
        return _numbered(faces.of_triangle, *found)
    if len(mesh.triangles) > MOST_TRIANGLES:
        return FilletNumbers(np.full(len(mesh.triangles), -1), np.zeros(0))
    key = key_of(["fillets", mesh.vertices, mesh.triangles, mesh.normals])
    return kept(FilletNumbers, (), key, lambda: _fillets_of_facets(mesh))


def _fillets_of_facets(mesh: PartMesh) -> FilletNumbers:
    """Return the fillets of a part whose file has no faces of its own."""
    vertices, triangles = mesh.vertices, mesh.triangles
    facet = plane_facets(find_edges(vertices, triangles), len(triangles))
    every = np.ones(len(triangles), dtype=bool)
    rule = Rule(every, False, turn=LEAST_TURN, narrow=0.0, tolerance=np.inf)
    if mesh.normals is None and has_points_in_facets(mesh, [rule]):
        # A facet is one face with few triangles again, as it is in a round.
        vertices, triangles, own = simplify_planes(vertices, triangles, facet)
        every = np.ones(len(triangles), dtype=bool)
    else:
        facet = own = np.arange(len(triangles))
    found = find_surfaces(vertices, triangles, every, mesh.normals)
    bends = (found.hollow > least_curvature(vertices)) & ~found.noisy
    pairs = side_pairs(triangles)
    one, two = pairs[~found.crease.ravel()[pairs].any(axis=1)].T // 3
    curvature = np.stack([found.hollow[one], found.hollow[two]])
    goes_on = bends[one] & bends[two] & (curvature.max(axis=0) < ALIKE * curvature.min(axis=0))
    piece = connected_pieces(one[goes_on], two[goes_on], len(triangles))[1]
    faces = Faces(vertices, triangles, np.where(bends, piece, -1))
    number, bent = find_fillets(faces, vertices, triangles, found.normals, LEAST_BEND, BOWL)
    own_bend = _bend_beside(vertices, triangles, np.isin(faces.of_triangle, number))
    first = np.unique(faces.of_triangle, return_index=True)[1][number]
    is_own = own_bend[first] < BESIDE * bent
    number, bent = number[is_own], bent[is_own]
    area = faces.area[number]
    is_large = (area >= LEAST * area.sum()) & (area.sum() > LEAST_IN_ALL * faces.area.sum())
    made = _numbered(faces.of_triangle, number[is_large], bent[is_large])
    of_facet = np.full(int(facet.max()) + 1, -1)
    of_facet[own] = made.of_triangle
    return FilletNumbers(of_facet[facet], made.curvature)


def _bend_beside(vertices: np.ndarray, triangles: np.ndarray, likely: np.ndarray) -> np.ndarray:
    """Return how hollow the face round each triangle is beside supposed fillets [1/m], (m,).

    It is the sum of all turns of the face times their lengths, over its area.

    Args:
        likely: marks the triangles of what may be fillets, (m,).
    """
    edges, faces = find_edges(vertices, triangles), Faces(vertices, triangles, CREASE_DEG)
    of = faces.of_triangle
    one, two = edges.triangles.T
    counts = (of[one] == of[two]) & ~likely[one] & ~likely[two]
    turned = np.where(counts, -edges.turn * edges.length, 0.0)
    area = np.bincount(of, np.where(likely, 0.0, areas(vertices, triangles)), faces.count)
    bend = np.bincount(of[one], turned, faces.count) / np.maximum(area, 1e-30)
    return np.asarray(bend[of])


def _numbered(face: np.ndarray, fillets: np.ndarray, curvature: np.ndarray) -> FilletNumbers:
    """Return fillets by their numbers among the faces (m,) of a part's triangles."""
    number = np.full(int(face.max()) + 1, -1)
    number[fillets] = np.arange(len(fillets))
    return FilletNumbers(number[face], curvature)
