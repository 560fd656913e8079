"""A replica to be simulated again, by itself and as far as one likes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from chamberopt.chamber.analytic import impacts_on_chamber

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import AnalyticCavity, ImpactLog, Scene


@dataclass(frozen=True)
class Replayed:
    """One replica of a result: what it was simulated from. cavity: in place of the chamber's mesh, where it was."""

    design: Design
    chamber: Chamber
    cavity: AnalyticCavity | None
    scene: Scene

    def booked(self, impacts: ImpactLog) -> ImpactLog:
        """The impacts, with the chamber's triangles, also where the cavity has others."""
        return impacts_on_chamber(impacts, self.chamber) if self.cavity else impacts
