"""What can be known of a design without simulating it: volumes, shot, target, and what looks wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber.build import TAG_PART, TAG_SONOTRODE, TAG_WALL, hidden_share, turning_axis
from chamberopt.chamber.checks.gaps import gap_warnings, pocket_warnings, target_warnings
from chamberopt.chamber.checks.ledges import ledges
from chamberopt.chamber.checks.place_names import CEILING, SIDE_WALL, on_target, surface_names
from chamberopt.chamber.dimensionless import free_path
from chamberopt.chamber.reach.reach import Reach, reach
from chamberopt.chamber.scene import chamber_mesh, require_ball_count, require_turnable
from chamberopt.design.shapes import is_sonotrode
from chamberopt.design.shapes.construction.surface import ShapeSurface
from chamberopt.geometry.triangles import areas, tetrahedron_volumes

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import TriangleMesh

# Above this share of the free volume the shot is a shaken bed rather than a gas: few balls reach the part,
# and event-driven simulation slows down, because collisions crowd.
CROWDED = 0.3
CLEAR_AMPLITUDES = (
    10.0  # between part and sonotrode, as a design's sonotrode_distance_mm has to have
)
MUCH_HIDDEN = 0.05  # of the target's area: cut off by a ceiling or wall that is in the wrong place
THIN = 10.0  # chamber heights between two meetings of a ball: from there on few dents come from balls that met


def describe(design: Design, chamber: Chamber, found: Reach | None = None) -> dict[str, Any]:
    """Facts and warnings on a design and its chamber, as plain JSON values; units are in the names.

    ``found``: its `shot_reach`, if it is known. Raises InputError when the shot has more balls than can be simulated,
    or the part cannot turn as asked; sim_core.SceneError, with the place, for a cavity that leaks.
    """
    require_ball_count(design)
    found = shot_reach(design, chamber) if found is None else found
    if design.effects.part_turn is not None:
        require_turnable(design, found.mesh)
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
            "shape_volume_cm3": _rounded(
                float(tetrahedron_volumes(shape.vertices, shape.triangles).sum()) * 1e6
            ),
            "free_volume_cm3": _rounded(chamber.volume * 1e6),
            "closed": "yes",  # what leaks has been refused above
            "sonotrode_clearance_mm": _rounded(sonotrode_clearance(found.mesh) * 1e3),
            "part_triangles": int((chamber.tags == TAG_PART).sum()),
            "sonotrode_triangles": int(is_sonotrode(chamber.tags).sum()),
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
        "reach": _reach_facts(found, chamber),
        "simulated_time_s": _rounded(simulated),
        "notes": [
            *chamber.notes,
            *(ledge.said for ledge in ledges(design, chamber) if not ledge.level),
        ],
        "warnings": warnings(design, chamber, found),
    }


def shot_reach(design: Design, chamber: Chamber) -> Reach:
    """What the shot can reach; a part that turns, where it is drawn. A second or two."""
    return reach(chamber_mesh(chamber), min(design.shot.diameters), design.shot.diameter)


def warnings(design: Design, chamber: Chamber, found: Reach | None = None) -> list[str]:
    """What is allowed but probably not meant, each with what to do; ``found``: its `shot_reach`, if it is known."""
    found = shot_reach(design, chamber) if found is None else found
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
    hidden = hidden_share(chamber.part, chamber.exposed_area)
    if hidden > MUCH_HIDDEN:
        said.append(
            f"{hidden:.0%} of the target's area is outside the chamber and counts as not covered: enlarge the chamber, "
            "or narrow [part.target] to what is to be peened"
        )
    path = free_path(design, chamber)
    if not design.effects.ball_collisions and path < THIN:
        said.append(
            f"effects.ball_collisions is false, though a ball would meet another every {path:.2g} chamber heights: "
            "they fly through each other; switch it on"
        )
    turn, recorded = (
        design.effects.part_turn,
        design.process.accuracy.replicas * design.process.recorded_time,
    )
    if turn is not None and turn.rpm != 0.0 and recorded < turn.period:
        said.append(
            f"the part takes {turn.period:.3g} s to turn once, the replicas together last "
            f"{recorded:.3g} s: coverage is that of some of its positions only; "
            "raise process.accuracy"
        )
    said += _sonotrode_warnings(design, found.mesh)
    said += target_warnings(found, chamber, design.part.target.reachable) + pocket_warnings(
        found, chamber
    )
    said += gap_warnings(found, chamber, ball, turns=turn is not None)
    crossing = _through_side_wall(design, chamber)
    if crossing is not None:
        low, high = crossing
        said.append(
            f"the part goes out through the side wall between z = {1e3 * low:.4g} and {1e3 * high:.4g} mm: what is "
            "outside is not peened; enlarge the chamber (chamber.diameter_mm), or check part.offset_mm"
        )
    return said + [ledge.said for ledge in ledges(design, chamber) if ledge.level]


def _reach_facts(found: Reach, chamber: Chamber) -> dict[str, Any]:
    """How much of target and part the smallest balls can touch, of what is in the chamber."""
    own = {"target": on_target(chamber), "part": chamber.tags == TAG_PART}
    size = areas(chamber.vertices, chamber.triangles)
    facts: dict[str, Any] = {"ball_mm": _rounded(found.diameter * 1e3)}
    for name, rows in own.items():
        touched = float((found.share * size)[rows].sum())
        facts[f"{name}_reachable_mm2"] = _rounded(touched * 1e6)
        facts[f"{name}_reachable_share"] = _rounded(touched / size[rows].sum())
    return facts


def _turn(design: Design) -> dict[str, Any]:
    """How the part turns, if it does: its axis in the chamber's frame."""
    turn = design.effects.part_turn
    if turn is None:
        return {}
    point, axis = turning_axis(design)
    motion = (
        {"rpm": turn.rpm}
        if turn.rpm is not None
        else {"angle_deg": turn.angle_deg, "frequency_hz": turn.frequency_hz}
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

    Not asked of a part that closes the chamber like a lid, nor of one that turns: its joint is a round shaft; nor
    where there is a hole for a fixture, or the part is drawn with its chamber.
    """
    if (
        design.chamber.holes
        or design.effects.part_turn is not None
        or design.chamber.setup() is not None
    ):
        return None
    names = surface_names(chamber)
    if not (names == CEILING).any():
        return None
    edges = chamber.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    own = np.repeat(chamber.tags == TAG_PART, 3)
    beside = np.repeat(names == SIDE_WALL, 3)
    of_part, of_wall = (
        {tuple(edge) for edge in np.sort(edges[rows]).tolist()} for rows in (own, beside)
    )
    height = chamber.vertices[np.array(sorted(of_part & of_wall), dtype=int).reshape(-1, 2), 2]
    return (float(height.min()), float(height.max())) if height.size else None


def _sonotrode_warnings(design: Design, mesh: TriangleMesh) -> list[str]:
    """What the sonotrode, or a ball on it, may hit."""
    amplitude, ball = design.sonotrode.amplitude, design.shot.diameter
    remedy = "raise chamber.sonotrode_distance_mm"
    clear, turn = sonotrode_clearance(mesh), design.effects.part_turn
    if clear < CLEAR_AMPLITUDES * amplitude:
        return [
            f"part and sonotrode are only {1e3 * clear:.3g} mm apart, less than ten amplitudes of "
            f"{1e6 * amplitude:g} µm: they may hit each other; {remedy}"
        ]
    if turn is None:
        return []
    own = mesh.vertices[mesh.triangles[mesh.tags == TAG_PART]].reshape(-1, 3)
    below = _lowest_on_its_way(design, own, turn.amplitude) - amplitude
    if not 0.0 < below < ball:
        return []
    return [
        f"the gap between turning part and sonotrode is {below * 1e3:.3g} mm, narrower than a ball of "
        f"{ball * 1e3:g} mm: a ball may be jammed there as the part turns; {remedy}"
    ]


def sonotrode_clearance(mesh: TriangleMesh) -> float:
    """Least distance [m] from a corner of the part to the sonotrode, or the other way; inf without one of them."""
    from sim_core import closest_points

    if not ((mesh.tags == TAG_PART).any() and (mesh.tags == TAG_SONOTRODE).any()):
        return float("inf")
    whole = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    ways = ((TAG_PART, TAG_SONOTRODE), (TAG_SONOTRODE, TAG_PART))
    corners = (np.unique(mesh.triangles[mesh.tags == one]) for one, _ in ways)
    return min(
        float(closest_points(mesh, mesh.vertices[these], whole, other).distance.min())
        for these, (_, other) in zip(corners, ways, strict=True)
    )


def _lowest_on_its_way(design: Design, points: np.ndarray, swing: float | None) -> float:
    """How low [m] points (n, 3) of the turning part get, going round or ``swing`` [rad] to each side.

    At angle a of the part a point is at c + r cos(a - a0) for some c, r and a0: lowest where a is furthest from a0.
    """
    point, axis = turning_axis(design)
    axis = axis / np.linalg.norm(axis)
    offset = points - point
    along = (offset @ axis)[:, None] * axis
    across, ahead = (offset - along)[:, 2], np.cross(axis, offset)[:, 2]
    furthest = np.minimum(
        np.abs(np.arctan2(ahead, across)) + (np.pi if swing is None else swing), np.pi
    )
    return float((point[2] + along[:, 2] + np.hypot(across, ahead) * np.cos(furthest)).min())


def _shape(design: Design, chamber: Chamber) -> ShapeSurface:
    """The cavity as it would be without the part."""
    return design.chamber.surface(chamber.part.vertices, chamber.part.triangles)


def _rounded(value: float) -> float:
    """Six figures: facts for reading, not for arithmetic."""
    return float(f"{value:.6g}")
