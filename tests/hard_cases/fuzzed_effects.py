"""Effects of random scenes: few combinations, because each is compiled, with random numbers."""

import math
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

from sim_core import (
    AmplitudeProfile,
    BallCollisions,
    Drag,
    Flexure,
    Friction,
    Gravity,
    PartRotation,
    Physics,
    RandomPhase,
    Rest,
    Restitution,
    Roughness,
    TriangleMesh,
    Vibration,
    zener_parameter,
)
from sim_core.effects.drag import MIN_PIECE
from tests.hard_cases.outcome import CONSTANT
from tests.helpers.scenes.cavities import FLOOR
from tests.helpers.scenes.turning_parts import PART

SIZES = "sizes"  # beside the fields of Physics: balls of several diameters and densities
SONOTRODES = "sonotrodes"  # the same: a lid that vibrates as well as the floor
BENT = "bent"  # the same: the floor, and the lid if it vibrates, move least at the rim
LAWFUL = "gravity restitution ball_collisions"  # of a chamber that is of this world
FEW = (
    f"{LAWFUL} vibration rest friction drag roughness flexure",
    f"{LAWFUL} vibration random_phase friction drag roughness flexure {SIZES} {BENT}",
    f"{LAWFUL} vibration rest friction part_rotation flexure {SIZES}",
    "gravity restitution vibration random_phase rest friction drag part_rotation",
    f"{LAWFUL} vibration rest {SONOTRODES}",
)
MANY = (
    *FEW,
    f"{LAWFUL} vibration rest friction part_rotation",
    f"{LAWFUL} vibration rest friction drag {SIZES}",
    f"{LAWFUL} rest {SIZES}",
    f"{LAWFUL} vibration roughness part_rotation {SIZES}",
    f"{LAWFUL} vibration rest friction drag",
    f"{LAWFUL} vibration random_phase drag {SIZES}",
    f"{LAWFUL} vibration rest friction part_rotation roughness",
    f"{LAWFUL} vibration roughness flexure {SONOTRODES}",
    f"{LAWFUL} vibration rest {SONOTRODES} {BENT}",
    f"{LAWFUL} vibration rest friction part_rotation {BENT}",
    "ball_collisions roughness",
    f"{LAWFUL} vibration random_phase rest friction drag part_rotation",
    f"{LAWFUL} vibration",
    f"{LAWFUL} vibration rest",
    f"{LAWFUL} vibration rest friction drag part_rotation {SONOTRODES}",
    f"{LAWFUL} vibration drag {SIZES} {SONOTRODES}",
    f"{LAWFUL} vibration friction",
    f"{LAWFUL} vibration random_phase friction",
    f"{LAWFUL} friction drag part_rotation",
    f"{LAWFUL} rest friction",
    f"{LAWFUL} rest part_rotation drag",
    f"ball_collisions {SIZES}",
    "ball_collisions friction",
    "ball_collisions",
    "gravity restitution rest friction",
    "restitution drag",
)
RESTITUTIONS = (0.0, 1e-9, 0.05, 0.5, 0.9, 1.0 - 1e-12, 1.0)
TAGS = 4
MODULUS = 1e11  # Pa, of the contact
LID = 3


class Strengths(NamedTuple):
    """How much of each effect, where it is present; speeds and widths are those of shot and
    chamber.

    ``weight``: g wide / speed²; ``restitution``: e; ``elastic_below`` [speeds]; ``swing``:
    [diameters] of the floor, ``beat``: the face's peak speed; ``tip``: the part's speed at its tip,
    ``to_and_fro``: it swings; ``rough``: mu and beta0 of balls that start spinning, once for
    surfaces, once for balls; ``slope``: rms slope of the surfaces; ``fall``: of the
    amplitude from the middle of a bent face to its rim; ``give``: Zener's parameter at the
    shot's speed; ``slowing``: share of the air's
    deceleration that takes all of the speed on one width; ``spread``: smallest over largest
    diameter.
    """

    weight: float
    restitution: float
    elastic_below: float
    swing: float
    beat: float
    tip: float
    to_and_fro: bool
    rough: tuple[tuple[float, float], tuple[float, float]]
    slope: float
    fall: float
    give: float
    slowing: float
    spread: float


def powers(low: float, high: float) -> st.SearchStrategy[float]:
    """Ten to a number from low to high."""
    return st.floats(low, high).map(lambda exponent: 10.0**exponent)


def strengths() -> st.SearchStrategy[Strengths]:
    """Of any size, the extremes often."""
    rough = st.tuples(
        st.sampled_from([0.0, 0.1, 0.5, 10.0]) | powers(-3.0, 1.0), st.floats(-1.0, 1.0)
    )
    return st.builds(
        Strengths,
        weight=st.just(0.0) | powers(-3.0, 2.0),
        restitution=st.sampled_from(RESTITUTIONS) | st.floats(0.0, 1.0),
        elastic_below=st.sampled_from([1e-3, 0.03]),
        swing=st.just(0.0) | powers(-4.0, 0.4),
        beat=powers(-1.0, 1.0),
        tip=st.just(0.0) | powers(-2.0, 1.0),
        to_and_fro=st.booleans(),
        rough=st.tuples(rough, rough),
        slope=st.just(0.0) | powers(-3.0, -0.31),
        fall=st.just(0.0) | st.floats(0.0, 1.0),
        give=st.just(0.0) | powers(-3.0, 1.0),
        slowing=powers(-4.0, 0.5),
        spread=st.floats(0.2, 1.0),
    )


def physics_of(
    effects: frozenset[str],
    much: Strengths,
    wide: float,
    speed: float,
    diameter: float,
    mesh: TriangleMesh,
    seed: int,
) -> Physics:
    """The effects named, for a chamber ``wide`` [m] with its ``mesh``, and shot of so much
    ``speed`` [m/s].
    """
    middle = mesh.middle
    law = (much.restitution, CONSTANT if much.restitution == 1.0 else speed)
    amplitude = much.swing * diameter
    rate = much.tip * speed / (0.3 * wide)  # rad/s
    turn = PartRotation(PART, tuple(middle.tolist()), (0.1, -0.2, 1.0), rpm=60.0 * rate / math.tau)
    if much.to_and_fro:
        turn = turn._replace(rpm=None, amplitude=0.7, frequency=max(rate, 1e-6) / (0.7 * math.tau))
    # of steel, at speed: 3/4 C_d air / (rho D) = slowing / wide, with C_d 0.44
    air = much.slowing * 7800.0 * diameter / (0.33 * wide)
    floor = Vibration(
        FLOOR, amplitude, much.beat * speed / (math.tau * amplitude) if amplitude else 20e3
    )
    lid = Vibration(LID, 0.7 * amplitude, 0.83 * floor.frequency, 1.0, (0.0, 0.0, -1.0))
    if BENT in effects:
        fall = min(much.fall, 0.002 * wide / amplitude) if amplitude else much.fall
        points = ((0.0, 1.0), (0.5 * wide, 1.0 - 0.5 * fall), (2.0 * wide, 1.0 - fall))
        profile = AmplitudeProfile(points, tuple((middle + 0.1 * wide).tolist()))
        floor, lid = floor._replace(profile=profile), lid._replace(profile=profile)
    # Every other triangle is thin.
    mass = 7800.0 * math.pi / 6.0 * diameter**3
    unit = zener_parameter(1.0, MODULUS, 0.5 * diameter, mass, speed)
    mobility = np.where(np.arange(len(mesh.triangles)) % 2, much.give / unit, 0.0)
    present = Physics(
        Gravity(z=-much.weight * speed**2 / wide),
        Restitution((law,) * TAGS, law, much.elastic_below * speed),
        (floor, lid) if SONOTRODES in effects else floor,
        Rest(1e-3 * speed),
        turn,
        Friction((much.rough[0],) * TAGS, much.rough[1]),
        RandomPhase(seed),
        BallCollisions(),
        Drag(air, air * speed * diameter / 1e4, max(0.1 * wide / speed, MIN_PIECE)),
        Roughness((much.slope,) * TAGS, seed),
        Flexure(mobility, MODULUS),
    )
    return Physics(
        **{name: effect if name in effects else None for name, effect in present._asdict().items()}
    )
