"""Several sonotrodes at once, each with its own axis, amplitude, frequency and phase, against a
bead between two vibrating plates whose every flight is searched for its end in small steps.
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from sim_core import Balls, Gravity, ImpactLog, Physics, Scene, TriangleMesh, Vibration, simulate
from sim_core.effects.gravity import STANDARD
from tests.helpers.scenes.cavities import CEILING, ELASTIC, FLOOR, SIDES, WEIGHTLESS, box
from tests.sim_core.geometry.test_sonotrode_border import trough

R = 1.5e-3  # m
TOP = 0.02  # m
PARTED = 3  # tag
UP, DOWN, EAST = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)
STEPS = 600  # a period of the faster plate
STRONG = (Vibration(FLOOR, 25e-6, 20e3, 0.4), Vibration(CEILING, 40e-6, 19.7e3, 2.0, DOWN))
# so weak that an error grows by a few per cent a hit
WEAK = (Vibration(FLOOR, 2e-6, 210.0, 0.4), Vibration(CEILING, 1e-6, 333.3, 2.0, DOWN))


def angle(plate: Vibration, time: np.ndarray) -> np.ndarray:
    """Of the wave, less whole turns before digits are lost: frequency x time in 64 bits of
    mantissa.
    """
    turns = np.asarray(time, dtype=np.longdouble) * np.longdouble(plate.frequency)
    return np.asarray(math.tau * (turns - np.floor(turns)).astype(float) + plate.phase)


def height(plate: Vibration, time: np.ndarray) -> np.ndarray:
    """Of the plate above its rest [m]: floor and ceiling are upright."""
    return plate.axis[2] * plate.amplitude * np.sin(angle(plate, time))


def speed(plate: Vibration, time: np.ndarray) -> np.ndarray:
    """Upward [m/s]."""
    return plate.axis[2] * plate.peak_speed * np.cos(angle(plate, time))


def next_hit(
    plates: tuple[Vibration, ...], start: float, z: float, v: float, g: float, last: int
) -> tuple[float, int]:
    """How long [s] until the bead, at z with speed v, meets which plate: 0 floor, 1 ceiling; it
    leaves the ``last``.
    """

    def gap(s: np.ndarray, k: int) -> np.ndarray:
        at = z + v * s - 0.5 * g * s * s
        plate = height(plates[k], start + s)
        return at - R - plate if k == 0 else TOP + plate - R - at

    step = 1.0 / (STEPS * max(plate.frequency for plate in plates))
    fastest = (
        math.sqrt(v * v + 2.0 * g * TOP) + g * 100.0 * step
    )  # of the bead, while it goes from plate to plate
    begin = 0.0
    while True:
        at = z + v * begin - 0.5 * g * begin * begin
        clear = min(
            at - R - plates[0].amplitude, TOP - R - plates[1].amplitude - at
        )  # of both swings
        if clear > fastest * step:
            begin += clear / fastest
            continue
        s = begin + step * np.arange(20 * STEPS + 1)
        ends = []
        for k in (0, 1):
            gaps = gap(s, k)
            skip = 1 if begin == 0.0 and k == last else 0  # where it leaves the plate it touches it
            below = np.flatnonzero(gaps[skip:] < 0.0)
            if len(below):
                i = below[0] + skip
                ends.append((brentq(gap, s[i - 1], s[i], (k,), xtol=1e-18, rtol=1e-15), k))
        if ends:
            return min(ends)
        begin = float(s[-1])


def box_log(plates: tuple[Vibration, ...], duration: float, g: float, v: float = 1.0) -> ImpactLog:
    room = box((0.03, 0.03, TOP))
    ball = Balls(np.array([[0.011, 0.013, 0.008]]), np.array([[0.0, 0.0, v]]), 2 * R)
    return simulate(Scene(room, ball, Physics(Gravity(z=-g), ELASTIC, plates), duration)).impacts


def plates_hit(log: ImpactLog, room: TriangleMesh) -> np.ndarray:
    tags = room.tags[log.triangle]
    assert np.isin(tags, [FLOOR, CEILING]).all()
    return np.where(tags == FLOOR, 0, 1)


@pytest.mark.long
@pytest.mark.parametrize("g", [0.0, STANDARD])
def test_a_bead_between_two_gentle_plates_follows_its_reference_for_hundreds_of_hits(
    g: float,
) -> None:
    log = box_log(WEAK, 4.0, g)
    which = plates_hit(log, box((0.03, 0.03, TOP)))
    now, z, v, last = 0.0, 0.008, 1.0, -1
    assert len(log) > 150
    for n in range(len(log)):
        flight, last = next_hit(WEAK, now, z, v, g, last)
        now, z, v = now + flight, z + v * flight - 0.5 * g * flight * flight, v - g * flight
        assert last == which[n]
        assert log.time[n] == pytest.approx(now, abs=1e-9)
        v = 2.0 * float(speed(WEAK[last], now)) - v


@pytest.mark.parametrize(
    ("g", "v", "duration"), [(0.0, 1.0, 1.5), (STANDARD, 1.0, 1.5), (0.0, -0.05, 60.0)]
)
def test_each_hit_gives_twice_the_plates_speed_and_the_next_comes_on_time(
    g: float, v: float, duration: float
) -> None:
    """Such plates throw a bead about by chance, so that each flight is followed anew from where it
    began.
    """
    plates = STRONG if duration < 10.0 else tuple(p._replace(amplitude=1e-9) for p in STRONG)
    log = box_log(plates, duration, g, v)
    which = plates_hit(log, box((0.03, 0.03, TOP)))
    shift = np.where(which == 0, height(plates[0], log.time), height(plates[1], log.time))
    np.testing.assert_allclose(
        log.position[:, 2], np.where(which == 0, R, TOP - R) + shift, atol=1e-12
    )
    shaken = np.where(which == 0, speed(plates[0], log.time), speed(plates[1], log.time))
    before = log.velocity[:, 2] + shaken  # the log has it as the plate sees it
    after = shaken - log.velocity[:, 2]
    np.testing.assert_allclose(after[:-1] - g * np.diff(log.time), before[1:], atol=1e-8)
    np.testing.assert_allclose(after - before, 2.0 * (shaken - before), atol=1e-12)
    assert len(log) > 100
    for n in range(0, len(log) - 1, 1 + len(log) // 100):
        flight, last = next_hit(plates, log.time[n], log.position[n, 2], after[n], g, which[n])
        assert last == which[n + 1]
        assert log.time[n + 1] - log.time[n] == pytest.approx(flight, abs=1e-11)


def test_the_same_chamber_upside_down_gives_the_same_upside_down() -> None:
    room = box((0.03, 0.03, TOP), (0.0, 0.0, 0.0))
    places = np.array([[0.003, 0.004, 0.001], [-0.006, 0.005, -0.002], [-0.004, -0.005, 0.004]])
    speeds = np.array([[0.2, 0.1, 1.0], [-0.1, 0.3, 0.7], [0.3, -0.2, -0.8]])
    flip = np.array([1.0, 1.0, -1.0])
    exchanged = (WEAK[1]._replace(tag=FLOOR, axis=UP), WEAK[0]._replace(tag=CEILING, axis=DOWN))
    down, up = (
        simulate(
            Scene(
                room,
                Balls(turn * places, turn * speeds, 2 * R),
                Physics(WEIGHTLESS, ELASTIC, plates),
                0.3,
            )
        )
        for turn, plates in ((1.0, WEAK), (flip, exchanged))
    )
    assert down.collisions == up.collisions
    assert down.collisions.sonotrode > 20
    np.testing.assert_allclose(down.balls.positions, flip * up.balls.positions, atol=1e-9)
    np.testing.assert_allclose(down.balls.velocities, flip * up.balls.velocities, atol=1e-6)


def test_a_wall_that_goes_to_and_fro_gives_its_own_speed_along_its_own_axis() -> None:
    """Floor and side walls, of which two face the ball: each hit changes one component by twice
    that face's speed.
    """
    sides = Vibration(SIDES, 15e-6, 23.1e3, 1.0, EAST)
    room = box((0.03, 0.03, TOP))
    ball = Balls(np.array([[0.011, 0.013, 0.008]]), np.array([[1.3, 0.0, 0.9]]), 2 * R)
    log = simulate(Scene(room, ball, Physics(WEIGHTLESS, ELASTIC, (STRONG[0], sides)), 1.0)).impacts
    tags = room.tags[log.triangle]
    assert {FLOOR, CEILING, SIDES} <= set(tags.tolist())
    velocity = np.array([1.3, 0.0, 0.9])
    for tag, time, seen in zip(tags, log.time, log.velocity, strict=True):
        face = {FLOOR: (STRONG[0], 2), SIDES: (sides, 0)}.get(int(tag))
        shaken = np.zeros(3)
        if face is not None:
            shaken[face[1]] = face[0].peak_speed * np.cos(angle(face[0], time))
        np.testing.assert_allclose(seen, velocity - shaken, atol=1e-8)
        velocity[face[1] if face is not None else 2] *= -1.0
        velocity += 2.0 * shaken


def ridge(second: int) -> TriangleMesh:
    """A floor in one plane, in two by a ridge of 80 degrees: the left of tag FLOOR, the right of
    tag ``second``.
    """
    room = trough([(0.021, 0.006), (0.022, 0.0), (0.04, 0.0)])
    level = (room.corners[:, :, 2] == 0.0).all(axis=1)
    right = level & (room.corners[:, :, 0] > 0.021).all(axis=1)
    return TriangleMesh(room.vertices, room.triangles, np.where(right, second, room.tags))


@pytest.mark.parametrize("first", [0, 1])
def test_two_faces_in_one_plane_are_hit_at_their_own_times(first: int) -> None:
    """Whichever of the two is given first; the balls fall so slowly that their hits show the
    phase.
    """
    room = ridge(PARTED)
    plates = (Vibration(FLOOR, 25e-6, 20e3, 0.0), Vibration(PARTED, 25e-6, 20e3, 3.0))
    ball = Balls(
        np.array([[0.01, 0.02, 0.0016], [0.031, 0.02, 0.0016]]),
        np.tile([0.0, 0.0, -0.4], (2, 1)),
        2 * R,
    )
    log = simulate(
        Scene(room, ball, Physics(WEIGHTLESS, ELASTIC, (plates[first], plates[1 - first])), 0.005)
    ).impacts
    for k, plate in enumerate(plates):
        own = log.ball == k
        expected, _ = next_hit((plate, STRONG[1]), 0.0, 0.0016, -0.4, 0.0, -1)
        assert log.time[own][0] == pytest.approx(expected, abs=1e-12)
        assert (room.tags[log.triangle[own]] == plate.tag)[:1].all()
    assert abs(log.time[log.ball == 0][0] - log.time[log.ball == 1][0]) > 1e-6
