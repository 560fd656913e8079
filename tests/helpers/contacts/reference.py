"""Checks in extended precision: is a reported contact too early, too late, or while receding?

No contact is computed here. A check takes the contact that the code under test reports and proves
or refutes it from the gap between ball and obstacle as a function of time:

    early     the gap [m] at the reported contact: it must not be open
    receding  if the gap is rising there, how far it opens [m] before it falls again: it must not
              open at all
    late      how much deeper [m] than touching, and than at its start, the ball got before the
              reported contact, or before the end of the flight if no contact is reported: a
              contact was missed

      gap \\               /   A ball that starts in overlap may come out of it without a contact.
       0 --\\-------------/--  One that starts deeper than half a radius is behind the surface and
            \\_  late  _ /     can be late only after it has come out in front.
              \\______/

Between the marks on a flight the gap only rises or only falls, so that nothing is missed between
them. Each check finds its marks by other means than the code under test, which solves quadratics,
steps from plane to plane, and splits sine waves. Numbers are numpy's longdouble. On x86 it has 64
bits of mantissa and a gap is known to about 1e-18 m. On machines where longdouble is plain float64
the same tests run with about 1e-16 m, still far below the required 1e-12 m.

Arrays of vectors have shape (3, n) here, because columns are quick to compute with.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

Long = np.longdouble
# a mark is known to 1e-13 of the flight: what the gap turns within that is far below 1e-18 m
HALVINGS = 44
BEHIND = 0.5  # of a radius: an overlap deeper than this is the far side, not a contact
SURELY = 1e-12  # m: a gap this wide is open, whatever rounding did
# m/s: a rate of zero, but for rounding in the code under test: that of the sonotrode's 25 m/s at an
# angle of 5000 rad, known to 5e-13 rad. In 10 ms a ball receding so slowly gains 1e-13 m.
STANDING = 1e-11
AHEAD = np.concatenate(
    [[0.0], 2.0 ** np.arange(-40, 1)]
)  # shares of the flight left at which to look ahead
UNSEEN = 1e-17  # m: falls smaller than this are not looked for


class ContactErrors(NamedTuple):
    """Errors of each case (n,) [m], see above; the first two are -inf without a contact."""

    early: np.ndarray
    receding: np.ndarray
    late: np.ndarray


def columns(vectors: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) as extended-precision columns (3, ...)."""
    return np.moveaxis(np.asarray(vectors, dtype=Long), -1, 0)


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Scalar products of columns."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector products of columns."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def value(polynomial: list[np.ndarray], t: np.ndarray) -> np.ndarray:
    """Polynomials with coefficients (n,), lowest first, at times (..., n)."""
    total = np.broadcast_to(polynomial[-1], np.shape(t))
    for coefficient in polynomial[-2::-1]:
        total = total * t + coefficient
    return total


def product(a: list[np.ndarray], b: list[np.ndarray]) -> list[np.ndarray]:
    """Product of two polynomials."""
    total = [np.zeros_like(a[0]) for _ in range(len(a) + len(b) - 1)]
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            total[i + j] = total[i + j] + x * y
    return total


def marks(polynomial: list[np.ndarray], end: np.ndarray) -> np.ndarray:
    """Times (k, n), rising from 0 to ``end`` (n,), between which each polynomial only rises or only
    falls.

    They are the roots of its derivative, which are found by halving where *that* only rises or only
    falls, and so on down to a straight line. A stretch without a root gives one of its ends: a mark
    too many does no harm.
    """
    zero = np.zeros_like(end)
    if len(polynomial) <= 2:
        return np.stack([zero, end])
    slope = [k * c for k, c in enumerate(polynomial)][1:]
    stretches = marks(slope, end)
    low, high = stretches[:-1], stretches[1:]
    rising = value(slope, high) > 0.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        right = (value(slope, middle) > 0.0) == rising
        low, high = np.where(right, low, middle), np.where(right, middle, high)
    return np.concatenate([zero[None], high, end[None]])


def depth(gaps: np.ndarray, behind: float = np.inf) -> np.ndarray:
    """How much deeper (n,) than touching, and than at first, gaps (k, n) in order of time get;
    where they start deeper than ``behind``, only what follows a gap that is surely open counts.
    """
    start = np.minimum(gaps[0], 0.0)
    out = np.maximum.accumulate(gaps, axis=0) > SURELY
    counts = np.where(start > -Long(behind), True, out)
    start = np.where(start > -Long(behind), start, 0.0)
    return np.where(counts, np.maximum(start - gaps, 0.0), 0.0).max(axis=0)


def contact_errors(
    found: np.ndarray,
    limit: float | np.ndarray,
    gap: Callable[..., np.ndarray],
    rate: np.ndarray,
    late: np.ndarray,
) -> ContactErrors:
    """``gap(cases, times (..., cases))``; ``rate`` (n,) is the gap's at the reported contacts."""
    early, receding = np.full(len(found), -np.inf), np.full(len(found), -np.inf)
    hit = np.flatnonzero(np.isfinite(found))
    early[hit] = gap(hit, found[hit].astype(Long))
    rising = hit[rate[hit] > STANDING]
    if len(rising):
        left = np.broadcast_to(limit, found.shape)[rising] - found[rising].astype(Long)
        ahead = gap(rising, found[rising] + left * AHEAD[:, None])
        still = np.logical_and.accumulate(np.diff(ahead, axis=0) > 0.0, axis=0)
        receding[rising] = np.where(still, ahead[1:], -np.inf).max(axis=0)
    return ContactErrors(early, receding, late.astype(float))


class Flight(NamedTuple):
    """Flights of points, columns (3, n): x(t) = position + velocity t + fall t²/2."""

    position: np.ndarray
    velocity: np.ndarray
    fall: np.ndarray

    def at(self, t: np.ndarray) -> np.ndarray:
        """Positions (3, ..., n) at times (..., n)."""
        shape = (3,) + (1,) * (np.ndim(t) - 1) + (self.position.shape[1],)
        return self.position.reshape(shape) + t * (
            self.velocity.reshape(shape) + t / 2 * self.fall.reshape(shape)
        )

    def speed(self, t: np.ndarray) -> np.ndarray:
        """Velocities (3, n) at times (n,)."""
        return self.velocity + t * self.fall

    def along(self, direction: np.ndarray, origin: np.ndarray | float = 0.0) -> list[np.ndarray]:
        """Polynomial of the distance travelled along a direction (3, n) from an origin (n,)."""
        return [
            dot(self.position, direction) - origin,
            dot(self.velocity, direction),
            dot(self.fall, direction) / 2,
        ]

    def squared(self) -> list[np.ndarray]:
        """Polynomial of the squared distance from the coordinates' origin."""
        p, v, g = self
        return [dot(p, p), 2 * dot(p, v), dot(v, v) + dot(p, g), dot(v, g), dot(g, g) / 4]


def flight_of(flights: np.ndarray) -> Flight:
    """Rows (n, 9) of position, velocity and acceleration as extended-precision columns."""
    return Flight(*(columns(flights[:, k : k + 3]) for k in (0, 3, 6)))


def end_of(found: np.ndarray, limit: float | np.ndarray) -> np.ndarray:
    """The reported contact, or the end of the flight where none is."""
    return np.asarray(np.minimum(found, limit), dtype=Long)


def check_faces(
    corners: np.ndarray,
    flights: np.ndarray,
    radius: float,
    seam: float,
    limit: float,
    found: np.ndarray,
) -> tuple[ContactErrors, np.ndarray]:
    """Contacts with the shot sides of triangles (n, 3 corners, 3) that wind clockwise as the shot
    sees them.

    Also returns how far (n,) [m] outside its triangle each reported contact is: up to ``seam`` is
    allowed.
    """
    ball = flight_of(flights)
    a, b, c = (columns(corners[:, k]) for k in range(3))
    normal = cross(c - a, b - a)
    normal = normal / np.sqrt(dot(normal, normal))
    ball = Flight(ball.position - a, ball.velocity, ball.fall)
    height = ball.along(normal, Long(radius))
    end = end_of(found, limit)

    def outside(t: np.ndarray) -> np.ndarray:
        """How far [m] the centre is from being over the triangle."""
        at = ball.at(t)
        over = np.full(t.shape, -np.inf, dtype=Long)
        nearest = np.full(t.shape, np.inf, dtype=Long)
        for s, e in ((a, b), (b, c), (c, a)):
            along = e - s
            length = np.sqrt(dot(along, along))
            rest = at + a - s
            rest = rest - dot(rest, normal) * normal
            over = np.maximum(over, dot(cross(along, normal), rest) / -length)
            rest = rest - np.clip(dot(rest, along) / length**2, 0.0, 1.0) * along
            nearest = np.minimum(nearest, np.sqrt(dot(rest, rest)))
        return np.where(over > 0.0, nearest, 0.0)

    times = marks(height, end)
    gaps = value(height, times)
    # a parabola falls while closed at most once, from where it closes or else turns: is it over the
    # triangle there? There, and where it is surely in, for a touch as long as it is shallow may end
    # beside the triangle.
    over = np.ones(len(found), dtype=bool)
    for sunk in (0.0, SURELY):
        begins = np.zeros_like(end)
        for low, high in pairwise(times):
            level = np.minimum(value(height, low), 0.0) - sunk
            closes = (value(height, low) > value(height, high)) & (value(height, high) <= level)
            for _ in range(HALVINGS + 20):
                middle = (low + high) / 2
                opened = value(height, middle) > level
                low, high = np.where(opened, middle, low), np.where(opened, high, middle)
            begins = np.where(closes, high, begins)
        over &= outside(begins) <= 0.0
    late = np.where(over, depth(gaps, BEHIND * radius), 0.0)

    def gap(i: np.ndarray, t: np.ndarray) -> np.ndarray:
        return value([c[i] for c in height], t)

    away = np.where(np.isfinite(found), outside(end), 0.0).astype(float)
    return contact_errors(found, limit, gap, height[1] + 2 * height[2] * end, late), away


def check_capsules(
    ends: np.ndarray, flights: np.ndarray, radius: float, limit: float, found: np.ndarray
) -> ContactErrors:
    """Contacts with the capsules about segments (n, 2 ends, 3).

    The squared distance is a quartic in time, one beside the segment and one off each end: the
    marks are those of all three, and the times when the centre passes from one region to the next.
    """
    ball = flight_of(flights)
    start = columns(ends[:, 0])
    along = columns(ends[:, 1]) - start
    length = np.sqrt(dot(along, along))
    along = along / length
    near = Flight(ball.position - start, ball.velocity, ball.fall)
    far = Flight(near.position - length * along, ball.velocity, ball.fall)
    reach = near.along(along)
    beside = [x - y for x, y in zip(near.squared(), product(reach, reach), strict=True)]
    end = end_of(found, limit)
    times = [marks(squared, end) for squared in (near.squared(), far.squared(), beside)]
    times += [
        _zeros([reach[0] - origin, *reach[1:]], end) for origin in (np.zeros_like(length), length)
    ]
    everything = np.sort(np.concatenate(times), axis=0)

    def away(i: np.ndarray, t: np.ndarray) -> np.ndarray:
        at = Flight(*(x[:, i] for x in near)).at(t)
        share = np.clip(value([c[i] for c in reach], t), 0.0, length[i])
        return at - share * along[:, i].reshape((3,) + (1,) * (t.ndim - 1) + (len(i),))

    def gap(i: np.ndarray, t: np.ndarray) -> np.ndarray:
        rest = away(i, t)
        return np.asarray(np.sqrt(dot(rest, rest)) - radius)

    everyone = np.arange(len(found))
    late = depth(gap(everyone, everything), BEHIND * radius)
    return contact_errors(found, limit, gap, dot(away(everyone, end), near.speed(end)), late)


def _zeros(polynomial: list[np.ndarray], end: np.ndarray) -> np.ndarray:
    """Sign changes (k, n) of quadratics in [0, end]; an end of a stretch where there is none."""
    return marks([np.zeros_like(end), *(c / (k + 1) for k, c in enumerate(polynomial))], end)


def check_meetings(
    apart: np.ndarray, closing: np.ndarray, reach: np.ndarray, limit: float, found: np.ndarray
) -> ContactErrors:
    """Meetings of two balls: relative position and velocity (n, 3), sum of the radii (n,)."""
    pair = Flight(columns(apart), columns(closing), np.zeros((3, len(reach)), dtype=Long))
    end = end_of(found, limit)

    def gap(i: np.ndarray, t: np.ndarray) -> np.ndarray:
        rest = Flight(*(x[:, i] for x in pair)).at(t)
        return np.asarray(np.sqrt(dot(rest, rest)) - reach[i])

    late = depth(gap(np.arange(len(found)), marks(pair.squared()[:3], end)))
    return contact_errors(found, limit, gap, dot(pair.at(end), pair.velocity), late)


class BentShare(NamedTuple):
    """Share of the amplitude along n flights over faces that bend.

    ``along(i, t)``: share and its rate [1/s] on the flights ``i`` at the times ``t`` [s];
    ``bounds``: of the share, of its rate [1/s] and of its second derivative [1/s²], on all flights.
    """

    along: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
    bounds: tuple[np.ndarray, np.ndarray, np.ndarray]


def check_waves(
    planes: np.ndarray,
    waves: np.ndarray,
    flights: np.ndarray,
    times: np.ndarray,
    radius: float,
    limits: np.ndarray,
    found: np.ndarray,
    share: BentShare | None = None,
) -> ContactErrors:
    """Contacts with vibrating planes; arguments as contact_calls.waving_planes.

    ``share``: share of the amplitude along each flight, if the planes bend.

    The gap bends by no more than a known curvature, so its value and rate in the middle of a
    stretch of time bound both all over it. A stretch that is open, or rises, holds no contact; one
    that falls is checked at its ends; any other is halved, until it is too short to hide a fall.
    """
    ball = flight_of(flights)
    normal = columns(planes[:, 0:3])
    height = ball.along(normal, planes[:, 3].astype(Long))
    swing = waves[:, 0].astype(Long) * dot(normal, columns(waves[:, 3:6]))
    omega = waves[:, 1].astype(Long)
    theta = omega * times + waves[:, 2]
    most_share, most_rate, most_bend = (1.0, 0.0, 0.0) if share is None else share.bounds
    bend = omega**2 * most_share + 2 * omega * most_rate + most_bend
    bend = 2 * np.abs(height[2]) + np.abs(swing) * bend

    def gap(i: np.ndarray, t: np.ndarray) -> np.ndarray:
        f = 1.0 if share is None else share.along(i, t)[0]
        return value([c[i] for c in height], t) - swing[i] * f * np.sin(omega[i] * t + theta[i])

    def rate(i: np.ndarray, t: np.ndarray) -> np.ndarray:
        f, change = (1.0, 0.0) if share is None else share.along(i, t)
        angle = omega[i] * t + theta[i]
        lift = f * omega[i] * np.cos(angle) + change * np.sin(angle)
        return height[1][i] + 2 * height[2][i] * t - swing[i] * lift

    everyone = np.arange(len(found))
    end = end_of(found, limits)
    start = np.minimum(gap(everyone, np.zeros_like(end)), 0.0)
    late = np.zeros(len(found), dtype=Long)
    behind = (
        start <= -BEHIND * radius
    )  # counts from the top of its flight on, if that is in front of the crests
    top = np.clip(-height[1] / np.where(height[2] < 0.0, 2 * height[2], -np.inf), 0.0, end)
    crest = np.abs(swing) * most_share
    out = value(height, top) > crest + SURELY
    start = np.where(behind, 0.0, start)
    i = np.flatnonzero(~behind | out)
    low, high = np.where(behind, top, 0.0)[i], end[i]
    while len(i):
        middle, half = (low + high) / 2, (high - low) / 2
        h = [c[i] for c in height]
        above = (
            value(h, middle)
            - half * (np.abs(h[1] + 2 * h[2] * middle) + half * np.abs(h[2]))
            - crest[i]
        )
        maybe = above <= 0.0  # below the crests somewhere
        i, low, high, middle, half = (x[maybe] for x in (i, low, high, middle, half))
        here, pace, most = gap(i, middle), rate(i, middle), bend[i] * half
        closed = here - half * (np.abs(pace) + most / 2) <= 0.0
        falling = closed & (pace < -most)
        if falling.any():
            k = i[falling]
            np.maximum.at(late, k, start[k] - gap(k, high[falling]))
        split = closed & (np.abs(pace) <= most) & (most * half > UNSEEN)
        i, low, high, middle = (x[split] for x in (i, low, high, middle))
        i, low, high = np.tile(i, 2), np.concatenate([low, middle]), np.concatenate([middle, high])
    return contact_errors(found, limits, gap, rate(everyone, end), late)


def check_triangles(
    corners: np.ndarray,
    flights: np.ndarray,
    radius: float,
    limits: np.ndarray,
    found: np.ndarray,
    allowed: float,
    tilt: float,
) -> ContactErrors:
    """First contacts with whole meshes: each flight with all of its triangles (n, k, 3 corners, 3).

    A triangle is convex, so it lies behind the plane through its point nearest to the ball, and is
    not reached before that plane is. Go there, take the nearest point anew, and so on, until the
    end of the flight or until the ball is ``allowed`` [m] deeper in a triangle than touching, and
    than it started. ``late`` is then at least that. ``tilt`` [rad]: where faces meet, how far the
    normal of a contact may be off.
    """
    cases, count = corners.shape[:2]
    ball = flight_of(flights)
    end = end_of(found, limits)
    triangles = [columns(corners[:, :, k].reshape(-1, 3)) for k in range(3)]
    everyone = np.arange(cases)

    def rest(pairs: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """From the nearest points of triangles to the balls at times (pairs,): distances and unit
        vectors.
        """
        at = Flight(*(x[:, pairs // count] for x in ball)).at(t)
        away = from_triangles(at, *(corner[:, pairs] for corner in triangles))
        distance = np.sqrt(dot(away, away))
        return distance, away / distance

    def gap(i: np.ndarray, t: np.ndarray) -> np.ndarray:
        pairs = np.add.outer(i * count, np.arange(count)).ravel()
        gaps = [
            rest(pairs, np.repeat(row, count))[0].reshape(len(i), count).min(axis=1) - radius
            for row in t
        ]
        return np.stack(gaps)

    pairs = np.arange(cases * count)
    start = np.minimum(gap(everyone, np.zeros((1, cases), dtype=Long))[0], 0.0)
    distance, normal = rest(pairs, np.repeat(end, count))
    late = start + radius - distance.reshape(cases, count).min(axis=1)
    # of the triangles and edges in touch, any that the ball approaches will do, if only with a
    # normal ``tilt`` aside
    velocity = np.repeat(ball.speed(end), count, axis=1)
    rate = np.where(distance - radius <= allowed, dot(normal, velocity), np.inf)
    position = np.repeat(ball.at(end), count, axis=1)
    for k in range(3):
        away = from_segments(position, triangles[k], triangles[k - 1])
        distance = np.sqrt(dot(away, away))
        rate = np.minimum(
            rate, np.where(distance - radius <= allowed, dot(away, velocity) / distance, np.inf)
        )
    rate = (rate - tilt * np.sqrt(dot(velocity, velocity))).reshape(cases, count).min(axis=1)

    time = np.zeros(len(pairs), dtype=Long)
    while len(pairs):
        distance, normal = rest(pairs, time)
        i = pairs // count
        room = distance - radius - start[i] + allowed
        deep = room <= allowed * 1e-3
        np.maximum.at(late, i[deep], Long(allowed))
        now = Flight(*(x[:, i] for x in ball))
        time = time + _first_root(
            np.maximum(room, 0.0), dot(normal, now.speed(time)), dot(normal, now.fall) / 2
        )
        on = ~deep & (time < end[i])
        pairs, time = pairs[on], time[on]
    return contact_errors(
        found, limits, lambda i, t: gap(i, np.atleast_2d(t)).reshape(t.shape), rate, late
    )


def _first_root(c: np.ndarray, b: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Smallest t >= 0 with c + b t + a t² <= 0 and falling, for c >= 0; infinite if there is
    none.
    """
    disc = b * b - 4 * a * c
    root = np.sqrt(np.maximum(disc, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        falling = np.where(disc >= 0.0, 2 * c / (root - b), np.inf)
        turning = np.where(a < 0.0, (b + root) / (-2 * a), np.inf)
    return np.where(b < 0.0, falling, turning)


def from_segments(at: np.ndarray, s: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Vectors (3, n) to points from the nearest points of segments with these ends (3, n)."""
    along, here = e - s, at - s
    return np.asarray(here - np.clip(dot(here, along) / dot(along, along), 0.0, 1.0) * along)


def from_triangles(at: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Vectors (3, n) to points from the nearest points of triangles with these corners (3, n)."""
    normal = cross(b - a, c - a)
    inside = np.ones(at.shape[1], dtype=bool)
    best = np.full(at.shape[1], np.inf, dtype=Long)
    rest = np.zeros_like(at)
    for s, e in ((a, b), (b, c), (c, a)):
        inside &= dot(cross(e - s, at - s), normal) >= 0.0
        here = from_segments(at, s, e)
        distance = dot(here, here)
        nearer = distance < best
        best, rest = np.where(nearer, distance, best), np.where(nearer, here, rest)
    return np.where(inside, dot(at - a, normal) / dot(normal, normal) * normal, rest)
