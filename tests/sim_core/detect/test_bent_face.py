"""Contacts with vibrating faces that bend, against the dense reference in extended precision."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from sim_core import AmplitudeProfile, Vibration
from sim_core.effects.amplitude_profile import (
    FaceProfiles,
    check_profile,
    new_face_profiles,
    rms_share,
    shares_at,
)
from tests.helpers.contacts import calls
from tests.helpers.contacts.reference import (
    BentShare,
    Flight,
    Long,
    check_waves,
    columns,
    dot,
    flight_of,
)
from tests.sim_core.detect.test_contacts import WAVE_AIMS, require, wave_cases

POINTS = ((0.0, 0.7), (4e-3, 0.9), (9e-3, 1.0), (15e-3, 0.85), (25e-3, 0.4))
MIDDLE = (0.012, -0.005, 0.002)
PROFILE = AmplitudeProfile(POINTS, MIDDLE)


def reference(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Share and its derivative by q = r² [1/m²]: scipy's cubic in extended precision, which levels
    off beyond the last point.
    """
    distance, share = np.array(POINTS).T
    cubic = PchipInterpolator(distance**2, share)
    knots, last = cubic.x.astype(Long), len(POINTS) - 2
    piece = np.clip(np.searchsorted(cubic.x, np.asarray(q, float), side="right") - 1, 0, last)
    x, c = q - knots[piece], cubic.c.astype(Long)[:, piece]
    value = ((c[0] * x + c[1]) * x + c[2]) * x + c[3]
    slope = (3 * c[0] * x + 2 * c[1]) * x + c[2]
    width = knots[-1] - knots[-2]
    end, steep = Long(share[-1]), Long(cubic.derivative()(cubic.x[-1]))
    beyond = np.clip(q - knots[-1], 0.0, width)
    level = end + steep * beyond * (1 - beyond / (2 * width))
    outside = q > knots[-1]
    value = np.where(outside, level, value)
    return value, np.where(outside, steep * (1 - beyond / width), slope)


def profiles_of(cases: int) -> FaceProfiles:
    """The profile, of the only sonotrode, whose faces all obstacles are."""
    vibration = Vibration(0, 1e-6, 20e3, profile=PROFILE)
    profiles = new_face_profiles((vibration,), np.zeros(cases, dtype=np.int64), np.zeros(3))
    assert profiles is not None
    return profiles


def shares_along(flights: np.ndarray, axis: np.ndarray, limits: np.ndarray) -> BentShare:
    """Share along the flights (n, 9). Bounds are those of a fine table of the profile."""
    ball, up, middle = flight_of(flights), columns(axis), columns(np.array([MIDDLE]))

    def along(i: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        flight = Flight(*(x[:, i] for x in ball))
        offset = [x - origin for x, origin in zip(flight.at(t), middle, strict=True)]
        velocity = [v + t * a for v, a in zip(flight.velocity, flight.fall, strict=True)]
        height = dot(offset, up[:, i])
        across = [x - height * n for x, n in zip(offset, up[:, i], strict=True)]
        share, slope = reference(dot(across, across))
        return share, 2 * slope * dot(across, velocity)

    r = np.linspace(0.0, 0.04, 4001)
    steep = 2.0 * r * np.abs(reference(r**2)[1]).astype(float)
    gradient = np.gradient(2.0 * r * reference(r**2)[1].astype(float), r)
    first, second = 1.1 * steep.max(), 1.5 * np.abs(gradient).max()
    pull = np.linalg.norm(flights[:, 6:9], axis=1)
    speed = np.linalg.norm(flights[:, 3:6], axis=1) + pull * limits
    return BentShare(along, (np.ones(len(speed)), first * speed, second * speed**2 + first * pull))


@pytest.mark.parametrize("aim", WAVE_AIMS)
def test_contacts_with_bent_planes(aim: str) -> None:
    """The aims hold for a rigid plane of the amplitude at the place where each ball arrives."""
    planes, waves, flights, times, radius, limits = wave_cases(np.random.default_rng(7), aim, 1500)
    axis = waves[:, 3:6]
    offset = planes[:, 3:4] * planes[:, 0:3] - MIDDLE
    across = offset - np.einsum("nd,nd->n", offset, axis)[:, None] * axis
    waves[:, 0] /= reference(np.einsum("nd,nd->n", across, across).astype(Long))[0].astype(float)
    found = calls.vibrating_planes(
        planes, waves, flights, times, radius, limits, profiles_of(len(times))
    )
    share = shares_along(flights, axis, limits)
    errors = check_waves(planes, waves, flights, times, radius, limits, found, share)
    require(errors, found, f"bent planes, {aim}")


def test_the_profile_is_scipys_cubic_and_its_bounds_hold() -> None:
    r = np.linspace(0.0, 0.045, 9001)
    points = np.column_stack([r, np.zeros_like(r), np.full_like(r, 0.3)]) + MIDDLE
    share = shares_at(Vibration(0, 1e-6, 20e3, profile=PROFILE), points)
    expected, slope = (one.astype(float) for one in reference((r**2).astype(Long)))
    np.testing.assert_allclose(share, expected, atol=1e-14)
    bounds = profiles_of(1).bounds[0]
    steep = np.abs(2.0 * r * slope)
    bent = np.abs(np.gradient(2.0 * r * slope, r))
    for largest, bound in zip((share.max(), steep.max(), bent.max()), bounds, strict=True):
        assert largest <= bound * (1.0 + 1e-9)
        assert bound <= 3.0 * largest
    inside = r <= POINTS[-1][0]
    rms = np.sqrt(np.trapezoid(share[inside] ** 2 * r[inside], r[inside]) * 2.0) / POINTS[-1][0]
    assert rms_share(PROFILE) == pytest.approx(rms, rel=1e-6)


@pytest.mark.parametrize(
    "points", [((0.0, 1.0), (0.02, 0.9)), ((0.0, 0.5), (0.01, 1.0), (1.0, 0.0))]
)
def test_profiles_of_few_points_go_through_them(points: tuple[tuple[float, float], ...]) -> None:
    vibration = Vibration(0, 1e-6, 20e3, profile=AmplitudeProfile(points))
    check_profile("vibration", vibration)
    distance, share = np.array(points).T
    places = np.column_stack([np.zeros_like(distance), distance, np.ones_like(distance)])
    np.testing.assert_allclose(shares_at(vibration, places), share, atol=1e-15)
