"""Draw a part before any simulation: its target in the chamber, or the faults of its mesh."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber.build import without_specks
from chamberopt.chamber.checks.check import touched
from chamberopt.chamber.flexure import softness_of_part
from chamberopt.chamber.part import chosen_on_part
from chamberopt.design.part import Selection
from chamberopt.geometry.triangles import area_vectors, unit_vectors
from chamberopt.pictures.actors import FAULT, NO_RENDER, add_edges, body_meanings
from chamberopt.pictures.camera import cells_of, near_directions, near_views, pushed_back, seen_area
from chamberopt.pictures.charts.colours import KINDS
from chamberopt.pictures.panels import (
    BORDER,
    SIZE,
    chamber_panel,
    choose_views,
    near_panels,
    part_panels,
    with_marks,
    without_twin,
)
from chamberopt.pictures.picture_page import Panel, Row, write_page
from chamberopt.pictures.subprocess_drawing import draw_in_subprocess, picture_path
from chamberopt.pictures.view import render_view
from chamberopt.results.vtp_files import MM, Surface, cavity_surface, pyvista, size_text

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.layout.target import Surface as Choosable
    from chamberopt.design.load import Design
    from chamberopt.design.sonotrode import Face


PLAIN, MARKED, MISSED, BEYOND, HELD = range(5)
COLOURS = {
    state: (KINDS[name].colour, KINDS[name].label)
    for state, name in (
        (PLAIN, "rest"), (MARKED, "target"), (MISSED, "unreached"), (BEYOND, "outside"),
    )
} | {HELD: (KINDS["holder"].colour, "held outside the chamber")}  # fmt: skip
# Restitution of a thin part over that of a rigid one, by bands, and their colours: greens, which
# mean nothing else in the picture.
BANDS = (0.5, 0.7, 0.9, 0.98)
SOFTER = "flexure, the restitution of the thin target over that of a rigid part, where below 0.98"
BAND_COLOURS = {
    PLAIN: COLOURS[PLAIN],
    1: ("#00441b", "below 0.5"),
    2: ("#238b45", "0.5 to 0.7"),
    3: ("#74c476", "0.7 to 0.9"),
    4: ("#c7e9c0", "0.9 to 0.98"),
    5: COLOURS[MARKED],
}
FACE = re.compile(r"face (\d+)")  # the name of a face without one in its file
MOST_NUMBERED, MOST_PLACES = 9, 24  # faces that bear their numbers, and places that are tried
LEAST_BESIDE = 0.1  # share of a face beside the target, below which it bears no number
NUMBERED = "numbers: “face 1” and so on; of several faces alike, one bears it"
CLEAR = 0.05  # mm: what stands out of the room by less does not
ALL = 0.999  # share of the target's area from which it is wholly in the chamber
OPPOSITE = np.array([(1.0, -1.6, 0.7), (-1.0, 1.6, -0.7)])


def draw_target(
    design: Design, chamber: Chamber, screenshot: Path, known: Sequence[Choosable] = ()
) -> str:
    """Draw the part with its target, and mark triangles of the target that are out of reach.

    With steps, the part stands as in the first, and what is marked is out of reach in all of them.
    Each further pose has a view in the chamber.

    Where the part is thin, further views show how soft it is. Faces of `known` that have a number
    bear it.

    Return in words where the picture is, or why there is none.
    """
    part = chamber.part
    hidden = part.target & (touched(design, chamber) <= 0.5)
    missed = without_specks(part, hidden, min(design.shot.diameters))
    corners = part.vertices[part.triangles]
    remark = draw_part(
        corners,
        part.name,
        screenshot,
        part.target,
        missed=missed,
        chamber=chamber,
        face=design.sonotrode.face,
        softness=softness_of_part(design, part),
        is_held_outside=design.holder is not None and design.holder.kind == "bore",
        marks=_numbered(design, chamber, known),
    )
    return remark or f"picture in {screenshot}"


def _numbered(
    design: Design, chamber: Chamber, known: Sequence[Choosable]
) -> list[tuple[str, np.ndarray]]:
    """Return the number of each numbered face, and places on it, those near its middle first.

    The places are in mm, each with the normal there, (k, 6).
    """
    part, found = chamber.part, list[tuple[str, np.ndarray]]()
    middles = part.vertices[part.triangles].mean(axis=1)
    normals = unit_vectors(area_vectors(part.vertices, part.triangles))
    for one in known:
        if (number := FACE.fullmatch(one.name)) and len(found) < MOST_NUMBERED:
            chosen = chosen_on_part(design, Selection.model_validate(one.keys), "")
            rows = np.flatnonzero(chosen & ~part.target)
            if part.area[rows].sum() < LEAST_BESIDE * part.area[chosen].sum():
                continue
            middle = np.average(middles[rows], axis=0, weights=part.area[rows])
            rows = rows[np.linalg.norm(middles[rows] - middle, axis=1).argsort()]
            share = part.area[rows].cumsum() / part.area[rows].sum()  # up to each place
            rows = rows[np.searchsorted(share, (np.arange(MOST_PLACES) + 0.5) / MOST_PLACES)]
            found.append((number[1], np.hstack([MM * middles[rows], normals[rows]])))
    return found


def draw_part(
    corners: np.ndarray,
    title: str,
    picture: str | Path,
    marked: np.ndarray | None = None,
    edges: np.ndarray | None = None,
    missed: np.ndarray | None = None,
    chamber: Chamber | None = None,
    face: Face | None = None,
    softness: np.ndarray | None = None,
    is_held_outside: bool = False,
    marks: Sequence[tuple[str, np.ndarray]] = (),
) -> str | None:
    """Draw a part with its target in its chamber, or with its faults.

    Args:
        corners: corners of the part's triangles [m], shape (n, 3, 3).
        title: text above the picture.
        picture: file to write, .png.
        marked: which triangles belong to the target, shape (n,).
        edges: lines drawn red and visible through the part [m], shape (k, 2, 3).
        missed: which triangles of the target balls can hardly touch, shape (n,).
        chamber: the chamber, drawn as glass round the part in a further view, with dimensions; if
            it has steps, in a view of each pose.
        face: on which the chamber stands, whose joints are drawn.
        softness: restitution of the part over that of a rigid one, shape (n,), where it is thin.
            A second row of views shows it on the target.
        is_held_outside: True if the part is clamped where it stands out of the chamber.
        marks: numbers of faces, each with places on it, as of `seen_marks`.
    Returns:
        None, or one line that says why there is no picture.
    Raises:
        InputError: `picture` cannot be written.
    """
    path = picture_path(picture)
    none = np.zeros(len(corners), dtype=bool)
    marked, missed = (none if chosen is None else chosen for chosen in (marked, missed))
    edges = np.zeros((0, 2, 3)) if edges is None else edges
    job = {"title": title, "corners": corners * MM, "marked": marked & ~missed, "missed": missed,
           "edges": edges * MM, "chamber": chamber, "face": face, "softness": softness,
           "is_held_outside": is_held_outside, "marks": [*marks]}  # fmt: skip
    return draw_in_subprocess(render_part, job, path)


def render_part(job: dict[str, Any]) -> None:
    """Draw the picture of draw_part; this runs in a child process."""
    marked, missed, edges, softness = (
        job[name] for name in ("marked", "missed", "edges", "softness")
    )
    poses = []
    if job["chamber"] is not None:
        poses = _further_poses(job)
        mask = job["chamber"].fixtures.get("mask")
        job["has_plugs"] = mask is not None and mask.kind == "plugs"
        job = job | {"chamber": cavity_surface(job["chamber"], job["face"])}
    kinds = np.select([missed, marked], [MISSED, MARKED], PLAIN)
    part, shown = _coloured(job, kinds)
    legend = [COLOURS[k] for k in np.unique(np.concatenate([kind for _, kind in shown]))]
    if job["chamber"] is not None:
        legend = [*body_meanings([job["chamber"]]), *legend]
    legend = legend if not len(edges) else [(FAULT, "what the message tells of")]
    panels = _panels(job, part, shown, COLOURS, [(one, *_coloured(one, kinds)) for one in poses])
    of_pose = panels[:1] if poses else panels  # in which the part stands as in the first
    marked_ones = with_marks(of_pose, job["marks"], part, job["chamber"])
    panels = [*marked_ones, *panels[len(of_pose) :]]
    rows = [Row(job["title"], panels)]
    if softness is not None:
        bands = np.where(marked | missed, 1 + np.searchsorted(BANDS, softness, "right"), PLAIN)
        part, shown = _coloured(job, bands, beyond=False)
        rows.append(Row(f"{job['title']}: {SOFTER}", _panels(job, part, shown, BAND_COLOURS)))
        legend += [one for k in np.unique(bands) if (one := BAND_COLOURS[k]) not in legend]
    remarks = [f"part as it stands: {size_text(part)}", *[NUMBERED] * bool(job["marks"])]
    write_page(job["picture"], rows, legend, remarks=remarks)


def _further_poses(job: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the job of each step of its chamber in which the part stands otherwise."""
    chamber, found = job["chamber"], []
    seen = [chamber.part.vertices]
    for step in chamber.steps:
        vertices = step.part.vertices
        if not any(np.array_equal(vertices, one) for one in seen):
            seen.append(vertices)
            corners = vertices[step.part.triangles] * MM
            found.append(job | {"chamber": cavity_surface(step, job["face"]), "corners": corners})
    return found


def _coloured(
    job: dict[str, Any], kinds: np.ndarray, beyond: bool = True
) -> tuple[Surface, list[tuple[Surface, np.ndarray]]]:
    """Return the part, and the surfaces to draw over one another with the kind of each triangle.

    Args:
        kinds: kind of each triangle of the part, shape (n,), PLAIN outside the target.
        beyond: True to mark what of the target is outside the chamber.
    """
    corners = job["corners"]
    part = pyvista().PolyData.from_regular_faces(
        corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
    )
    if job["chamber"] is None:
        return part, [(part, kinds)]
    chamber = job["chamber"]
    # surface inside the chamber is drawn over the part
    source = np.asarray(chamber["source"])
    inside, own = cells_of(chamber, source >= 0), kinds[source[source >= 0]]
    inside = pyvista().PolyData.from_regular_faces(  # with its normals out of the part
        inside.points, np.asarray(inside.regular_faces)[:, ::-1]
    )
    whole, there = (
        cells_of(one, kind != PLAIN).area for one, kind in ((part, kinds), (inside, own))
    )
    outside = kinds
    if beyond:
        outside = np.where(kinds == PLAIN, PLAIN, BEYOND if there < ALL * whole else MARKED)
        if job["is_held_outside"]:
            low, high = np.reshape(chamber.bounds, (3, 2)).T
            stands_out = ((corners < low - CLEAR) | (corners > high + CLEAR)).any(axis=(1, 2))
            radius = np.linalg.norm(chamber.points[:, :2], axis=1).max()  # of a round chamber
            far = np.linalg.norm(corners[..., :2], axis=2).max(axis=1)
            stands_out |= far > radius + CLEAR
            outside[stands_out & (outside == PLAIN)] = HELD
    return part, [(part, outside), (inside, own)]


def _panels(
    job: dict[str, Any],
    part: Surface,
    shown: list[tuple[Surface, np.ndarray]],
    colours: Mapping[int, tuple[str, str]],
    poses: Sequence[tuple[dict[str, Any], Surface, list[tuple[Surface, np.ndarray]]]] = (),
) -> list[Panel]:
    """Return the views of a part whose triangles have colours by their kinds.

    Args:
        shown: surfaces to draw over one another, with the kind of each triangle.
        colours: colour and meaning of each kind.
        poses: job, part and surfaces of each further pose. They take the place of the target's
            second view.
    """
    edges = job["edges"]
    lines = pyvista().line_segments_from_points(edges.reshape(-1, 3)) if len(edges) else None

    def add_pose(part: Surface, shown: list[tuple[Surface, np.ndarray]], plotter: Any) -> None:
        for level, (surface, kind) in enumerate(shown):
            for k in np.unique(kind):
                actor = plotter.add_mesh(
                    cells_of(surface, kind == k), color=colours[k][0], ambient=0.45, diffuse=0.6,
                    opacity=1.0 if lines is None else 0.35, **NO_RENDER,
                )  # fmt: skip
                if level == 0:
                    pushed_back(actor)
        if lines is not None:
            plotter.add_mesh(lines, color=FAULT, line_width=6, lighting=False, **NO_RENDER)
        else:
            add_edges(plotter, part)

    add = partial(add_pose, part, shown)
    surface, kind = shown[-1]
    target, rest = cells_of(surface, kind != PLAIN), [part]
    if not target.n_cells:  # the part has faults, or lies outside the chamber
        points = np.concatenate([part.points, edges.reshape(-1, 3)])
        return [
            Panel(render_view(add, eye, points, SIZE, BORDER), caption)
            for eye, caption in zip(OPPOSITE, ("from one side", "from the other"), strict=True)
        ]
    if job["chamber"] is None:
        eyes = near_directions(target)
        near = near_views(seen_area(target, rest, eyes), eyes)
        return without_twin(near_panels(add, target, part, near))
    chamber = job["chamber"]
    eye, near = choose_views([(target, part)], [chamber])
    whole, *of_target = part_panels(add, target, part, chamber, (eye, near), job["has_plugs"])
    if not poses:
        return [whole, *without_twin(of_target)]
    others = [
        chamber_panel(
            partial(add_pose, own, of_pose), own, one["chamber"], eye, f"in pose {number}"
        )
        for number, (one, own, of_pose) in enumerate(poses, start=2)
    ]
    return [whole._replace(caption="in the chamber, pose 1"), *others, *of_target[:1]]
