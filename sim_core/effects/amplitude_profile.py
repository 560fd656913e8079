"""Amplitude over a vibrating face: a sonotrode bends, and each place has its own amplitude.

All places move along the axis of the vibration, in phase. A ball of radius R touches the face where
the height of its centre above the mean plane is R + h. The normal is that of the bent face, n -
grad h, which leans by 1e-4 in real sonotrodes. The speed at which a ball approaches the face along
this normal is then the speed at which the gap closes. So a ball that bounces off never ends below
the face, and in the frame of the face at that place the restitution law holds. The height is off by
R (grad h)²/2, which MOST_LEAN keeps below R / 20,000.

Notation:
    r: distance of a place from the axis of the vibration through ``middle`` [m]
    q = r² [m²]
    f: share of the vibration's amplitude A at a place [-]
    h = A f sin(omega t + phase): displacement of the face at a place [m]
    pieces: f is a cubic in q between two measured points

Between the points f is the monotone cubic of Fritsch and Butland in q: it goes through the points,
rises or falls as they do, and has no kink, in the middle of the face neither. Beyond the last point
it levels off over a piece as long as the last one. No face goes on there but for corners of the rim
(scene/bent_faces.py), and its plane, in which a ball beside the face is followed.

Source: F. N. Fritsch & J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, equation 5; C. Moler,
Numerical Computing with MATLAB (SIAM 2004), section 3.6, for the slopes at both ends.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from sim_core.effects.sonotrodes import AnyWave
from sim_core.effects.vibration import AmplitudeProfile, Vibration, Wave
from sim_core.errors import SceneError, number
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3, add_scaled, dot, scaled, sub, vec3_at

# Largest slope of the bent face [-]. Sonotrodes have 1e-4: a tenth of 30 µm over 30 mm. A steeper
# face is one that was measured wrongly, and would need the curvature of the face at the contact.
MOST_LEAN = 0.01


class FaceProfiles(NamedTuple):
    """Profiles of k sonotrodes with m pieces in all, as numbers for compiled code."""

    middle: np.ndarray  # a point on the axis of each sonotrode [m], shape (k, 3)
    first: np.ndarray  # first piece of each sonotrode, and m, shape (k + 1,) int64
    start: np.ndarray  # q at which each piece starts [m²], shape (m,)
    # f = c0 + c1 x + c2 x² + c3 x³ with x = q - start, shape (m, 4)
    pieces: np.ndarray
    # bounds of |f| [-], |grad f| [1/m] and |second derivative along the face| [1/m²], shape (k, 3)
    bounds: np.ndarray
    faces: np.ndarray  # the sonotrode of each obstacle, shape (obstacles,) int64


def check_profile(which: str, vibration: Vibration) -> None:
    """Raise SceneError for a profile with numbers out of range, or on a face that leans too much.

    ``which``: name of the profile in messages.
    """
    profile = vibration.profile
    if profile is None:
        return
    if not isinstance(profile, AmplitudeProfile):
        raise SceneError(f"{which} is {profile!r}: give an AmplitudeProfile, or None")
    for k, (distance, share) in enumerate(profile.points):
        here = f"{which}.points[{k}]"
        if not 0.0 <= number(here, distance) < math.inf:
            raise SceneError(f"{here} is at {distance} m: it must be 0 or more")
        if not 0.0 <= number(here, share) <= 1.0:
            raise SceneError(f"{here} has the share {share}: it must lie in [0, 1]")
    distances = [distance for distance, _ in profile.points]
    if len(distances) < 2 or distances[0] != 0.0:
        raise SceneError(f"{which}.points are at {distances} m: give two or more, the first at 0")
    if any(b * b <= a * a for a, b in pairwise(distances)):
        raise SceneError(f"{which}.points are at {distances} m: give them in order")
    if not all(math.isfinite(x) for x in profile.middle):
        raise SceneError(f"{which}.middle is {profile.middle} m: it must be finite")
    lean = float(vibration.amplitude) * _bounds(*_pieces(profile))[1]
    if not lean <= MOST_LEAN:
        raise SceneError(
            f"{which}: the face would lean by up to {lean:.2g}, more than {MOST_LEAN:g}, "
            "where its amplitude changes most; no sonotrode bends so much, give shares that "
            "change less from point to point"
        )


def new_face_profiles(
    vibrations: tuple[Vibration, ...], tags: np.ndarray, centre: np.ndarray
) -> FaceProfiles | None:
    """Return the profiles of all sonotrodes; None if all are rigid.

    Args:
        vibrations: vibrations of the sonotrodes, checked.
        tags: tags of all obstacles, shape (obstacles,).
        centre: origin of the simulation's coordinates [m], shape (3,).
    """
    if all(one.profile is None for one in vibrations):
        return None
    rigid = AmplitudeProfile(((0.0, 1.0), (1.0, 1.0)))
    profiles = [rigid if one.profile is None else one.profile for one in vibrations]
    each = [_pieces(profile) for profile in profiles]
    faces = np.zeros(len(tags), dtype=np.int64)
    for k, one in enumerate(vibrations):
        faces[tags == one.tag] = k
    return FaceProfiles(
        np.array([profile.middle for profile in profiles], dtype=float) - centre,
        np.cumsum([0, *(len(start) for start, _ in each)], dtype=np.int64),
        np.concatenate([start for start, _ in each]),
        np.concatenate([pieces for _, pieces in each]),
        np.array([_bounds(*one) for one in each]),
        faces,
    )


def _pieces(profile: AmplitudeProfile) -> tuple[np.ndarray, np.ndarray]:
    """Return the starts (m,) [m²] of the pieces of a profile, and their coefficients (m, 4)."""
    distance, share = np.array(profile.points, dtype=float).T
    q = distance * distance
    slopes = _slopes(q, share)
    # beyond the last point the slope falls to 0
    last = q[-1] - q[-2]
    q = np.append(q, q[-1] + last)
    share = np.append(share, share[-1] + 0.5 * slopes[-1] * last)
    slopes = np.append(slopes, 0.0)
    width, rise = np.diff(q), np.diff(share)
    chord = rise / width
    one, two = slopes[:-1], slopes[1:]
    pieces = np.stack(
        [
            share[:-1],
            one,
            (3.0 * chord - 2.0 * one - two) / width,
            (one + two - 2.0 * chord) / width**2,
        ],
        axis=1,
    )
    return q, np.concatenate([pieces, [[share[-1], 0.0, 0.0, 0.0]]])


def _slopes(q: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return df/dq [1/m²] at each point: those of Fritsch and Butland, shape (n,)."""
    width, chord = np.diff(q), np.diff(share) / np.diff(q)
    if len(chord) == 1:
        return np.array([chord[0], chord[0]])
    inner = np.zeros(len(q) - 2)
    same = chord[:-1] * chord[1:] > 0.0
    one, two = 2.0 * width[1:] + width[:-1], width[1:] + 2.0 * width[:-1]
    before, after = chord[:-1][same], chord[1:][same]
    inner[same] = (one + two)[same] / (one[same] / before + two[same] / after)
    ends = [
        _end_slope(width[0], width[1], chord[0], chord[1]),
        _end_slope(width[-1], width[-2], chord[-1], chord[-2]),
    ]
    return np.array([ends[0], *inner, ends[1]])


def _end_slope(width: float, next_width: float, chord: float, next_chord: float) -> float:
    """Return the slope at an end: that of the parabola through three points, kept monotone."""
    slope = ((2.0 * width + next_width) * chord - width * next_chord) / (width + next_width)
    if slope * chord <= 0.0:
        return 0.0
    if chord * next_chord <= 0.0 and abs(slope) > 3.0 * abs(chord):
        return 3.0 * chord
    return slope


def _bounds(start: np.ndarray, pieces: np.ndarray) -> tuple[float, float, float]:
    """Return bounds of |f|, |grad f| [1/m] and of the second derivative along the face [1/m²].

    grad f has the length 2 r f'(q). The second derivatives of f are 2 f' around the axis, and 2 f'
    + 4 q f'' away from it. A polynomial lies between the coefficients of its Bernstein form.
    """
    width, c = np.append(np.diff(start), 0.0), pieces.T
    end = start + width
    value = [
        c[0],
        c[0] + c[1] * width / 3.0,
        c[0] + 2.0 * c[1] * width / 3.0 + c[2] * width**2 / 3.0,
        c[0] + width * (c[1] + width * (c[2] + width * c[3])),
    ]
    first = [c[1], c[1] + c[2] * width, c[1] + width * (2.0 * c[2] + 3.0 * width * c[3])]
    second = [2.0 * c[2], 2.0 * c[2] + 6.0 * c[3] * width]
    steep, bent = np.abs(first).max(axis=0), np.abs(second).max(axis=0)
    return (
        float(np.abs(value).max()),
        float((2.0 * np.sqrt(end) * steep).max()),
        float((2.0 * steep + 4.0 * end * bent).max()),
    )


def shares_at(vibration: Vibration, points: np.ndarray) -> np.ndarray:
    """Return the share of the amplitude at places of a face, shape (n,).

    ``points``: positions [m], shape (n, 3), at any height above the face.
    """
    if vibration.profile is None:
        return np.ones(len(points))
    offset, axis = points - np.array(vibration.profile.middle), np.array(vibration.axis, float)
    axis /= np.linalg.norm(axis)
    across = offset - np.outer(offset @ axis, axis)
    q = np.einsum("ij,ij->i", across, across)
    start, pieces = _pieces(vibration.profile)
    piece = np.searchsorted(start, q, side="right") - 1
    x, c = q - start[piece], pieces[piece].T
    return np.asarray(c[0] + x * (c[1] + x * (c[2] + x * c[3])))


def rms_share(profile: AmplitudeProfile) -> float:
    """Return the rms of the share over the disc round the middle to the last point.

    f² is a polynomial of degree 6 in q, for which Gauss's rule of four points is exact.
    """
    start, pieces = _pieces(profile)
    width, c = np.diff(start[:-1]), pieces[:-2].T
    nodes, weights = np.polynomial.legendre.leggauss(4)
    x = 0.5 * (1.0 + nodes[:, None]) * width
    share = c[0] + x * (c[1] + x * (c[2] + x * c[3]))
    return math.sqrt(float((0.5 * weights @ share**2) @ width) / float(start[-2]))


@jit
def share_and_slope(
    profiles: FaceProfiles, face: int, axis: Vec3, position: Vec3
) -> tuple[float, Vec3]:
    """Return the share of the amplitude at a place of a face, and its gradient [1/m].

    Args:
        profiles: profiles of all sonotrodes.
        face: obstacle number of the face.
        axis: unit vector along the vibration.
        position: position of the ball's centre over the place [m].
    """
    k = profiles.faces[face]
    offset = sub(position, vec3_at(profiles.middle, k))
    across = add_scaled(offset, -dot(offset, axis), axis)
    q = dot(across, across)
    piece, last = profiles.first[k], profiles.first[k + 1] - 1
    while piece < last and profiles.start[piece + 1] <= q:
        piece += 1
    x, c = q - profiles.start[piece], profiles.pieces
    share = c[piece, 0] + x * (c[piece, 1] + x * (c[piece, 2] + x * c[piece, 3]))
    rise = c[piece, 1] + x * (2.0 * c[piece, 2] + 3.0 * x * c[piece, 3])
    return share, scaled(2.0 * rise, across)


@inlined
def wave_at(profiles: FaceProfiles | None, wave: AnyWave, face: int, position: Vec3) -> AnyWave:
    """Return the vibration of a face at the place under a ball.

    ``wave``: vibration of the face where the share is 1. ``position``: the ball's centre [m].
    """
    if profiles is None or wave is None:
        return wave
    share, _ = share_and_slope(profiles, face, wave.axis, position)
    return Wave(share * wave.amplitude, wave.omega, wave.phase, wave.axis)


@inlined
def bent_normal(
    profiles: FaceProfiles | None,
    wave: Wave | None,
    face: int,
    position: Vec3,
    time: float,
    normal: Vec3,
) -> Vec3:
    """Return a vector along the normal of a bent face under a ball, not of unit length.

    Args:
        profiles: profiles of all sonotrodes; None if all are rigid.
        wave: vibration of the face where the share is 1.
        face: obstacle number of the face.
        position: position of the ball's centre [m].
        time: time since the start of the present time window [s].
        normal: unit normal of the mean face, returned for a rigid face.
    """
    if profiles is None or wave is None:
        return normal
    _, slope = share_and_slope(profiles, face, wave.axis, position)
    swing = dot(normal, wave.axis) * wave.amplitude * math.sin(wave.omega * time + wave.phase)
    return add_scaled(normal, -swing, slope)
