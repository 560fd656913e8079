"""Scenes that cannot be simulated are refused, with ball, triangle or field named."""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from sim_core import Balls, Gravity, Physics, Restitution, Scene, TriangleMesh, Vibration
from tests.hard_cases.outcome import Case, Outcome, named, refusal
from tests.helpers.scenes.cavities import FLOOR, box

ROOM = box((0.03, 0.03, 0.03))
MIDDLE = [0.015, 0.015, 0.015]
DIAMETER = 3e-3  # m
NO_NUMBERS = (math.nan, math.inf, -math.inf)
LAW = (0.9, 1.0)
PHYSICS = Physics(Gravity(), Restitution((LAW,) * 3, LAW), Vibration(FLOOR, 25e-6, 20e3))


def still(*positions: list[float]) -> Balls:
    """Balls of 3 mm at rest."""
    return Balls(np.array(positions), np.zeros((len(positions), 3)), DIAMETER)


def fields(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every number in nested NamedTuples and tuples, as (path, the whole with a hole where the
    number was).

    The hole is a function: number -> the whole.
    """
    if isinstance(value, tuple):
        names = getattr(value, "_fields", range(len(value)))
        for k, (name, part) in enumerate(zip(names, value, strict=True)):
            for place, fill in fields(
                part, f"{path}.{name}" if isinstance(name, str) else f"{path}[{name}]"
            ):
                yield place, partial(_refilled, value, k, fill)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path.lstrip("."), lambda number: number


def _refilled(whole: Any, k: int, fill: Any, number: float) -> Any:
    parts = [*whole[:k], fill(number), *whole[k + 1 :]]
    return type(whole)(*parts) if hasattr(whole, "_fields") else type(whole)(parts)


def physics_without_a_number(field: str, fill: Any) -> Outcome:
    """NaN and both infinities in one field of Physics: each refused, the effect and the field
    named.
    """
    effect, _, rest = field.partition(".")
    name = rest.partition("[")[0] if effect != "gravity" else ""
    return _all_refused(
        lambda value: Scene(ROOM, still(MIDDLE), fill(value), 1.0), rf"{effect}.*{name}"
    )


def _all_refused(attempt: Any, message: str) -> Outcome:
    outcomes = [refusal(partial(attempt, value), message) for value in NO_NUMBERS]
    bad = [
        f"{value}: {one.said}"
        for value, one in zip(NO_NUMBERS, outcomes, strict=True)
        if not one.ok
    ]
    return Outcome("", not bad, "; ".join(bad) if bad else outcomes[0].said)


def position_without_a_number() -> Outcome:
    """The ball is named."""
    return _all_refused(lambda value: still(MIDDLE, [0.01, value, 0.01]), "balls.positions: ball 1")


def velocity_without_a_number() -> Outcome:
    """The ball is named."""
    return _all_refused(
        lambda value: Balls(np.array([MIDDLE]), np.array([[0.0, 0.0, value]]), DIAMETER),
        "balls.velocities: ball 0",
    )


def diameter_without_a_number() -> Outcome:
    """Not a size."""
    return _all_refused(
        lambda value: Balls(np.array([MIDDLE]), np.zeros((1, 3)), value), "balls.diameter"
    )


def density_without_a_number() -> Outcome:
    """Not a density."""
    return _all_refused(
        lambda value: Balls(np.array([MIDDLE]), np.zeros((1, 3)), DIAMETER, value), "balls.density"
    )


def vertex_without_a_number() -> Outcome:
    """The vertex is named."""

    def attempt(value: float) -> TriangleMesh:
        vertices = ROOM.vertices.copy()
        vertices[3, 1] = value
        return TriangleMesh(vertices, ROOM.triangles, ROOM.tags)

    return _all_refused(attempt, "mesh vertex 3 ")


def triangle_without_a_number() -> Outcome:
    """An index that is none: the triangle is named."""

    def attempt(value: float) -> TriangleMesh:
        triangles = ROOM.triangles.astype(float)
        triangles[2, 0] = value
        return TriangleMesh(ROOM.vertices, triangles, ROOM.tags)

    return _all_refused(attempt, "triangle")


def fractional_index() -> Outcome:
    """Half an index is not the index below it."""
    return refusal(
        lambda: TriangleMesh(ROOM.vertices, ROOM.triangles + 0.5, ROOM.tags),
        "mesh triangles .*whole",
    )


def tag_without_a_number() -> Outcome:
    """A tag that is none: tags are named."""

    def attempt(value: float) -> TriangleMesh:
        tags = ROOM.tags.astype(float)
        tags[2] = value
        return TriangleMesh(ROOM.vertices, ROOM.triangles, tags)

    return _all_refused(attempt, "mesh tags")


def fractional_tag() -> Outcome:
    """Half a tag is not the tag below it."""
    return refusal(
        lambda: TriangleMesh(ROOM.vertices, ROOM.triangles, ROOM.tags + 0.5), "mesh tags .*whole"
    )


def duration_without_a_number() -> Outcome:
    """The field is named."""
    return _all_refused(
        lambda value: Scene(ROOM, still(MIDDLE), Physics(), value), "scene.duration"
    )


def warmup_without_a_number() -> Outcome:
    """The field is named."""
    return _all_refused(
        lambda value: Scene(ROOM, still(MIDDLE), Physics(), 1.0, warmup=value), "scene.warmup"
    )


def restitution_of_too_few_numbers() -> Outcome:
    """One number where two belong."""
    physics = Physics(restitution=Restitution((LAW,) * 3, (0.9,)))  # type: ignore[arg-type]
    return refusal(lambda: Scene(ROOM, still(MIDDLE), physics, 1.0), "restitution.balls")


def speed_beyond_numbers() -> Outcome:
    """1e200 m/s is finite, its square is not."""
    return refusal(
        lambda: Balls(np.array([MIDDLE]), np.array([[1e200, 0.0, 0.0]]), DIAMETER),
        "balls.velocities: ball 0",
    )


def frequency_beyond_numbers() -> Outcome:
    """1e300 Hz is finite, and no time step is short enough for it."""
    physics = Physics(vibration=Vibration(FLOOR, 1e-9, 1e300))
    return refusal(lambda: Scene(ROOM, still(MIDDLE), physics, 1.0), "vibration.frequency")


def two_balls_in_one_place() -> Outcome:
    """Both are named."""
    return refusal(
        lambda: Scene(ROOM, still(MIDDLE, MIDDLE), Physics(), 1.0),
        "balls (0 and 1|1 and 0) overlap",
    )


def balls_overlapping() -> Outcome:
    """Both are named, and by how much."""
    return refusal(
        lambda: Scene(ROOM, still([0.005] * 3, MIDDLE, [0.015, 0.015, 0.0178]), Physics(), 1.0),
        "balls (1 and 2|2 and 1) overlap by 0.0002 m",
    )


def ball_outside() -> Outcome:
    """The ball is named."""
    return refusal(
        lambda: Scene(ROOM, still(MIDDLE, [0.05, 0.0, 0.0]), Physics(), 1.0),
        "ball 1 .* outside the mesh",
    )


def ball_in_a_wall() -> Outcome:
    """Its centre is inside, its side is not."""
    return refusal(
        lambda: Scene(ROOM, still(MIDDLE, [0.001, 0.01, 0.01]), Physics(), 1.0),
        "ball 1 .* overlaps a surface by 0.0005",
    )


def ball_in_the_sonotrode() -> Outcome:
    """Clear of the face at rest, not where it is at the start."""
    physics = Physics(vibration=Vibration(FLOOR, 1e-3, 20e3, 0.5 * math.pi))
    return refusal(
        lambda: Scene(ROOM, still([0.015, 0.015, 2e-3]), physics, 1.0),
        "ball 0 .* 0.0005 m inside the vibrating",
    )


CASES = [
    *(
        Case(f"{field} not a number", partial(physics_without_a_number, field, fill))
        for field, fill in fields(PHYSICS)
    ),
    named(position_without_a_number),
    named(velocity_without_a_number),
    named(diameter_without_a_number),
    named(density_without_a_number),
    named(vertex_without_a_number),
    named(triangle_without_a_number),
    named(fractional_index),
    named(tag_without_a_number),
    named(fractional_tag),
    named(duration_without_a_number),
    named(warmup_without_a_number),
    named(restitution_of_too_few_numbers),
    named(speed_beyond_numbers),
    named(frequency_beyond_numbers),
    named(two_balls_in_one_place),
    named(balls_overlapping),
    named(ball_outside),
    named(ball_in_a_wall),
    named(ball_in_the_sonotrode),
]
