"""Estimate the memory that the evaluation of a design takes, before it begins.

Pairs of dents and windows are not included, because they are kept only while there is room for them
(common/memory.py). The bytes were measured, see docs/reference/trust.md. The number of impacts is
estimated as in a gas of balls: n V A / 4 a second on an area A, with n balls per volume and the
peak speed V of the sonotrode. This is 0.7 to 2.1 times the simulated number.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from chamberopt.common import memory
from chamberopt.common.errors import InputError
from chamberopt.common.number_text import plain
from chamberopt.coverage.field.target_field import MAX_PIECES, PIECES_PER_WINDOW
from chamberopt.geometry.triangles import areas

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design

PROCESS = 350e6  # bytes of a process that has loaded and compiled everything
OF_POINT, OF_POINT_AT_WORK = 250.0, 550.0  # bytes a point of a field: kept, and while it is made
OF_POINT_IN_BATCH = 110.0  # bytes a point and batch of replicas, while figures are estimated
BATCHES = 40  # most batches of replicas, MAX_BATCHES of coverage_from_impacts.py
OF_PIECE = 120.0  # bytes a piece of the surface
OF_TRIANGLE = 500.0  # bytes a triangle of the chamber, with its search tree
OF_IMPACT, OF_LOGGED = 150.0, 100.0  # bytes an impact: kept on the part; logged during the run


def evaluation_bytes(design: Design, chamber: Chamber, replicas: int) -> float:
    """Return the estimated memory [bytes] to simulate and evaluate a design, without the memory of
    the process itself.
    """
    accuracy, target = design.process.accuracy, chamber.part.target
    fields = 1 + len(design.zones) + len(design.steps or ())
    of_points = OF_POINT * (fields - 1) + OF_POINT_AT_WORK
    of_points += OF_POINT_IN_BATCH * min(replicas, BATCHES)
    windows = float(chamber.part.area[target].sum()) / accuracy.gauge
    on_area = design.shot.count / chamber.volume * design.sonotrode.rms_peak_speed / 4.0
    on_area *= design.process.recorded_time
    walls = float(areas(chamber.vertices, chamber.triangles).sum())
    return (
        of_points * accuracy.points
        + OF_PIECE * fields * min(PIECES_PER_WINDOW * windows, MAX_PIECES)
        + OF_TRIANGLE * len(chamber.triangles)
        + OF_IMPACT * on_area * float(chamber.exposed_area.sum()) * replicas
        + OF_LOGGED * on_area * walls
    )


def time_within(most: float, design: Design, chamber: Chamber, replicas: int) -> float:
    """Return the simulated time of all replicas [s] whose evaluation takes some bytes, or 0.

    Args:
        most: these bytes, with those of the process.
    """
    one, two = (
        evaluation_bytes(
            design.changed({"process.accuracy.simulated_time_s": time}), chamber, replicas
        )
        for time in (1.0, 2.0)
    )
    return max(0.0, replicas * (most - PROCESS - (2.0 * one - two)) / (two - one))


def how_many_fit(most: int, each: float, common: float = 0.0) -> int:
    """Return how many tasks of equal size, from 1 to `most`, may run at once in the allowed memory.

    Args:
        most: largest number.
        each: bytes of one task, such as the evaluation of a design.
        common: bytes that all tasks share.
    Raises:
        InputError: not even one task fits.
    """
    room = memory.OF_FREE * memory.free_memory()
    if math.isinf(room):
        return most
    if common + each > room:
        taken, there = plain(1e-9 * (common + each), 2), plain(1e-9 * room, 2)
        raise InputError(
            f"process.accuracy.points: this takes about {taken} GB of memory, and {there} GB, half "
            "of what is free, may be taken; give fewer points, shorter replicas "
            "(simulated_time_s) or a larger gauge_mm2, or end other programs"
        )
    return max(1, min(most, int((room - common) / each)))
