"""Write blade.stl: a twisted, tapered, compressor-like blade that hangs down from its root block.

Run `python designs/parts/blade.py`. The aerofoil goes from its tip at z = 0 up to z = SPAN, with
the block above. It is a free-form test part and not a real blade: there is no fillet between
aerofoil and block. Lengths are in millimetres.

The section is a NACA four-digit camber line and thickness with the closed trailing edge (last
coefficient -0.1036 instead of -0.1015), moved outward by EDGE_RADIUS so that the trailing edge is
round and can be peened.

Source: E. N. Jacobs, K. E. Ward and R. M. Pinkerton, NACA Report 460, 1933.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from surfaces import planar, save, tube

SPAN = 40.0
CHORD = (20.0, 25.0)  # at the tip, at the root; linear between
STAGGER_DEG = (52.0, 20.0)  # chord line against x
THICKNESS = (0.055, 0.095)  # of the chord
CAMBER = (0.04, 0.07)  # of the chord
CAMBER_PLACE = 0.45  # of the chord, where the camber is largest
EDGE_RADIUS = 0.30
BLOCK = (36.0, 22.0, 10.0)
EDGE = 1.2  # triangle edge wanted on the aerofoil
BLOCK_EDGE = 2.0
TURN_PER_EDGE = np.radians(40.0)  # the round leading and trailing edges get shorter edges


def mean_line(x: np.ndarray, camber: float) -> tuple[np.ndarray, np.ndarray]:
    """Height and slope of the camber line at x (0..1), in chords."""
    p = CAMBER_PLACE
    scale = np.where(x < p, camber / p**2, camber / (1 - p) ** 2)
    offset = np.where(x < p, 0.0, 1 - 2 * p)
    return scale * (offset + 2 * p * x - x**2), scale * (2 * p - 2 * x)


def half_thickness(x: np.ndarray, thickness: float) -> np.ndarray:
    """Half the thickness at x (0..1), in chords."""
    root = 0.2969 * np.sqrt(x)
    return 5 * thickness * (root - 0.1260 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)


def fine_section(span: float) -> np.ndarray:
    """One section (n, 2) mm in fine steps, counter-clockwise from the trailing edge."""
    chord, thickness, camber, stagger = (
        pair[0] + (pair[1] - pair[0]) * span
        for pair in (CHORD, THICKNESS, CAMBER, np.radians(STAGGER_DEG))
    )
    around = np.linspace(0.0, 2 * np.pi, 4001)
    x = (1 + np.cos(around)) / 2
    height, slope = mean_line(x, camber)
    lean = np.arctan(slope)
    out = half_thickness(x, thickness) * np.sign(np.sin(around))
    sharp = chord * np.c_[x - out * np.sin(lean), height + out * np.cos(lean)]
    along = np.gradient(sharp, axis=0)
    along[0], along[-1] = sharp[1] - sharp[0], sharp[-1] - sharp[-2]
    normal = np.c_[along[:, 1], -along[:, 0]] / np.linalg.norm(along, axis=1)[:, None]
    first, last = np.arctan2(normal[0, 1], normal[0, 0]), np.arctan2(normal[-1, 1], normal[-1, 0])
    fan = np.linspace(last, first, 201)[1:-1]  # the round trailing edge
    round_end = sharp[0] + EDGE_RADIUS * np.c_[np.cos(fan), np.sin(fan)]
    section = np.r_[sharp + EDGE_RADIUS * normal, round_end]
    middle = chord * np.array([0.5, mean_line(np.array(0.5), camber)[0]])
    c, s = np.cos(stagger), np.sin(stagger)
    return (section - middle) @ np.array([[c, s], [-s, c]])


def edge_ends(curve: np.ndarray) -> np.ndarray:
    """Ends (n,) of short edges along a closed curve, as indices into it; more at bends."""
    step = np.roll(curve, -1, axis=0) - curve
    length = np.linalg.norm(step, axis=1)
    heading = np.arctan2(step[:, 1], step[:, 0])
    turn = np.abs((np.diff(heading, append=heading[0]) + np.pi) % (2 * np.pi) - np.pi)
    cost = np.cumsum(np.hypot(length / EDGE, turn / TURN_PER_EDGE))
    return np.interp(
        np.linspace(0.0, cost[-1], round(cost[-1]) + 1)[:-1],
        np.r_[0.0, cost],
        np.arange(len(curve) + 1),
    )


def rectangle(z: float) -> np.ndarray:
    """The block's outline (n, 3) at height z, counter-clockwise."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array(BLOCK[:2]) / 2
    sides = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = round(np.linalg.norm(end - start) / BLOCK_EDGE)
        sides.append(start + (end - start) * (np.arange(count) / count)[:, None])
    border = np.concatenate(sides)
    return np.c_[border, np.full(len(border), z)]


def lattice(spacing: float) -> np.ndarray:
    """Points (n, 2) of a regular triangular pattern over the block."""
    y = np.arange(-BLOCK[1] / 2, BLOCK[1] / 2, spacing * np.sqrt(3) / 2)
    x = np.arange(-BLOCK[0] / 2, BLOCK[0] / 2, spacing)
    return np.concatenate(
        [np.c_[x + spacing / 2 * (row % 2), np.full_like(x, at)] for row, at in enumerate(y)]
    )


def main(path: Path) -> None:
    spans = np.linspace(0.0, 1.0, 1 + round(SPAN / EDGE))
    places = edge_ends(fine_section(0.5))
    rings = []
    for span in spans:
        fine = fine_section(span)
        closed = np.r_[fine, fine[:1]]
        at = np.arange(len(closed))
        ring = np.c_[np.interp(places, at, closed[:, 0]), np.interp(places, at, closed[:, 1])]
        rings.append(np.c_[ring, np.full(len(ring), span * SPAN)])
    top = SPAN + BLOCK[2]
    levels = np.linspace(SPAN, top, 1 + round(BLOCK[2] / BLOCK_EDGE))
    tip, root, block = rings[0][:, :2], rings[-1][:, :2], rectangle(SPAN)[:, :2]
    save(
        path,
        [
            tube(np.stack(rings)),
            planar([tip], lattice(EDGE), EDGE, 0.0, up=False),
            planar([block, root], lattice(EDGE), 0.8 * BLOCK_EDGE, SPAN, up=False),
            tube(np.stack([rectangle(z) for z in levels])),
            planar([block], lattice(BLOCK_EDGE), BLOCK_EDGE, top, up=True),
        ],
    )


if __name__ == "__main__":
    main(Path(__file__).with_suffix(".stl"))
