"""What can be known of a design without simulating it: volumes, shot, target, and what looks wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber import TAG_PART, TAG_SONOTRODE, TAG_WALL, turning_axis
from chamberopt.groups import free_path
from chamberopt.ledges import ledges
from chamberopt.process import chamber_mesh, require_countable, require_turnable
from chamberopt.shapes.cylinder import Cylinder
from chamberopt.shapes.surface import ShapeSurface
from chamberopt.slivers import THINNEST
from chamberopt.triangles import area_vectors, tetrahedron_volumes

if TYPE_CHECKING:
    from chamberopt.chamber import Chamber
    from chamberopt.config import Design

# Above this share of the free volume the shot is a shaken bed rather than a gas: few balls reach the part,
# and event-driven simulation slows down, because collisions crowd.
CROWDED = 0.3
THIN = 10.0  # chamber heights between two meetings of a ball: from there on few dents come from balls that met


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
    shape = _shape(design, chamber)
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
            "shape_volume_cm3": _rounded(float(tetrahedron_volumes(shape.vertices, shape.triangles).sum()) * 1e6),
            "free_volume_cm3": _rounded(chamber.volume * 1e6),
            "part_triangles": int((chamber.tags == TAG_PART).sum()),
            "sonotrode_triangles": int((chamber.tags == TAG_SONOTRODE).sum()),
            "wall_triangles": int((chamber.tags == TAG_WALL).sum()),
        },
        **_turn(design),
        "sonotrode": {"peak_speed_m_s": _rounded(design.sonotrode.peak_speed)},
        "shot": {
            "balls": shot.count,
            "ball_mass_mg": _rounded(shot.ball_mass * 1e6),
            "mass_g": _rounded(shot.count * shot.ball_mass * 1e3),
            "packing_fraction": _rounded(shot.volume / chamber.volume),
        },
        "simulated_time_s": _rounded(simulated),
        "notes": [*chamber.notes, *(ledge.said for ledge in ledges(design, chamber) if not ledge.level)],
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
    path = free_path(design, chamber)
    if not design.effects.ball_collisions and path < THIN:
        said.append(
            f"effects.ball_collisions is false, though a ball would meet another every {path:.2g} chamber heights: "
            "they fly through each other; switch it on"
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
    crossing = _through_side_wall(design, chamber)
    if crossing is not None:
        low, high = crossing
        said.append(
            f"the part goes out through the side wall between z = {1e3 * low:.4g} and {1e3 * high:.4g} mm: what is "
            "outside is not peened; raise chamber.diameter_mm, or check part.offset_mm"
        )
    return said + [ledge.said for ledge in ledges(design, chamber) if ledge.level]


def _turn(design: Design) -> dict[str, Any]:
    """How the part turns, if it does: its axis in the chamber's frame."""
    turn = design.effects.part_turn
    if turn is None:
        return {}
    point, axis = turning_axis(design)
    motion = (
        {"rpm": turn.rpm} if turn.rpm is not None else {"angle_deg": turn.angle_deg, "frequency_hz": turn.frequency_hz}
    )
    return {
        "part_turn": {
            **motion,
            "through_mm": [_rounded(x * 1e3) for x in point],
            "axis": [_rounded(x) for x in axis / np.linalg.norm(axis)],
        }
    }


def _through_side_wall(design: Design, chamber: Chamber) -> tuple[float, float] | None:
    """Between which heights [m] part and side wall are joined; None where they are not.

    Not asked of a part that closes the chamber like a lid, nor of one that turns: its joint is a round shaft.
    """
    if design.effects.part_turn is not None or chamber.height < _shape(design, chamber).vertices[:, 2].max() - THINNEST:
        return None
    edges = chamber.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    normal = area_vectors(chamber.vertices, chamber.triangles)
    upright = np.abs(normal[:, 2]) < 0.5 * np.linalg.norm(normal, axis=1)
    own = np.repeat(chamber.tags == TAG_PART, 3)
    beside = np.repeat((chamber.tags == TAG_WALL) & upright, 3)
    of_part, of_wall = ({tuple(edge) for edge in np.sort(edges[rows]).tolist()} for rows in (own, beside))
    height = chamber.vertices[np.array(sorted(of_part & of_wall), dtype=int).reshape(-1, 2), 2]
    return (float(height.min()), float(height.max())) if height.size else None


def _gaps(design: Design, chamber: Chamber) -> list[tuple[str, float, str]]:
    """Clear widths [m] between the part and the walls; 0 where they touch.

    A Design has room for a ball over its sonotrode where the part is put, but it may turn down into that.
    """
    corners = chamber.vertices[chamber.triangles]  # (k, 3, 3)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    upwards = normal[:, 2] < -0.5 * np.linalg.norm(normal, axis=1)  # out of the cavity is into the part
    part = chamber.tags == TAG_PART
    gaps = []
    if isinstance(design.chamber, Cylinder):
        apothem = design.chamber.diameter / 2.0 * np.cos(np.pi / design.chamber.facets)
        reach = np.hypot(*corners[part].reshape(-1, 3)[:, :2].T).max()
        remedy = "raise chamber.diameter_mm or check part.offset_mm"
        gaps.append(("part and side wall", max(0.0, apothem - reach), remedy))
    turn = design.effects.part_turn
    if turn is not None:
        lowest = _lowest_on_its_way(design, corners[part].reshape(-1, 3), turn.swing)
        below = max(0.0, lowest - design.sonotrode.amplitude)
        gaps.append(("turning part and sonotrode", below, "raise chamber.sonotrode_distance_mm"))
    if (part & upwards).any():
        above = chamber.height - corners[part & upwards][..., 2].max()
        gaps.append(("part and ceiling", max(0.0, above), "raise chamber.height_mm or close the gap"))
    return gaps


def _lowest_on_its_way(design: Design, points: np.ndarray, swing: float | None) -> float:
    """How low [m] points (n, 3) of the turning part get, going round or ``swing`` [rad] to each side.

    At angle a of the part a point is at c + r cos(a - a0) for some c, r and a0: lowest where a is furthest from a0.
    """
    point, axis = turning_axis(design)
    axis = axis / np.linalg.norm(axis)
    offset = points - point
    along = (offset @ axis)[:, None] * axis
    across, ahead = (offset - along)[:, 2], np.cross(axis, offset)[:, 2]
    furthest = np.minimum(np.abs(np.arctan2(ahead, across)) + (np.pi if swing is None else swing), np.pi)
    return float((point[2] + along[:, 2] + np.hypot(across, ahead) * np.cos(furthest)).min())


def _shape(design: Design, chamber: Chamber) -> ShapeSurface:
    """The cavity as it would be without the part."""
    return design.chamber.surface(chamber.part.vertices, chamber.part.triangles)


def _rounded(value: float) -> float:
    """Six figures: facts for reading, not for arithmetic."""
    return float(f"{value:.6g}")
