"""What can be known of a design without simulating it: volumes, shot, target, and what looks wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber import TAG_PART, TAG_SONOTRODE, TAG_WALL
from chamberopt.process import chamber_mesh, require_countable, require_turnable
from chamberopt.shapes import shape_surface

if TYPE_CHECKING:
    from chamberopt.chamber import Chamber
    from chamberopt.config import Design

# Above this share of the free volume the shot is a shaken bed rather than a gas: few balls reach the part,
# and event-driven simulation slows down, because collisions crowd.
CROWDED = 0.3


def describe(design: Design, chamber: Chamber) -> dict[str, Any]:
    """Facts and warnings on a design and its chamber, as plain JSON values; units are in the names.

    Raises InputError when the shot has more balls than can be simulated, or the part cannot turn as asked.
    """
    require_countable(design)
    if design.effects.part_turn is not None:
        require_turnable(design, chamber_mesh(chamber))
    part, shot, process = chamber.part, design.shot, design.process
    exposed = chamber.exposed_area > 0.0
    box = part.vertices.max(axis=0) - part.vertices.min(axis=0)
    shape = _volume(*_surface(design))
    simulated = process.accuracy.replicas * (process.recorded_time + process.accuracy.warmup_time)
    return {
        "part": {
            "mesh": str(design.part.mesh_path),
            "unit": part.unit,
            "names": list(part.names),
            "triangles": len(part.triangles),
            "bounding_box_mm": [_rounded(side * 1e3) for side in box],
            "area_mm2": _rounded(part.area.sum() * 1e6),
            "exposed_area_mm2": _rounded(chamber.exposed_area.sum() * 1e6),
        },
        "target": {
            "triangles": int(part.target.sum()),
            "exposed_triangles": int((part.target & exposed).sum()),
            "area_mm2": _rounded(part.area[part.target].sum() * 1e6),
            "exposed_area_mm2": _rounded(chamber.exposed_area[part.target].sum() * 1e6),
        },
        "chamber": {
            "shape": design.chamber.shape,
            "shape_volume_cm3": _rounded(shape * 1e6),
            "free_volume_cm3": _rounded(chamber.volume * 1e6),
            "part_triangles": int((chamber.tags == TAG_PART).sum()),
            "sonotrode_triangles": int((chamber.tags == TAG_SONOTRODE).sum()),
            "wall_triangles": int((chamber.tags == TAG_WALL).sum()),
        },
        "sonotrode": {"peak_speed_m_s": _rounded(design.sonotrode.peak_speed)},
        "shot": {
            "balls": shot.count,
            "ball_mass_mg": _rounded(shot.ball_mass * 1e6),
            "mass_g": _rounded(shot.count * shot.ball_mass * 1e3),
            "packing_fraction": _rounded(shot.volume / chamber.volume),
        },
        "simulated_time_s": _rounded(simulated),
        "notes": list(chamber.notes),
        "warnings": warnings(design, chamber),
    }


def warnings(design: Design, chamber: Chamber) -> list[str]:
    """What is allowed but probably not meant, each with what to do."""
    shot, said = design.shot, []
    ball = shot.diameter
    filled = shot.volume / chamber.volume
    if filled > CROWDED:
        said.append(
            f"the balls fill {filled:.0%} of the free volume; above {CROWDED:.0%} they hinder each other: "
            "lower shot.mass_g or enlarge the chamber"
        )
    if abs(shot.count * shot.ball_mass - shot.mass) > 0.05 * shot.mass:
        said.append(
            f"shot.mass_g = {shot.mass_g:g} is rounded to {shot.count} whole ball(s) of "
            f"{shot.ball_mass * 1e6:.3g} mg: the charge differs by more than 5 %"
        )
    turn, recorded = design.effects.part_turn, design.process.accuracy.replicas * design.process.recorded_time
    if turn is not None and turn.rpm != 0.0 and recorded < turn.period:
        said.append(
            f"the part takes {turn.period:.3g} s to turn once, the replicas together last "
            f"{recorded:.3g} s: coverage is that of some of its positions only; "
            "raise process.accuracy"
        )
    caught = "no ball gets in there" if turn is None else "a ball may be jammed there as the part turns"
    for place, gap, remedy in _gaps(design, chamber):
        if 0.0 < gap < ball:
            said.append(
                f"the gap between {place} is {gap * 1e3:.3g} mm, narrower than a ball of "
                f"{ball * 1e3:g} mm: {caught}; {remedy}"
            )
    return said


def _gaps(design: Design, chamber: Chamber) -> list[tuple[str, float, str]]:
    """Clear widths [m] between the part and what surrounds it; 0 where they touch."""
    corners = chamber.vertices[chamber.triangles]  # (k, 3, 3)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    upwards = normal[:, 2] < -0.5 * np.linalg.norm(normal, axis=1)  # out of the cavity is into the part
    part = chamber.tags == TAG_PART
    apothem = design.chamber.diameter / 2.0 * np.cos(np.pi / design.chamber.facets)
    reach = np.hypot(*corners[part].reshape(-1, 3)[:, :2].T).max()
    below = design.chamber.sonotrode_distance - design.sonotrode.amplitude
    gaps = [
        ("part and sonotrode", below, "raise chamber.sonotrode_distance_mm"),
        (
            "part and side wall",
            max(0.0, apothem - reach),
            "raise chamber.diameter_mm or check part.offset_mm",
        ),
    ]
    if (part & upwards).any():
        above = design.chamber.height - corners[part & upwards][..., 2].max()
        gaps.append(("part and ceiling", max(0.0, above), "raise chamber.height_mm or close the gap"))
    return gaps


def _surface(design: Design) -> tuple[np.ndarray, np.ndarray]:
    shape = shape_surface(design)
    return shape.vertices, shape.triangles


def _volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """Volume inside a closed surface: the tetrahedra from the origin to each triangle, signed."""
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def _rounded(value: float) -> float:
    """Six figures: facts for reading, not for arithmetic."""
    return float(f"{value:.6g}")
