"""In a closed chamber no ball ever leaves, or enters a surface or another ball.

The checks, repeated during long runs, use scene/invariants.py, which counts ray crossings and
measures distances and shares no code with the search for contacts.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from benchmarks.scenes import DIAMETER, PHYSICS, cylinder, scene
from sim_core import Balls, Physics, Scene, SceneError, SimulationError, SimulationResult, simulate
from sim_core.effects.amplitude_profile import shares_at
from sim_core.geometry.flat_faces import SurfaceTriangles, surface_triangles
from sim_core.geometry.sonotrode_border import SonotrodeBorder, find_border
from sim_core.loop.simulate import Simulation
from sim_core.scene.invariants import beneath_mean_plane, clearance, closest_pair, contained
from tests.helpers.scenes.fuzzed_chambers import FAMILIES, Chamber, random_chamber

# m: how far from touching an impact may be. An edge counts as met at 1e-13, a face at rounding.
TOUCH = 2e-13
ROUNDING = 8 * np.finfo(float).eps  # of the coordinates [m]: it matters far from the origin
REACH = 1.01  # of a radius: where clearance stops measuring


@dataclass
class Record:
    """Results of the checks.

    surface, pair: deepest overlap with a surface and of a pair [m].
    touch: largest distance from touching among the impacts checked [m].
    """

    collisions: int = 0
    checks: int = 0
    impacts: int = 0
    surface: float = 0.0
    pair: float = 0.0
    touch: float = 0.0

    def add(self, other: "Record") -> None:
        """Both together."""
        for name in ("collisions", "checks", "impacts"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for name in ("surface", "pair", "touch"):
            setattr(self, name, max(getattr(self, name), getattr(other, name)))


def height_at(chamber: Chamber, points: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Height (n,) [m] of points (n, 3) [m] above the nearest sonotrode at time (n,) [s].

    Sonotrodes are planes here, each place of which swings by its share of the amplitude. With a
    random phase they are taken at their lowest.
    """
    mesh, height = chamber.mesh, np.full(len(points), np.inf)
    for vibration in chamber.physics.vibrations:
        axis = np.array(vibration.axis) / np.linalg.norm(vibration.axis)
        shift = vibration.amplitude * np.sin(
            math.tau * vibration.frequency * time + vibration.phase
        )
        if chamber.physics.random_phase is not None:
            shift = np.full(len(points), -vibration.amplitude)
        else:
            shift = shift * shares_at(vibration, points)
        height = np.minimum(
            height, (points - mesh.corners[mesh.tags == vibration.tag][0, 0]) @ axis - shift
        )
    return height


def clearance_at(chamber: Chamber, points: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Distance (n,) [m] from points (n, 3) [m] to the nearest surface at time (n,) [s].

    A part that turns is left out.
    """
    mesh, balls, physics = chamber
    reach = REACH * balls.radius
    moving = [
        effect.tag for effect in (*physics.vibrations, physics.part_rotation) if effect is not None
    ]
    still = clearance(mesh.corners[~np.isin(mesh.tags, moving)], points, reach)
    return np.minimum(still, np.minimum(height_at(chamber, points, time), reach))


def has_sharp_rim(chamber: Chamber, points: np.ndarray, time: np.ndarray) -> np.ndarray:
    """False (n,) for balls near a sonotrode where walls go on beneath it, and are met there."""
    mesh, balls, sharp = chamber.mesh, chamber.balls, np.ones(len(points), dtype=bool)
    for one in chamber.physics.vibrations:
        surface = surface_triangles(mesh, (one.tag,), (one.amplitude,))
        border = find_border(surface, balls.radius)
        near = height_at(chamber, points, time) < balls.radius + 2.0 * one.amplitude
        sharp &= ~near | (len(border.walls) == 0)
    return sharp


def later(physics: Physics, duration: float) -> Physics:
    """The same effects, with sonotrode and turning part where they are ``duration`` [s] later."""
    turn, moved = physics.part_rotation, []
    for one in physics.vibrations:
        phase = (one.phase + math.tau * one.frequency * duration) % math.tau
        moved.append(one._replace(phase=phase))
    if moved:
        physics = physics._replace(vibration=tuple(moved) if len(moved) > 1 else moved[0])
    if turn is not None:
        rate = turn.rpm / 60.0 if turn.rpm is not None else turn.frequency or 0.0  # [1/s]
        physics = physics._replace(
            part_rotation=turn._replace(phase=(turn.phase + math.tau * rate * duration) % math.tau)
        )
    return physics


def check(before: Chamber, after: Chamber, result: SimulationResult, impacts: int) -> Record:
    """Check that every ball is inside and that the last ``impacts`` lie on surfaces."""
    mesh, balls, physics = after
    inside = contained(mesh, balls.positions)
    inside |= beneath_mean_plane(mesh, physics.vibrations, balls.positions, 0.5 * balls.diameters)
    outside = np.flatnonzero(~inside)
    assert len(outside) == 0, (
        f"ball {outside[0]} has left at {balls.positions[outside[0]].tolist()} m"
    )
    log = result.impacts
    where, when = log.position[-impacts:], log.time[-impacts:]
    sharp = has_sharp_rim(before, where, when)
    hit = clearance_at(before, where[sharp], when[sharp])
    return Record(
        collisions=result.collisions.total,
        checks=1,
        impacts=len(hit),
        surface=float(
            balls.radius - clearance_at(after, balls.positions, np.zeros(len(balls))).min()
        ),
        pair=balls.diameter - closest_pair(balls)[0],
        touch=float(np.abs(hit - balls.radius).max(initial=0.0)),
    )


def simulate_with_checks(chamber: Chamber, collisions: int, every: int, impacts: int) -> Record:
    """Simulate ``collisions``, with a check after about every ``every`` of them."""
    mesh, balls, _ = chamber
    speed = np.linalg.norm(balls.velocities, axis=1).mean()
    duration = float(every * 0.3 * np.ptp(mesh.vertices, axis=0).max() / (speed * len(balls)))
    record = Record()
    while record.collisions < collisions:
        result = simulate(Scene(*chamber, duration))
        after = Chamber(mesh, result.balls, later(chamber.physics, duration))
        record.add(check(chamber, after, result, impacts))
        allowed = TOUCH + ROUNDING * np.abs(mesh.vertices).max()
        # An impact's time is a float: after 400 s it is known to 6e-14 s.
        allowed += np.spacing(duration) * result.impacts.normal_speed.max(initial=0.0)
        assert max(record.surface, record.pair, record.touch) <= allowed, record
        chamber = after
        duration *= min(max(every / (result.collisions.total + 1), 0.25), 4.0)
    return record


@pytest.mark.parametrize("family", FAMILIES)
def test_no_ball_leaves_a_fuzzed_chamber(family: str) -> None:
    for seed in range(2):
        print(
            family,
            simulate_with_checks(
                random_chamber(family, seed), collisions=10_000, every=500, impacts=500
            ),
        )


WIDEST = 5.0  # radii of the balls: how far a sonotrode swings
STANDING = ["pillared", "wedged", "throated", "grooved"]  # what a wide swing does not crush


def swing_widely(family: str, seeds: range, collisions: int) -> tuple[Record, int]:
    """What was seen, and in how many chambers the floor swings wider than a ball's radius.

    A ball may be caught between the floor and what hangs over it: that stops with a message.
    """
    record, wide = Record(), 0
    for seed in seeds:
        chamber = random_chamber(family, seed, WIDEST)
        wide += any(one.amplitude > chamber.balls.radius for one in chamber.physics.vibrations)
        try:
            record.add(simulate_with_checks(chamber, collisions, collisions // 5, impacts=500))
        except (SceneError, SimulationError) as error:
            assert "jams" in str(error) or "does not fit" in str(error), (family, seed)  # noqa: PT017
    return record, wide


@pytest.mark.parametrize("family", STANDING[:3])  # the long test has all, the last takes longest
def test_no_ball_leaves_under_the_walls_of_a_sonotrode_that_swings_wider_than_a_ball(
    family: str,
) -> None:
    record, wide = swing_widely(family, range(200, 206), 10_000)
    assert wide >= 3
    print(family, record, wide)


@pytest.mark.long
@pytest.mark.parametrize("family", STANDING)
def test_no_ball_leaves_under_such_walls_in_twenty_five_million_collisions_of_each_family(
    family: str,
) -> None:
    record, wide, seed = Record(), 0, 1_000
    while record.collisions < 25_000_000:
        more, of_them = swing_widely(family, range(seed, seed + 10), 250_000)
        record.add(more)
        wide += of_them
        seed += 10
    print(family, record, f"{wide} of {seed - 1_000} chambers swing wider than a ball")


def test_the_first_ball_that_leaves_is_named_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The floor of a box swings wider than a ball, and its walls end where they are drawn."""
    chamber = random_chamber("pillared", 214, WIDEST)
    assert chamber.physics.vibrations[0].amplitude > 2.0 * chamber.balls.radius
    duration = 1.0

    def ends_at_the_edge(surface: SurfaceTriangles, radius: float) -> SonotrodeBorder:
        border = find_border(surface, radius)
        return SonotrodeBorder(border.overhang, *(rows[:0] for rows in border[1:]))

    simulate(Scene(*chamber, duration))
    monkeypatch.setattr("sim_core.geometry.obstacles.find_border", ends_at_the_edge)
    run = Simulation(Scene(replace(chamber.mesh), *chamber[1:], duration))
    with pytest.raises(SimulationError, match=r"ball \d+ has left the mesh: it is at \[") as error:
        run.advance_to(duration)
    assert run.time < duration
    assert f"{run.time:.6f} s after the start" in str(error.value)


@pytest.mark.parametrize(
    ("family", "seed"),
    [
        pytest.param("bladed", 109, id="a face that rounding made a point"),
        pytest.param("bladed", 110, id="a ball that hops on an edge"),
        pytest.param("wedged", 106, id="gentle slopes beside the sonotrode"),
    ],
)
def test_no_ball_leaves_a_chamber_that_one_once_left(family: str, seed: int) -> None:
    simulate_with_checks(
        random_chamber(family, seed), collisions=10_000, every=5_000, impacts=1_000
    )


@pytest.mark.long
@pytest.mark.parametrize("family", FAMILIES)
def test_no_ball_leaves_fuzzed_chambers_in_half_a_million_collisions_each(family: str) -> None:
    record = Record()
    for seed in range(100, 115):
        record.add(
            simulate_with_checks(
                random_chamber(family, seed), collisions=500_000, every=5_000, impacts=1_000
            )
        )
    print(family, record)


@pytest.mark.long
def test_no_ball_leaves_the_gears_chamber_in_a_hundred_million_collisions() -> None:
    gear = scene("gear-200-10k")
    record = simulate_with_checks(
        Chamber(gear.mesh, gear.balls, gear.physics),
        collisions=100_000_000,
        every=50_000,
        impacts=200,
    )
    print("gear", record)
    assert record.checks > 1_000


def test_no_ball_falls_through_a_wide_floor_beside_its_rim() -> None:
    """A ring of balls dropped on it; one place once had no floor."""
    radius = 0.42866070498705616
    mesh = cylinder(radius, 0.04, 10_000)
    angle = np.arange(800) * 2.0 * np.pi / 800
    place = (radius - 2e-3) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    falls = np.tile([0.0, 0.0, -1.9], (800, 1))
    balls = Balls(np.column_stack([place, np.full(800, 3e-3)]), falls, DIAMETER)
    done = simulate(Scene(mesh, balls, PHYSICS, 0.002))
    assert done.collisions.sonotrode >= 800
