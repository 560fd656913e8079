"""Compute how hard the shot pushes a part, from the impacts of a result."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chamberopt.geometry.triangles import area_vectors, unit_vectors
from sim_core import restitution_at

if TYPE_CHECKING:
    from chamberopt.results.arrays_file import ResultArrays
    from chamberopt.results.load import Result


def push_of_shot(result: Result, arrays: ResultArrays) -> np.ndarray | None:
    """Return the mean force of the shot on the part, in the chamber's frame [N], (3,).

    It is the momentum across the surface that balls give up in a second: each impact leaves
    m (1 + e) v, with the mean normal speed v in a window round its triangle, which is off by some
    per cent beside edges. Single impacts push far harder, for microseconds. None of a part that
    turns or stands in several poses, and of balls of several sizes, whose impacts are not told
    apart.
    """
    design, record = result.design, result.record
    if design.effects.part_turn is not None or design.steps or len(design.shot.sizes) > 1:
        return None
    part, values = arrays.chamber.part, arrays.elements
    speed = np.nan_to_num(values["mean_normal_speed"].astype(float))
    back = 1.0 + restitution_at(speed, design.materials.part.restitution)
    seconds = record.replicas * record.simulated_time_s
    momentum = design.shot.ball_mass * back * speed * values["impacts"] / seconds
    normal = unit_vectors(area_vectors(part.vertices, part.triangles))
    return np.asarray(-momentum @ normal)
