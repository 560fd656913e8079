"""Gaps about as wide as a ball: slots, a sonotrode too near the part, wedges."""

import math

import numpy as np

from sim_core import (
    Balls,
    Physics,
    Scene,
    SceneError,
    SimulationError,
    TriangleMesh,
    Vibration,
    pack_balls,
    simulate,
)
from tests.hard_cases.outcome import (
    LOSSLESS,
    ROUNDING,
    Case,
    Claim,
    Outcome,
    named,
    near,
    outcome_of,
    play,
    refusal,
)
from tests.helpers.scenes.cavities import CEILING, FLOOR, WEIGHTLESS, box
from tests.helpers.scenes.fuzzed_chambers import Chamber

RADIUS = 1.5e-3  # m
SPEED = 1.0  # m/s
BOUNCES = 1000


def slot(more: float) -> tuple[TriangleMesh, Balls]:
    """A slot 2 r + ``more`` [m] wide along z, open for 2 cm along x and y, and a ball in its
    middle, thrown upwards.
    """
    room = box((0.02, 0.02, 2.0 * RADIUS + more), centre=(0.0, 0.0, 0.0))
    return room, Balls(np.zeros((1, 3)), np.array([[0.0, 0.0, SPEED]]), 2.0 * RADIUS)


def slot_wider_by(more: float) -> Outcome:
    """A ball goes to and fro once every 2 (w - 2 r)/v, without gravity and losses."""
    room, ball = slot(more)
    width = (
        float(np.ptp(room.vertices[:, 2])) - 2.0 * RADIUS
    )  # the gap there is, after rounding of the corners
    period = width / SPEED
    seen = play(Chamber(room, ball, Physics()), (BOUNCES + 0.25) * period)
    # a wall lies where rounding of its coordinates puts it; each crossing is off by that at most
    off = ROUNDING * RADIUS / SPEED
    sides = room.tags[seen.triangle[: len(seen.time)]]
    return outcome_of(
        seen,
        f"{SPEED / (2.0 * width):.3g} times to and fro a second",
        near("bounces", len(seen.time), BOUNCES, 0),
        near("time of the last [s]", seen.time[-1], (BOUNCES - 0.5) * period, BOUNCES * off),
        near("speed [m/s]", seen.normal_speed, np.full(len(seen.time), SPEED), 0.0),
        Claim(
            bool((sides[::2] == CEILING).all() and (sides[1::2] == FLOOR).all()),
            "one side was met twice",
        ),
    )


def slot_narrower_by(less: float) -> Outcome:
    """There is no place for a rigid ball: refused at the door, with both sides named where the ball
    touches both.
    """
    room, ball = slot(-less)
    return refusal(
        lambda: Scene(room, ball, Physics(), 1.0),
        r"ball 0 at .* (overlaps a surface|does not fit between triangle \d+ and triangle \d+: .* "
        r"by \S+ m; widen it)",
        SceneError,
    )


def upright_slot_narrower_than_two_balls() -> Outcome:
    """The first of those that do not fit is named."""
    room = box((2.0 * RADIUS - 1e-11, 0.02, 0.02), centre=(0.0, 0.0, 0.0))
    balls = Balls(np.array([[0.0, 5e-3, 0.0], [0.0, -5e-3, 0.0]]), np.zeros((2, 3)), 2.0 * RADIUS)
    return refusal(
        lambda: Scene(room, balls, Physics(), 1.0),
        r"ball 0 at .* narrower than the ball by 1e-11 m;",
    )


def slot_too_tight_for_a_second() -> Outcome:
    """A picometre of play means 10^12 bounces a second: that is said, instead of being worked on
    for ever.
    """
    room, ball = slot(1e-12)
    return refusal(
        lambda: simulate(Scene(room, ball, Physics(), 1.0)),
        "jams at .* as wide as the ball",
        SimulationError,
    )


def slot_just_as_wide() -> Outcome:
    """No play at all: a ball moves along it for ever, and not across."""
    room, ball = slot(0.0)
    along = Balls(ball.positions, np.array([[SPEED, 0.0, 0.0]]), ball.diameter)
    seen = play(Chamber(room, along, Physics()), 1.0)
    way = 0.02 - 2.0 * RADIUS
    times = (0.5 * way + way * np.arange(60)) / SPEED
    return outcome_of(
        seen,
        "goes to and fro along the slot, touching both sides",
        near("times [s]", seen.time, times[times < 1.0], 1e-12),
        near("across [m]", seen.end.positions[0, 2], 0.0, 1e-18),
    )


AMPLITUDE = 25e-6  # m


def _low_room(clear: float) -> TriangleMesh:
    """Floor (the sonotrode, at rest) to ceiling (the part) is a ball's diameter and ``clear``
    [m].
    """
    return box((0.02, 0.02, 2.0 * RADIUS + clear))


def _swinging(phase: float = 0.0) -> Physics:
    return Physics(WEIGHTLESS, LOSSLESS, Vibration(FLOOR, AMPLITUDE, 20e3, phase))


def sonotrode_nearer_than_a_ball() -> Outcome:
    """Packing refuses: no ball fits."""
    rng = np.random.default_rng(1)
    return refusal(
        lambda: pack_balls(_low_room(-1e-4), 1, 2.0 * RADIUS, rng, AMPLITUDE),
        "3 mm fits .* narrower than the ball",
    )


def sonotrode_nearer_than_a_ball_and_its_swing() -> Outcome:
    """At rest a ball would fit, at the crest it would not: packing refuses that too."""
    rng = np.random.default_rng(1)
    return refusal(
        lambda: pack_balls(_low_room(0.5 * AMPLITUDE), 1, 2.0 * RADIUS, rng, AMPLITUDE),
        "narrower than the ball",
    )


def ball_in_a_room_too_low() -> Outcome:
    """Put there by hand, it overlaps."""
    ball = Balls(np.array([[0.01, 0.01, RADIUS - 5e-5]]), np.zeros((1, 3)), 2.0 * RADIUS)
    return refusal(
        lambda: Scene(_low_room(-1e-4), ball, _swinging(), 1.0), "ball 0 at .* (overlaps|inside)"
    )


def ball_crushed_by_the_sonotrode() -> Outcome:
    """It fits at the phase of the start, and is caught between two rigid bodies a quarter period
    later: no motion of a rigid ball is right, so that it must be said.
    """
    ball = Balls(
        np.array([[0.01, 0.01, RADIUS + 0.25 * AMPLITUDE]]), np.zeros((1, 3)), 2.0 * RADIUS
    )
    return refusal(
        lambda: Scene(_low_room(0.5 * AMPLITUDE), ball, _swinging(-0.5), 0.1),
        r"ball 0 .* the vibrating surface \(triangle \d+\).* narrower .* by 1.25e-05 m at the end "
        "of its swing",
        SceneError,
    )


def ball_with_just_the_swing_for_room() -> Outcome:
    """As wide as the ball at the crest: it fits, whatever the phase. Beside a wall it does not
    matter how the face swings: nothing nears there.
    """
    for phase in (-0.5 * math.pi, -0.5, 0.5 * math.pi):
        lift = AMPLITUDE * max(0.0, math.sin(phase))
        here = np.array([[RADIUS, 0.01, RADIUS + lift]])
        Scene(
            _low_room(AMPLITUDE), Balls(here, np.zeros((1, 3)), 2.0 * RADIUS), _swinging(phase), 0.1
        )
    return Outcome("", True, "allowed")


def ball_in_a_wedge_by_rounding() -> Outcome:
    """It overlaps both sides of a corner by less than is asked of it: no gap, it can move out, so
    it is let in.
    """
    less = RADIUS - 5e-10
    ball = Balls(np.array([[less, less, less]]), np.zeros((1, 3)), 2.0 * RADIUS)
    Scene(box((0.02, 0.02, 0.02)), ball, Physics(), 0.1)
    return Outcome("", True, "allowed")


def ball_with_room_above_the_crest() -> Outcome:
    """A hair more than the swing: the ball rattles, and never overlaps. Elastic: who is hit gains,
    so few periods.
    """
    clear = 1.2 * AMPLITUDE
    ball = Balls(
        np.array([[0.01, 0.01, RADIUS + 0.9 * clear]]), np.array([[0.3, 0.2, -0.5]]), 2.0 * RADIUS
    )
    seen = play(Chamber(_low_room(clear), ball, _swinging()), 2e-3, 20)
    return outcome_of(
        seen,
        "rattles between sonotrode and part",
        Claim(seen.collisions > 40, f"only {seen.collisions} hits in forty periods"),
        near("speed along the floor [m/s]", np.abs(seen.end.velocities[0, :2]), [0.3, 0.2], 0.0),
    )


def design_with_a_part_nearer_than_a_ball() -> Outcome:
    """The design itself is refused, with both fields named."""
    from chamberopt.common.errors import InputError
    from tests.helpers.synthetic import plate_design

    return refusal(
        lambda: plate_design(chamber__sonotrode_distance_mm=2.5),
        r"shot.diameter_mm: .* chamber.sonotrode_distance_mm = 2.5",
        InputError,
    )


def design_with_a_part_nearer_than_a_ball_and_its_swing() -> Outcome:
    """At rest a ball would fit under the part, at the crest it would be crushed: refused, with the
    swing named.
    """
    from chamberopt.common.errors import InputError
    from tests.helpers.synthetic import plate_design

    return refusal(
        lambda: plate_design(chamber__sonotrode_distance_mm=3.01),
        r"shot.diameter_mm: given 3, .* chamber.sonotrode_distance_mm = 3.01 less the amplitude",
        InputError,
    )


def wedge() -> Outcome:
    """Into a wedge along its plane of symmetry, nearly: mirrored at each wall, the path is a
    straight line through a fan of images of the wedge, and crosses as many of their walls as lie
    between its two ends.
    """
    angle = math.radians(10.0)
    across = math.tan(math.radians(5.2))  # so that the last crossing is well before the far wall
    slope = math.tan(0.5 * angle)
    length, depth = 0.1, 0.02
    outline = [(0.0, 0.0), (length, -length * slope), (length, length * slope)]
    front, back = ([(x, y, z) for x, z in outline] for y in (0.0, depth))
    triangles = [
        (0, 1, 2),
        (3, 5, 4),
        (0, 3, 4),
        (0, 4, 1),
        (1, 4, 5),
        (1, 5, 2),
        (2, 5, 3),
        (2, 3, 0),
    ]
    far, side = 2, 1
    mesh = TriangleMesh(
        np.array([*front, *back]), triangles, np.array([0, 0, side, side, far, far, side, side])
    )
    start = Balls(np.array([[0.09, 0.01, 0.0]]), np.array([[-1.0, 0.0, across]]), 2.0 * RADIUS)
    seen = play(Chamber(mesh, start, Physics()), 0.3)
    ends = np.flatnonzero(mesh.tags[seen.triangle] == far)
    hits = math.floor((math.pi - math.atan(across) - 0.5 * angle) / angle) + 1
    return outcome_of(
        seen,
        f"comes out of the wedge after {hits} hits",
        near("hits before the far wall", ends[0] if len(ends) else len(seen.time), hits, 0),
    )


CASES = [
    *(
        Case(f"slot 2r + {more:g} m", lambda more=more: slot_wider_by(more))
        for more in (1e-12, 1e-9, 1e-7, 1e-5, 1e-3)
    ),
    *(
        Case(f"slot 2r - {less:g} m", lambda less=less: slot_narrower_by(less))
        for less in (1e-12, 1e-9, 1e-6)
    ),
    named(slot_too_tight_for_a_second),
    named(slot_just_as_wide),
    named(upright_slot_narrower_than_two_balls),
    named(sonotrode_nearer_than_a_ball),
    named(sonotrode_nearer_than_a_ball_and_its_swing),
    named(ball_in_a_room_too_low),
    named(ball_crushed_by_the_sonotrode),
    named(ball_with_just_the_swing_for_room),
    named(ball_in_a_wedge_by_rounding),
    named(ball_with_room_above_the_crest),
    named(design_with_a_part_nearer_than_a_ball),
    named(design_with_a_part_nearer_than_a_ball_and_its_swing),
    named(wedge),
]
