"""Propose a chamber's shape and sizes from the part's box and the ball's diameter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

# In ball diameters, and as a share of the part's width: room for balls to get round the part and
# gather speed. They are starting points that a study varies.
GAP, GAP_SHARE, MIN_GAP = 5.0, 0.15, 4e-3
DISTANCE, DISTANCE_SHARE, MIN_DISTANCE = 6.0, 0.2, 8e-3
ABOVE = 5.0  # ball diameters between target and ceiling
SHAPES = ("cylinder", "box", "prism", "conformal")
LONG = 1.6  # length over width from which the walls follow the part's sides
SIDES = 6  # of a prism


@dataclass(frozen=True)
class Sizes:
    """Sizes of a chamber, and how the part is in it."""

    shape: str
    plan: dict[str, Any]  # keys of [chamber] for its form in plan, and their values
    distance: float  # sonotrode to part [m]
    height: float  # [m]
    gap: float  # part to side wall [m]
    through_ceiling: bool  # whether the part goes out there
    top: float  # of what must be below the ceiling, over the part's lowest point [m]


def shape_for(box: np.ndarray) -> str:
    """The shape for a part whose box has these sides (3,) [m]."""
    return "box" if max(box[:2]) > LONG * min(box[:2]) else "cylinder"


def propose_sizes(
    vertices: np.ndarray, target_top: float, ball: float, shape: str, wider: float = 1.0
) -> Sizes:
    """The sizes of a chamber of a shape, one of SHAPES.

    Args:
        vertices: of the part as it is turned, its lowest point at z = 0 [m], shape (n, 3).
        target_top: the target's highest point [m].
        ball: diameter [m].
        wider: factor on the room beside, below and above the part.
    """
    top = float(vertices[:, 2].max())
    width = float(np.ptp(vertices[:, :2], axis=0).max())
    distance = 1e-3 * _up_mm(
        max(DISTANCE * ball, DISTANCE_SHARE * min(width, top), MIN_DISTANCE) * wider
    )
    above = ABOVE * ball * wider
    through = top > target_top + 2.0 * above
    below = target_top if through else top
    height = 1e-3 * _up_mm(distance + below + above)
    inside = vertices[vertices[:, 2] <= height - distance + 1e-9]
    # The box of the whole part is centred on the axis.
    middle = 0.5 * (vertices[:, :2].min(axis=0) + vertices[:, :2].max(axis=0))
    half = np.abs(inside[:, :2] - middle).max(axis=0)
    gap = max(GAP * ball, GAP_SHARE * 2.0 * float(half.max()), MIN_GAP) * wider
    radius = float(np.linalg.norm(inside[:, :2] - middle, axis=1).max())
    across = _up_mm(2.0 * (radius + gap))
    plans: dict[str, dict[str, Any]] = {
        "cylinder": {"diameter_mm": across},
        "box": dict(zip(("length_mm", "width_mm"), map(_up_mm, 2.0 * (half + gap)), strict=True)),
        "prism": {"sides": SIDES, "across_mm": across},
        "conformal": {"outline": "hull", "gap_mm": _up_mm(gap)},
    }
    return Sizes(shape, plans[shape], distance, height, gap, through, below)


def _up_mm(length: float) -> float:
    """A length [m] in whole millimetres, rounded up."""
    return float(math.ceil(1e3 * length - 1e-6))
