"""The part in its chamber in 3D: meshes for plotly, and the numbers by which the page colours it.

Colours are made in the browser (part.js). The page carries the numbers of each target triangle
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

from chamberopt.coverage.coverage_from_impacts import coverage_from_dent_density
from chamberopt.design.shapes import TAG_PART, TAG_WALL, is_sonotrode
from chamberopt.geometry.triangles import area_vectors
from chamberopt.output.disc_averages import average_over_discs
from chamberopt.output.plots.quantities import QUANTITIES
from chamberopt.output.results.load import Result, load_coverage
from chamberopt.output.vtp_files import CHAMBER, read_coverage_model, read_surface

# A triangle takes about 80 bytes of the page: up to this number it stays below 60 MB and opens.
MAX_TRIANGLES = 600_000
ELEMENT = "element"  # column of coverage.vtp: number of a triangle in the part's file, if known
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
        coverage: of the target's triangles as shown, 0..1, shape (k,).
        area: of the target's triangles [mm²], shape (k,).
    """

    data: dict[str, Any] | None
    remarks: tuple[str, ...]
    coverage: np.ndarray
    area: np.ndarray


def part_scene(result: Result, title: str, max_triangles: int = MAX_TRIANGLES) -> PartScene:
    """Part and chamber of a result.

    Args:
        max_triangles: of a larger part only the target is drawn, and nothing if even the target
            has more.

    Raises:
        InputError: a surface is missing, damaged or of another result.
    """
    surface = load_coverage(result)
    points, triangles = np.asarray(surface.points, dtype=float), np.asarray(surface.regular_faces)
    fields = {name: np.asarray(surface.cell_data[name]) for name in surface.cell_data}
    vectors = area_vectors(points, triangles)
    area = np.linalg.norm(vectors, axis=1)
    target = fields["target"] > 0
    shown = target & (fields["exposed_area_mm2"] > 0.0)
    exposed = fields["exposed_area_mm2"][shown]
    is_marked = read_coverage_model(surface) == "dents"
    density, radius = average_over_discs(
        points[triangles[shown]].mean(axis=1),
        vectors[shown] / np.maximum(area[shown], 1e-300)[:, None],
        fields["dent_density"][shown],
        exposed,
        fields["dents"][shown],
    )
    coverage = np.zeros(len(area))
    on_exposed = fields["coverage"][shown] if is_marked else coverage_from_dent_density(density)
    coverage[shown] = on_exposed * np.minimum(exposed / area[shown], 1.0)
    remarks = []
    if is_marked:
        remarks.append(
            "This simulation marked every dent until the end of the treatment, "
            "so it knows the coverage at no other time."
        )
    elif radius > 0.0:
        remarks.append(
            f"Colours of the coverage are averages over {radius:.2g} mm around each triangle, "
            "because single triangles got too few dents. The numbers of a triangle are its own."
        )
    count, too_many = int(shown.sum()), f"triangles, more than the {max_triangles:,} that a page"
    if count > max_triangles:
        remarks.append(
            f"The target has {count:,} {too_many} can draw, so there is no picture here; "
            "chamberopt inspect shows it."
        )
        return PartScene(None, tuple(remarks), coverage[target], area[target])
    rest = triangles[~shown]
    if len(triangles) > max_triangles:
        remarks.append(
            f"The part has {len(triangles):,} {too_many} can draw: only its target is drawn."
        )
        rest = triangles[:0]
    columns = {
        one.name: _packed(one.factor * fields[one.column][shown])
        for one in QUANTITIES.values()
        if one.column in fields
    }
    if not is_marked:  # from these the page computes the coverage at any time
        columns["shown-density"] = _packed(density)
        columns["density"] = _packed(fields["dent_density"][shown])
    chamber = read_surface(result.folder / CHAMBER)
    eye = _eye(vectors[shown])
    data = {
        "title": title,
        "treatment": result.design.process.treatment_time,
        "curve": [
            [row["time_s"], row["mean_coverage"]]
            for row in result.data.get("coverage_against_time", [])
        ],
        "columns": columns,
        "number": _packed(np.flatnonzero(shown), "<i4"),
        **({ELEMENT: _packed(fields[ELEMENT][shown], "<i4")} if ELEMENT in fields else {}),
        "figure": _traces(points, triangles[shown], rest, chamber, eye),
        "view": _view(points, chamber, eye),
    }
    return PartScene(data, tuple(remarks), coverage[target], area[target])


def quantities_in_all(scenes: Sequence[dict[str, Any]]) -> list[dict[str, str]]:
    """The quantities that all of the scenes have."""
    keys = ("name", "label", "unit", "title", "colours")
    return [
        {key: getattr(one, key) for key in keys}
        for one in QUANTITIES.values()
        if all(one.name in scene["columns"] for scene in scenes)
    ]


def _traces(
    points: np.ndarray, target: np.ndarray, rest: np.ndarray, chamber: Any, eye: np.ndarray
) -> Any:
    """Traces of plotly by name: part, rest, sonotrode, glass, edges."""
    import plotly.graph_objects as go

    tags = np.asarray(chamber["tag"])
    walls, faces = np.asarray(chamber.points, dtype=float), np.asarray(chamber.regular_faces)
    # Flat colours that match the colour bar: little shading, no shine. With both epsilons at 0
    # slivers are shaded as their neighbours.
    soft = {"ambient": 0.85, "diffuse": 0.25, "specular": 0.0, "roughness": 1.0, "fresnel": 0.0}
    soft |= {"facenormalsepsilon": 0.0, "vertexnormalsepsilon": 0.0}
    common = {"flatshading": True, "lighting": soft, "showscale": False}
    traces = [
        go.Mesh3d(
            name="part", **_mesh(points, target), intensitymode="cell", hoverinfo="none", **common
        ),
        go.Mesh3d(name="rest", **_mesh(points, rest), color=PART_GREY, hoverinfo="skip", **common),
    ]
    for name, here, colour, opacity in (
        ("sonotrode", is_sonotrode(tags), SONOTRODE, 0.55 if eye is ABOVE else 0.08),
        ("glass", tags == TAG_WALL, GLASS, 0.13),
    ):
        look = {"color": colour, "opacity": opacity, "hoverinfo": "skip"}
        traces.append(go.Mesh3d(name=name, **_mesh(walls, faces[here]), **look, **common))
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


def _mesh(points: np.ndarray, triangles: np.ndarray) -> dict[str, np.ndarray]:
    """The mesh without unused points, in single precision (about 1e-5 mm)."""
    used, faces = np.unique(triangles, return_inverse=True)
    x, y, z = points[used].astype(np.float32).T
    i, j, k = faces.reshape(-1, 3).astype(np.int32).T
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
