"""What happened: the impacts of the shot on the recorded surfaces, as columns."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sim_core.numerics.jit import inlined
from sim_core.numerics.vec3 import Vec3

CHUNK = 65_536  # impacts the compiled loop writes before handing them over


class ImpactBuffer(NamedTuple):
    """What the compiled loop writes.

    ``numbers`` (CHUNK, 8): time, position, velocity, normal speed; ``names`` (CHUNK, 2) int32: ball, triangle;
    ``filled`` (1,): rows written; ``record`` (MAX_TAGS,) bool: surfaces to record.
    """

    numbers: np.ndarray
    names: np.ndarray
    filled: np.ndarray
    record: np.ndarray


def new_impact_buffer(record: np.ndarray) -> ImpactBuffer:
    """An empty page recording the tags marked in ``record`` (256,) bool."""
    return ImpactBuffer(
        np.zeros((CHUNK, 8)),
        np.zeros((CHUNK, 2), dtype=np.int32),
        np.zeros(1, dtype=np.int64),
        record,
    )


@inlined
def note_impact(
    buffer: ImpactBuffer,
    time: float,
    ball: int,
    triangle: int,
    position: Vec3,
    velocity: Vec3,
    speed: float,
) -> None:
    """Write one impact down."""
    row = buffer.filled[0]
    buffer.numbers[row, 0] = time
    for axis in range(3):
        buffer.numbers[row, 1 + axis] = position[axis]
        buffer.numbers[row, 4 + axis] = velocity[axis]
    buffer.numbers[row, 7] = speed
    buffer.names[row, 0] = ball
    buffer.names[row, 1] = triangle
    buffer.filled[0] = row + 1


@dataclass(frozen=True)
class ImpactLog:
    """One row an impact, in order of time.

    ``time`` (n,) [s] since the end of the warm-up; ``ball``, ``triangle`` (n,) int32, indices into the scene's
    balls and mesh; ``position`` (n, 3) [m] of the ball's centre; ``velocity`` (n, 3) [m/s] before the impact,
    relative to the surface; ``normal_speed`` (n,) [m/s], positive. An impact on an edge is booked on the
    neighbour that faces the ball more. On a turning part position and velocity are in its own frame: where the part,
    as the mesh has it, was hit, and how.
    """

    time: np.ndarray
    ball: np.ndarray
    triangle: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    normal_speed: np.ndarray

    def __len__(self) -> int:
        return len(self.time)

    def only(self, rows: np.ndarray) -> "ImpactLog":
        """Some of the impacts: those marked (n,) bool, or by index."""
        return ImpactLog(**{name: column[rows] for name, column in vars(self).items()})


def impact_log(chunks: list[tuple[np.ndarray, np.ndarray]], centre: np.ndarray) -> ImpactLog:
    """Joins pages of (numbers, names) into one log, positions in the user's coordinates again."""
    numbers, names = [buffer[0] for buffer in chunks], [buffer[1] for buffer in chunks]
    numbers = numbers or [np.zeros((0, 8))]
    names = names or [np.zeros((0, 2), dtype=np.int32)]

    def column(
        of: list[np.ndarray], part: int | slice
    ) -> np.ndarray:  # one by one: ten million impacts are a gigabyte
        return np.concatenate([buffer[:, part] for buffer in of])

    position = column(numbers, slice(1, 4))
    position += centre
    return ImpactLog(
        time=column(numbers, 0),
        ball=column(names, 0),
        triangle=column(names, 1),
        position=position,
        velocity=column(numbers, slice(4, 7)),
        normal_speed=column(numbers, 7),
    )
