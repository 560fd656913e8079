"""Gases of rough spheres, all of whose hits stick: how energy is shared with the spins.

Notation:
    e, β: coefficients of restitution along the normal and of the touching points (beta0) [-]
    q: moment of inertia over m R², 2/5 of a solid sphere [-]
    T_tr, T_rot: temperatures m <v²>/3 and q m R² <w²>/3 [J]; R is their ratio T_rot/T_tr in a gas
        that cools, once it is constant [-]
    ν: collisions of a ball a second [1/s]

With m = 1 and η = q (1 + β)/(2 q + 2)

    dT_tr/dt = -(4/3) ν (A T_tr - B T_rot),  A = (1 - e²)/4 + η (1 - η),  B = η²/q
    dT_rot/dt = (4/3) ν (B T_tr - C T_rot),  C = (η/q) (1 - η/q)

where velocities and spins are Maxwell's and independent of each other, as if each ball had just
forgotten its last hits: M. Huthmann & A. Zippelius, Phys. Rev. E 56 (1997) R6275; S. Luding, M.
Huthmann, S. McNamara & A. Zippelius, Phys. Rev. E 58 (1998) 3416. They are not quite (N. V.
Brilliantov, T. Poeschel, W. T. Kranz & A. Zippelius, Phys. Rev. Lett. 98 (2007) 128001), and a
Monte Carlo solution of Boltzmann's equation says how much that is.
"""

import math
from collections.abc import Iterator

import numpy as np

from benchmarks.cases.row import Row, mean_and_half_width
from sim_core import Balls, Friction, Physics, Restitution, Scene, simulate
from tests.helpers.scenes.gas import enskog_rate, in_a_box, lattice_gas

Q = 0.4
CASES = ((1.0, 1.0), (1.0, 0.0), (0.9, 0.5), (0.9, 0.0), (0.9, -0.5))  # e and β
PER_SIDE, PACKING = 10, 0.02  # small and thin enough that no cluster or vortex grows
# Collisions of a ball before and while it is measured: differences from the constant ratio die
# out within 5 to 20.
UNTIL_CONSTANT, MEASURED = 80, 80
PIECE = 4.0  # collisions of a ball at the first speed, after which that speed is given back
SEEDS = 16
HUGE = 1e9  # mu: every hit sticks
ELASTIC = (1.0, 1.0, 0.0)

COPIES = 4_000  # balls of the Monte Carlo solution
COPY_SEEDS = 4
FASTEST = 6.0  # sqrt(kT): pairs approach more slowly, all but one in 4e4


def mean_field(e: float, beta: float) -> float:
    """The ratio R, from B R² + (C - A) R - B = 0."""
    eta = Q * (1.0 + beta) / (2.0 * Q + 2.0)
    a, b = 0.25 * (1.0 - e * e) + eta * (1.0 - eta), eta * eta / Q
    c = eta / Q * (1.0 - eta / Q)
    return (a - c + math.hypot(a - c, 2.0 * b)) / (2.0 * b)


def monte_carlo(e: float, beta: float, seed: int) -> float:
    """The ratio R by Boltzmann's equation: balls without places, paired at random.

    A pair collides with a probability in proportion to its speed of approach along a random
    normal. G. A. Bird, Molecular Gas Dynamics and the Direct Simulation of Gas Flows (1994).
    """
    rng, eta = np.random.default_rng(seed), Q * (1.0 + beta) / (2.0 * Q + 2.0)
    velocities, rims = rng.normal(size=(COPIES, 3)), np.zeros((COPIES, 3))  # rims: R w
    velocities -= velocities.mean(axis=0)  # it is kept, and would outlast the temperature
    collisions, ratios = 0.0, []
    while collisions < UNTIL_CONSTANT + MEASURED:
        one, two = rng.permutation(COPIES).reshape(2, -1)
        normals = rng.normal(size=(len(one), 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        closing = ((velocities[two] - velocities[one]) * normals).sum(axis=1)
        square = float((velocities**2).sum())
        limit = FASTEST * math.sqrt(square / (3.0 * COPIES))
        hits = -closing > limit * rng.uniform(size=len(one))
        one, two, normals, closing = one[hits], two[hits], normals[hits], closing[hits, None]
        relative = velocities[two] - velocities[one]
        slip = relative - np.cross(rims[one] + rims[two], normals)
        slip -= (slip * normals).sum(axis=1)[:, None] * normals
        change = -0.5 * (1.0 + e) * closing * normals - eta * slip  # of the second ball
        velocities[two] += change
        velocities[one] -= change
        turn = np.cross(normals, change) / Q
        rims[one] -= turn
        rims[two] -= turn
        collisions += 2.0 * len(one) / COPIES
        if collisions > UNTIL_CONSTANT:
            ratios.append(Q * float((rims**2).sum() / (velocities**2).sum()))
    return float(np.mean(ratios))


def simulated(e: float, beta: float, seed: int) -> float:
    """T_rot/T_tr between walls that are smooth, or where the gas keeps its energy, as rough."""
    gas = lattice_gas(PER_SIDE, PACKING, seed)
    rate, wall = enskog_rate(in_a_box(gas), 1.0), (HUGE, 1.0) if keeps(e, beta) else (0.0, 0.0)
    physics = Physics(
        restitution=Restitution((ELASTIC,) * 3, (e, 1.0, 0.0), 0.0),
        friction=Friction((wall,) * 3, (HUGE, beta)),
    )
    balls, collisions, sums = gas.balls, 0.0, []
    piece = PIECE / (rate * math.sqrt(gas.kt))
    while collisions < UNTIL_CONSTANT + MEASURED:
        result = simulate(Scene(gas.room, balls, physics, piece, record=()))
        balls, spins = result.balls, result.balls.spins
        collisions += 2.0 * result.collisions.balls / len(balls)
        assert spins is not None
        square = float((balls.velocities**2).sum())
        if collisions > UNTIL_CONSTANT:
            sums.append((Q * balls.radius**2 * float((spins**2).sum()), square))
        # Constant coefficients know no speed: the gas goes on as fast as it began.
        faster = 1.0 if keeps(e, beta) else math.sqrt(3.0 * len(balls) * gas.kt / square)
        balls = Balls(
            balls.positions, faster * balls.velocities, balls.diameter, spins=faster * spins
        )
    spinning, moving = np.array(sums).T
    return float(spinning.mean() / moving.mean() if keeps(e, beta) else (spinning / moving).mean())


def keeps(e: float, beta: float) -> bool:
    """Whether collisions keep the energy."""
    return e == 1.0 and abs(beta) == 1.0


def rows() -> Iterator[Row]:
    for e, beta in CASES:
        theory, error, way = mean_field(e, beta), 0.0, "keeps its energy"
        if not keeps(e, beta):
            way = f"cools, mean field: {theory:.4f}"
            copies = [monte_carlo(e, beta, seed) for seed in range(COPY_SEEDS)]
            theory, error = mean_and_half_width(np.array(copies))
        found = [simulated(e, beta, seed) for seed in range(SEEDS)]
        yield Row("rough spheres", f"e = {e}, beta0 = {beta}, {way}", "T_rot / T_tr",
                  theory, error, *mean_and_half_width(np.array(found)))  # fmt: skip
