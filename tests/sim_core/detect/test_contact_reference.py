"""The contact checks notice a contact that is early, late, missing, or of a ball that leaves."""

import math

import numpy as np
import pytest

from sim_core.effects.gravity import STANDARD as G
from sim_core.geometry.obstacles import NUMBERS
from tests.helpers.contacts.reference import (
    ContactErrors,
    check_capsules,
    check_faces,
    check_meetings,
    check_triangles,
    check_waves,
)

RADIUS = 1.5e-3
LIMIT = 0.01
OFF = 2e-12  # m: twice what the tests allow
# A ball 2 mm above touching falls at 1 m/s: contact where 2 mm = 1 t + g t²/2. It is over the
# middle of a triangle, an edge, another ball, or a plane that does not vibrate to speak of.
HEIGHT, SPEED = 2e-3, 1.0
CONTACT = 2 * HEIGHT / (SPEED + math.sqrt(SPEED**2 + 2 * G * HEIGHT))
STRAIGHT = HEIGHT / SPEED  # two balls: no gravity between them
TRIANGLE = np.array(
    [[-0.01, -0.01, 0.0], [0.0, 0.01, 0.0], [0.01, -0.01, 0.0]]
)  # clockwise from above


def errors_of(check: str, found: float, upwards: bool = False) -> ContactErrors:
    """The errors on a reported contact; ``upwards``: of a ball that starts in touch and leaves at
    1 m/s.
    """
    height, speed = (0.0, SPEED) if upwards else (HEIGHT, -SPEED)
    flight = np.array([[0.0, 0.0, RADIUS + height, 0.0, 0.0, speed, 0.0, 0.0, -G]])
    said = np.array([found])
    if check == "face":
        return check_faces(TRIANGLE[None], flight, RADIUS, 1e-8, LIMIT, said)[0]
    if check == "capsule":
        return check_capsules(
            np.array([[[-0.01, 0.0, 0.0], [0.01, 0.0, 0.0]]]), flight, RADIUS, LIMIT, said
        )
    if check == "meeting":
        return check_meetings(flight[:, :3], flight[:, 3:6], np.array([RADIUS]), LIMIT, said)
    if check == "wave":
        plane = np.zeros((1, NUMBERS))
        plane[0, 2:4] = 1.0, RADIUS
        wave = np.array([[1e-30, 1e5, 0.0, 0.0, 0.0, 1.0]])
        return check_waves(plane, wave, flight, np.zeros(1), RADIUS, np.array([LIMIT]), said)
    return check_triangles(
        TRIANGLE[None, None], flight, RADIUS, np.array([LIMIT]), said, 1e-12, 0.0
    )


@pytest.mark.parametrize("check", ["face", "capsule", "meeting", "wave", "mesh"])
def test_every_check_notices_a_wrong_contact(check: str) -> None:
    contact = STRAIGHT if check == "meeting" else CONTACT
    speed = SPEED if check == "meeting" else SPEED + G * CONTACT
    right = errors_of(check, contact)
    assert all(abs(x[0]) < 1e-17 or x[0] <= 0.0 for x in right)
    assert errors_of(check, contact - OFF / speed).early[0] == pytest.approx(OFF, rel=1e-3)
    assert errors_of(check, contact + OFF / speed).late[0] == pytest.approx(OFF, rel=1e-3)
    assert errors_of(check, math.inf).late[0] >= 1e-12
    leaving = errors_of(check, 0.0, upwards=True)
    assert leaving.early[0] <= 0.0
    assert leaving.receding[0] > 1e-3
