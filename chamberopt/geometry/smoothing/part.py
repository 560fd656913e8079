"""Divide the rounds of a part's mesh into finer facets, and say how coarse the facets are.

A round is a curved surface, such as a fillet, that the file divides into plane facets. A ball meets
the curved surface of the real part, but plane facets in the file. The rounds of the target (the
surface to peen) and of zones (surfaces with limits of their own) are divided, and rounds so near
that a ball can touch them at the same time.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import make_folder, remove_file
from chamberopt.common.npz_files import load_record, save_record
from chamberopt.common.versions import sources_digest
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.meshes.raw_mesh import number_by_position
from chamberopt.geometry.meshes.self_intersection import crossing_pairs
from chamberopt.geometry.smoothing.divide import LESS, SLACK
from chamberopt.geometry.smoothing.normals import measure_facets, plane_facets
from chamberopt.geometry.smoothing.rounds import find_edges, is_hard
from chamberopt.geometry.smoothing.smooth import Surfaces, divide_rounds, find_surfaces, moves
from chamberopt.geometry.solids import simplify_planes
from chamberopt.geometry.triangles import angles_between, areas, tetrahedron_volumes, unit_normals

if TYPE_CHECKING:
    from chamberopt.geometry.smoothing.divide import Surface

# Records that take seconds to make, kept in the user's cache folder for the next command.

Record = TypeVar("Record")
MOST_KEPT = 40  # number of records that are kept: each holds a few MB


def key_of(values: Iterable[object]) -> str:
    """Return a digest of arrays and other values, and of this program's sources."""
    digest = hashlib.sha256(sources_digest().encode())
    for value in values:
        if isinstance(value, np.ndarray):
            digest.update(f"{value.dtype} {value.shape}".encode())
            digest.update(np.ascontiguousarray(value).tobytes())
        else:
            digest.update(repr(value).encode())
    return digest.hexdigest()[:32]


def kept(
    kind: type[Record], others: Sequence[type], key: str, make: Callable[[], Record]
) -> Record:
    """Return the record of a key from the user's cache, or make and keep it if it is not there.

    Args:
        kind: class of the record, which is an object that takes seconds to make.
        others: classes of the objects in the record.
        key: name of the record, such as a digest of all on which it depends.
        make: called to make the record.
    """
    from sim_core import user_cache

    cache = user_cache()
    if cache is None:
        return make()
    folder = cache / "kept"
    with suppress(InputError):  # a missing or damaged record is made again
        return load_record(folder / f"{key}.npz", kind, others, "")
    record = make()
    with suppress(InputError, OSError):  # such as a full disk: every command makes its own record
        make_folder(folder)
        save_record(folder / f"{key}.npz", record)
        found = sorted(folder.glob("*.npz"), key=lambda path: path.stat().st_mtime)
        for path in found[:-MOST_KEPT]:
            remove_file(path)
    return record


NEAR = 2e-3  # m from the target: as far as usual balls reach
DIVIDED = 1e-9  # m: a smaller move is no move
MOST = 0.9  # share of the area
ALONG = np.radians(1.0)  # largest angle between planes of a facet
MOST_TRIANGLES = 1.5e6  # triangles of a part: more take too long to fly among


@dataclass(frozen=True)
class SmoothingFacts:
    """Facts about the smoothing of a part: how far the surface moved, and how coarse facets remain.

    Attributes:
        largest_move: largest move of the surface [m].
        moved_share: share of the target's area where the surface was moved.
        volume_change: relative change of the part's volume.
        given_triangles: number of the file's triangles.
        blunt_creases: number of sharp edges that turn by no more than facets of a curved surface
            may.
        facet_turn: largest angle between the file's facets on curved surfaces of the target [rad],
            without the tenth of the area with the largest angles.
        coarse_turn: the same angle, only for facets left coarser than requested; 0 without such
            facets.
        coarse_share: share of the target's area on facets that are left coarser.
        noisy_share: part of coarse_share that was left because the facets are noise, as of a scan.
        crossing_share: part of coarse_share that was left because finer facets would cross others.
    """

    largest_move: float
    moved_share: float
    volume_change: float
    given_triangles: int
    blunt_creases: int
    facet_turn: float
    coarse_turn: float
    coarse_share: float
    noisy_share: float
    crossing_share: float


@dataclass(frozen=True)
class SmoothPart:
    """Mesh of a part whose rounds (curved surfaces, such as fillets) are divided into finer facets.

    Attributes:
        vertices: vertex positions [m], shape (n, 3).
        triangles: vertex indices, shape (k, 3).
        origin: the file's triangle from which each triangle comes, shape (k,).
        normals: unit normals of the surface at the corners, shape (k, 3, 3).
        hollow: largest hollow curvature [1/m], shape (k,).
        facts: results of the smoothing.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    origin: np.ndarray
    normals: np.ndarray
    hollow: np.ndarray
    facts: SmoothingFacts

    def of_part(self, mesh: PartMesh) -> PartMesh:
        """Return a part with this divided mesh, and the numbers and groups of the file's triangles.

        Args:
            mesh: the part as its file has it.
        """
        # The number of triangles is no test: a simplified mesh may have as many after its division.
        if np.array_equal(self.triangles, mesh.triangles):
            return mesh
        return mesh.divided(self.vertices, self.triangles, self.origin)


class Rule(NamedTuple):
    """Rule that says how finely some triangles of the file are divided.

    Attributes:
        triangles: marks the triangles, shape (m,).
        is_off: True if the triangles stay as they are.
        turn: largest angle between facets [rad].
        narrow: width [m] below which facets are not divided.
        tolerance: largest allowed move of the surface [m].
    """

    triangles: np.ndarray
    is_off: bool
    turn: float
    narrow: float
    tolerance: float


def smooth(mesh: PartMesh, target: Rule, zones: list[Rule]) -> SmoothPart:
    """Return a part with its curved surfaces divided, loaded if an earlier command has made it.

    Args:
        target: rule for the triangles to cover, and for triangles near them and near the zones.
        zones: rules for surfaces with limits of their own, which may lie on the target.
    """
    values = [one for rule in (target, *zones) for one in rule]
    key = key_of([mesh.vertices, mesh.triangles, mesh.normals, mesh.is_exact, *values])
    return kept(SmoothPart, [SmoothingFacts], key, lambda: _smooth(mesh, target, zones))


def _smooth(mesh: PartMesh, target: Rule, zones: list[Rule]) -> SmoothPart:
    """Divide the curved surfaces of a part, simplified first if its facets have vertices inside.

    Args:
        target: rule for the triangles to cover, and for triangles near them and near the zones.
        zones: rules for surfaces with limits of their own, which may lie on the target.
    """
    rules = [target, *zones]
    if mesh.normals is None and has_points_in_facets(mesh, rules):
        plain, plain_rules = _without_points_in_planes(mesh, rules)
        found = _divided(plain, plain_rules[0], plain_rules[1:])
        if len(found.triangles) > len(plain.triangles):
            return _on_file(found, plain, mesh)
    return _divided(mesh, target, zones)


def has_points_in_facets(mesh: PartMesh, rules: list[Rule]) -> bool:
    """Return True if a facet to be divided has vertices of the file in its interior.

    Such vertices are on the facet, and not on the curved surface behind it.
    """
    edges = find_edges(mesh.vertices, mesh.triangles)
    facet, size = plane_facets(edges, len(mesh.triangles)), np.abs(edges.turn)
    limit = np.full(len(mesh.triangles), np.inf)
    for rule in rules:
        limit[rule.triangles] = math.inf if rule.is_off else rule.turn
    bends = ~is_hard(edges) & (size > limit[edges.triangles].min(axis=1))
    of_round = np.isin(facet, facet[edges.triangles[bends]])
    # A vertex inside a facet has only triangles of that facet around it.
    low = np.full(len(mesh.vertices), len(mesh.triangles))
    high = np.full(len(mesh.vertices), -1)
    for corner in mesh.triangles.T:
        np.minimum.at(low, corner, facet)
        np.maximum.at(high, corner, facet)
    inside = (low == high)[mesh.triangles].any(axis=1)
    return bool((inside & of_round).any())


def _without_points_in_planes(mesh: PartMesh, rules: list[Rule]) -> tuple[PartMesh, list[Rule]]:
    """Return the part with as few triangles as its planes need, and the rules for these triangles.

    The borders between triangles of different rules stay in place.
    """
    marks = np.stack([rule.triangles for rule in rules], axis=1)
    kinds, label = np.unique(marks, axis=0, return_inverse=True)
    vertices, triangles, label = simplify_planes(mesh.vertices, mesh.triangles, label.reshape(-1))
    plain = replace(
        mesh,
        vertices=vertices,
        triangles=triangles,
        numbering=number_by_position(len(triangles)),
        groups={},
    )
    return plain, [rule._replace(triangles=kinds[label, k]) for k, rule in enumerate(rules)]


def _on_file(found: SmoothPart, plain: PartMesh, mesh: PartMesh) -> SmoothPart:
    """Return a divided part whose origins are triangles of the file.

    So far the origin of a new triangle is a triangle of the simplified mesh. The new triangle's
    middle is moved into the plane of this origin. The file's triangle closest to it is the new
    origin. If the moved middle is beyond the plane's border, the middle of the simplified triangle
    is taken instead.

    Args:
        found: the divided part, with origins in the simplified mesh.
        plain: the simplified mesh.
        mesh: the mesh of the file.
    """
    from sim_core import TriangleMesh, closest_points

    corners = plain.vertices[plain.triangles[found.origin]]
    normal, middle = unit_normals(corners), found.vertices[found.triangles].mean(axis=1)
    height = np.einsum("ki,ki->k", middle - corners[:, 0], normal)
    surface = TriangleMesh(mesh.vertices, mesh.triangles, np.zeros(len(mesh.triangles), np.uint8))
    size = float(np.ptp(mesh.vertices))
    origin = closest_points(surface, middle - height[:, None] * normal, size).triangle
    of_file = unit_normals(mesh.vertices[mesh.triangles])
    beyond = np.flatnonzero(np.einsum("ki,ki->k", of_file[origin], normal) < np.cos(ALONG))
    origin[beyond] = closest_points(surface, corners[beyond].mean(axis=1), size).triangle
    facts = replace(found.facts, given_triangles=len(mesh.triangles))
    return replace(found, origin=origin, facts=facts)


def _divided(mesh: PartMesh, target: Rule, zones: list[Rule]) -> SmoothPart:
    """Divide the curved surfaces of a part whose vertices all lie on these surfaces.

    Args:
        target: rule for the triangles to cover, and for triangles near them and near the zones.
        zones: rules for surfaces with limits of their own, which may lie on the target.
    """
    vertices, triangles, on_target = mesh.vertices, mesh.triangles, target.triangles
    near = _near(vertices, triangles, np.any([one.triangles for one in (target, *zones)], axis=0))
    surfaces = find_surfaces(vertices, triangles, near, mesh.normals)
    asked, turn, narrow, tolerance = (np.full(len(triangles), np.inf) for _ in range(4))
    for rule in (target._replace(triangles=near), *zones):
        own = rule.triangles
        asked[own] = math.inf if rule.is_off else rule.turn
        turn[own], narrow[own], tolerance[own] = rule.turn, rule.narrow, rule.tolerance
    if mesh.is_exact:
        asked[:] = np.inf  # the triangles were made from the exact surface, as fine as requested
    # The sides of halves move again. All moves together are 1 / (1 - LESS) times the first move.
    surfaces = surfaces._replace(rise=np.minimum(surfaces.rise, (1.0 - LESS) * tolerance))
    finer, crossing = _divide_apart(mesh, surfaces, asked, narrow)
    moved = moves(vertices, triangles, finer)

    area = areas(vertices, triangles)
    of_target = np.where(on_target, area, 0.0) / area[on_target].sum()
    coarse = on_target & (surfaces.turn > SLACK * turn) & (not mesh.is_exact)
    is_whole = np.bincount(finer.parent, minlength=len(triangles)) == 1
    bend = angles_between(surfaces.normals, np.roll(surfaces.normals, 1, axis=1)).max(axis=1)
    is_whole &= bend > SLACK * turn
    is_whole &= measure_facets(vertices, triangles).height.min(axis=1) > narrow
    left = coarse & (np.isinf(asked) | surfaces.noisy | crossing | is_whole)
    before = tetrahedron_volumes(vertices, triangles).sum()
    facts = SmoothingFacts(
        largest_move=float(moved[moved > DIVIDED].max(initial=0.0)),
        moved_share=float(of_target[moved > DIVIDED].sum()),
        volume_change=float(
            tetrahedron_volumes(finer.vertices, finer.triangles).sum() / before - 1.0
        ),
        given_triangles=len(triangles),
        blunt_creases=surfaces.blunt,
        facet_turn=_usual_turn(surfaces.turn, area, on_target),
        coarse_turn=_usual_turn(surfaces.turn, area, left),
        coarse_share=float(of_target[left].sum()),
        noisy_share=float(of_target[left & surfaces.noisy & np.isfinite(asked)].sum()),
        crossing_share=float(of_target[left & crossing & np.isfinite(asked)].sum()),
    )
    return SmoothPart(
        vertices=finer.vertices,
        triangles=finer.triangles.astype(np.int32),
        origin=finer.parent,
        normals=finer.normals.astype(np.float32),
        hollow=surfaces.hollow[finer.parent].astype(np.float32),
        facts=facts,
    )


def _divide_apart(
    mesh: PartMesh, surfaces: Surfaces, limit: np.ndarray, narrow: np.ndarray
) -> tuple[Surface, np.ndarray]:
    """Divide the rounds (curved surfaces), except rounds whose finer facets would cross others.

    Args:
        limit: angle between facets [rad] above which edges are split, (m,); infinite where nothing
            is divided.
        narrow: width [m] below which facets are not divided, (m,).

    Returns:
        The divided surface, and marks of the triangles left whole because they would cross, (m,).
    """
    crossing = np.zeros(len(mesh.triangles), dtype=bool)
    while True:
        stays = surfaces.noisy | crossing
        finer = divide_rounds(
            mesh.vertices, mesh.triangles, surfaces, np.where(stays, np.inf, limit), narrow
        )
        if len(finer.triangles) == len(mesh.triangles):
            return finer, crossing
        if len(finer.triangles) > MOST_TRIANGLES:
            raise InputError(
                f"part.smoothing: makes {len(finer.triangles):,} triangles of "
                f"{len(mesh.triangles):,}; give a larger limit_deg or narrow_mm, or a smaller "
                "part.target"
            )
        pairs = crossing_pairs(finer.vertices, finer.triangles)
        if not pairs.size:
            return finer, crossing
        more = np.isin(surfaces.face, surfaces.face[finer.parent[pairs].ravel()]) & ~crossing
        crossing |= more if more.any() else True


def _near(vertices: np.ndarray, triangles: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return marks (m,) of chosen triangles and of triangles with a corner near a chosen corner.

    Near means at most NEAR away.
    """
    from scipy.spatial import cKDTree

    corners = np.unique(triangles[chosen])
    away, _ = cKDTree(vertices[corners]).query(vertices, distance_upper_bound=NEAR)
    return np.asarray(chosen | np.isfinite(away)[triangles].any(axis=1))


def _usual_turn(turn: np.ndarray, area: np.ndarray, chosen: np.ndarray) -> float:
    """Return the turn (angle between facets) [rad] that nine tenths of the area do not exceed.

    Only chosen triangles with a turn above 0 count. The result is 0 if there are none.

    Args:
        turn, area: largest turn at the sides [rad] and area [m²] of each triangle, (m,).
        chosen: marks the triangles that count, (m,).
    """
    rows = np.flatnonzero(chosen & (turn > 0.0))
    if not len(rows):
        return 0.0
    rows = rows[np.argsort(turn[rows])]
    upto = np.cumsum(area[rows])
    return float(turn[rows][np.searchsorted(upto, MOST * upto[-1])])
