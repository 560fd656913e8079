"""Checks of vibrating faces that bend, against the surface that they belong to."""

import numpy as np

from sim_core.effects.amplitude_profile import check_profile
from sim_core.effects.vibration import AmplitudeProfile, Vibration
from sim_core.errors import SceneError
from sim_core.geometry.analytic import AnalyticCavity
from sim_core.geometry.mesh import TriangleMesh, normals_towards_shot

# Largest sine of the angle between a bending face's normal and the axis of its vibration. On a face
# that moves askew, a place is not above the point of the sonotrode that was measured.
ASKEW = 1e-3
# Share of the last distance by which corners of the rim may be further out: those of a polygon of 8
# sides in place of a circle of the same area are by 0.054.
BEYOND = 0.06


def require_profiles(
    mesh: TriangleMesh | AnalyticCavity,
    vibrations: tuple[Vibration, ...],
    names: tuple[str, ...] = (),
) -> None:
    """Raise SceneError for a profile with wrong numbers, or that does not fit its face.

    It must be known to the rim of the face, which moves along its own normal, and not in a periodic
    box. ``names``: names of the profiles in messages.
    """
    for k, one in enumerate(vibrations):
        which = "vibration.profile" if len(vibrations) == 1 else f"vibration[{k}].profile"
        which = names[k] if names else which
        check_profile(which, one)
        if one.profile is not None:
            _require_measured(mesh, one, one.profile, which)


def _require_measured(
    mesh: TriangleMesh | AnalyticCavity, one: Vibration, profile: AmplitudeProfile, which: str
) -> None:
    axis = np.array(one.axis, dtype=float)
    axis /= np.linalg.norm(axis)
    if isinstance(mesh, AnalyticCavity):
        if mesh.periodic:
            raise SceneError(
                f"{which} is not supported in a periodic box, whose floor has no middle; "
                "leave it out"
            )
        points, beyond = _floor(mesh)
    else:
        corners = mesh.corners[mesh.tags == one.tag]
        normals, doubled = normals_towards_shot(corners)
        askew = np.linalg.norm(np.cross(normals, axis), axis=1)[doubled > 0.0].max(initial=0.0)
        if askew > ASKEW:
            raise SceneError(
                f"{which} is given, and the face moves askew, {askew:.2g} rad from its "
                "normal: not supported together; let axis be the face's normal"
            )
        points, beyond = corners.reshape(-1, 3), 0.0
    across = np.cross(points - np.array(profile.middle), axis)
    rim = float(np.linalg.norm(across, axis=1).max(initial=0.0)) + beyond
    last = float(profile.points[-1][0])
    if rim > last * (1.0 + BEYOND):
        raise SceneError(
            f"{which} ends at {last:.6g} m from its middle, and the face goes on to "
            f"{rim:.6g} m: give a share for the rim"
        )


def _floor(cavity: AnalyticCavity) -> tuple[np.ndarray, float]:
    """Return points (n, 3) [m] such that the floor reaches a distance [m] beyond them."""
    if cavity.radius is not None:
        return np.array([[*cavity.centre, cavity.bottom]]), cavity.radius
    height = np.full(len(cavity.outline), cavity.bottom)
    return np.column_stack([cavity.outline, height]), 0.0
