"""Propose a mask: on surfaces that must not be peened, or on a level top where balls would lie."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from chamberopt.chamber.build import Chamber
from chamberopt.chamber.part import chosen_on_part
from chamberopt.chamber.propose.pose import Turns
from chamberopt.chamber.propose.proposed_arbor import Bore
from chamberopt.chamber.propose.proposed_target import Surface
from chamberopt.design.design import Design
from chamberopt.design.part import Selection
from chamberopt.geometry.faces import Faces
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.triangles import areas, rotation_matrix

FLAT_DEG = 1.0  # largest angle in a flat face
STRAIGHT_UP = 0.9998  # cosine from which on a face is level: balls lie on it
MOST_PADS = 8  # faces under one pad
MOSTLY = 0.9  # share of an area that counts as all of it
MET = 0.5  # share of a surface in the chamber from which on the shot meets it
# Names of what fits to other parts, whose size and finish shot would change.
NEVER = re.compile(
    r"(?<![a-z])(?:bores?|(?:\w+.)?holes?|threads?|(?:bearing|valve)?.?seats?|key.?ways?|splines?)"
    r"(?![a-z])",
    re.I,
)


def is_met(design: Design, chamber: Chamber, surface: Surface) -> bool:
    """Return whether a surface lies in the chamber for the most part, beside the target."""
    inside, whole = met_area(design, chamber, surface)
    return inside > MET * whole


def met_area(design: Design, chamber: Chamber, surface: Surface) -> tuple[float, float]:
    """Return the area of a surface in the chamber beside the target, and its whole area [m²]."""
    rows = rows_of(design, surface.keys)
    inside = chamber.exposed_area[rows & ~chamber.part.target].sum()
    return float(inside), float(chamber.part.area[rows].sum())


def rows_of(design: Design, keys: Mapping[str, Any]) -> np.ndarray:
    """Return the rows of the part's triangles that the keys of a selection choose, (m,) bool."""
    return np.asarray(chosen_on_part(design, Selection.model_validate(keys), ""))


def are_holes(
    mesh: PartMesh, known: Sequence[Surface], names: Sequence[str], holes: Sequence[Bore]
) -> bool:
    """Return whether surfaces of these names are no more than the walls of holes."""
    area = areas(mesh.vertices, mesh.triangles)
    chosen = np.any([one.triangles for one in known if one.name in names] or [area < 0.0], axis=0)
    walls = np.any([one.triangles for one in holes], axis=0)
    return bool(area[chosen & ~walls].sum() <= (1.0 - MOSTLY) * area[chosen].sum())


def to_be_plugged(
    design: Design, chamber: Chamber, bores: Sequence[Bore], names: Sequence[str]
) -> list[Bore]:
    """Return the bores that bear one of these names, or that the chamber's wall cuts."""
    found, area = [], chamber.part.area
    named = np.zeros(len(area), dtype=bool)
    if names:
        named = rows_of(design, {"surface": list(names)})
    for bore in bores:
        rows = rows_of(design, {"faces": [bore.wall]})
        whole, inside = area[rows].sum(), chamber.exposed_area[rows].sum()
        is_named = area[rows & named].sum() > MOSTLY * whole
        if is_named or (1.0 - MOSTLY) * whole < inside < MOSTLY * whole:
            found.append(bore)
    return found


def to_be_masked(design: Design, chamber: Chamber, known: Sequence[Surface]) -> list[str]:
    """Return the names of surfaces that the shot meets and that must not be peened."""
    named = [one for one in known if "surface" in one.keys and NEVER.search(one.name)]
    return [one.name for one in named if is_met(design, chamber, one)]


def pads(mesh: PartMesh, target: np.ndarray, turns: Turns, ball: float) -> list[dict[str, Any]]:
    """Return keys that choose the level faces on which balls would lie, the most faces first.

    A pad on them fills the room up to the ceiling. No face of the target is among them.

    Args:
        target: marks the triangles to be peened, (m,).
        turns: turns of the part in the chamber [degrees].
        ball: diameter of a ball [m].
    """
    faces = Faces(mesh.vertices, mesh.triangles, FLAT_DEG)
    up = faces.area_vectors @ rotation_matrix(turns)[2]
    level = faces.free_of(target) & (up > STRAIGHT_UP * faces.area) & (faces.area > ball * ball)
    found = np.flatnonzero(level)
    found = found[np.argsort(-faces.area[found], kind="stable")][:MOST_PADS]
    keys = [{"at_mm": faces.place_mm(int(one)), "crease_deg": FLAT_DEG} for one in found]
    return [{"faces": one} for one in (keys, keys[:1])[: len(keys)] if one]
