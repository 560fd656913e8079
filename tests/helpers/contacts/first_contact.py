"""A slow, plain first contact of a ball with triangles: dense sampling, then bisection in extended
precision.

It knows distances only: no planes moved out, no capsules, no tree, no quadratic or quartic.
"""

import numba
import numpy as np

SAMPLES = 256
GOLDEN = 0.3819660112501051


@numba.njit(cache=True)
def _point_triangle(p: np.ndarray, corners: np.ndarray) -> float:
    """Distance from a point (3,) to a triangle (3, 3): to its plane if the foot lies inside, else
    to a border.
    """
    a, b, c = corners[0], corners[1], corners[2]
    normal = np.cross(b - a, c - a)
    size = np.sqrt((normal * normal).sum())
    inside = size > 0.0
    best = np.inf
    for k in range(3):
        s, e = corners[k], corners[(k + 1) % 3]
        along = e - s
        if (np.cross(along, p - s) * normal).sum() < 0.0:
            inside = False
        share = min(max(((p - s) * along).sum() / (along * along).sum(), 0.0), 1.0)
        rest = p - s - share * along
        best = min(best, np.sqrt((rest * rest).sum()))
    if inside:
        return abs(((p - a) * normal).sum()) / size
    return best


@numba.njit(cache=True)
def _gap(
    t: float, p: np.ndarray, v: np.ndarray, g: np.ndarray, corners: np.ndarray, radius: float
) -> float:
    at = p + v * t + 0.5 * g * t * t
    best = np.inf
    for k in range(len(corners)):
        best = min(best, _point_triangle(at, corners[k]))
    return best - radius


@numba.njit(cache=True)
def bracket(p, v, g, corners, radius, length):  # type: ignore[no-untyped-def]
    """(last time outside, first known time inside), infinite if the ball passes; the lowest gap
    seen. Starts apart.
    """
    step = length / SAMPLES
    before, here = np.inf, _gap(0.0, p, v, g, corners, radius)
    lowest = here
    for k in range(1, SAMPLES + 1):
        after = _gap(k * step, p, v, g, corners, radius)
        if (
            here <= before and here <= after and here < 4.0 * step * 20.0
        ):  # a dip: golden section to its bottom
            low, high = (k - 2) * step if k > 1 else 0.0, k * step
            for _ in range(80):
                one, two = low + GOLDEN * (high - low), high - GOLDEN * (high - low)
                if _gap(one, p, v, g, corners, radius) < _gap(two, p, v, g, corners, radius):
                    high = two
                else:
                    low = one
            bottom = 0.5 * (low + high)
            depth = _gap(bottom, p, v, g, corners, radius)
            lowest = min(lowest, depth)
            if depth < 0.0:
                return max(k - 2, 0) * step, bottom, lowest
        lowest = min(lowest, after)
        if after < 0.0:
            return (k - 1) * step, k * step, lowest
        before, here = here, after
    return np.inf, np.inf, lowest


def distance_to_triangles(p: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distance from points (n, 3) to the nearest of their triangles (n, k, 3 corners, 3), in the
    arrays' own precision.
    """

    def dot(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return (u * v).sum(axis=-1)

    a, b, c = corners[:, :, 0], corners[:, :, 1], corners[:, :, 2]
    normal = np.cross(b - a, c - a)
    at = p[:, None, :]
    inside = np.ones(normal.shape[:-1], dtype=bool)
    nearest = np.full(inside.shape, np.inf, dtype=p.dtype)
    for s, e in ((a, b), (b, c), (c, a)):
        along = e - s
        inside &= dot(np.cross(along, at - s), normal) >= 0.0
        share = np.clip(dot(at - s, along) / dot(along, along), 0.0, 1.0)
        rest = at - s - share[..., None] * along
        nearest = np.minimum(nearest, np.sqrt(dot(rest, rest)))
    face = np.abs(dot(at - a, normal)) / np.sqrt(dot(normal, normal))
    return np.asarray(np.where(inside, face, nearest).min(axis=1))


def gap_at(
    time: np.ndarray,
    p: np.ndarray,
    v: np.ndarray,
    g: np.ndarray,
    corners: np.ndarray,
    radius: float,
) -> np.ndarray:
    """Distance from the ball's surface to the triangles at ``time`` (n,), in extended precision (80
    bits on x86).
    """
    time, p, v, g, corners = (np.asarray(x, dtype=np.longdouble) for x in (time, p, v, g, corners))
    at = p + v * time[:, None] + g * (time * time)[:, None] / 2
    return distance_to_triangles(at, corners) - np.longdouble(radius)


def first_contact_reference(
    p: np.ndarray,
    v: np.ndarray,
    g: np.ndarray,
    corners: np.ndarray,
    radius: float,
    length: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """First touch of each ball (n, 3) flying at v (n, 3) under g (3,) with the triangles (k, 3
    corners, 3).

    Returns times (n,), inf if none within ``length`` (n,), and the lowest gap seen up to there.
    """
    found = np.array([bracket(p[i], v[i], g, corners, radius, length[i]) for i in range(len(p))])
    hit = np.flatnonzero(np.isfinite(found[:, 1]))
    low, high = (found[hit, k].astype(np.longdouble) for k in (0, 1))
    cases = (
        p[hit],
        v[hit],
        np.broadcast_to(g, (len(hit), 3)),
        np.broadcast_to(corners, (len(hit), *corners.shape)),
        radius,
    )
    for _ in range(64):
        middle = (low + high) / 2
        outside = gap_at(middle, *cases) > 0.0
        low, high = np.where(outside, middle, low), np.where(outside, high, middle)
    times = np.full(len(p), np.inf)
    times[hit] = high
    return times, found[:, 2]
