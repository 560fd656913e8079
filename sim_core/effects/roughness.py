"""Rough surfaces: at a hit, the normal of the touched facet is drawn about the surface's normal.

Peened and blasted faces have slopes of degrees. A perfectly smooth face keeps a ball's motion along
the surface, or with friction takes it for good; a rough face turns one into the other.

Notation:
    n: unit normal of the surface, towards the ball
    m: unit normal of the facet that the ball touches, the direction of n + s_1 t_1 + s_2 t_2
    t_1, t_2: unit vectors along the surface; the ball moves along -t_1
    s_1, s_2: slopes of the facet in these directions [-], positive where it faces t_1, t_2
    sigma: rms slope of a profile of the surface [-], the same in all directions, ``slope``
    v_n, v_t: speed of the ball towards and along the surface, before the hit [m/s]
    a: sigma v_t / v_n [-]

Slopes have a normal distribution of standard deviation sigma in each direction. A ball meets a
facet the more often, the more the facet faces it, and never from behind: with u = s_1 / sigma, the
density of u is proportional to exp(-u²/2) max(0, 1 + a u). This is the shadow effect of Sommerfeld
and Huber. u is drawn exactly, by rejection from three simple densities.

A ball that a facet throws towards the surface hits it once more in the same instant, on another
facet. After MOST_HITS such hits the ball leaves from the mean plane. Restitution and friction act
at each facet. The energy per mass is unchanged for e = 1 and mu = 0.

A draw is a hash of seed, ball and number of the draw (numerics/random_draws.py). So the same scene
gives the same bits on any thread.

Sources: M. Sommerfeld & N. Huber, Int. J. Multiphase Flow 25 (1999) 1457, section 2; E. Heitz & E.
d'Eon, Computer Graphics Forum 33 (2014) 103, for the density of visible slopes.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError, number
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.random_draws import checked_seed, uniform
from sim_core.numerics.vec3 import Touch, Vec3, add_scaled, cross, dot, scaled

# Hits of a ball on facets in the same instant. In an isotropic gas on slopes of 5 degrees, one hit
# in 300 is followed by a second, and one in 10,000 by a third.
MOST_HITS = 8
MAX_SLOPE = 0.5  # 27 degrees; facets of steeper surfaces hide one another
# Largest a for which slopes are drawn. Balls at a smaller angle are drawn as at this angle.
STEEPEST = 1e6
TRIES = 64  # of one draw, of which more than half succeed


class Roughness(NamedTuple):
    """Roughness of surfaces.

    Args:
        surfaces: rms slope of a profile of each surface [-], by tag number; 0 for a smooth surface.
        seed: whole number from 0 to 2**32 - 1 from which the draws follow.
    """

    surfaces: tuple[float, ...] | np.ndarray
    seed: int = 0


class RoughnessState(NamedTuple):
    """Roughness of surfaces, and the draws of n balls, as numbers for compiled code."""

    slopes: np.ndarray  # rms slope of each surface [-], shape (tags,)
    draws: np.ndarray  # number of draws of each ball, shape (n,) int64
    seed: int  # seed of the draws


def checked_roughness(roughness: Roughness | None, tags: int) -> Roughness | None:
    """Return the roughness with the slopes as an array (tags,); None for None.

    ``tags``: number of surface tags in the scene.

    Raises:
        SceneError: for a number out of range, and for a tag without a slope.
    """
    if roughness is None:
        return None
    given = np.array(roughness.surfaces, dtype=object).ravel()
    if len(given) < tags:
        raise SceneError(
            f"roughness.surfaces has {len(given)} values, but the mesh has tags up to {tags - 1}: "
            "give one slope for each tag"
        )
    slopes = [number(f"roughness.surfaces[{tag}]", one) for tag, one in enumerate(given)]
    for tag, slope in enumerate(slopes):
        if not 0.0 <= slope <= MAX_SLOPE:
            raise SceneError(
                f"roughness.surfaces[{tag}] is {slope}: it must lie in [0, {MAX_SLOPE:g}]"
            )
    return Roughness(np.array(slopes), checked_seed("roughness.seed", roughness.seed))


def new_roughness_state(roughness: Roughness | None, balls: int) -> RoughnessState | None:
    """Return the state of balls that have hit nothing; None for smooth surfaces.

    ``roughness``: from checked_roughness. ``balls``: number of balls.
    """
    if roughness is None:
        return None
    draws = np.zeros(balls, dtype=np.int64)
    return RoughnessState(np.asarray(roughness.surfaces), draws, roughness.seed)


@inlined
def touched_facet(roughness: RoughnessState | None, ball: int, touch: Touch) -> Touch:
    """Return the contact of a ball with a facet of the surface that it hits.

    The result has a drawn normal of unit length. ``touch``: the contact with the mean plane.
    """
    if roughness is None:
        return touch
    return _facet(roughness, ball, touch)


@jit
def _facet(roughness: RoughnessState, ball: int, touch: Touch) -> Touch:
    slope = roughness.slopes[touch.tag]
    if slope == 0.0:
        return touch
    normal = scaled(1.0 / math.sqrt(dot(touch.away, touch.away)), touch.away)
    approach = -dot(normal, touch.relative)
    if approach <= 0.0:
        return touch
    along = add_scaled(touch.relative, approach, normal)
    speed = math.sqrt(dot(along, along))
    first = _any_across(normal) if speed == 0.0 else scaled(-1.0 / speed, along)
    s_1 = slope * _visible(roughness, ball, min(slope * speed / approach, STEEPEST))
    s_2 = slope * _normals(roughness, ball)[0]
    away = add_scaled(normal, s_1, first)
    away = add_scaled(away, s_2, cross(normal, first))
    facet = scaled(1.0 / math.sqrt(dot(away, away)), away)
    return Touch(facet, touch.relative, touch.tag, touch.kind, touch.triangle)


@jit
def _any_across(normal: Vec3) -> Vec3:
    """Return a unit vector across a unit vector."""
    axis = Vec3(1.0, 0.0, 0.0) if abs(normal.x) < 0.6 else Vec3(0.0, 1.0, 0.0)
    across = cross(normal, axis)
    return scaled(1.0 / math.sqrt(dot(across, across)), across)


@jit
def _visible(roughness: RoughnessState, ball: int, a: float) -> float:
    """Draw u of the module docstring, whose density is proportional to exp(-u²/2) max(0, 1 + a u).

    For u > 0 the density is that of a half normal and a Rayleigh distribution. For u < 0 it lies
    below a half normal one.
    """
    whole = 1.0 + a / math.sqrt(2.0 * math.pi)
    for _ in range(TRIES):
        part = whole * _draw(roughness, ball)
        one, _, length = _normals(roughness, ball)
        if part >= 1.0:
            return length
        if part >= 0.5:
            return abs(one)
        if _draw(roughness, ball) < 1.0 - a * abs(one):
            return -abs(one)
    return 0.0


@jit
def _normals(roughness: RoughnessState, ball: int) -> tuple[float, float, float]:
    """Draw two independent standard normal numbers. Return these and the length of their vector.

    The length has a Rayleigh distribution. Source: G. E. P. Box & M. E. Muller, Ann. Math. Stat. 29
    (1958) 610.
    """
    length = math.sqrt(-2.0 * math.log(_draw(roughness, ball)))
    angle = 2.0 * math.pi * _draw(roughness, ball)
    return length * math.cos(angle), length * math.sin(angle), length


@jit
def _draw(roughness: RoughnessState, ball: int) -> float:
    roughness.draws[ball] += 1
    return uniform(roughness.seed, ball, roughness.draws[ball])
