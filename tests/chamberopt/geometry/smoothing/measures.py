"""What tests of smoothing measure: the divided surface against the exact one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from chamberopt.geometry.meshes.self_intersection import crossing_pairs
from chamberopt.geometry.smoothing.divide import Surface
from chamberopt.geometry.smoothing.smooth import Surfaces, divide_rounds, find_surfaces, moves
from chamberopt.geometry.solids import split_bodies
from chamberopt.geometry.triangles import areas, find_shells, side_pairs, unit_normals, unit_vectors
from tests.helpers.scenes.rounded_solids import Mesh, Solid, on_sides

POINTS = 5000
ROUNDED = 1e-7  # m: simplified planes may be off by the solid's tolerance


class Smoothed(NamedTuple):
    """A mesh, what was found of its surface, and its divided surface."""

    mesh: Mesh
    found: Surfaces
    finer: Surface

    @property
    def largest_move(self) -> float:
        return float(moves(*self.mesh, self.finer).max())


class Errors(NamedTuple):
    """Distances [m] from an exact surface and angles [degrees] from its normals."""

    rms: float
    largest: float
    normals: float  # rms
    normals_usually: float  # of 99 % of the area


def smoothed(mesh: Mesh, degrees: float = 6.0) -> Smoothed:
    """Divide all rounds of a mesh until edges bend by no more than so many degrees."""
    count = len(mesh[1])
    found = find_surfaces(*mesh, np.ones(count, dtype=bool))
    limit = np.where(found.noisy, np.inf, np.radians(degrees))
    return Smoothed(mesh, found, divide_rounds(*mesh, found, limit, np.zeros(count)))


def errors_of(solid: Solid, mesh: Mesh, chosen: np.ndarray, normals: np.ndarray) -> Errors:
    """Errors at random points of the chosen triangles (m,) with normals (m, 3, 3) at corners."""
    rng = np.random.default_rng(0)
    vertices, triangles = mesh
    area = np.where(chosen, areas(vertices, triangles), 0.0)
    rows = rng.choice(len(triangles), POINTS, p=area / area.sum())
    part = rng.dirichlet(np.ones(3), POINTS)
    places = np.einsum("pk,pki->pi", part, vertices[triangles[rows]])
    distance, exact = solid.nearest(places)
    own = unit_vectors(np.einsum("pk,pki->pi", part, normals[rows]))
    angle = np.degrees(np.arccos(np.clip((own * exact).sum(axis=1), -1.0, 1.0)))
    return Errors(
        float(np.sqrt((distance**2).mean())),
        float(distance.max()),
        float(np.sqrt((angle**2).mean())),
        float(np.quantile(angle, 0.99)),
    )


def errors_before_and_after(solid: Solid, mesh: Mesh) -> tuple[Errors, Errors]:
    """Errors of the facets, and of the divided surface with its normals."""
    result = smoothed(mesh)
    sides = on_sides(mesh, solid)
    facets = np.repeat(unit_normals(mesh[0][mesh[1]])[:, None], 3, axis=1)
    finer = result.finer
    after = errors_of(solid, (finer.vertices, finer.triangles), sides[finer.parent], finer.normals)
    return errors_of(solid, mesh, sides, facets), after


def require_sound(result: Smoothed) -> None:
    """The divided surface is a solid, does not cross itself, and keeps what the file has."""
    finer = result.finer
    require_solid(result.mesh, (finer.vertices, finer.triangles), finer.parent, result.largest_move)
    assert np.allclose(np.linalg.norm(finer.normals, axis=2), 1.0)


def require_solid(mesh: Mesh, finer: Mesh, parent: np.ndarray, largest_move: float) -> None:
    """The same of a finer mesh whose triangles (k,) come from those of a mesh.

    Where the planes of a mesh were simplified before, its vertices and triangles need not be found
    in the finer one; but each triangle lies along the plane of the one that it comes from.
    """
    (vertices, triangles), (places, children) = mesh, finer
    if np.array_equal(places[: len(vertices)], vertices):
        assert (np.diff(parent) >= 0).all()  # children lie where their parents did
        assert np.array_equal(np.unique(parent), np.arange(len(triangles)))
    else:
        corners, middle = vertices[triangles[parent]], places[children].mean(axis=1)
        normal = unit_normals(corners)
        height = np.einsum("ki,ki->k", middle - corners[:, 0], normal)
        assert np.abs(height).max() <= largest_move + ROUNDED
    side_pairs(children)
    assert len(find_shells(places, children)[1]) == len(find_shells(vertices, triangles)[1])
    split_bodies(places, children, "divided")
    assert not crossing_pairs(places, children).size
