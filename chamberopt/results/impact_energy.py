"""Where the energy of the shot goes: energy of impacts on each surface of a chamber, and its maps.

Notation
    v    normal speed of an impact relative to the surface [m/s]
    e    restitution at this speed
    m    mass of the ball; of two balls, m1 m2 / (m1 + m2) [kg]
    energy of an impact                  m v² / 2
    energy lost to the normal rebound    (1 - e²) m v² / 2, in any frame, of a surface that is much
                                         heavier than the ball

In a chamber without friction, roughness and drag that is all that is lost. What friction takes
is not in it: the log has no spins.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.checks.place_names import CEILING, SIDE_WALL, SONOTRODE, surface_names
from chamberopt.chamber.largest_ball import spread_points
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate, estimate
from chamberopt.design.shape_surface import TAG_PART, TAG_WALL
from chamberopt.geometry.triangles import areas

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.results.rebuild import RebuiltReplica
    from sim_core import ImpactLog

BLOCKS = 10  # pieces of the recorded time, whose scatter gives the intervals
PART, BALLS = "the part", "ball on ball"
FACE_BINS, ANGLES, HEIGHTS = 24, 36, 12  # bins of the maps
LEAST = 0.25  # share of the largest bin: of less surface, single impacts would be a figure
SAMPLES = 200_000  # points on all surfaces, and some more, from which the areas of bins are found


class SurfaceEnergy(NamedTuple):
    """Power of the impacts on a surface.

    area: [m²]; nan for impacts of balls on one another.
    rate: impacts [1/s].
    impact_power, lost_power: energy of impacts, and what their normal rebound loses [W].
    """

    name: str
    area: float
    rate: Estimate
    impact_power: Estimate
    lost_power: Estimate


class EnergyMap(NamedTuple):
    """Power of impacts over area [W/m²] in bins (columns, rows); nan where there is little surface.

    across, up: edges of the bins [m], or degrees across a wall that is unrolled.
    """

    title: str
    across: np.ndarray
    up: np.ndarray
    power: np.ndarray
    is_unrolled: bool


@dataclass(frozen=True)
class ImpactEnergy:
    """Energy of impacts in one replica of a result."""

    seconds: float
    surfaces: tuple[SurfaceEnergy, ...]  # by power lost, most first
    maps: tuple[EnergyMap, ...]

    @property
    def lost(self) -> float:
        """Power lost to all normal rebounds [W]."""
        return sum(one.lost_power.value for one in self.surfaces)


def energy_lost(mass: np.ndarray, speed: np.ndarray, restitution: np.ndarray) -> np.ndarray:
    """Return the energy [J] that normal rebounds lose.

    Args:
        mass: mass of the ball, or m1 m2 / (m1 + m2) of two balls [kg].
        speed: normal speed before [m/s].
        restitution: normal speed after over that before.
    """
    return np.asarray(0.5 * mass * (1.0 - restitution**2) * speed**2)


def require_mesh(replica: RebuiltReplica) -> None:
    """Raise InputError for a result of several steps, or one simulated in exact surfaces."""
    if replica.cavity is not None:
        text = "simulated in exact surfaces, which have no names; simulate it without --analytic"
        raise InputError(f"{replica.result.folder}: {text}")
    replica.design.require_one_step("a map of the energy of impacts")


def simulate_energy(
    replica: RebuiltReplica, progress: Callable[[float], None] = lambda seconds: None
) -> ImpactEnergy:
    """Simulate a replica of a result again, and return the energy of impacts on all surfaces.

    Raises:
        InputError: the result was simulated in exact surfaces, or in steps.
        sim_core.SimulationError: the simulation had to stop.
    """
    from sim_core import simulate

    require_mesh(replica)
    meet = replica.scene.physics.ball_collisions is not None
    scene = replace(replica.scene, record=None, record_held=True, record_collisions=meet)
    found = simulate(scene, progress=progress)
    design, chamber = replica.design.simulated, replica.chamber
    log, seconds = found.impacts, scene.duration
    mass = scene.balls.masses
    energy = 0.5 * mass[log.ball] * log.normal_speed**2
    e = _restitution(design, chamber.tags[log.triangle], log.normal_speed)
    lost = energy_lost(mass[log.ball], log.normal_speed, e)
    names = _names(chamber)
    of_triangle = areas(chamber.vertices, chamber.triangles)
    surfaces = [
        _surface(name, float(of_triangle[names == name].sum()), log.time[on], energy[on], lost[on],
                 seconds)
        for name in dict.fromkeys(names)
        for on in [names[log.triangle] == name]
    ]  # fmt: skip
    if found.ball_collisions is not None:
        pairs = found.ball_collisions
        both = mass[pairs.one] * mass[pairs.two] / (mass[pairs.one] + mass[pairs.two])
        e = _law_at(design, None, pairs.normal_speed)
        how = pairs.time, 0.5 * both * pairs.normal_speed**2
        lost_by_pairs = energy_lost(both, pairs.normal_speed, e)
        surfaces.append(_surface(BALLS, np.nan, *how, lost_by_pairs, seconds))
    surfaces.sort(key=lambda one: -one.lost_power.value)
    return ImpactEnergy(seconds, tuple(surfaces), _maps(chamber, names, log, energy / seconds))


def _names(chamber: Chamber) -> np.ndarray:
    """Return the name of each triangle's surface. All of the part has one name."""
    names = surface_names(chamber)
    names[chamber.tags == TAG_PART] = PART
    return names


def _restitution(design: Design, tags: np.ndarray, speed: np.ndarray) -> np.ndarray:
    found = np.ones(len(speed))
    for tag in np.unique(tags):
        found[tags == tag] = _law_at(design, int(tag), speed[tags == tag])
    return found


def _law_at(design: Design, tag: int | None, speed: np.ndarray) -> np.ndarray:
    """Return the restitution on the surface of a tag, or of two balls for None."""
    from sim_core import restitution_at

    materials = design.materials
    laws = {None: materials.shot, TAG_PART: materials.part, TAG_WALL: materials.wall}
    law = laws.get(tag, materials.sonotrode).restitution
    slow = speed < design.process.accuracy.elastic_below
    return np.asarray(np.where(slow, 1.0, restitution_at(speed, law)))


def _surface(
    name: str, area: float, time: np.ndarray, energy: np.ndarray, lost: np.ndarray, seconds: float
) -> SurfaceEnergy:
    """Return the power of impacts, with intervals from blocks of the recorded time."""
    block = np.minimum((BLOCKS * time / seconds).astype(int), BLOCKS - 1)
    length = seconds / BLOCKS
    sums = [np.bincount(block, weights, BLOCKS) / length for weights in (None, energy, lost)]
    return SurfaceEnergy(name, area, *(estimate(one, 0.0) for one in sums))


def _maps(
    chamber: Chamber, names: np.ndarray, log: ImpactLog, power: np.ndarray
) -> tuple[EnergyMap, ...]:
    """Return maps of sonotrode and ceiling from above, and of the wall unrolled about the axis."""
    shape = chamber.vertices, chamber.triangles
    spacing = np.full(len(chamber.triangles), math.sqrt(areas(*shape).sum() / SAMPLES))
    triangle, points, stands_for = spread_points(*shape, spacing)
    found = []
    for name, title, unrolled in (
        (SONOTRODE, "sonotrode, from above", False),
        (CEILING, "ceiling, from above", False),
        (SIDE_WALL, "side wall, unrolled", True),
    ):
        on, hit = names[triangle] == name, names[log.triangle] == name
        if not on.any():
            continue
        places, hits = (_flat(one, unrolled) for one in (points[on], log.position[hit]))
        low, high = places.min(axis=0), places.max(axis=0)
        counts = (ANGLES, HEIGHTS) if unrolled else (FACE_BINS, FACE_BINS)
        edges = [np.linspace(low[k], high[k], counts[k] + 1) for k in range(2)]
        hits = np.clip(hits, low, high)  # centres of balls lie a radius off the surface
        area = np.histogramdd(places, bins=edges, weights=stands_for[on])[0]
        energy = np.histogramdd(hits, bins=edges, weights=power[hit])[0]
        with np.errstate(invalid="ignore", divide="ignore"):
            density = np.where(area > LEAST * area.max(), energy / area, np.nan)
        found.append(EnergyMap(title, edges[0], edges[1], density, unrolled))
    return tuple(found)


def _flat(points: np.ndarray, unrolled: bool) -> np.ndarray:
    """Return points (n, 3) as x and y [m], or as angle about the axis [degrees] and height [m]."""
    if not unrolled:
        return np.asarray(points[:, :2])
    angle = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    return np.stack([angle, points[:, 2]], axis=1)
