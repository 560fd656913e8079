"""Many contacts at nearly one time: Newton's cradle, inelastic collapse, triple contact, dense
packings.
"""

import math

import numpy as np

from sim_core import Balls, Gravity, Physics, Restitution, Scene, pack_balls, simulate
from sim_core.scene.invariants import clearance, closest_pair, momentum
from tests.hard_cases.outcome import (
    Case,
    Claim,
    Outcome,
    Played,
    named,
    near,
    outcome_of,
    play,
    with_rest,
)
from tests.helpers.scenes.cavities import WEIGHTLESS, box
from tests.helpers.scenes.fuzzed_chambers import Chamber

DIAMETER = 3e-3  # m
ROOM = box((0.2, 0.2, 0.2))
MIDDLE = 0.1  # m
EVERY_TAG = 3


def with_losses(e: float, elastic_below: float = 0.01) -> Restitution:
    """The same constant e everywhere."""
    return Restitution(((e, 1e3),) * EVERY_TAG, (e, 1e3), elastic_below)


def row(places: list[float], speeds: list[float]) -> Balls:
    """Balls on a line along x through the middle of the room: x [m] from the first's place, and
    their speeds [m/s].
    """
    positions = np.full((len(places), 3), MIDDLE)
    positions[:, 0] += np.array(places) - 0.02
    velocities = np.zeros((len(places), 3))
    velocities[:, 0] = speeds
    return Balls(positions, velocities, DIAMETER)


def newtons_cradle() -> Outcome:
    """Five equal balls, 1 mm apart: each hands its whole velocity to the next."""
    gap, speed = 1e-3, 1.0
    balls = row([k * (DIAMETER + gap) for k in range(5)], [speed, 0, 0, 0, 0])
    pieces = (
        11  # each of half the time between two hits, so that the k-th hit lies inside piece 2 k + 1
    )
    seen = play(Chamber(ROOM, balls, Physics()), pieces * 0.5 * gap / speed, pieces)
    order = [int(one.velocities[:, 0].argmax()) for one in seen.track]
    return outcome_of(
        seen,
        "the last ball leaves with the first's velocity",
        near("velocities [m/s]", seen.end.velocities[:, 0], [0, 0, 0, 0, speed], 1e-15),
        near("sideways [m/s]", seen.end.velocities[:, 1:], np.zeros((5, 2)), 1e-15),
        near("hits", seen.pairs, 4, 0),
        Claim(
            order == sorted(order) and set(order) == set(range(5)), f"the moving ball was {order}"
        ),
    )


def newtons_cradle_touching() -> Outcome:
    """The same with no gap at all but the rounding of places: four hits at one time, one after the
    other.
    """
    balls = row([0.0, *(2 * DIAMETER + k * DIAMETER for k in range(4))], [1.0, 0, 0, 0, 0])
    seen = play(Chamber(ROOM, balls, Physics()), 5e-3)
    return outcome_of(
        seen,
        "the last ball leaves with the first's velocity",
        near("velocities [m/s]", seen.end.velocities[:, 0], [0, 0, 0, 0, 1.0], 1e-14),
        near("hits", seen.pairs, 4, 0),
    )


def newtons_cradle_with_two() -> Outcome:
    """Two in, two out: elastic hits in a row exchange velocities, so that their order along the row
    is kept.
    """
    balls = row(
        [0.0, DIAMETER + 1e-6, *(5 * DIAMETER + k * (DIAMETER + 1e-6) for k in range(3))],
        [2.0, 2.0, 0, 0, 0],
    )
    seen = play(Chamber(ROOM, balls, Physics()), 8e-3)
    return outcome_of(
        seen,
        "two balls come, two balls leave",
        near("velocities [m/s]", seen.end.velocities[:, 0], [0, 0, 0, 2.0, 2.0], 1e-14),
        near("hits", seen.pairs, 6, 0),
    )


def never_warmer(seen: Played) -> Claim:
    """Kinetic energy does not grow without gravity, whatever is lost."""
    energy = np.array([float((one.velocities**2).sum()) for one in seen.track])
    worst = float((energy[1:] / energy[:-1]).max())
    return Claim(worst <= 1.0 + 1e-12, f"energy grows by {worst - 1.0:.2g}")


def inelastic_collapse_of_three() -> Outcome:
    """Two balls close on a third with e below 7 - 4 sqrt(3): infinitely many hits in finite time.

    McNamara & Young, Phys. Fluids A 4 (1992) 496. With a finite precision they end: together,
    momentum kept.
    """
    e = 0.05
    balls = row([0.0, 0.02, 0.04], [1.0, 0.1, -1.0])
    seen = play(Chamber(ROOM, balls, Physics(WEIGHTLESS, with_losses(e, 0.0))), 0.05, 5)
    mean = 0.1 / 3.0
    return outcome_of(
        seen,
        "they go on together with the momentum they had",
        near("velocities [m/s]", seen.end.velocities[:, 0], np.full(3, mean), 1e-9),
        near("momentum", momentum(seen.end)[0] / momentum(balls)[0], 1.0, 1e-12),
        Claim(seen.collisions < 1000, f"{seen.collisions} hits"),
        never_warmer(seen),
    )


def collapse_of_a_row_between_walls() -> Outcome:
    """Twenty balls in a row, e = 0.5 between themselves and at the walls: collapses within the
    first traverse.
    """
    rng = np.random.default_rng(5)
    balls = row([k * 2 * DIAMETER for k in range(20)], list(rng.normal(0.0, 1.0, 20)))
    seen = play(Chamber(ROOM, balls, Physics(WEIGHTLESS, with_losses(0.5))), 2.0, 20)
    along = seen.end.positions[:, 0]
    return outcome_of(
        seen,
        "keeps its order and cools",
        Claim(bool((np.diff(along) > 0.0).all()), "balls have passed through each other"),
        Claim(
            seen.events / seen.duration < 1e6, f"{seen.events / seen.duration:.2g} events a second"
        ),
        never_warmer(seen),
    )


def collapse_of_a_cloud() -> Outcome:
    """A hundred balls without gravity, e = 0.3: it cools into clusters."""
    rng = np.random.default_rng(6)
    room = box((0.03, 0.03, 0.03))
    balls = Balls(pack_balls(room, 100, DIAMETER, rng), rng.normal(0.0, 1.0, (100, 3)), DIAMETER)
    seen = play(Chamber(room, balls, Physics(WEIGHTLESS, with_losses(0.3, 1e-6))), 1.0, 20)
    share = float((seen.end.velocities**2).sum() / (balls.velocities**2).sum())
    return outcome_of(
        seen,
        "cools into clusters in a bounded number of events",
        Claim(share < 0.01, f"has kept {share:.2g} of its energy"),
        Claim(
            seen.events / seen.duration < 1e6, f"{seen.events / seen.duration:.2g} events a second"
        ),
        never_warmer(seen),
    )


def pile_coming_to_rest() -> Outcome:
    """Fifty balls settle in a box under gravity, e = 0.5: they lie still after a second, and cost
    nothing then.
    """
    rng = np.random.default_rng(7)
    room = box((0.012, 0.012, 0.06))
    balls = Balls(pack_balls(room, 50, DIAMETER, rng), rng.normal(0.0, 0.5, (50, 3)), DIAMETER)
    seen = play(
        Chamber(room, balls, with_rest(Physics(Gravity(), with_losses(0.5)))), 2.0, 20, record=()
    )
    speed = float(np.abs(seen.end.velocities).max())
    return outcome_of(
        seen,
        "lies still in the end",
        Claim(speed < 1e-2, f"still at {speed:.2g} m/s"),
        Claim(
            seen.events / seen.duration < 1e5, f"{seen.events / seen.duration:.2g} events a second"
        ),
    )


def triple_contact() -> Outcome:
    """A ball flies between two that touch, at both at once. Which comes first is open; momentum and
    energy are not.
    """
    half = 0.5 * DIAMETER
    positions = np.array(
        [
            [MIDDLE - 0.02, MIDDLE, MIDDLE],
            [MIDDLE, MIDDLE + half, MIDDLE],
            [MIDDLE, MIDDLE - half, MIDDLE],
        ]
    )
    velocities = np.array([[1.0, 0, 0], [0, 0, 0], [0, 0, 0]])
    balls = Balls(positions, velocities, DIAMETER)
    seen = play(Chamber(ROOM, balls, Physics()), 0.03)
    end = seen.end
    apart = end.positions[:, None] - end.positions
    closing = ((end.velocities[:, None] - end.velocities) * apart).sum(axis=2)
    return outcome_of(
        seen,
        "momentum and energy are kept and all fly apart",
        near("momentum", momentum(end) / momentum(balls)[0], [1.0, 0.0, 0.0], 1e-14),
        near("energy", (end.velocities**2).sum(), 1.0, 1e-14),
        Claim(bool((closing >= 0.0).all()), "two still approach"),
        Claim(bool((end.velocities[1:, 0] > 0.0).all()), "one of the two was not hit"),
    )


def four_balls_close_on_one() -> Outcome:
    """From the corners of a tetrahedron at one speed: momentum stays none, the energy what it
    was.
    """
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / math.sqrt(3.0)
    positions = MIDDLE + np.concatenate([[[0.0, 0, 0]], 0.01 * corners])
    balls = Balls(positions, np.concatenate([[[0.0, 0, 0]], -2.0 * corners]), DIAMETER)
    seen = play(Chamber(ROOM, balls, Physics()), 0.02)
    return outcome_of(
        seen,
        "momentum and energy are kept",
        near("momentum over m", seen.end.velocities.sum(axis=0), np.zeros(3), 1e-13),
        near("energy", (seen.end.velocities**2).sum(), 16.0, 1e-12),
    )


def crystal(
    side: int, share: float, jitter: float, rng: np.random.Generator
) -> tuple[Chamber, float]:
    """A face-centred cubic crystal of 4 side³ balls that fills ``share`` of its box, each moved by
    up to ``jitter`` of the free gap; and the share. Elastic, no gravity.
    """
    count = 4 * side**3
    wide = (count * math.pi / 6.0 / share) ** (1.0 / 3.0) * DIAMETER
    apart = (wide - DIAMETER) / (side - 0.5)  # of cells; neighbours are apart / sqrt(2)
    gap = apart / math.sqrt(2.0) - DIAMETER
    cells = np.stack(np.meshgrid(*[np.arange(side)] * 3), axis=-1).reshape(-1, 3)
    basis = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])
    positions = 0.5 * DIAMETER + apart * (cells[:, None] + basis).reshape(-1, 3)
    moved = rng.normal(size=(count, 3))
    moved *= jitter * 0.5 * gap / np.linalg.norm(moved, axis=1)[:, None]
    inside = np.clip(positions + moved, 0.5 * DIAMETER, wide - 0.5 * DIAMETER)
    room = box((wide, wide, wide))
    return Chamber(
        room, Balls(inside, rng.normal(0.0, 1.0, (count, 3)), DIAMETER), Physics()
    ), share


def packing_of_64_percent() -> Outcome:
    """A jittered crystal at the share of random close packing, half the free volume of the gaps
    gone.
    """
    chamber, share = crystal(6, 0.64, 0.9, np.random.default_rng(8))
    seen = play(chamber, 0.005, 5, record=())
    return outcome_of(
        seen,
        f"{len(chamber.balls)} balls fill {share:.0%} of the box and keep their energy",
        Claim(seen.pairs > 50 * len(chamber.balls), f"only {seen.pairs} hits"),
    )


def compressed(count: int, closer: float, rng: np.random.Generator) -> tuple[Chamber, float]:
    """An elastic gas whose balls grow, to what the narrowest gap allows, until they hardly can; and
    its packing.

    Stepwise event-driven compression after Lubachevsky & Stillinger, J. Stat. Phys. 60 (1990) 561:
    irregular, unlike a crystal. Stops when the balls have grown by less than ``closer`` [-] over
    twenty steps. The packing is a share of the whole box; balls cannot be as dense at its walls as
    in its middle.
    """
    side = 0.01
    room = box((side, side, side))
    diameter = side * (0.2 / count * 6.0 / math.pi) ** (1.0 / 3.0)
    velocities = rng.normal(0.0, 1.0, (count, 3))
    balls = Balls(pack_balls(room, count, diameter, rng), velocities, diameter)
    step = 2e-3
    history = [diameter]
    while len(history) <= 20 or history[-1] > history[-21] * (1.0 + closer):
        end = simulate(Scene(room, balls, Physics(), step, record=())).balls
        gap = 2.0 * float(clearance(room.corners, end.positions, side).min())
        diameter = min(gap, closest_pair(end)[0]) * (1.0 - 1e-12)
        step = max(2e-5, step * 0.97)
        balls = Balls(end.positions, end.velocities, diameter)
        history.append(diameter)
    return Chamber(room, balls, Physics()), count * math.pi / 6.0 * (diameter / side) ** 3


def random_packing_compressed() -> Outcome:
    """Balls grown to an irregular packing: some touch all but for rounding."""
    chamber, share = compressed(150, 5e-4, np.random.default_rng(9))
    seen = play(chamber, 5e-4, 4, record=())
    return outcome_of(
        seen,
        f"irregular, {share:.0%} of the box filled, keeps its energy",
        Claim(share > 0.5, f"only {share:.0%} filled"),
        Claim(seen.pairs > 10 * len(chamber.balls), f"only {seen.pairs} hits"),
    )


CASES = [
    named(newtons_cradle),
    named(newtons_cradle_touching),
    named(newtons_cradle_with_two),
    named(inelastic_collapse_of_three),
    named(collapse_of_a_row_between_walls),
    named(collapse_of_a_cloud),
    named(pile_coming_to_rest, needs_rest=True),
    named(triple_contact),
    named(four_balls_close_on_one),
    Case("packing of 64 %", packing_of_64_percent),
    Case("random packing compressed", random_packing_compressed, long=True),
]
