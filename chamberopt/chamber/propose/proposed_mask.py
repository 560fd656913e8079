"""Propose a mask on surfaces of a part that must not be peened, as their names say."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from chamberopt.chamber.build import Chamber
from chamberopt.chamber.fixture import is_hole, pieces_of
from chamberopt.chamber.part import chosen_on_part
from chamberopt.chamber.propose.proposed_target import Surface
from chamberopt.design.design import Design
from chamberopt.design.part import Selection
from chamberopt.geometry.meshes.part_mesh import PartMesh

MET = 0.5  # share of a surface in the chamber from which on the shot meets it
# Names of what fits to other parts, whose size and finish shot would change.
NEVER = re.compile(
    r"(?<![a-z])(?:bores?|(?:\w+.)?holes?|threads?|(?:bearing|valve)?.?seats?|key.?ways?|splines?)"
    r"(?![a-z])",
    re.I,
)


def is_met(design: Design, chamber: Chamber, surface: Surface) -> bool:
    """Return whether a surface lies in the chamber for the most part, beside the target."""
    rows = chosen_on_part(design, Selection.model_validate(surface.keys), "")
    inside = chamber.exposed_area[rows & ~chamber.part.target].sum()
    return bool(inside > MET * chamber.part.area[rows].sum())


def are_holes(mesh: PartMesh, known: Sequence[Surface], names: Sequence[str]) -> bool:
    """Return whether all surfaces of these names are walls of holes, which plugs fill."""
    chosen = np.any([one.triangles for one in known if one.name in names], axis=0)
    pieces = pieces_of(mesh.triangles, chosen)
    return all(is_hole(mesh.vertices, mesh.triangles[rows]) for rows in pieces)


def to_be_masked(design: Design, chamber: Chamber, known: Sequence[Surface]) -> list[str]:
    """Return the names of surfaces that the shot meets and that must not be peened."""
    named = [one for one in known if "surface" in one.keys and NEVER.search(one.name)]
    return [one.name for one in named if is_met(design, chamber, one)]
