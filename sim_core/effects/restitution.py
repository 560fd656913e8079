"""Normal restitution as a function of impact speed.

Notation:
    v: relative speed along the normal [m/s], ``speed``
    e(v): coefficient of restitution [-]
    v_1 < ... < v_n, e_1 ... e_n: speeds [m/s] at which e is given, and e there
    q: exponent of the fall above v_n [-]

One law holds for every surface and for ball on ball:

    e = e_1                        for v <= v_1
    e = linear in v                from each v_i to v_(i+1)
    e = e_n (v / v_n)^(-q)         for v >= v_n

A power law (C0, v0, q) is one point, e = C0 below v0 and C0 (v / v0)^(-q) above; a constant is one
point with q = 0; a table is many points with q = 0.

Sources: q = 1/4 is Badreddine et al., "CAD based simulation of ultrasonic shot peening", eq. 2,
after McNamara & Falcon, Phys. Rev. E 71 (2005) 031302; it is that of a fully plastic contact, K. L.
Johnson, Contact Mechanics (1985), section 11.5. Other laws are tables, such as that of viscoelastic
balls, 1 - e ~ v^(1/5) for small v (Ramirez et al., Phys. Rev. E 60 (1999) 4465), and that of Bizon
et al., Phys. Rev. Lett. 80 (1998) 57, for shaken layers: e = 1 - (1 - e0) (v / v_0)^(3/4) up to v_0
and e0 above.

Impacts slower than ``elastic_below`` lose nothing. Without such a limit a ball that comes to rest
bounces infinitely often in finite time; with it the number of bounces is bounded, and what is
neglected is below v²/2 per impact. This is the idea of the TC model of Luding & McNamara, Granular
Matter 1 (1998) 113, with a speed in place of a time.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from sim_core.errors import SceneError, number
from sim_core.numerics.jit import jit

# m/s: a thousandth of the shot's speed. Mean speeds change by less than 3 % between 1 and 100 mm/s.
# Lower values spend events on chatter: 2 % of the impacts on the sonotrode here, 20 % at 1 mm/s.
ELASTIC_BELOW = 0.01

EXPONENT = 0.25  # of a law that is given without one; two square roots are faster than a power
BALLS = -1  # row of ball on ball, the last


class TabulatedRestitution(NamedTuple):
    """Restitution at given speeds: linear in speed between them, constant beyond both ends.

    Args:
        speeds: [m/s], ascending, 0 or more, shape (n,).
        e: the coefficient at each, in [0, 1], shape (n,).
    """

    speeds: Sequence[float] | np.ndarray
    e: Sequence[float] | np.ndarray


RestitutionLaw = tuple[float, float] | tuple[float, float, float] | TabulatedRestitution
LAW_FORMS = "(C0, v0), (C0, v0, exponent) or a TabulatedRestitution"


class Restitution(NamedTuple):
    """Coefficients of restitution.

    Each law is one of

    - (C0, v0): C0 up to v0 [m/s] and C0 (v / v0)^(-1/4) above;
    - (C0, v0, exponent): with another exponent than 1/4; 0 makes C0 hold at all speeds;
    - a TabulatedRestitution.

    Args:
        surfaces: the law of each surface, by tag number.
        balls: the law of ball on ball.
        elastic_below: impacts slower than this lose nothing [m/s].
    """

    surfaces: Sequence[RestitutionLaw] | np.ndarray
    balls: RestitutionLaw
    elastic_below: float = ELASTIC_BELOW


class RestitutionLaws(NamedTuple):
    """Laws as compiled code needs them: a row for each surface tag, and the last for the balls.

    Rows of fewer than n points repeat their last one.
    """

    speeds: np.ndarray  # v_1 to v_n [m/s], shape (rows, n)
    coefficients: np.ndarray  # e_1 to e_n, shape (rows, n)
    exponents: np.ndarray  # q, shape (rows,)


class RestitutionState(NamedTuple):
    """Restitution as compiled code needs it."""

    laws: RestitutionLaws
    elastic_below: float  # [m/s]


def checked_restitution(restitution: Restitution, tags: int) -> RestitutionState:
    """The laws as arrays, one row for each tag or more; raises SceneError if one is bad."""
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
    laws = RestitutionLaws(
        _filled_up([speeds for speeds, _, _ in points]),
        _filled_up([e for _, e, _ in points]),
        np.array([exponent for _, _, exponent in points]),
    )
    return RestitutionState(laws, elastic_below)


def _filled_up(rows: list[np.ndarray]) -> np.ndarray:
    """Rows of various lengths as one array, whose shorter rows repeat their last number."""
    longest = max(map(len, rows))
    return np.array([np.pad(row, (0, longest - len(row)), mode="edge") for row in rows])


def _points(name: str, law: Any) -> tuple[np.ndarray, np.ndarray, float]:
    """v_i [m/s] and e_i, (n,) each, and q of a law; raises SceneError, naming it, if it is bad."""
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
    return np.array([v0]), np.array([c0]), exponent


def _table(name: str, table: TabulatedRestitution) -> tuple[np.ndarray, np.ndarray, float]:
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
    return speeds, e, 0.0


@jit
def restitution_law(laws: RestitutionLaws, row: int, speed: float) -> float:
    """e of one of the laws at a relative normal speed [m/s]."""
    speeds, coefficients = laws.speeds, laws.coefficients
    high = speeds.shape[1] - 1
    if speed < speeds[row, high]:
        if speed <= speeds[row, 0]:
            return coefficients[row, 0]
        low = 0
        while high - low > 1:
            middle = (low + high) // 2
            if speed < speeds[row, middle]:
                high = middle
            else:
                low = middle
        share = (speed - speeds[row, low]) / (speeds[row, high] - speeds[row, low])
        return coefficients[row, low] + share * (coefficients[row, high] - coefficients[row, low])
    exponent = laws.exponents[row]
    if exponent == 0.0:
        return coefficients[row, high]
    ratio = speed / speeds[row, high]
    if exponent == EXPONENT:
        return coefficients[row, high] / math.sqrt(math.sqrt(ratio))
    return coefficients[row, high] / ratio**exponent


@jit
def surface_restitution(restitution: RestitutionState | None, tag: int, speed: float) -> float:
    """e of a ball on a surface; 1 without the effect."""
    if restitution is None:
        return 1.0
    if speed < restitution.elastic_below:
        return 1.0
    return restitution_law(restitution.laws, tag, speed)


@jit
def ball_restitution(restitution: RestitutionState | None, speed: float) -> float:
    """e of ball on ball; 1 without the effect."""
    if restitution is None:
        return 1.0
    if speed < restitution.elastic_below:
        return 1.0
    return restitution_law(restitution.laws, BALLS, speed)


def restitution_at(speed: np.ndarray, law: RestitutionLaw) -> np.ndarray:
    """e of a law on an array of speeds [m/s] of any shape; SceneError for a bad law."""
    speed = np.asarray(speed, dtype=np.float64)
    speeds, coefficients, exponent = _points("law", law)
    e = np.interp(speed, speeds, coefficients)
    if exponent == 0.0:
        return np.asarray(e)
    ratio = np.maximum(speed / speeds[-1], 1.0)
    # math.sqrt and numpy's round alike, so that this is the e that a simulation takes
    fall = np.sqrt(np.sqrt(ratio)) if exponent == EXPONENT else ratio**exponent
    return np.asarray(e / fall)
