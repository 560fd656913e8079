"""Propose a ball: the largest sold that touches nearly all that the smallest would.

If there are such balls of at most half the radius of the target's fillets, it is one of those.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from chamberopt.chamber.checks.fillets import OF_FILLET, inner_edges
from chamberopt.chamber.reach.largest_ball import largest_balls, spread_points
from chamberopt.chamber.reach.reach import TOLERATED_OVERLAP
from chamberopt.geometry.triangles import area_vectors, areas, unit_vectors

POINTS = 20_000  # on the target
MISSED = 0.05  # share of the target's area that a larger ball may leave out


def touched_shares(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray, diameters: Sequence[float]
) -> np.ndarray:
    """Share of a part's target that balls of these diameters [m] can touch, from any side.

    Args:
        vertices: of the part [m], shape (n, 3).
        triangles: normals out of the part, shape (m, 3).
        target: marks triangles, shape (m,).
    Returns:
        One share for each diameter.
    """
    from sim_core import TriangleMesh

    own = triangles[target]
    spacing = np.full(len(own), np.sqrt(areas(vertices, own).sum() / POINTS))
    triangle, point, area = spread_points(vertices, own, spacing)
    normal = unit_vectors(area_vectors(vertices, own))[triangle]
    mesh = TriangleMesh(vertices, triangles, np.zeros(len(triangles), dtype=np.uint8))
    overlap = TOLERATED_OVERLAP * 0.5 * min(diameters)
    radius = largest_balls(mesh, point, normal, 0.5 * max(diameters), overlap)[0]
    touched = [area[radius >= 0.5 * one - overlap].sum() for one in diameters]
    return np.array(touched) / area.sum()


def fit_fillets(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray, diameters: Sequence[float]
) -> np.ndarray:
    """Whether each of the diameters [m] is small enough for the fillets of a part's target.

    Arguments as in `touched_shares`. Inner edges without a fillet are left out: no ball fits there.
    """
    _, length, radius = inner_edges(vertices, triangles, target)
    small = [(radius > 0.0) & (OF_FILLET * radius < one) for one in diameters]
    return np.array([length[own].sum() < one for own, one in zip(small, diameters, strict=True)])


def propose_ball(
    shares: np.ndarray, fits: np.ndarray, diameters: Sequence[float]
) -> tuple[float, str]:
    """The diameter [m] of the ball, and the reason.

    Args:
        shares, fits: of `touched_shares` and `fit_fillets`.
        diameters: [m], in ascending order.
    """
    touching = shares >= shares[0] - MISSED
    both = touching & fits
    chosen = int(np.flatnonzero(both if both.any() else touching)[-1])
    reason = f"touches {shares[chosen]:.0%} of the target"
    if both.any() and not fits.all():
        reason += ", at most half the radius of its fillets"
    elif chosen + 1 < len(diameters):
        larger = f"{1e3 * diameters[chosen + 1]:g} mm {shares[chosen + 1]:.0%}"
        reason += f", balls of {larger}"
    return diameters[chosen], reason
