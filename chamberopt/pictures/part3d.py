"""Prepare the part in its chamber for a 3D view on a web page: surfaces, and values to colour them.

The browser makes the colours (part.js). The page carries the values of each quantity at the points
of the target once, in single precision. It can show any quantity, and the coverage at any time:
1 - exp(-dent density · time / treatment time).
"""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from chamberopt.chamber.bores_and_deflectors import on_deflectors
from chamberopt.common.estimate import NOT_PROVEN
from chamberopt.coverage.metrics import tells_coverage
from chamberopt.design.shape_surface import TAG_PART, TAG_WALL, is_sonotrode
from chamberopt.design.sonotrode import Face
from chamberopt.geometry.sight import way_to_see
from chamberopt.geometry.triangles import border_edges
from chamberopt.pictures.charts.colours import EDGES
from chamberopt.pictures.drawn_part import DrawnPart, colour_range, point_areas
from chamberopt.pictures.quantities import QUANTITIES, TIME_TO_98, times_to_98
from chamberopt.results.arrays_file import load_result_arrays
from chamberopt.results.load import Result
from chamberopt.results.vtp_files import JOINTS, MM, ZONE, Surface, cavity_surface, fixture_marks

# A triangle takes about 80 bytes of the page. Up to this number the page stays below 60 MB.
MAX_TRIANGLES = 600_000
BESIDE = 0.35  # room round the target that is looked at first, in lengths of its diagonal
DISTANCE = 2.2  # distance of the camera, in lengths of the cavity's diagonal
EDGE_ANGLE = 30.0  # degrees; sharper edges of the chamber are drawn
SATURATED = 95.0  # %; where nearly all of the target has more, coverage tells no places apart


@dataclass(frozen=True)
class PartScene:
    """The part of one result for a 3D view on a page.

    Args:
        data: surfaces and numbers for part.js; None for a part that is too large.
        remarks: sentences on surfaces that are not shown.
        coverage: coverage at points of the target, 0..1, shape (k,); 0 where no ball fits. None if
            there are too few simulated dents to tell points apart.
        area: area of the surface around each point [mm²], shape (k,).
        is_saturated: whether nearly all of the target is covered to 95 % or more.
        tells_coverage: whether there are enough simulated dents to tell the coverage.
    """

    data: dict[str, Any] | None
    remarks: tuple[str, ...]
    coverage: np.ndarray | None
    area: np.ndarray
    is_saturated: bool = False
    tells_coverage: bool = True


def part_scene(result: Result, title: str, max_triangles: int = MAX_TRIANGLES) -> PartScene:
    """Return part and chamber of a result for a 3D view on a page.

    Args:
        max_triangles: largest number of triangles to draw. If the part has more, only its target
            is drawn. If the target has more, nothing is drawn.
    Raises:
        InputError: the arrays are missing, damaged or of another result.
    """
    arrays = load_result_arrays(result)
    part = DrawnPart(arrays.field)
    whole, target = part.whole, part.target
    reached = np.asarray(whole["reachable"]) > 0.5
    coverage = np.where(reached, whole["coverage"], 0.0) if result.resolves_places else None
    area = point_areas(whole)
    limits = colour_range([part])
    is_saturated = limits[0] >= SATURATED
    is_told, remarks = tells_coverage(result.metrics), []
    count = whole.n_cells
    too_many = f"triangles, more than the {max_triangles:,} that a page"
    if count > max_triangles:
        remarks.append(
            f"The target is drawn with {count:,} {too_many} can draw, so there is no picture here; "
            "chamberopt inspect shows it."
        )
        return PartScene(None, tuple(remarks), coverage, area, is_saturated, is_told)
    rest = part.rest
    if count + rest.n_cells > max_triangles:
        remarks.append(
            f"The part is drawn with {count + rest.n_cells:,} {too_many} can draw: only its target "
            "is drawn."
        )
        rest = None
    chamber = cavity_surface(arrays.chamber, result.design.sonotrode.face)
    fitting = arrays.chamber.fitting
    on_deflector = np.zeros(chamber.n_cells, dtype=bool)
    if fitting is not None:
        on_deflector = on_deflectors(result.design, fitting)
    drawn = arrays.chamber.part
    eye = way_to_see(
        drawn.vertices, drawn.triangles, drawn.target & (arrays.chamber.exposed_area > 0.0)
    )
    # The part's triangle around each point, and the values of each triangle.
    triangles, row = np.unique(target["triangle"], return_inverse=True)
    of_point = np.zeros(target.n_points, dtype=int)
    of_point[np.asarray(target.regular_faces)] = row.reshape(-1, 1)
    zones = [zone.name for zone in result.design.zones] if ZONE in arrays.elements else []
    surface = arrays.chamber.part.surface
    is_closed = not len(border_edges(arrays.chamber.part.triangles))  # or drawn as a piece
    treatment, mean = result.design.process.treatment_time, result.metrics["mean_coverage"]
    data = {
        "title": title,
        "limits": limits,  # of coverage after the treatment time, as in pictures
        "treatment": treatment,
        "doubt": "" if is_told else f", {NOT_PROVEN}",  # behind coverage at a place, and its time
        # After the treatment time as all say it; the curve takes fewer points.
        "mean": [mean.value, mean.half_width] if math.isfinite(mean.half_width) else [],
        "curve": [
            [row.time_s, row.mean_coverage, row.half_width]
            for row in result.record.coverage_against_time
        ],
        "columns": {
            **{
                one.name: _packed(one.factor * target[one.column])
                for one in QUANTITIES.values()
                if one.column in target.point_data
            },
            "density": _packed(target["dent_density"]),  # gives the coverage at any time
            TIME_TO_98.name: _packed(times_to_98(np.asarray(target["dent_density"]), treatment)),
        },
        "own": {
            "coverage": _packed(100.0 * arrays.elements["coverage"][triangles]),
            "interval": _packed(100.0 * arrays.elements["coverage_interval"][triangles]),
        },
        "triangle": _packed(of_point, "<i4"),
        "number": _packed(triangles, "<i4"),
        "element": _packed(arrays.elements["element"][triangles], "<i4"),
        "impacts": _packed(arrays.elements["impacts"][triangles], "<i4"),
        "zone": _packed(arrays.elements[ZONE][triangles] if zones else triangles[:0], "<i4"),
        "zones": zones,
        "surface": _packed(triangles[:0] if surface is None else surface[triangles], "<i4"),
        "names": () if surface is None else arrays.chamber.part.names,
        "surfaces": _block(result.design.sonotrode.face)
        | _surfaces(part, rest, chamber, on_deflector)
        | {
            name: _shape(MM * one.vertices, one.triangles) | {"kind": name}
            for name, one in arrays.chamber.fixtures.items()
        },
        "whole": is_closed and rest is not None,  # so that a section can fill the part
        "edges": {"ends": _packed(_edges(chamber, np.asarray(chamber["tag"]))), "colour": EDGES},
        "view": _view(chamber, part, eye),
    }
    return PartScene(data, tuple(remarks), coverage, area, is_saturated, is_told)


def quantities_in_all(scenes: Sequence[dict[str, Any]]) -> list[dict[str, str]]:
    """Return the quantities that all 3D views of a page can show, as JSON values."""
    keys = ("name", "label", "unit", "title", "colours")
    coverage, *others = QUANTITIES.values()
    return [
        {key: getattr(one, key) for key in keys}
        for one in (coverage, TIME_TO_98, *others)
        if all(one.name in scene["columns"] for scene in scenes)
    ]


def _surfaces(
    part: DrawnPart, rest: Surface | None, chamber: Surface, on_deflector: np.ndarray
) -> dict[str, dict[str, object]]:
    """Return the surfaces that view3d.js draws, by name, but for holder and mask.

    The names are part (the target with enough dents), few (the target with too few dents),
    unreached (the target that no ball can touch), rest (the rest of the part), sonotrode,
    deflectors, and walls. Colour and opacity of each are those of its kind, but for part.

    Args:
        on_deflector: which triangles of the cavity are of a deflector, (k,).
    """
    tags = np.asarray(chamber["tag"])
    walls = (tags == TAG_WALL) & ~np.any([tags < 0, *fixture_marks(chamber).values()], axis=0)
    target, resolved = part.target, np.asarray(part.target["resolved"])
    corners = target.regular_faces
    found: dict[str, dict[str, Any]] = {
        "part": {"points": _packed(target.points), "triangles": _packed(corners[resolved], "<i4")},
        # These surfaces share the points of the part, which the page carries once.
        "few": {"triangles": _packed(corners[~resolved], "<i4"), "kind": "few"},
    }
    around = {
        "sonotrode": (is_sonotrode(tags), "sonotrode"),
        "deflectors": (walls & on_deflector, "wall"),
        "walls": (walls & ~on_deflector, "wall"),
    }
    others = [("unreached", part.unreached, "unreached"), ("rest", rest, "rest")]
    others += [
        (name, chamber.extract_cells(here).extract_surface(algorithm="dataset_surface"), kind)
        for name, (here, kind) in around.items()
        if here.any()
    ]
    for name, surface, kind in others:
        if surface is not None and surface.n_cells:
            found[name] = _shape(surface.points, surface.regular_faces) | {"kind": kind}
    return found


def _block(face: Face | None) -> dict[str, dict[str, object]]:
    """Return what is drawn of the disc or blocks on which the chamber stands, if known."""
    if face is None:
        return {}
    points, triangles = face.body
    return {"block": _shape(MM * points, triangles) | {"kind": "sonotrode"}}


def _shape(points: np.ndarray, triangles: np.ndarray) -> dict[str, object]:
    return {"points": _packed(points), "triangles": _packed(triangles, "<i4")}


def _view(chamber: Surface, part: DrawnPart, eye: np.ndarray) -> dict[str, object]:
    """Return the middle of what is looked at first, and the camera's position and size [mm].

    It is the target with what is near to it, and no more than the cavity.
    """
    target = np.asarray(part.target.points, dtype=float)
    low, high = target.min(axis=0), target.max(axis=0)
    beside = BESIDE * float(np.linalg.norm(high - low))
    cavity = np.reshape(chamber.bounds, (3, 2)).T
    around = np.clip([low - beside, high + beside], *cavity)
    size = float(np.linalg.norm(np.ptp(around, axis=0)))
    middle = 0.5 * (around.min(axis=0) + around.max(axis=0))
    return {
        "middle": middle.tolist(),
        "eye": (middle + DISTANCE * size * eye).tolist(),
        "size": size,
    }


def _edges(chamber: Surface, tags: np.ndarray) -> np.ndarray:
    """Return the end points of the n sharp edges and joints of the cavity, (2 n, 3)."""
    around = chamber.extract_cells(tags != TAG_PART).extract_surface(algorithm="dataset_surface")
    lines = around.extract_feature_edges(
        feature_angle=EDGE_ANGLE, manifold_edges=False, non_manifold_edges=False
    )
    ends = lines.points[np.asarray(lines.lines).reshape(-1, 3)[:, 1:]].reshape(-1, 3)
    return np.concatenate([ends, chamber.field_data.get(JOINTS, np.zeros((0, 3)))])


def _packed(values: np.ndarray, kind: str = "<f4") -> str:
    return base64.b64encode(np.asarray(values).astype(kind).tobytes()).decode()
