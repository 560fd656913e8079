"""Collect facts about a design before it is simulated, such as volumes, shot and clearances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber.checks.check import (
    notes,
    reached_share,
    shot_reach,
    sonotrode_clearance,
    warnings,
)
from chamberopt.chamber.checks.fillets import touched_by_curvature
from chamberopt.chamber.fixture import plugs_of
from chamberopt.chamber.flexure import flexure_facts, flexure_of_surfaces
from chamberopt.chamber.part import turning_axis
from chamberopt.chamber.reach import Reach, reached_part_share
from chamberopt.chamber.replica_seed import replica_seed
from chamberopt.chamber.scene import build_scene, require_ball_count, require_turnable
from chamberopt.design.shape_surface import TAG_PART, TAG_WALL, is_sonotrode
from chamberopt.design.tolerances import require_tolerances, tolerance_box
from chamberopt.geometry.triangles import areas, tetrahedron_volumes

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.fixture import Plug
    from chamberopt.chamber.part import Part
    from chamberopt.design.load import Design
    from sim_core import TriangleMesh

Facts = dict[str, object]
"""JSON values by name, with the unit in the name."""


def describe(design: Design, chamber: Chamber) -> dict[str, Any]:
    """Return facts about a design and its chamber, as JSON values with named units.

    "notes" are sentences, and "warnings" are each a DesignWarning.

    Raises:
        InputError: there are too many balls, or the part cannot turn.
        sim_core.SceneError: the cavity is not closed; the message says where.
    """
    if chamber.steps:
        return _describe_steps(design, chamber)
    require_ball_count(design)
    reach = shot_reach(design, chamber)
    axis = turning_axis(design, chamber.part)
    require_turnable(design, reach.mesh, axis)
    if not design.effects.auto:  # a scene is built to see if the shot fits
        flexure = flexure_of_surfaces(design, chamber, reach.mesh)
        build_scene(design, reach.mesh, replica_seed(design.process.seed, 0), axis, flexure)
    process = design.process
    accuracy = process.accuracy
    simulated = accuracy.replicas * (process.recorded_time + accuracy.warmup_time)
    return {
        **with_clearance(first_facts(design, chamber), reach.mesh),
        **_zone_facts(reach, chamber),
        **_fixture_facts(design, chamber),
        **_turn_facts(design, chamber.part),
        **flexure_facts(design, chamber),
        "materials": {name: law.in_words for name, law in design.materials},
        "reach": _reach_facts(reach, chamber),
        **_tolerance_facts(design),
        "replicas": {
            "count": accuracy.replicas,
            "most": accuracy.replicas
            if accuracy.objective_half_width is None
            else accuracy.max_replicas,
            "recorded_s": _rounded(process.recorded_time),
            "warmup_s": _rounded(accuracy.warmup_time),
            "simulated_s_in_all": _rounded(simulated),
        },
        "notes": notes(design, chamber),
        "warnings": warnings(design, chamber),
    }


def _describe_steps(design: Design, chamber: Chamber) -> dict[str, Any]:
    """Return facts and warnings about a design with steps, first those of its first step."""
    steps = [*zip(design.in_steps.items(), chamber.steps, strict=True)]
    found = {name: describe(one, room) for (name, one), room in steps}
    first, told = found[steps[0][0][0]], {}
    for (name, one), room in steps:
        facts = found[name]
        told[name] = {
            "treatment_time_s": _rounded(one.process.treatment_time),
            "recorded_s": _rounded(one.process.recorded_time),
            "lowest_point_mm": facts["part"]["lowest_point_mm"],
            "target_exposed_area_mm2": facts["target"]["exposed_area_mm2"],
            "target_reachable_share": facts["reach"]["target_reachable_share"],
            "free_volume_cm3": _rounded(room.volume * 1e6),
            "balls": facts["shot"]["balls"],
        }
    accuracy, own = design.process.accuracy, len(found) * design.process.accuracy.warmup_time
    replicas = first["replicas"] | {
        "recorded_s": _rounded(design.process.recorded_time),
        "simulated_s_in_all": _rounded(accuracy.replicas * (design.process.recorded_time + own)),
    }
    return {
        **first,
        **with_clearance(first_facts(design, chamber), chamber.mesh),
        "replicas": replicas,
        "steps": told,
        "notes": notes(design, chamber),
        "warnings": warnings(design, chamber),
    }


def first_facts(design: Design, chamber: Chamber) -> dict[str, Facts]:
    """Return the facts that are known as soon as the chamber is built, by subject and name."""
    part, shot = chamber.part, design.shot
    exposed = chamber.exposed_area > 0.0
    box, low = np.ptp(part.vertices, axis=0), part.vertices.min(axis=0)
    shape = design.chamber.surface(part.vertices, part.triangles)  # without the part
    shape_volume = float(tetrahedron_volumes(shape.vertices, shape.triangles).sum())
    return {
        "part": {
            "mesh": str(design.part.mesh_path),
            "unit": part.unit,
            "names": list(part.names),
            "triangles": len(part.triangles),
            "bounding_box_mm": [_rounded(side * 1e3) for side in box],
            "box_middle_mm": [_rounded(x * 1e3) for x in low[:2] + 0.5 * box[:2]],  # from the axis
            "lowest_point_mm": _rounded(low[2] * 1e3),
            "area_mm2": _rounded(part.area.sum() * 1e6),
            "exposed_area_mm2": _rounded(chamber.exposed_area.sum() * 1e6),
            **_smoothing_facts(part, min(shot.diameters)),
        },
        "target": {
            "triangles": int(part.target.sum()),
            "exposed_triangles": int((part.target & exposed).sum()),
            "area_mm2": _rounded(part.area[part.target].sum() * 1e6),
            "exposed_area_mm2": _rounded(chamber.exposed_area[part.target].sum() * 1e6),
        },
        "chamber": {
            "shape": design.chamber.shape,
            "shape_volume_cm3": _rounded(shape_volume * 1e6),
            "free_volume_cm3": _rounded(chamber.volume * 1e6),
            "part_triangles": int((chamber.tags == TAG_PART).sum()),
            "sonotrode_triangles": int(is_sonotrode(chamber.tags).sum()),
            "wall_triangles": int((chamber.tags == TAG_WALL).sum()),
        },
        "sonotrode": {
            "amplitude_um": _rounded(1e6 * design.sonotrode.amplitude),
            "amplitude_pv_um": _rounded(2e6 * design.sonotrode.amplitude),
            "peak_speed_m_s": _rounded(design.sonotrode.peak_speed),
        },
        "shot": {
            "balls": shot.count,
            "ball_mass_mg": _rounded(shot.ball_mass * 1e6),
            "mass_g": _rounded(shot.count * shot.ball_mass * 1e3),
            "packing_fraction": _rounded(shot.volume / chamber.volume),
        },
    }


def _smoothing_facts(part: Part, ball: float) -> Facts:
    """Return facts on how facets of the target's curved surfaces were smoothed; none without any.

    Args:
        ball: diameter of the smallest ball [m].
    """
    facts = part.smoothing
    if facts is None or not facts.facet_turn:
        return {}
    return {
        "facets_deg": _rounded(float(np.degrees(facts.facet_turn))),
        "given_triangles": facts.given_triangles,
        "smoothed_share": _rounded(facts.moved_share),
        "smoothed_at_most_mm": _rounded(facts.largest_move * 1e3),
        "volume_change": _rounded(facts.volume_change),
        "blunt_creases": facts.blunt_creases,
        "coarse_facets_share": _rounded(facts.coarse_share),
        "touched_by_curvature": _rounded(touched_by_curvature(part, ball)),
    }


def with_clearance(facts: dict[str, Facts], mesh: TriangleMesh) -> dict[str, Facts]:
    """Return the facts of `first_facts` with the distance between sonotrode and part added.

    Args:
        mesh: closed mesh of the chamber.
    """
    clearance = _rounded(sonotrode_clearance(mesh) * 1e3)
    more = {"closed": "yes", "sonotrode_clearance_mm": clearance}
    return {**facts, "chamber": facts["chamber"] | more}


def _reach_facts(reach: Reach, chamber: Chamber) -> Facts:
    """Return area and share of the target and of the part that the smallest balls can touch."""
    size = areas(chamber.vertices, chamber.triangles)
    facts: Facts = {"ball_mm": _rounded(reach.diameter * 1e3)}
    for name, rows in (("target", chamber.on_target), ("part", chamber.tags == TAG_PART)):
        share = reached_share(reach, rows)
        facts[f"{name}_reachable_mm2"] = _rounded(share * size[rows].sum() * 1e6)
        facts[f"{name}_reachable_share"] = _rounded(share)
    return facts


def _zone_facts(reach: Reach, chamber: Chamber) -> dict[str, Facts]:
    """Return the size of each zone, and the share of it that the smallest balls can touch.

    The share is of the zone's area inside the cavity.
    """
    part = chamber.part
    share = reached_part_share(reach, chamber.source, len(part.triangles))
    facts: dict[str, Facts] = {}
    for name, zone in part.zones.items():
        exposed = chamber.exposed_area[zone]
        facts[f"zone {name}"] = {
            "triangles": int(zone.sum()),
            "area_mm2": _rounded(part.area[zone].sum() * 1e6),
            "exposed_area_mm2": _rounded(exposed.sum() * 1e6),
            "reachable_share": _rounded(share[zone] @ exposed / exposed.sum()),
        }
    return facts


def _turn_facts(design: Design, part: Part) -> dict[str, Facts]:
    """Return motion and axis of a turning part, in the chamber's frame; nothing if none turns."""
    turn, line = design.effects.part_turn, turning_axis(design, part)
    if turn is None or line is None:
        return {}
    point, axis = line
    swing = {"angle_deg": turn.angle_deg, "frequency_hz": turn.frequency_hz}
    pose = {
        "through_mm": [_rounded(x * 1e3) for x in point],
        "axis": [_rounded(x) for x in axis / np.linalg.norm(axis)],
    }
    return {"part_turn": {**(swing if turn.rpm is None else {"rpm": turn.rpm}), **pose}}


def _fixture_facts(design: Design, chamber: Chamber) -> dict[str, Facts]:
    """Return size and place of holder and mask, and the area of the part under each."""
    facts: dict[str, Facts] = {}
    if design.holder is not None and design.holder.kind == "bore":
        facts["holder"] = {"kind": "bore", "clearance_mm": design.holder.clearance_mm}
    for name, one in chamber.fixtures.items():
        if one.kind == "plugs":
            sizes = _plug_facts(plugs_of(design, chamber.part))
        else:
            sizes = {"size_mm": [_rounded(1e3 * side) for side in one.size]}
            sizes |= {"length_mm": _rounded(1e3 * one.length)} if one.length else {}
        facts[name] = {
            "kind": one.kind,
            **sizes,
            "covered_mm2": _rounded(1e6 * one.covered),
            "covered_target_mm2": _rounded(1e6 * one.covered_target),
        }
    return facts


def _plug_facts(plugs: Sequence[Plug]) -> Facts:
    """Return the number of plugs, and diameter and depth of each size once; {} without any."""
    each = [[float(f"{1e3 * x:.4g}") for x in plug] for plug in plugs]
    sizes = [size for k, size in enumerate(each) if size not in each[:k]]
    if not sizes:
        return {}
    diameters, depths = map(list, zip(*sizes, strict=True))
    return {"holes": len(plugs), "hole_diameters_mm": diameters, "hole_depths_mm": depths}


def _tolerance_facts(design: Design) -> dict[str, Facts]:
    """Return the lowest, given and highest value of each number of a design that has a tolerance.

    Raises InputError if the design is not valid at either end of a range.
    """
    require_tolerances(design)
    box = tolerance_box(design)
    ranges: Facts = {
        k: {"low": a, "start": design.value(k), "high": b} for k, (a, b) in box.items()
    }
    return {"tolerances": ranges} if box else {}


def _rounded(value: float) -> float:
    """Return the value rounded to six digits, for readers."""
    return float(f"{value:.6g}")
