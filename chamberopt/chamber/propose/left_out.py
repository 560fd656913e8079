"""Offer what may be left out of a proposed target: what faces away, and what no ball touches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from chamberopt.chamber.part import chosen_triangles
from chamberopt.chamber.propose.proposal import Proposal, touched_share
from chamberopt.chamber.propose.proposed_mask import MET, met_area
from chamberopt.chamber.propose.proposed_target import RUNNING, Surface, area_in_mm2, named_or_all
from chamberopt.geometry.triangles import area_vectors, areas, rotation_matrix, unit_vectors

AWAY_DEG = 105.0  # angle to the way down from which on a face is turned away from the sonotrode
LEAST = 0.02  # share of the target's area below which nothing is offered
NEARLY_ALL, MOST_NAMED = 0.9, 3
MOST_LOOKED_AT = 20  # surfaces, the largest
# Share of the target's area from which on what is met of a surface is named, though most of it lies
# outside of the chamber.
PARTLY_MET = 0.05


@dataclass(frozen=True)
class LeftOut:
    """What may be left out of a target, and the keys of [part.target] that leave it out.

    Without keys it is what the shot meets beside the target, and the text is a whole sentence.
    """

    keys: dict[str, object]
    text: str


def find_left_out(proposal: Proposal) -> list[LeftOut]:
    """Return what of a proposed target faces away from the sonotrode or is hidden from the shot."""
    mesh, part = proposal.mesh, proposal.design.part
    target, area = chosen_triangles(mesh, part.target), areas(mesh.vertices, mesh.triangles)
    down = -rotation_matrix(part.rotate_deg)[2]
    normals = unit_vectors(area_vectors(mesh.vertices, mesh.triangles))
    away = target & (normals @ down < np.cos(np.radians(AWAY_DEG)))
    found = []
    whole = [
        one
        for one in proposal.known
        if area[one.triangles & away].sum() > NEARLY_ALL * area[one.triangles].sum()
    ]
    # The upper half of a round surface is no face that could be left out.
    of_faces = np.any([one.triangles for one in whole], axis=0) & away
    share = area[away].sum() / area[target].sum()
    if share > LEAST and area[of_faces].sum() > 0.5 * area[away].sum():
        named = ", ".join(one.name for one in whole[:MOST_NAMED])
        direction = [round(float(x), 4) + 0.0 for x in down]
        keys: dict[str, object] = {"direction": direction, "angle_deg": [0.0, AWAY_DEG]}
        found.append(LeftOut(keys, f"the {share:.0%} that face away from the sonotrode ({named})"))
    hidden = 1.0 - touched_share(proposal)
    if hidden > LEAST and not part.target.reachable:
        found.append(LeftOut({"reachable": True}, f"the {hidden:.0%} that no ball touches here"))
    others = [one for one in proposal.known if not np.any(one.triangles & target)]
    found += _met_beside(proposal, others[:MOST_LOOKED_AT], float(area[target].sum()))
    return found


def _met_beside(
    proposal: Proposal, others: Sequence[Surface], target_area: float
) -> Iterator[LeftOut]:
    """Yield what the shot meets of the part beside its target, the largest surfaces by name.

    Args:
        target_area: area of the target [m²].
    """
    design, chamber = proposal.design, proposal.chamber
    areas_of = ((one, met_area(design, chamber, one)) for one in named_or_all(others))
    met = [
        (one, inside, whole)
        for one, (inside, whole) in areas_of
        if inside > min(MET * whole, PARTLY_MET * target_area)
    ]
    if not met:
        return
    met.sort(key=lambda one: (not RUNNING.search(one[0].name), one[1] <= MET * one[2]))
    names = [
        f"{one.name} ({area_in_mm2(inside)}{'' if inside > NEARLY_ALL * whole else ' of it'})"
        for one, inside, whole in met[:MOST_NAMED]
    ]
    more = f" and {len(met) - MOST_NAMED} more" if len(met) > MOST_NAMED else ""
    runs = "runs or fits by its name, and " if RUNNING.search(met[0][0].name) else ""
    yield LeftOut(
        {},
        f"NOT MASKED: the shot also meets {', '.join(names)}{more}; {runs}what has to keep its "
        "size and finish takes a [mask] (docs/how_to/chambers.md)",
    )
