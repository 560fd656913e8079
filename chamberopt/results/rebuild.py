"""Rebuild the replicas of a result so that simulating them again gives the same bits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.analytic import analytic_cavity, impacts_on_chamber
from chamberopt.chamber.flexure import flexure_of_surfaces
from chamberopt.chamber.part import turning_axis
from chamberopt.chamber.replica_seed import replica_seed
from chamberopt.chamber.scene import build_scene, chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.coverage.part_impacts import HITS_FILE, load_hits
from chamberopt.results.arrays_file import load_chamber

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.results.load import Result
    from sim_core import AnalyticCavity, ImpactLog, Scene

REMEDY = "simulate the design again, and use that result"


@dataclass(frozen=True)
class RebuiltChamber:
    """The chamber of a result, loaded to be simulated again.

    cavity: analytical cavity that was simulated in place of the mesh; None if the mesh was.
    """

    chamber: Chamber
    cavity: AnalyticCavity | None


@dataclass(frozen=True)
class RebuiltReplica:
    """One replica of a result, ready to be simulated again.

    cavity: analytical cavity that was simulated in place of the mesh; None if the mesh was.
    scene: input of the simulator: cavity, balls, motions and seed.
    """

    result: Result
    chamber: Chamber
    cavity: AnalyticCavity | None
    scene: Scene

    @property
    def design(self) -> Design:
        return self.result.design

    def on_chamber(self, impacts: ImpactLog) -> ImpactLog:
        """Assign impacts, which may be on an analytical cavity, to triangles of the chamber's mesh.

        Raises:
            InputError: an impact on the part within the recorded time is not in hits.npz of the
                result. Triangle and speed must agree to the last bit.
        """
        impacts = impacts_on_chamber(impacts, self.chamber) if self.cavity else impacts
        source = self.chamber.source[impacts.triangle]
        mine = (source >= 0) & (impacts.time < self.scene.duration)
        hits = load_hits(self.result.path(HITS_FILE)).hits
        own = np.isin(
            _identity(source[mine], np.asarray(impacts.normal_speed)[mine]),
            _identity(hits.triangle, hits.speed),
        )
        if not own.all():
            raise InputError(
                f"{self.result.folder}: this program on this machine does not simulate it again "
                f"bit for bit: {(~own).sum()} of {len(own)} impacts are not the result's (made by "
                f"{made_by(self.result)}); {REMEDY}"
            )
        return impacts


def rebuild_chamber(result: Result) -> RebuiltChamber:
    """Return the chamber of a result as it was simulated.

    Raises InputError if its file changed, or the design has steps, each with its own chamber.
    """
    result.design.require_one_step("simulating a result again")
    chamber = load_chamber(result)
    return RebuiltChamber(
        chamber, analytic_cavity(result.design, chamber) if result.record.analytic else None
    )


def rebuild_replica(result: Result, number: int = 0) -> RebuiltReplica:
    """Build one replica of a result again, numbered from 0.

    Raises:
        InputError: the result has no such replica, or the file of its chamber was changed.
    """
    there = result.record.replicas
    if not 0 <= number < there:
        raise InputError(
            f"--replica: given {number}; the result has {there}, give 0 to {there - 1}"
        )
    rebuilt, (seed, stream) = rebuild_chamber(result), result.seeds
    mesh = rebuilt.cavity or chamber_mesh(rebuilt.chamber)
    axis = turning_axis(result.design, rebuilt.chamber.part)
    flexure = flexure_of_surfaces(result.design, rebuilt.chamber, mesh)
    scene = build_scene(result.design, mesh, replica_seed(seed, number, stream), axis, flexure)
    return RebuiltReplica(result, rebuilt.chamber, rebuilt.cavity, scene)


def _identity(triangle: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return an integer for each impact, shape (n,), from its triangle and the bits of its speed.

    Two impacts have the same integer only if triangle and speed are the same.
    """
    bits = speed.astype(np.float32).view(np.int32).astype(np.int64)
    return np.asarray((triangle.astype(np.int64) << 32) + bits)


def made_by(result: Result) -> str:
    """Return a text with the versions of the program, libraries and system that made a result."""
    made = result.record.versions
    names = ("chamberopt", "manifold3d", "numba", "numpy", "system")
    return ", ".join(f"{name} {made[name]}" for name in names if name in made)
