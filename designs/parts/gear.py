"""Write gear.stl: a pinion shaft, an involute spur gear with an integral shaft, held from above.

Run `python designs/parts/gear.py`. The axis is z, the teeth go from z = 0 to FACE_WIDTH, with the
shaft above. Lengths are in millimetres.

The tooth form (no profile shift) comes from the basic rack of ISO 53 profile A, rolled on the pitch
circle:

Involute: inv(a) = tan a - a. The half tooth angle at radius r is
    pi/2z + inv(ALPHA) - inv(acos(r_b / r)).
Root fillet: the trochoid that the rack's rounded tip leaves. The common normal goes through the
    pitch point (law of gearing), so the tip's arc at normal angle b touches the gear at
    (d/tan b + RHO cos b, r_p - d - RHO sin b), turned by (d/tan b - x_c) / r_p. Here d is the depth
    of the arc's centre below the pitch line and x_c its distance from the middle of the rack tooth.
    b runs from ALPHA, where it is tangent to the involute, to 90 degrees.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from surfaces import planar, rings_of_points, save, tube

TEETH = 20
MODULE = 2.0
ALPHA = np.radians(20.0)  # pressure angle
ADDENDUM = 1.00 * MODULE  # ISO 53: h_aP, h_fP, rho_fP
DEDENDUM = 1.25 * MODULE
RHO = 0.38 * MODULE
FACE_WIDTH = 10.0
SHAFT_DIAMETER = 16.0
SHAFT_LENGTH = 60.0
EDGE = 1.3  # triangle edge wanted on the teeth
SHAFT_EDGE = 2.5  # the shaft is not peened: coarser along its axis

PITCH_RADIUS = TEETH * MODULE / 2
BASE_RADIUS = PITCH_RADIUS * np.cos(ALPHA)
TIP_RADIUS = PITCH_RADIUS + ADDENDUM
ROOT_RADIUS = PITCH_RADIUS - DEDENDUM


def involute_function(angle: np.ndarray | float) -> np.ndarray | float:
    """inv(a) = tan a - a [rad]."""
    return np.tan(angle) - angle


def flank(radius: np.ndarray) -> np.ndarray:
    """Points (n, 2) of the involute at these radii; +y is the middle of a tooth space, x > 0."""
    half_space = np.pi / (2 * TEETH) - involute_function(ALPHA)
    angle = half_space + involute_function(np.arccos(BASE_RADIUS / radius))
    return radius[:, None] * np.c_[np.sin(angle), np.cos(angle)]


def fillet(normal_angle: np.ndarray) -> np.ndarray:
    """Points (n, 2) of the trochoid in the same frame, from ALPHA at the involute to pi/2."""
    depth = DEDENDUM - RHO
    centre = np.pi * MODULE / 4 - depth * np.tan(ALPHA) - RHO / np.cos(ALPHA)
    x = depth / np.tan(normal_angle) + RHO * np.cos(normal_angle)
    y = PITCH_RADIUS - depth - RHO * np.sin(normal_angle)
    turn = (depth / np.tan(normal_angle) - centre) / PITCH_RADIUS  # counter-clockwise
    return np.c_[x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)]


def evenly(curve: np.ndarray, spacing: float) -> np.ndarray:
    """Points (n + 1, 2) along a finely sampled curve, about `spacing` apart, with both ends."""
    arc = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))]
    stops = np.linspace(0.0, arc[-1], 1 + max(1, round(arc[-1] / spacing)))
    return np.c_[np.interp(stops, arc, curve[:, 0]), np.interp(stops, arc, curve[:, 1])]


def profile() -> np.ndarray:
    """The outline (n, 2) mm, counter-clockwise, with a tooth along each axis (TEETH = 4 k)."""
    root_to_form = fillet(np.linspace(np.pi / 2, ALPHA, 2000))
    root_angle = np.linspace(-1.0, 1.0, 101) * np.arctan2(root_to_form[0, 0], root_to_form[0, 1])
    root = ROOT_RADIUS * np.c_[np.sin(root_angle), np.cos(root_angle)]
    mirrored = root_to_form[::-1] * [-1.0, 1.0]
    # Half the edge length, because the fillet is strongly curved.
    space = evenly(np.r_[mirrored[:-1], root, root_to_form[1:]], 0.5 * EDGE)
    right = evenly(flank(np.linspace(np.hypot(*root_to_form[-1]), TIP_RADIUS, 2000)), EDGE)
    half_tip = np.pi / TEETH - np.arctan2(right[-1, 0], right[-1, 1])  # half the tip's angle
    # An even number puts a corner in the middle of the tip, at its full radius.
    tip_count = 2 * max(1, round(half_tip * TIP_RADIUS / EDGE))
    tip_angle = np.pi / TEETH + half_tip * np.linspace(-1.0, 1.0, tip_count + 1)[1:-1]
    tip = TIP_RADIUS * np.c_[np.sin(tip_angle), np.cos(tip_angle)]
    left = right[::-1] * [-1.0, 1.0]
    clockwise = np.r_[left[:-1], space, right[1:], tip]  # from one tip over a space to the next tip
    teeth = []
    for tooth in range(TEETH):
        angle = 2 * np.pi * (tooth - 0.5) / TEETH
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        teeth.append(clockwise @ turn.T)
    return np.concatenate(teeth)[::-1]


def ring(outline: np.ndarray, z: float) -> np.ndarray:
    return np.c_[outline, np.full(len(outline), z)]


def main(path: Path) -> None:
    outline = profile()
    shaft_radius = SHAFT_DIAMETER / 2
    count = TEETH * round(2 * np.pi * shaft_radius / EDGE / TEETH)
    angle = np.pi / 2 + 2 * np.pi * np.arange(count) / count
    circle = shaft_radius * np.c_[np.cos(angle), np.sin(angle)]

    rows = np.linspace(0.0, FACE_WIDTH, 1 + round(FACE_WIDTH / EDGE))
    shaft_rows = FACE_WIDTH + np.linspace(0.0, SHAFT_LENGTH, 1 + round(SHAFT_LENGTH / SHAFT_EDGE))
    top = FACE_WIDTH + SHAFT_LENGTH
    step = EDGE * np.sqrt(3) / 2
    disc = rings_of_points(np.arange(shaft_radius, TIP_RADIUS, step), EDGE, TEETH)
    core = np.r_[
        rings_of_points(np.arange(step, shaft_radius - step / 2, step), EDGE, 6), [[0.0, 0.0]]
    ]
    save(
        path,
        [
            tube(np.stack([ring(outline, z) for z in rows])),
            planar([outline], np.r_[core, disc], EDGE, 0.0, up=False),
            planar([outline, circle], disc, EDGE, FACE_WIDTH, up=True),
            tube(np.stack([ring(circle, z) for z in shaft_rows])),
            planar([circle], core, EDGE, top, up=True),
        ],
    )


if __name__ == "__main__":
    main(Path(__file__).with_suffix(".stl"))
