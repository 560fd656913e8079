"""Single contacts with friction: rebound off a plate and another ball, and a ball on an incline.

Notation:
    n: unit normal of the contact
    g: velocity of the touching points relative to each other, spins included [m/s]
    psi1, psi2: tangential velocity of the touching points before and after an impact, over their
        normal velocity before it [-]
    e, mu, beta0: coefficients of restitution, friction and tangential restitution [-]
    a: angle of the incline [rad]

A solid sphere of radius R has the moment of inertia 2/5 m R².
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from benchmarks.cases.row import Row, mean_and_half_width
from sim_core import Balls, Friction, Gravity, Physics, Rest, Restitution, Scene, simulate
from sim_core.effects.contact_mode import CAPTURE
from sim_core.effects.gravity import STANDARD
from tests.helpers.scenes.cavities import box

DIAMETER = 3e-3  # m
RADIUS = 0.5 * DIAMETER
TAGS = 3  # ceiling, floor and sides
ROUNDING = 1e-7  # of the closed forms below: far above what a double loses, far below any effect


class Material(NamedTuple):
    """Coefficients that were fitted to measured impacts, and whether of two spheres."""

    name: str
    e: float
    mu: float
    beta0: float
    of_two: bool


# S. F. Foerster, M. Y. Louge, H. Chang & K. Allia, Phys. Fluids 6 (1994) 1108, as we have them.
MATERIALS = (
    Material("two spheres of glass", 0.97, 0.092, 0.44, True),
    Material("glass on an aluminium plate", 0.83, 0.125, 0.31, False),
    Material("two spheres of cellulose acetate", 0.87, 0.25, 0.43, True),
)
INCIDENCES = (10.0, 20.0, 30.0, 45.0, 60.0, 75.0)  # degrees; psi1 is the tangent
PER_SIDE = 5  # impacts of one incidence along a side of the floor
CELL = 20e-3  # m, for each impact
GAP = 1e-3  # m, before an impact
WITHIN = 1.2e-3  # s: all impacts have happened, and no other

ANGLES = (10.0, 20.0, 35.0, 50.0)  # degrees
FRICTIONS = (0.0, 0.1, 0.3)
SLIDES_FOR = 0.2  # s
DROPS = 0.5e-3  # m, above the incline
BOUNCES_FOR = 0.5  # s
CAPTURES_LATE = 1e-8  # m/s, instead of CAPTURE


def walton(psi1: float, material: Material) -> float:
    """psi2 by Walton's model: the touching points stick or slide throughout.

    Sticking turns psi1 into -beta0 psi1. Sliding takes 7/2 (1 + e) mu, for the impulse mu J changes
    the tangential velocity of the touching points by 1 + m R²/I = 7/2 times what it changes that
    of the centres. Source: Foerster and others (1994).
    """
    slides = 3.5 * (1.0 + material.e) * material.mu
    sticks = (1.0 + material.beta0) * psi1
    return psi1 - min(slides, sticks)


def directions(rng: np.random.Generator, count: int) -> np.ndarray:
    """Unit vectors in all directions alike, shape (count, 3)."""
    vectors = rng.normal(size=(count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])


def rebounds(material: Material, psi1: float, seed: int) -> np.ndarray:
    """psi2 of impacts that differ in speed, spin and direction along the surface, shape (n,)."""
    rng, count = np.random.default_rng(seed), PER_SIDE**2
    line = CELL * (np.arange(PER_SIDE) + 0.5)
    x, y = np.meshgrid(line, line)
    middle = np.stack([x.ravel(), y.ravel(), np.full(count, 0.5 * CELL)], axis=1)
    normal = directions(rng, count) if material.of_two else np.tile([0.0, 0.0, 1.0], (count, 1))
    along = np.cross(normal, directions(rng, count))
    along /= np.linalg.norm(along, axis=1)[:, None]
    fast = rng.uniform(1.0, 1.5, count)[:, None]  # normal speed of approach [m/s]
    contact = fast * (psi1 * along - normal)  # velocity of the touching points
    reach = DIAMETER if material.of_two else RADIUS
    # The centres pass the touching points' velocity less the spins' share: g = v - R w x n of the
    # ball that has the contact at -R n, and the other ball's spin adds alike.
    spins = rng.normal(0.0, 100.0, (2 if material.of_two else 1, count, 3))
    closing = contact + RADIUS * np.cross(spins.sum(axis=0), normal)
    time = GAP / fast
    if material.of_two:
        drift = rng.normal(0.0, 0.2, (count, 3))
        velocities = np.concatenate([drift - 0.5 * closing, drift + 0.5 * closing])
        meet = np.concatenate([middle, middle + reach * normal])
        places, spin = meet - np.concatenate([time, time]) * velocities, np.concatenate(spins)
    else:
        middle[:, 2] = reach
        velocities, spin = closing, spins[0]
        places = middle - time * velocities
    law, friction = (material.e, 1.0, 0.0), (material.mu, material.beta0)
    physics = Physics(
        restitution=Restitution((law,) * TAGS, law, 0.0),
        friction=Friction((friction,) * TAGS, friction),
    )
    room = box((CELL * PER_SIDE, CELL * PER_SIDE, CELL))
    result = simulate(Scene(room, Balls(places, velocities, DIAMETER, spins=spin), physics, WITHIN))
    if result.collisions.total != count:
        raise RuntimeError(f"{result.collisions.total} impacts instead of {count}")
    after, turned = result.balls.velocities, result.balls.spins
    assert turned is not None
    if material.of_two:
        after, turned = after[count:] - after[:count], turned[:count] + turned[count:]
    touching = after - RADIUS * np.cross(turned, normal)
    return np.asarray((touching * along).sum(axis=1) / fast[:, 0])


def foerster() -> Iterator[Row]:
    """Rebound against incidence, in the axes of Foerster and others."""
    for number, material in enumerate(MATERIALS):
        for angle in INCIDENCES:
            psi1 = math.tan(math.radians(angle))
            mean, half_width = mean_and_half_width(rebounds(material, psi1, number))
            slides = 3.5 * (1.0 + material.e) * material.mu < (1.0 + material.beta0) * psi1
            regime = "slides" if slides else "sticks"
            yield Row("foerster", f"{material.name}, {angle:.0f}°, {regime}", "psi2",
                      walton(psi1, material), 0.0, mean, half_width + ROUNDING)  # fmt: skip


def downhill(degrees: float, mu: float) -> tuple[float, str]:
    """Acceleration [m/s²] of a solid sphere on an incline, and how it moves.

    It rolls with 5/7 g sin a where friction holds it, tan a <= 7/2 mu; else it slides with
    g (sin a - mu cos a). Source: any textbook, as L. D. Landau & E. M. Lifshitz, Mechanics.
    """
    angle = math.radians(degrees)
    if math.tan(angle) <= 3.5 * mu:
        return 5.0 / 7.0 * STANDARD * math.sin(angle), "rolls"
    return STANDARD * (math.sin(angle) - mu * math.cos(angle)), "slides"


def laid_down(degrees: float, mu: float) -> np.ndarray:
    """Accelerations [m/s²] of balls that start at rest on the incline, shape (n,)."""
    return _descents(degrees, mu, 0.0, SLIDES_FOR, CAPTURE)


def dropped(degrees: float, mu: float, capture: float) -> np.ndarray:
    """Velocity over time [m/s²] of balls that have stopped bouncing on the incline, shape (n,).

    Whatever the bounces were, it is the acceleration of a ball that was laid down: gravity alone
    turns the ball about the line of contact, and the surface's impulses along the normal add up to
    that of its weight. ``capture``: normal speed below which a hit is the last one [m/s].
    """
    return _descents(degrees, mu, DROPS, BOUNCES_FOR, capture)


def _descents(
    degrees: float, mu: float, height: float, seconds: float, capture: float
) -> np.ndarray:
    angle = math.radians(degrees)
    gravity = Gravity(STANDARD * math.sin(angle), 0.0, -STANDARD * math.cos(angle))
    law = (0.5, 1.0, 0.0)
    physics = Physics(
        gravity,
        Restitution((law,) * TAGS, law),
        rest=Rest(capture, resistance=0.0),
        friction=Friction(((mu, 0.3),) * TAGS, (mu, 0.3)),
    )
    long = STANDARD * seconds**2 + 0.1
    room = box((long, 0.1, 0.05))
    line = 0.01 + 0.02 * np.arange(5)
    places = np.stack([np.linspace(0.01, 0.05, 5), line, np.full(5, RADIUS + height)], axis=1)
    balls = simulate(
        Scene(room, Balls(places, np.zeros((5, 3)), DIAMETER), physics, seconds, record=())
    ).balls
    return np.asarray(balls.velocities[:, 0] / seconds)


def incline() -> Iterator[Row]:
    """Accelerations of balls that are laid on inclines, and of balls that are dropped on them."""
    for mu in FRICTIONS:
        for angle in ANGLES:
            theory, way = downhill(angle, mu)
            found, half_width = mean_and_half_width(laid_down(angle, mu))
            yield Row("incline", f"mu = {mu}, {angle:.0f}°, laid down, {way}", "acceleration, m/s²",
                      theory, 0.0, found, half_width + ROUNDING)  # fmt: skip
    for mu, angle in ((0.0, 20.0), (0.1, 35.0), (0.3, 20.0)):
        theory, way = downhill(angle, mu)
        for capture in (CAPTURE, CAPTURES_LATE):
            found, half_width = mean_and_half_width(dropped(angle, mu, capture))
            name = f"mu = {mu}, {angle:.0f}°, dropped, then {way}, capture {1e3 * capture:g} mm/s"
            yield Row("incline", name, "velocity / time, m/s²",
                      theory, 0.0, found, half_width + ROUNDING)  # fmt: skip
