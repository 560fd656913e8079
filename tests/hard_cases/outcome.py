"""The outcome of a hard case, by closed forms, conservation, or a clear refusal."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from sim_core import Balls, Physics, Scene, SceneError, SimulationError, TriangleMesh, simulate
from sim_core.scene.invariants import (
    beneath_mean_plane,
    clearance,
    contained,
    narrowest_gap,
    turned_corners,
)
from tests.helpers.scenes.cavities import uniform_restitution
from tests.helpers.scenes.fuzzed_chambers import Chamber
from tests.sim_core.loop.test_containment import REACH, ROUNDING, clearance_at, later

# impacts of each piece whose overlap is measured: where a ball is deepest, if it is ever too deep
WATCHED = 20_000
NOT_ELASTIC = math.nan
# m: a contact is found to 1e-13, and a ball that slides on edges may be there several at a time
DEEPEST = 1e-12
CONSTANT = 1e6  # m/s: a yield speed v0 that no ball reaches, so that e = C0 at any speed
# Effects that change nothing, where a case wants none: fewer combinations of effects have to be
# compiled.
LOSSLESS = uniform_restitution(1.0, CONSTANT)


@dataclass(frozen=True)
class Outcome:
    """``ok``: did what physics demands happen; ``said``: what was expected and seen, or the message
    it stopped with.

    ``collisions``; ``events_per_s``: collisions and stale meetings a simulated second;
    ``penetration`` [m]: worst overlap with a surface or a ball, negative while none touched;
    ``energy_drift`` [-]: worst relative change of the energy, NaN where it need not be kept.
    """

    case: str
    ok: bool
    said: str
    collisions: int = 0
    events_per_s: float = 0.0
    penetration: float = math.nan
    energy_drift: float = NOT_ELASTIC


class Claim(NamedTuple):
    """One thing physics demands, and whether it was so."""

    holds: bool
    said: str


@dataclass(frozen=True)
class Case:
    """A named hard case. ``needs_rest``: it can only go right with the contact mode; ``long``:
    minutes; ``unsolved``: why it is known to go wrong, empty where it does not.
    """

    name: str
    run: Callable[[], Outcome]
    needs_rest: bool = False
    long: bool = False
    unsolved: str = ""

    @property
    def supported(self) -> bool:
        """False while the simulator lacks what the case is about."""
        return has_rest() or not self.needs_rest

    def outcome(self) -> Outcome:
        """Plays it; an error that nobody expected, of any kind, is an outcome too, and not a good
        one.
        """
        try:
            return replace(self.run(), case=self.name)
        except Exception as error:
            return Outcome(self.name, False, f"{type(error).__name__}: {error}")


def named(function: Callable[[], Outcome], **about: bool | str) -> Case:
    """A case called like its function."""
    return Case(function.__name__.replace("_", " "), function, **about)  # type: ignore[arg-type]


@dataclass
class Played:
    """A chamber played piece by piece, and what was seen on the way.

    ``time`` [s], ``ball``, ``triangle``, ``position`` [m], ``normal_speed`` [m/s]: of all recorded
    impacts. ``track``: the balls at the start and after each piece.
    """

    mesh: TriangleMesh
    track: list[Balls]
    duration: float
    pairs: int = 0
    collisions: int = 0
    events: int = 0
    penetration: float = -math.inf
    energy_drift: float = NOT_ELASTIC
    impacts: list[tuple[np.ndarray, ...]] = field(default_factory=list)

    @property
    def end(self) -> Balls:
        return self.track[-1]

    @property
    def time(self) -> np.ndarray:
        return self._column(0)

    @property
    def ball(self) -> np.ndarray:
        return self._column(1)

    @property
    def triangle(self) -> np.ndarray:
        return self._column(2)

    @property
    def position(self) -> np.ndarray:
        return self._column(3)

    @property
    def normal_speed(self) -> np.ndarray:
        return self._column(4)

    def _column(self, k: int) -> np.ndarray:
        return np.concatenate([row[k] for row in self.impacts])


def play(
    chamber: Chamber, duration: float, pieces: int = 1, record: tuple[int, ...] | None = None
) -> Played:
    """Plays the chamber for ``duration`` [s] and looks at all overlaps, energies and who is still
    inside at the end of each of the ``pieces``. Raises SimulationError when a ball is outside.
    """
    mesh, balls, physics = chamber
    seen = Played(mesh, [balls], duration)
    elastic = is_elastic(physics)
    before = energy_above_floor(mesh, balls, physics)
    if elastic:
        seen.energy_drift = 0.0
    for piece in range(pieces):
        result = simulate(Scene(mesh, seen.end, physics, duration / pieces, record=record))
        log = result.impacts
        here = np.flatnonzero(_in_the_room(mesh, physics)[log.triangle])[-WATCHED:]
        if len(here):
            gap = clearance_at(Chamber(mesh, balls, physics), log.position[here], log.time[here])
            gap += _hop_within_a_contact(physics, log.normal_speed[here])
            seen.penetration = max(
                seen.penetration, float((0.5 * balls.diameters[log.ball[here]] - gap).max())
            )
        start = piece * duration / pieces
        seen.impacts.append(
            (start + log.time, log.ball, log.triangle, log.position, log.normal_speed)
        )
        physics = later(physics, duration / pieces)
        seen.penetration = max(seen.penetration, overlap(Chamber(mesh, result.balls, physics)))
        seen.track.append(result.balls)
        seen.collisions += result.collisions.total
        seen.pairs += result.collisions.balls
        seen.events += result.collisions.total + result.collisions.stale
        places, corners = result.balls.positions, corners_now(mesh, physics)
        inside = contained(mesh, places, corners)
        inside |= beneath_mean_plane(
            mesh, physics.vibrations, places, 0.5 * balls.diameters, corners
        )
        outside = np.flatnonzero(~inside)
        if len(outside):
            raise SimulationError(
                f"ball {outside[0]} is outside at {result.balls.positions[outside[0]].tolist()} m"
            )
        if elastic and before > 0.0:
            drift = abs(energy_above_floor(mesh, result.balls, physics) / before - 1.0)
            seen.energy_drift = max(seen.energy_drift, drift)
    return seen


def overlap(chamber: Chamber) -> float:
    """Deepest overlap [m] of any ball with a surface or, where balls meet, with another ball,
    now.
    """
    mesh, balls, physics = chamber
    gap = clearance_at(chamber, balls.positions, np.zeros(len(balls)))
    corners = corners_now(mesh, physics)
    if corners is not None and physics.part_rotation is not None:
        part = np.ascontiguousarray(corners[np.isin(mesh.tags, physics.part_rotation.tags)])
        gap = np.minimum(gap, clearance(part, balls.positions, REACH * balls.radius))
    near = gap < REACH * balls.radius  # others touch nothing: how far they are is not measured
    surface = float((0.5 * balls.diameters - gap)[near].max(initial=-math.inf))
    return surface if physics.ball_collisions is None else max(surface, -narrowest_gap(balls)[0])


def _in_the_room(mesh: TriangleMesh, physics: Physics) -> np.ndarray:
    """True (m,) for triangles whose impacts are logged where they happen, and not as a turning part
    sees them.
    """
    return (
        np.ones(len(mesh.tags), dtype=np.bool_)
        if physics.part_rotation is None
        else ~np.isin(mesh.tags, physics.part_rotation.tags)
    )


def corners_now(mesh: TriangleMesh, physics: Physics) -> np.ndarray | None:
    """The triangles (m, 3, 3) [m] where a turning part is now; None if none turns."""
    return None if physics.part_rotation is None else turned_corners(mesh, physics.part_rotation)


def is_still(physics: Physics) -> bool:
    """True when no surface moves, so that no energy comes in."""
    return all(one.amplitude == 0.0 for one in physics.vibrations) and physics.part_rotation is None


def is_elastic(physics: Physics) -> bool:
    """True when energy must be kept."""
    if physics.friction is not None or physics.drag is not None:
        return False
    if physics.restitution is None:
        return is_still(physics)
    surfaces, balls, _ = physics.restitution
    return is_still(physics) and all(c0 == 1.0 and v0 >= CONSTANT for c0, v0 in [*surfaces, balls])


def energy_above_floor(mesh: TriangleMesh, balls: Balls, physics: Physics) -> float:
    """Energy of a kilogram of shot [J/kg], potential energy counted from the mesh's lowest corner:
    never negative.
    """
    each = 0.5 * (balls.velocities**2).sum(axis=1)
    if balls.spins is not None:
        each += 0.05 * balls.diameters**2 * (balls.spins**2).sum(axis=1)
    if physics.gravity is not None:
        down = np.array(physics.gravity)
        each += (mesh.vertices @ down).max() - balls.positions @ down
    return float(np.average(each, weights=balls.masses))


def _hop_within_a_contact(physics: Physics, speeds: np.ndarray) -> np.ndarray:
    """Height [m] of hops at normal speeds [m/s] that is of the size of DEEPEST, 0 for higher ones.

    Where nothing lets a ball lie, it slides along an edge in ever lower hops of µm/s. A hop lower
    than contacts are resolved happens within the contact, as deep as it is high.
    """
    weight = float(np.linalg.norm(physics.gravity or (0.0, 0.0, 0.0)))
    height = 0.5 * speeds**2 / max(weight, 1e-300)
    return np.where(height < 10.0 * DEEPEST, height, 0.0)


def allowed(mesh: TriangleMesh) -> float:
    """Overlap [m] that is allowed: contacts are promised to DEEPEST, coordinates to their own
    rounding.
    """
    return float(DEEPEST + ROUNDING * np.abs(mesh.vertices).max())


# relative energy error of a run of up to a million elastic collisions: 1e-16 each, adding up at
# random
DRIFT = 1e-12


def near(what: str, seen: object, wanted: object, within: float) -> Claim:
    """All of ``seen`` equal ``wanted`` to ``within`` (absolute, any unit); shapes must agree."""
    one, two = np.asarray(seen, dtype=float), np.asarray(wanted, dtype=float)
    if one.shape != two.shape:
        return Claim(False, f"{what}: {one.shape} where {two.shape} was expected")
    off = float(np.abs(one - two).max(initial=0.0))
    return Claim(off <= within, f"{what} off by {off:.2g} (allowed {within:.2g})")


def outcome_of(played: Played, expected: str, *claims: Claim, drift: float = DRIFT) -> Outcome:
    """Claims of the case, and those of every case: no overlap, and energy kept to ``drift`` where
    nothing loses it.
    """
    deepest = allowed(played.mesh)
    every = [
        *claims,
        Claim(
            played.penetration <= deepest,
            f"overlap {played.penetration:.2g} m (allowed {deepest:.2g})",
        ),
        Claim(not played.energy_drift > drift, f"energy drifts by {played.energy_drift:.2g}"),
    ]
    broken = [claim.said for claim in every if not claim.holds]
    return Outcome(
        "",
        not broken,
        f"{expected}, but {'; '.join(broken)}" if broken else expected,
        played.collisions,
        played.events / played.duration,
        played.penetration,
        played.energy_drift,
    )


def refusal(
    attempt: Callable[[], object],
    message: str,
    error: type[Exception] | tuple[type[Exception], ...] = SceneError,
) -> Outcome:
    """The attempt must be refused with an ``error`` whose message matches the pattern: it names who
    and where.
    """
    try:
        attempt()
    except error as said:
        ok = re.search(message, str(said)) is not None
        return Outcome(
            "", ok, f"refused: {said}" if ok else f"refused without saying {message!r}: {said}"
        )
    return Outcome("", False, f"not refused, though it should be with {message!r}")


def has_rest() -> bool:
    """True when the simulator has the contact mode."""
    return "rest" in Physics._fields


def with_rest(physics: Physics) -> Physics:
    """The same effects with the contact mode, where the simulator has it."""
    if not has_rest():
        return physics
    hint = Physics.__annotations__["rest"]  # Rest | None
    rest = next(kind for kind in hint.__args__ if kind is not type(None))
    return physics._replace(rest=rest())  # type: ignore[call-arg]
