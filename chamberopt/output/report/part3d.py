"""The part in its chamber in 3D: meshes for plotly, and the numbers by which the page colours it.

Colours are made in the browser (part.js). The page carries the numbers at each point of the target
once, in single precision, and shows any of them, or the coverage at any time:
1 - exp(-dent density · time / treatment time).
"""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from chamberopt.design.shapes import TAG_PART, TAG_WALL, is_sonotrode
from chamberopt.output.plots.colours import FEW_DENTS, UNREACHED
from chamberopt.output.plots.quantities import QUANTITIES
from chamberopt.output.results.load import Result, load_cavity, load_field, load_part
from chamberopt.output.viewer.drawn_part import DrawnPart, point_areas
from chamberopt.output.vtp_files import Surface

# A triangle takes about 80 bytes of the page: up to this number it stays below 60 MB and opens.
MAX_TRIANGLES = 600_000
# Places of the camera, from the middle of the cavity, in lengths of its diagonal.
ABOVE, BELOW = np.array([0.55, -0.9, 0.62]), np.array([0.55, -0.9, -0.62])
EDGE_ANGLE = 30.0  # degrees; edges of the chamber that are sharper are drawn
PART_GREY, SONOTRODE, GLASS, EDGES = "#b9bec4", "#c58b52", "#9fc3dd", "#6f8796"


@dataclass(frozen=True)
class PartScene:
    """One result for the page.

    Args:
        data: for part.js; None for a part that is too large.
        remarks: sentences on what is not shown.
        coverage: at points of the target, 0..1, 0 out of reach, shape (k,); None where too few
            dents were simulated to tell single places apart.
        area: that each point stands for [mm²], shape (k,).
    """

    data: dict[str, Any] | None
    remarks: tuple[str, ...]
    coverage: np.ndarray | None
    area: np.ndarray


def part_scene(result: Result, title: str, max_triangles: int = MAX_TRIANGLES) -> PartScene:
    """Part and chamber of a result.

    Args:
        max_triangles: of a larger part only the target is drawn, and nothing if even the target
            has more.

    Raises:
        InputError: a surface is missing, damaged or of another result.
    """
    own = load_part(result)
    part = DrawnPart(load_field(result, own))
    whole, target = part.whole, part.target
    reached = np.asarray(whole["reachable"]) > 0.5
    coverage = np.where(reached, whole["coverage"], 0.0) if result.resolves_places else None
    area = point_areas(whole)
    remarks = []
    count = whole.n_cells
    too_many = f"triangles, more than the {max_triangles:,} that a page"
    if count > max_triangles:
        remarks.append(
            f"The target is drawn with {count:,} {too_many} can draw, so there is no picture here; "
            "chamberopt inspect shows it."
        )
        return PartScene(None, tuple(remarks), coverage, area)
    rest = part.rest
    if count + rest.n_cells > max_triangles:
        remarks.append(
            f"The part is drawn with {count + rest.n_cells:,} {too_many} can draw: only its target "
            "is drawn."
        )
        rest = None
    chamber = load_cavity(result)
    eye = _eye(np.asarray(whole.face_normals) * np.asarray(whole["area"])[:, None])
    # Of the part's triangles: the one in which each point lies, and what is known of each of them.
    triangles, row = np.unique(target["triangle"], return_inverse=True)
    of_point = np.zeros(target.n_points, dtype=int)
    of_point[np.asarray(target.regular_faces)] = row.reshape(-1, 1)
    data = {
        "title": title,
        "treatment": result.design.process.treatment_time,
        "curve": [
            [row["time_s"], row["mean_coverage"], row["half_width"]]
            for row in result.data.get("coverage_against_time", [])
        ],
        "columns": {
            **{
                one.name: _packed(one.factor * target[one.column])
                for one in QUANTITIES.values()
                if one.column in target.point_data
            },
            "density": _packed(target["dent_density"]),  # gives the coverage at any time
        },
        "own": {
            "coverage": _packed(100.0 * own["coverage"][triangles]),
            "interval": _packed(100.0 * own["coverage_interval"][triangles]),
        },
        "triangle": _packed(of_point, "<i4"),
        "number": _packed(triangles, "<i4"),
        "element": _packed(own["element"][triangles], "<i4"),
        "impacts": _packed(own["impacts"][triangles], "<i4"),
        "figure": _traces(part, rest, chamber, eye),
        "view": _view(np.asarray(own.points, dtype=float), chamber, eye),
    }
    return PartScene(data, tuple(remarks), coverage, area)


def quantities_in_all(scenes: Sequence[dict[str, Any]]) -> list[dict[str, str]]:
    """The quantities that all of the scenes have."""
    keys = ("name", "label", "unit", "title", "colours")
    return [
        {key: getattr(one, key) for key in keys}
        for one in QUANTITIES.values()
        if all(one.name in scene["columns"] for scene in scenes)
    ]


def _traces(part: DrawnPart, rest: Surface | None, chamber: Any, eye: np.ndarray) -> Any:
    """Traces of plotly by name: part, few, unreached, rest, sonotrode, glass, edges."""
    import plotly.graph_objects as go

    tags = np.asarray(chamber["tag"])
    # Flat colours that match the colour bar: little shading, no shine. With both epsilons at 0
    # slivers are shaded as their neighbours.
    soft = {"ambient": 0.85, "diffuse": 0.25, "specular": 0.0, "roughness": 1.0, "fresnel": 0.0}
    soft |= {"facenormalsepsilon": 0.0, "vertexnormalsepsilon": 0.0}
    common = {"lighting": soft, "showscale": False}
    target, resolved = _mesh(part.target), np.asarray(part.target["resolved"])
    traces = []
    for name, cells in (("part", resolved), ("few", ~resolved)):
        mesh = target | {side: target[side][cells] for side in "ijk"}
        if name == "few":  # on the same points, which the page takes from the first
            mesh = {side: mesh[side] for side in "ijk"} | {"color": FEW_DENTS}
        traces.append(go.Mesh3d(name=name, **mesh, hoverinfo="none", **common))
    walls = {
        "sonotrode": (is_sonotrode(tags), SONOTRODE, 0.55 if eye is ABOVE else 0.08),
        "glass": (tags == TAG_WALL, GLASS, 0.13),
    }
    surfaces = [("unreached", part.unreached, UNREACHED, 1.0), ("rest", rest, PART_GREY, 1.0)]
    surfaces += [
        (name, chamber.extract_cells(here).extract_surface(algorithm="dataset_surface"), *look)
        for name, (here, *look) in walls.items()
    ]
    for name, surface, colour, opacity in surfaces:
        mesh = {} if surface is None else _mesh(surface)
        look = {"color": colour, "opacity": opacity, "hoverinfo": "skip", "flatshading": True}
        traces.append(go.Mesh3d(name=name, **mesh, **look, **common))
    line = {"color": EDGES, "width": 2}
    traces.append(
        go.Scatter3d(
            name="edges", mode="lines", line=line, hoverinfo="skip", **_edges(chamber, tags)
        )
    )
    return json.loads(go.Figure(traces, {"template": None}).to_json())["data"]


def _eye(normal: np.ndarray) -> np.ndarray:
    """Where the camera is: above, unless twice as much of the target is visible from below.

    From above the border of the chamber hides least.

    Args:
        normal: of the target's triangles, any length, shape (k, 3).
    """
    above, below = (float(np.maximum(normal @ eye, 0.0).sum()) for eye in (ABOVE, BELOW))
    return BELOW if below > 2.0 * above else ABOVE


def _view(points: np.ndarray, chamber: Any, eye: np.ndarray) -> dict[str, Any]:
    """Axis ranges and camera such that the cavity fills the view, even if the part is larger."""
    around = np.asarray(chamber.points, dtype=float)
    low, high = (of(np.concatenate([around, points]), axis=0) for of in (np.min, np.max))
    size = float(np.linalg.norm(np.ptp(around, axis=0)))
    middle = (0.5 * (around.min(axis=0) + around.max(axis=0)) - 0.5 * (low + high)) / size

    def named(vector: np.ndarray) -> dict[str, float]:
        return dict(zip("xyz", vector.tolist(), strict=True))

    return {
        **{
            f"{name}axis": {"range": [low[i], high[i]], "visible": False}
            for i, name in enumerate("xyz")
        },
        "aspectmode": "manual",
        "aspectratio": named((high - low) / size),
        "camera": {"center": named(middle), "eye": named(middle + eye)},
        "dragmode": "orbit",
    }


def _mesh(surface: Surface) -> dict[str, np.ndarray]:
    """Points and triangles in single precision (about 1e-5 mm)."""
    x, y, z = np.asarray(surface.points, dtype=np.float32).T
    i, j, k = np.asarray(surface.regular_faces, dtype=np.int32).reshape(-1, 3).T
    return {
        name: np.ascontiguousarray(a) for name, a in zip("xyzijk", (x, y, z, i, j, k), strict=True)
    }


def _edges(chamber: Any, tags: np.ndarray) -> dict[str, np.ndarray]:
    """The sharp edges of the cavity, as one line that is broken by NaN."""
    around = chamber.extract_cells(tags != TAG_PART).extract_surface(algorithm="dataset_surface")
    lines = around.extract_feature_edges(
        feature_angle=EDGE_ANGLE, manifold_edges=False, non_manifold_edges=False
    )
    ends = np.asarray(lines.points)[np.asarray(lines.lines).reshape(-1, 3)[:, 1:]]
    broken = (
        np.concatenate([ends, np.full((len(ends), 1, 3), np.nan)], axis=1)
        .reshape(-1, 3)
        .astype(np.float32)
    )
    return dict(zip("xyz", broken.T.copy(), strict=True))


def _packed(values: np.ndarray, kind: str = "<f4") -> str:
    return base64.b64encode(np.asarray(values).astype(kind).tobytes()).decode()
