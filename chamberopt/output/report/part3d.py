"""The part in its chamber as the page draws it: meshes for plotly, and the columns that the page colours it by.

Colours are made in the browser (part.js): the page carries the numbers of each target triangle once, in single
precision, and shows any of them, or the coverage at any time, 1 - exp(-dent density · time / treatment time).
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
from chamberopt.output.results.load import Result, load_coverage
from chamberopt.output.vtp_files import CHAMBER, read_coverage_model, read_surface
from chamberopt.simulation.triangle_fields import QUANTITIES

# A triangle costs about 80 bytes of the page: with this many it stays below 60 MB and opens.
MOST_TRIANGLES = 600_000
ELEMENT = "element"  # the part file's own number of a triangle, where coverage.vtp has it
# Where the eye is, from the cavity's middle, in lengths of its diagonal.
ABOVE, BELOW = np.array([0.55, -0.9, 0.62]), np.array([0.55, -0.9, -0.62])
SHARP = 30.0  # degrees: edges of the chamber that are drawn


@dataclass(frozen=True)
class Scene:
    """One result ready for the page: `data` for part.js, `remarks` on what is not shown, and coverage as it is shown.

    coverage (k,) of the target's triangles, 0..1; area (k,) [mm²] of each.
    """

    data: dict[str, Any] | None
    remarks: tuple[str, ...]
    coverage: np.ndarray
    area: np.ndarray


def part_scene(result: Result, title: str, most: int = MOST_TRIANGLES) -> Scene:
    """A result's part and chamber. InputError when its surfaces are not there, damaged or another's.

    most: triangles that may be drawn; of a larger part the target alone is, and nothing where that is still too large.
    """
    surface = load_coverage(result)
    points, triangles = np.asarray(surface.points, dtype=float), np.asarray(surface.regular_faces)
    fields = {name: np.asarray(surface.cell_data[name]) for name in surface.cell_data}
    corners = points[triangles]
    vectors = area_vectors(points, triangles)
    area = np.linalg.norm(vectors, axis=1)
    target = fields["target"] > 0
    seen = target & (fields["exposed_area_mm2"] > 0.0)
    unit = vectors[seen] / np.maximum(area[seen], 1e-300)[:, None]
    density, reach = average_over_discs(
        corners[seen].mean(axis=1),
        unit,
        *(fields[name][seen] for name in ("dent_density", "exposed_area_mm2", "dents")),
    )
    marked = read_coverage_model(surface) == "dents"
    shown = fields["coverage"][seen] if marked else coverage_from_dent_density(density)
    covered = np.zeros(len(area))
    covered[seen] = shown * np.minimum(fields["exposed_area_mm2"][seen] / area[seen], 1.0)
    remarks = _remarks(len(triangles), int(seen.sum()), most, reach if not marked else 0.0, marked)
    whole = (covered[target], area[target])
    if seen.sum() > most:
        return Scene(None, remarks, *whole)
    columns = {
        one.name: _packed(one.factor * fields[one.column][seen])
        for one in QUANTITIES.values()
        if one.column in fields
    }
    if not marked:
        columns["shown-density"] = _packed(density)  # what the colours are made of
        columns["density"] = _packed(fields["dent_density"][seen])
    chamber = read_surface(result.folder / CHAMBER)
    eye = _eye(vectors[seen])
    rest = triangles[~seen] if len(triangles) <= most else triangles[:0]
    data = {
        "title": title,
        "treatment": result.design.process.treatment_time,
        "curve": [
            [row["time_s"], row["mean_coverage"]]
            for row in result.data.get("coverage_against_time", [])
        ],
        "columns": columns,
        "number": _packed(np.flatnonzero(seen), "<i4"),
        **({"element": _packed(fields[ELEMENT][seen], "<i4")} if ELEMENT in fields else {}),
        "figure": _figure(points, triangles[seen], rest, chamber, eye),
        "view": _view(points, chamber, eye),
    }
    return Scene(data, remarks, *whole)


def quantities(scenes: Sequence[dict[str, Any]]) -> list[dict[str, str]]:
    """What can be chosen: the quantities that all of the scenes have."""
    return [
        {
            "name": one.name,
            "label": one.label,
            "unit": one.unit,
            "title": one.title,
            "colours": one.colours,
        }
        for one in QUANTITIES.values()
        if all(one.name in scene["columns"] for scene in scenes)
    ]


def _remarks(triangles: int, target: int, most: int, reach: float, marked: bool) -> tuple[str, ...]:
    said = []
    if reach > 0.0:
        said.append(
            f"Colours of the coverage are averaged over {reach:.2g} mm around each triangle, which else got too few "
            "dents to tell; the figures of a triangle are its own."
        )
    if marked:
        said.append(
            "Every dent was marked in this simulation, to the end of the treatment: it tells no other times."
        )
    if target > most:
        said.append(
            f"The target has {target:,} triangles, more than the {most:,} that a page can draw: no picture here; "
            "chamberopt inspect shows it."
        )
    elif triangles > most:
        said.append(
            f"The part has {triangles:,} triangles, more than the {most:,} that a page can draw: of it the target "
            "alone is drawn."
        )
    return tuple(said)


def _figure(
    points: np.ndarray, target: np.ndarray, rest: np.ndarray, chamber: Any, eye: np.ndarray
) -> Any:
    """Traces by name: part, rest, sonotrode, glass, edges."""
    import plotly.graph_objects as go

    tags = np.asarray(chamber["tag"])
    walls, faces = np.asarray(chamber.points, dtype=float), np.asarray(chamber.regular_faces)
    # Flat colours that stay true to the bar: little shading, no shine.
    soft = {"ambient": 0.85, "diffuse": 0.25, "specular": 0.0, "roughness": 1.0, "fresnel": 0.0}
    soft |= {
        "facenormalsepsilon": 0.0,
        "vertexnormalsepsilon": 0.0,
    }  # slivers face as their neighbours do
    common = {"flatshading": True, "lighting": soft, "showscale": False}
    traces = [
        go.Mesh3d(
            name="part", **_mesh(points, target), intensitymode="cell", hoverinfo="none", **common
        ),
        go.Mesh3d(name="rest", **_mesh(points, rest), color="#b9bec4", hoverinfo="skip", **common),
    ]
    for name, here, colour, opacity in (
        ("sonotrode", is_sonotrode(tags), "#c58b52", 0.55 if eye is ABOVE else 0.08),
        ("glass", tags == TAG_WALL, "#9fc3dd", 0.13),
    ):
        look = {"color": colour, "opacity": opacity, "hoverinfo": "skip"}
        traces.append(go.Mesh3d(name=name, **_mesh(walls, faces[here]), **look, **common))
    line = {"color": "#6f8796", "width": 2}
    traces.append(
        go.Scatter3d(
            name="edges", mode="lines", line=line, hoverinfo="skip", **_edges(chamber, tags)
        )
    )
    return json.loads(go.Figure(traces, {"template": None}).to_json())["data"]


def _eye(normal: np.ndarray) -> np.ndarray:
    """Above, where the rim of the chamber hides least, unless from below twice as much of the target is to be seen."""
    above, below = (float(np.maximum(normal @ place, 0.0).sum()) for place in (ABOVE, BELOW))
    return BELOW if below > 2.0 * above else ABOVE


def _view(points: np.ndarray, chamber: Any, eye: np.ndarray) -> dict[str, Any]:
    """Ranges and camera: what is inside the cavity fills the view, however far the part reaches out of it."""
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
    """Of the points only those in use, in single precision: 1e-5 mm of a part is far more than is seen."""
    used, faces = np.unique(triangles, return_inverse=True)
    x, y, z = points[used].astype(np.float32).T
    i, j, k = faces.reshape(-1, 3).astype(np.int32).T
    return {
        name: np.ascontiguousarray(a) for name, a in zip("xyzijk", (x, y, z, i, j, k), strict=True)
    }


def _edges(chamber: Any, tags: np.ndarray) -> dict[str, np.ndarray]:
    """The sharp edges of the cavity around the part, as one line that is broken by NaN."""
    around = chamber.extract_cells(tags != TAG_PART).extract_surface(algorithm="dataset_surface")
    lines = around.extract_feature_edges(
        feature_angle=SHARP, manifold_edges=False, non_manifold_edges=False
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
