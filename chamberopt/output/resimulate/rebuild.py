"""What a result was simulated in, and its replicas: the same design, chamber and seed make the same scene again, to the
last bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from chamberopt.chamber.analytic import analytic_cavity, impacts_on_chamber
from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.part import posed_part
from chamberopt.chamber.scene import build_scene, chamber_mesh, replica_seed
from chamberopt.common.errors import InputError
from chamberopt.output.vtp_files import CHAMBER, COVERAGE, MM, read_surface

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.output.results.load import Result
    from sim_core import AnalyticCavity, ImpactLog, Scene

REMEDY = "simulate the design again, and use that result"


@dataclass(frozen=True)
class RebuiltChamber:
    """Where a result was simulated: its chamber, built again, and the analytical cavity if it was simulated in one."""

    chamber: Chamber
    cavity: AnalyticCavity | None


@dataclass(frozen=True)
class Replica:
    """One replica of a result: what it was simulated from. cavity: in place of the chamber's mesh, where it was."""

    design: Design
    chamber: Chamber
    cavity: AnalyticCavity | None
    scene: Scene

    def booked(self, impacts: ImpactLog) -> ImpactLog:
        """The impacts, with the chamber's triangles, also where the cavity has others."""
        return impacts_on_chamber(impacts, self.chamber) if self.cavity else impacts


def rebuild_chamber(result: Result) -> RebuiltChamber:
    """The chamber of a simulation, or of a study's best or start, as it was simulated; its target is the result's.

    Raises InputError when a file that the design names has changed since, or this version builds another chamber.
    """
    part = posed_part(result.design)[0]
    kept = read_surface(result.folder / COVERAGE)
    if part.sha256 != result.part_sha256 or kept.n_cells != len(part.triangles):
        _refuse_file(result, "part.mesh", result.design.part.mesh_path)
    if result.design.chamber.sha256 != result.data.get("shape_sha256", ""):
        _refuse_file(result, "chamber", "the file of its shape")
    target = np.asarray(kept["target"]) > 0 if result.design.part.target.reachable else None
    chamber = build_chamber(result.design, target)
    drawn = read_surface(result.folder / CHAMBER)
    same = np.array_equal(drawn.points, chamber.vertices * MM) and np.array_equal(
        drawn["tag"], chamber.tags
    )
    if not same or not np.array_equal(drawn.regular_faces, chamber.triangles):
        raise InputError(
            f"{result.folder}: its chamber comes out differently now: a file that the design names has changed, or "
            f"another version made it ({made_by(result)}); {REMEDY}"
        )
    return RebuiltChamber(
        chamber, analytic_cavity(result.design, chamber) if result.data.get("analytic") else None
    )


def rebuild_replica(result: Result, number: int = 0) -> Replica:
    """A replica of a simulation, or of a study's best or start. InputError for one that is not there, or cannot be
    simulated again.
    """
    there = int(result.data["replicas"])
    if not 0 <= number < there:
        raise InputError(
            f"--replica: given {number}; the result has {there}, give 0 to {there - 1}"
        )
    ground, (seed, stream) = rebuild_chamber(result), result.seeds
    mesh = ground.cavity or chamber_mesh(ground.chamber)
    scene = build_scene(result.design, mesh, replica_seed(seed, number, stream))
    return Replica(result.design, ground.chamber, ground.cavity, scene)


def _refuse_file(result: Result, field: str, path: object) -> NoReturn:
    raise InputError(
        f"{field}: {path}: not what {result.folder} was simulated with; restore it, or {REMEDY}"
    )


def made_by(result: Result) -> str:
    """The versions that a result was made by."""
    made = result.data.get("versions", {})
    names = ("chamberopt", "manifold3d", "numba", "numpy", "system")
    return (
        ", ".join(f"{name} {made[name]}" for name in names if name in made) or "an unknown version"
    )
