"""The replicas of a result, ready to be simulated again exactly as they were."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from chamberopt.chamber.analytic import analytic_cavity, impacts_on_chamber
from chamberopt.chamber.part import turning_axis
from chamberopt.chamber.scene import build_scene, chamber_mesh, replica_seed
from chamberopt.common.errors import InputError
from chamberopt.output.results.chamber_file import load_chamber

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.output.results.load import Result
    from sim_core import AnalyticCavity, ImpactLog, Scene

REMEDY = "simulate the design again, and use that result"


@dataclass(frozen=True)
class RebuiltChamber:
    """Chamber of a result.

    cavity: the analytical cavity that was simulated in place of the chamber's mesh, if it was.
    """

    chamber: Chamber
    cavity: AnalyticCavity | None


@dataclass(frozen=True)
class RebuiltReplica:
    """One replica of a result, ready to be simulated again; cavity as in RebuiltChamber."""

    design: Design
    chamber: Chamber
    cavity: AnalyticCavity | None
    scene: Scene

    def on_chamber(self, impacts: ImpactLog) -> ImpactLog:
        """Impacts with the triangles of the chamber, also where an analytical cavity has others."""
        return impacts_on_chamber(impacts, self.chamber) if self.cavity else impacts


def rebuild_chamber(result: Result) -> RebuiltChamber:
    """The chamber of a result from its own folder; InputError if its file is not as it was."""
    chamber = load_chamber(result)
    is_analytic = result.data.get("analytic")
    return RebuiltChamber(chamber, analytic_cavity(result.design, chamber) if is_analytic else None)


def rebuild_replica(result: Result, number: int = 0) -> RebuiltReplica:
    """Build one replica of a result again, numbered from 0.

    Raises:
        InputError: the result has no such replica, or its chamber's file is not as it was.
    """
    there = int(result.data["replicas"])
    if not 0 <= number < there:
        raise InputError(
            f"--replica: given {number}; the result has {there}, give 0 to {there - 1}"
        )
    rebuilt, (seed, stream) = rebuild_chamber(result), result.seeds
    mesh = rebuilt.cavity or chamber_mesh(rebuilt.chamber)
    axis = turning_axis(result.design, rebuilt.chamber.part)
    scene = build_scene(result.design, mesh, replica_seed(seed, number, stream), axis)
    return RebuiltReplica(result.design, rebuilt.chamber, rebuilt.cavity, scene)


def made_by(result: Result) -> str:
    """Versions of the programs that made a result, for messages."""
    made = result.data.get("versions", {})
    names = ("chamberopt", "manifold3d", "numba", "numpy", "system")
    return (
        ", ".join(f"{name} {made[name]}" for name in names if name in made) or "an unknown version"
    )
