"""The flexure of a chamber's thin part: for the simulator, as facts, and for a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.thin_part import LOSS, mobility, zener_factor
from chamberopt.design.flexure import plate_metals
from chamberopt.design.shape_surface import TAG_PART

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.part import Part
    from chamberopt.design.design import Design
    from sim_core import AnalyticCavity, Flexure, TriangleMesh


def softness_of_part(design: Design, part: Part) -> np.ndarray | None:
    """Return the restitution of each triangle over that of a rigid part, (m,), for a picture.

    It is Zener's e of the largest ball at the sonotrode's peak speed; None for a rigid part.
    """
    metals = plate_metals(design)
    if part.thickness is None or metals is None:
        return None
    return zener_factor(design, metals, part.thickness)


def mean_softness(design: Design, chamber: Chamber) -> float:
    """Return the mean of softness_of_part over the target in the chamber; 1 for a rigid part."""
    softness = softness_of_part(design, chamber.part)
    area = chamber.exposed_area * chamber.part.target
    return 1.0 if softness is None else float(area @ softness / area.sum())


def flexure_facts(design: Design, chamber: Chamber) -> dict[str, dict[str, object]]:
    """Return facts on the target where flexure is simulated; none elsewhere.

    Shares are of the target's area in the chamber. A note has how thin the target is.
    """
    softness = softness_of_part(design, chamber.part)
    if softness is None:
        return {}
    area = chamber.exposed_area * chamber.part.target
    return {
        "flexure": {
            "lowers_restitution_on_share": float(
                f"{area[softness < 1.0 - LOSS].sum() / area.sum():.3g}"
            ),
            "restitution_times": float(f"{mean_softness(design, chamber):.3g}"),
        }
    }


def mobility_of_part(design: Design, part: Part) -> np.ndarray | None:
    """Return the mobility of each triangle of a part [s/kg], (m,); None if it counts as rigid."""
    given, metals = design.effects.flexure, plate_metals(design)
    if part.thickness is None or metals is None or (given is not None and not given.on):
        return None
    return mobility(metals, part.thickness)


def flexure_of_surfaces(
    design: Design, chamber: Chamber, mesh: TriangleMesh | AnalyticCavity
) -> Flexure | None:
    """Return the flexure of the surfaces of a scene; None if the part counts as rigid.

    In an analytical cavity, whose ceiling is the part, the ceiling has its mean mobility.

    Args:
        mesh: mesh of the chamber, or its analytical cavity.
    """
    from sim_core import AnalyticCavity, Flexure

    metals, of_part = plate_metals(design), mobility_of_part(design, chamber.part)
    if metals is None or of_part is None:
        return None
    if isinstance(mesh, AnalyticCavity):
        area = chamber.exposed_area
        of_surfaces = np.where(mesh.tags == TAG_PART, area @ of_part / area.sum(), 0.0)
    else:
        # a source of -1, off the part, reads the appended 0
        of_surfaces = np.append(of_part, 0.0)[chamber.source]
    return Flexure(of_surfaces, metals.contact_modulus)
