"""Normal restitution: the share of normal speed that a ball keeps in a hit, by impact speed.

Notation:
    v: relative speed along the normal [m/s], ``speed``
    e(v): coefficient of restitution [-]
    v_1 < ... < v_n, e_1 ... e_n: speeds [m/s] with a given e, and e at these speeds
    q: exponent of the fall above v_n [-]

One law holds for every surface and for ball on ball:

    e = e_1                        for v <= v_1
    e = linear in v                from each v_i to v_(i+1)
    e = e_n (v / v_n)^(-q)         for v >= v_n

A power law (C0, v0, q) is a single point: e = C0 below v0 and C0 (v / v0)^(-q) above. A constant is
a single point with q = 0. A table has many points and q = 0.

Sources: q = 1/4 is in Badreddine et al., "CAD based simulation of ultrasonic shot peening", eq. 2,
after McNamara & Falcon, Phys. Rev. E 71 (2005) 031302. It belongs to a fully plastic contact, K. L.
Johnson, Contact Mechanics (1985), section 11.5. Other laws are given as tables. Viscoelastic balls
have 1 - e ~ v^(1/5) for small v (Ramirez et al., Phys. Rev. E 60 (1999) 4465). Shaken layers have
e = 1 - (1 - e0) (v / v_0)^(3/4) up to v_0 and e0 above (Bizon et al., Phys. Rev. Lett. 80 (1998)
57).

Impacts slower than ``elastic_below`` lose nothing. Without such a limit a ball that comes to rest
bounces infinitely often in finite time. The limit bounds the number of bounces and neglects an
energy per mass below elastic_below²/2 per impact. The idea is from the TC model of Luding &
McNamara, Granular Matter 1 (1998) 113, with a speed in place of a time.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError, number
from sim_core.numerics.jit import jit

# m/s: a thousandth of the shot's speed. Mean speeds change by less than 3 % between 1 and 100 mm/s.
# Lower values spend events on chatter: 2 % of the impacts on the sonotrode at this value, 20 % at 1
# mm/s.
ELASTIC_BELOW = 0.01

# exponent of a law that is given without one; two square roots are faster than a power
EXPONENT = 0.25
BALLS = -1  # stands for ball on ball, the last law, in place of a surface's tag
V, E, Q = 0, 1, 2  # columns of the points of a law


class TabulatedRestitution(NamedTuple):
    """Coefficient of restitution at given impact speeds, linear between them.

    Below the first and above the last speed it is constant.

    Args:
        speeds: ascending speeds [m/s], 0 or more, shape (n,).
        e: coefficient of restitution at each speed, in [0, 1], shape (n,).
    """

    speeds: Sequence[float] | np.ndarray
    e: Sequence[float] | np.ndarray


RestitutionLaw = tuple[float, float] | tuple[float, float, float] | TabulatedRestitution
LAW_FORMS = "(C0, v0), (C0, v0, exponent) or a TabulatedRestitution"


class Restitution(NamedTuple):
    """Laws for the coefficient of restitution, as a function of impact speed.

    Each law has one of these forms:

    - (C0, v0): C0 up to v0 [m/s] and C0 (v / v0)^(-1/4) above v0;
    - (C0, v0, exponent): an exponent other than 1/4. With 0, C0 holds at all speeds;
    - a TabulatedRestitution.

    Args:
        surfaces: the law of each surface, by tag number.
        balls: the law of ball on ball.
        elastic_below: speed [m/s] below which impacts lose nothing.

    Example:
        >>> steel = (0.9, 1.0)  # 0.9 up to 1 m/s, falling above
        >>> Restitution(surfaces=[steel, steel], balls=steel, elastic_below=0.01)
        Restitution(surfaces=[(0.9, 1.0), (0.9, 1.0)], balls=(0.9, 1.0), elastic_below=0.01)
    """

    surfaces: Sequence[RestitutionLaw] | np.ndarray
    balls: RestitutionLaw
    elastic_below: float = ELASTIC_BELOW


class RestitutionState(NamedTuple):
    """Laws of restitution as one array for compiled code."""

    # v_i [m/s], e_i and q of the points of each law, shape (laws, n, 3). Laws are ordered by
    # surface tag, and the last law is for ball on ball. A law with fewer than n points repeats its
    # last point.
    points: np.ndarray
    elastic_below: float  # speed [m/s] below which impacts lose nothing


def checked_restitution(restitution: Restitution, tags: int) -> RestitutionState:
    """Return the laws of restitution of all surfaces and of ball on ball, for compiled code.

    ``tags``: number of surface tags in the scene. More laws may be given.

    Raises:
        SceneError: for a bad law, and for a tag without a law.
    """
    form = f"give {LAW_FORMS} for each of the tags 0 to {tags - 1}"
    if isinstance(restitution.surfaces, TabulatedRestitution):
        raise SceneError(f"restitution.surfaces is one table: {form}")
    try:
        given = list(restitution.surfaces)
    except TypeError:
        raise SceneError(f"restitution.surfaces is {restitution.surfaces!r}: {form}") from None
    if len(given) < tags:
        raise SceneError(f"restitution.surfaces has {len(given)} laws: {form}")
    points = [_points(f"restitution.surfaces[{i}]", law) for i, law in enumerate(given)]
    points.append(_points("restitution.balls", restitution.balls))
    elastic_below = number("restitution.elastic_below", restitution.elastic_below)
    if not 0.0 <= elastic_below < math.inf:
        raise SceneError(
            f"restitution.elastic_below is {elastic_below}: it must be 0 or more [m/s]"
        )
    most = max(map(len, points))
    filled_up = [np.pad(one, ((0, most - len(one)), (0, 0)), mode="edge") for one in points]
    return RestitutionState(np.array(filled_up), elastic_below)


def _points(name: str, law: object) -> np.ndarray:
    """Return the points of a law of restitution, as an array (n, 3).

    Each point has a speed [m/s], the coefficient of restitution at it, and the exponent of the
    fall above the last speed.

    Raises:
        SceneError: if the law is bad. The message calls the law ``name``.
    """
    if isinstance(law, TabulatedRestitution):
        return _table(name, law)
    values = tuple(law) if isinstance(law, (tuple, list, np.ndarray)) else ()
    if len(values) not in (2, 3):
        raise SceneError(f"{name} is {law!r}: give {LAW_FORMS}")
    numbers = tuple(number(name, one) for one in values)
    c0, v0, exponent = (*numbers, EXPONENT)[:3]
    if not 0.0 <= c0 <= 1.0 or not 0.0 < v0 < math.inf or not 0.0 <= exponent < math.inf:
        raise SceneError(
            f"{name} is {numbers}: C0 must lie in [0, 1], v0 be positive [m/s], and an exponent "
            "be 0 or more"
        )
    return np.array([[v0, c0, exponent]])


def _table(name: str, table: TabulatedRestitution) -> np.ndarray:
    columns = []
    for field, values in table._asdict().items():
        try:
            column = [number(f"{name}.{field}", one) for one in values]
        except TypeError:
            raise SceneError(f"{name}.{field} is {values!r}: give a list of numbers") from None
        columns.append(np.array(column, dtype=np.float64))
    speeds, e = columns
    if len(speeds) != len(e) or not len(e):
        raise SceneError(
            f"{name} has {len(speeds)} speeds and {len(e)} values of e: give one e for each speed"
        )
    previous = math.nextafter(0.0, -1.0)
    for i, speed in enumerate(speeds):
        if not previous < speed < math.inf:
            text = "give ascending speeds of 0 m/s or more, each once"
            raise SceneError(f"{name}.speeds[{i}] is {speed}: {text}")
        if not 0.0 <= e[i] <= 1.0:
            raise SceneError(f"{name}.e[{i}] is {e[i]}: it must lie in [0, 1]")
        previous = speed
    return np.column_stack([speeds, e, np.zeros(len(e))])


@jit
def restitution_law(points: np.ndarray, law: int, speed: float) -> float:
    """Return the coefficient of restitution [-] at a relative normal ``speed`` [m/s].

    ``points``: points of all laws, as in RestitutionState. ``law``: tag of the surface that is hit,
    or BALLS for ball on ball.
    """
    last = points.shape[1] - 1
    if speed < points[law, last, V]:
        return points[law, 0, E] if speed <= points[law, 0, V] else _between(points, law, speed)
    e, exponent = points[law, last, E], points[law, last, Q]
    if exponent == EXPONENT:
        return float(e / math.sqrt(math.sqrt(speed / points[law, last, V])))
    return float(e if exponent == 0.0 else e / (speed / points[law, last, V]) ** exponent)


@jit
def _between(points: np.ndarray, law: int, speed: float) -> float:
    """Return the coefficient of restitution at a speed, by interpolation in the law's points."""
    low, high = 0, points.shape[1] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if speed < points[law, middle, V]:
            high = middle
        else:
            low = middle
    rise = points[law, high, E] - points[law, low, E]
    wide = points[law, high, V] - points[law, low, V]
    return float(points[law, low, E] + rise * (speed - points[law, low, V]) / wide)


@jit
def surface_restitution(restitution: RestitutionState | None, tag: int, speed: float) -> float:
    """Return the coefficient of restitution of a ball that hits a surface at ``speed`` [m/s].

    It is 1 without restitution, and for hits slower than elastic_below.
    """
    if restitution is None:
        return 1.0
    if speed < restitution.elastic_below:
        return 1.0
    return restitution_law(restitution.points, tag, speed)


@jit
def ball_restitution(restitution: RestitutionState | None, speed: float) -> float:
    """Return the coefficient of restitution of two balls that meet at ``speed`` [m/s].

    It is 1 without restitution, and for hits slower than elastic_below.
    """
    if restitution is None:
        return 1.0
    if speed < restitution.elastic_below:
        return 1.0
    return restitution_law(restitution.points, BALLS, speed)


def restitution_at(speed: np.ndarray, law: RestitutionLaw) -> np.ndarray:
    """Return the coefficients of restitution that a law gives at speeds [m/s] of any shape.

    Raises:
        SceneError: for a bad law.
    """
    speed = np.asarray(speed, dtype=np.float64)
    points = _points("law", law)
    e, exponent = np.interp(speed, points[:, V], points[:, E]), points[-1, Q]
    if exponent == 0.0:
        return np.asarray(e)
    ratio = np.maximum(speed / points[-1, V], 1.0)
    # math.sqrt and numpy's sqrt round alike, so that a simulation finds the same e
    fall = np.sqrt(np.sqrt(ratio)) if exponent == EXPONENT else ratio**exponent
    return np.asarray(e / fall)
