"""Build the chamber and replicas of a result again, exactly as they were simulated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from chamberopt.chamber.analytic import analytic_cavity, impacts_on_chamber
from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.part import posed_part
from chamberopt.chamber.scene import build_scene, chamber_mesh, replica_seed
from chamberopt.common.errors import InputError
from chamberopt.output.vtp_files import CHAMBER, ELEMENT_COLUMNS, MM, PART, read_surface

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
    """Build the chamber of a result again, with the result's own target.

    Raises:
        InputError: a file that the design names has changed since, or this version of the program
            builds another chamber.
    """
    part = posed_part(result.design)[0]
    surface = read_surface(result.folder / PART, ELEMENT_COLUMNS)
    if part.sha256 != result.part_sha256 or surface.n_cells != len(part.triangles):
        _refuse_changed_file(result, "part.mesh", result.design.part.mesh_path)
    if result.design.chamber.sha256 != result.data.get("shape_sha256", ""):
        _refuse_changed_file(result, "chamber", "the file of its shape")
    target = np.asarray(surface["target"]) > 0 if result.design.part.target.reachable else None
    chamber = build_chamber(result.design, target)
    written = read_surface(result.folder / CHAMBER)
    same = (
        np.array_equal(written.points, chamber.vertices * MM)
        and np.array_equal(written["tag"], chamber.tags)
        and np.array_equal(written.regular_faces, chamber.triangles)
    )
    if not same:
        raise InputError(
            f"{result.folder}: its chamber comes out differently now: a file that the design names "
            f"has changed, or another version made it ({made_by(result)}); {REMEDY}"
        )
    analytic = result.data.get("analytic")
    return RebuiltChamber(chamber, analytic_cavity(result.design, chamber) if analytic else None)


def rebuild_replica(result: Result, number: int = 0) -> RebuiltReplica:
    """Build one replica of a result again, numbered from 0.

    Raises:
        InputError: the result has no such replica, or its chamber cannot be built again.
    """
    there = int(result.data["replicas"])
    if not 0 <= number < there:
        raise InputError(
            f"--replica: given {number}; the result has {there}, give 0 to {there - 1}"
        )
    rebuilt, (seed, stream) = rebuild_chamber(result), result.seeds
    mesh = rebuilt.cavity or chamber_mesh(rebuilt.chamber)
    scene = build_scene(result.design, mesh, replica_seed(seed, number, stream))
    return RebuiltReplica(result.design, rebuilt.chamber, rebuilt.cavity, scene)


def made_by(result: Result) -> str:
    """Versions of the programs that made a result, for messages."""
    made = result.data.get("versions", {})
    names = ("chamberopt", "manifold3d", "numba", "numpy", "system")
    return (
        ", ".join(f"{name} {made[name]}" for name in names if name in made) or "an unknown version"
    )


def _refuse_changed_file(result: Result, field: str, path: object) -> NoReturn:
    raise InputError(
        f"{field}: {path}: not what {result.folder} was simulated with; restore it, or {REMEDY}"
    )
