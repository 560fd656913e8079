"""Add what is drawn in 3D to a pyvista plotter: the part, the chamber as glass, and discs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from chamberopt.design.shape_surface import TAG_WALL, is_sonotrode
from chamberopt.geometry.faces import Faces
from chamberopt.pictures.camera import pushed_back
from chamberopt.pictures.charts.colours import (
    FEW_DENTS,
    FIXTURE_COLOURS,
    GLASS,
    KINDS,
    OUTSIDE,
    PART_GREY,
    SONOTRODE,
    UNREACHED,
    zone_colour,
)
from chamberopt.pictures.drawn_part import DrawnPart
from chamberopt.results.vtp_files import JOINTS, Surface, fixture_body, fixture_marks, pyvista

DARK, BACKGROUND = "#2b3440", "white"
FAULT, PALE = "#d01c1c", "#c8b0dc"
SHARP_EDGE = 30  # degrees between the triangles at an edge that is drawn
ROUND_STEPS = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)  # of colour bars, times powers of ten
FROM_OUTSIDE = 0.45  # opacity of a sonotrode that is seen from outside
CUT_WALL = 6  # pixels, of a wall that is cut, which has no thickness in a design
LIFT = 0.1  # height of discs over the surface, in radii, so that facets of an edge hide no disc
DISC_SIDES = 24
SCATTER = "counted dents scatter: single places look less even than they are"
NO_RENDER = {"render": False, "reset_camera": False}  # while actors are added to the plotter


def light(plotter: Any) -> None:
    """Make the background of a plotter white and put a light beside its camera."""
    plotter.set_background(BACKGROUND)
    plotter.remove_all_lights()
    plotter.add_light(pyvista().Light(light_type="headlight"))


def body_meanings(chambers: Sequence[Surface]) -> list[tuple[str, str]]:
    """Return the colours of sonotrode, and of holder and mask if any, with meanings."""
    bodies = dict.fromkeys(name for one in chambers for name in fixture_marks(one))
    return [(KINDS[name].colour, KINDS[name].label) for name in ("sonotrode", *bodies)]


def colour_meanings(parts: Sequence[DrawnPart]) -> list[tuple[str, str]]:
    """Return the colours that stand for no value, such as out of reach, each with its meaning."""
    entries = (
        (any(part.rest.n_cells for part in parts), PART_GREY, "not in the target"),
        (any(not np.all(part.target["resolved"]) for part in parts), FEW_DENTS, "too few dents"),
        (any(part.unreached.n_cells for part in parts), UNREACHED, "out of the shot's reach"),
        (any(part.outside.n_cells for part in parts), OUTSIDE, "target outside the chamber"),
    )
    return [(colour, meaning) for there, colour, meaning in entries if there]


def add_part(
    plotter: Any, part: DrawnPart, limits: tuple[float, float], pale: np.ndarray | None = None
) -> list[Any]:
    """Add a part to a plotter: its target, coloured by its quantity, and the rest.

    The target has another colour where too few dents were simulated for a value.

    Args:
        limits: values at the ends of the colour bar.
        pale: True for triangles of `part.target` that are drawn pale instead.
    Returns:
        The actors. The mapper of the first actor has the colours.
    """
    if part.quantity.name == "zones":
        return _add_zones(plotter, part)
    pale = np.zeros(part.target.n_cells, dtype=bool) if pale is None else pale
    resolved = np.asarray(part.target["resolved"])
    style = {"ambient": 0.7, "diffuse": 0.3, **NO_RENDER}
    coloured = np.flatnonzero(resolved & ~pale)
    actors = [
        plotter.add_mesh(
            part.target.extract_cells(coloured) if len(coloured) else part.whole.extract_cells([0]),
            scalars="shown" if len(coloured) else np.zeros(3), cmap=part.quantity.colours,
            clim=limits, nan_color=FEW_DENTS, show_scalar_bar=False, **style,
        )
    ]  # fmt: skip
    actors[0].visibility = bool(len(coloured))  # the colour bar needs an actor all the same
    for surface, colour in (
        (part.target.extract_cells(np.flatnonzero(pale)), PALE),
        (part.target.extract_cells(np.flatnonzero(~resolved & ~pale)), FEW_DENTS),
        (part.unreached, UNREACHED),
        (part.outside, OUTSIDE),
        (part.rest, PART_GREY),
    ):
        if surface.n_cells:
            style |= {"ambient": 0.75, "diffuse": 0.25} if colour == PART_GREY else {}
            actors.append(plotter.add_mesh(surface, color=colour, **style))
    for actor in actors:
        actor.prop.interpolation = "Phong"  # by the normals at the vertices
    return actors


def _add_zones(plotter: Any, part: DrawnPart) -> list[Any]:
    """Add a part to a plotter with each zone in a colour of its own, and return the actors."""
    actors = []
    for number, surface in part.zones.items():
        colour = zone_colour(number - 1) if number else PART_GREY
        actors.append(
            plotter.add_mesh(surface, color=colour, ambient=0.6, diffuse=0.4, **NO_RENDER)
        )
        actors[-1].prop.interpolation = "Phong"
    return actors


def add_body(plotter: Any, chamber: Surface, name: str) -> Any:
    """Add a chamber's "holder" or "mask" to a plotter, and return its actor.

    Where it touches the part, the part's surface is what is seen.
    """
    look = {"color": FIXTURE_COLOURS[name], "ambient": 0.45, "diffuse": 0.6, "pickable": False}
    actor = plotter.add_mesh(fixture_body(chamber, name), **look, **NO_RENDER)
    pushed_back(actor)
    return actor


def add_section(
    plotter: Any, chamber: Surface, part: Surface | None, normal: Any, origin: Any
) -> None:
    """Fill holder, mask and part where a plane cuts them, and draw walls and sonotrodes thick.

    Args:
        part: the part's surface, if it is cut too.
        normal, origin: of the plane.
    """
    style = {"lighting": False, "pickable": False, **NO_RENDER}
    bodies = {name: fixture_body(chamber, name) for name in fixture_marks(chamber)}
    filled = [(one, FIXTURE_COLOURS[name]) for name, one in bodies.items()]
    filled += [] if part is None else [(part, PART_GREY)]
    for body, colour in filled:
        closed = pyvista().PolyData(body.points, body.faces).clean()
        outline = closed.slice(normal, origin=origin)
        if outline.n_cells and not closed.n_open_edges:
            fill = outline.triangulate_contours()
            plotter.add_mesh(fill, color=colour, **style)
            plotter.add_mesh(outline, color=DARK, line_width=2, **style)
    tags = np.asarray(chamber["tag"])
    on_body = np.any([*fixture_marks(chamber).values(), np.zeros(len(tags), bool)], axis=0)
    for chosen, colour in ((tags == TAG_WALL) & ~on_body, DARK), (is_sonotrode(tags), SONOTRODE):
        line = chamber.extract_cells(chosen).slice(normal, origin=origin)
        if line.n_cells:
            plotter.add_mesh(line, color=colour, line_width=CUT_WALL, **style)


def add_chamber(plotter: Any, chamber: Surface) -> tuple[dict[int, Any], list[Any]]:
    """Add a chamber to a plotter: sonotrodes, holder and mask, and walls as glass with edges.

    Clicks pass through all of them, to the part.

    Returns:
        The actors of the sonotrodes, by the tag (number) of a sonotrode's surface, and the actors
        of the walls, with those of holder and mask.
    """
    tags = np.asarray(chamber["tag"])
    style = {"pickable": False, **NO_RENDER}
    glass, actors, faces = tags == TAG_WALL, [], {}
    for tag in np.unique(tags[is_sonotrode(tags)]):
        face = chamber.extract_cells(tags == tag).extract_surface(algorithm="dataset_surface")
        look = {"color": SONOTRODE, "lighting": False, **style}
        faces[int(tag)] = plotter.add_mesh(face, culling="front", **look)
        # Seen from outside, as from below, it does not hide the part.
        actors.append(plotter.add_mesh(face, culling="back", opacity=FROM_OUTSIDE, **look))
    for name, own in fixture_marks(chamber).items():
        glass &= ~own
        actors.append(add_body(plotter, chamber, name))
    wall = chamber.extract_cells(glass).extract_surface(algorithm="dataset_surface")
    edges = wall.extract_feature_edges(SHARP_EDGE, non_manifold_edges=False, manifold_edges=False)
    if JOINTS in chamber.field_data:
        joints = pyvista().line_segments_from_points(np.asarray(chamber.field_data[JOINTS]))
        actors.append(plotter.add_mesh(joints, color=DARK, line_width=2, opacity=0.6, **style))
    return faces, [
        *actors,
        *(
            # The far walls come first: glass hides what is drawn later behind it.
            plotter.add_mesh(wall, color=GLASS, opacity=0.16, specular=0.3, culling=side, **style)
            for side in ("front", "back")
        ),
        plotter.add_mesh(edges, color=DARK, line_width=2, opacity=0.6, **style),
    ]


def add_edges(plotter: Any, part: Surface) -> None:
    """Add the sharp edges of a part to a plotter as thin lines.

    Those between the facets of a coarse mesh, which would blacken it, are left out.
    """
    whole = pyvista().PolyData(part.points, part.faces).clean()
    faces = Faces(np.asarray(whole.points), np.asarray(whole.regular_faces), float(SHARP_EDGE))
    if (facets := faces.are_facets[faces.of_triangle]).any():
        whole = whole.extract_cells(~facets).extract_surface(algorithm="dataset_surface")
    edges = whole.extract_feature_edges(
        SHARP_EDGE, boundary_edges=False, non_manifold_edges=False, manifold_edges=False
    )
    if edges.n_cells:
        mapper = plotter.add_mesh(edges, color=DARK, line_width=3, opacity=0.6, **NO_RENDER).mapper
        mapper.SetResolveCoincidentTopologyToPolygonOffset()  # in front of the part's surface
        mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-2.0, -4.0)


class Discs(NamedTuple):
    """Flat discs to draw on a surface, such as dents. Each row of the arrays is a disc.

    Attributes:
        place: centres [mm], shape (k, 3).
        normal: unit vectors away from the surface, shape (k, 3).
        radius: radii [mm], shape (k,).
        colour: colours as red, green and blue, uint8, shape (k, 3).
    """

    place: np.ndarray
    normal: np.ndarray
    radius: np.ndarray
    colour: np.ndarray

    def only(self, rows: np.ndarray) -> Discs:
        """Return a copy with only the given discs.

        Args:
            rows: numbers of the discs to keep, or a mask.
        """
        return Discs(*(column[rows] for column in self))


def disc_actor(discs: Discs, ambient: float = 1.0) -> Any:
    """Return a VTK actor that shows discs, later discs over earlier discs.

    Args:
        ambient: brightness of a disc seen edge on, as a share of a disc seen face on.
    """
    import vtk

    points = pyvista().PolyData(discs.place + LIFT * discs.radius[:, None] * discs.normal)
    points["normal"], points["diameter"] = discs.normal, 2.0 * discs.radius
    points["colour"] = discs.colour
    # A regular polygon with the area of the circle of diameter 1.
    angle = 2.0 * np.pi / DISC_SIDES
    radius = 0.5 * np.sqrt(angle / np.sin(angle))
    # The mapper turns the x axis of its source into the normal.
    polygon = pyvista().Disc(inner=0.0, outer=radius, normal=(1.0, 0.0, 0.0), c_res=DISC_SIDES)
    mapper = vtk.vtkGlyph3DMapper()
    mapper.SetInputData(points)
    mapper.SetSourceData(polygon)
    mapper.SetScaleArray("diameter")
    mapper.SetScaleModeToScaleByMagnitude()
    mapper.SetOrientationArray("normal")
    mapper.SetOrientationModeToDirection()
    mapper.SetScalarModeToUsePointFieldData()
    mapper.SelectColorArray("colour")
    mapper.SetColorModeToDirectScalars()
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetAmbient(ambient)
    actor.GetProperty().SetDiffuse(1.0 - ambient)
    # VTK draws translucent actors after all others and without writing their depth. So a disc is
    # hidden by surfaces in front of it, and covers the discs drawn before it.
    actor.ForceTranslucentOn()
    return actor


def escape_dollars(text: str) -> str:
    """Return a text with `$` escaped, so that VTK does not typeset a folder's name as a formula."""
    return text.replace("$", r"\$")


def colour_bar_ticks(limits: tuple[float, float]) -> tuple[int, str]:
    """Return the number of round steps of a colour bar, and the format of its labels."""
    span = limits[1] - limits[0]
    for steps in (5, 4, 6, 7, 8, 9, 10, 3):
        step = span / steps
        if any(np.isclose(step / 10.0 ** np.floor(np.log10(step)), one) for one in ROUND_STEPS):
            exact = (n for n in range(9) if np.isclose(round(step, n), step, rtol=1e-6))
            return steps, f"%.{next(exact, 9)}f"
    return 5, f"%.{max(0, int(np.ceil(1.0 - np.log10(span)))) if span > 0.0 else 2}f"
