"""What is put into a plotter: the part, the chamber as glass, discs, colour bars."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from chamberopt.design.shapes import TAG_WALL, is_sonotrode
from chamberopt.output.plots.colours import FEW_DENTS, UNREACHED
from chamberopt.output.viewer.drawn_part import DrawnPart
from chamberopt.output.viewer.view_state import DEFAULT_VIEW
from chamberopt.output.vtp_files import Surface, pyvista

GREY, DARK, GLASS, SONOTRODE, BACKGROUND = "#b9bec4", "#2b3440", "#9db7cc", "#e08a2e", "white"
FAULT, PALE = "#d01c1c", "#eceff2"
VIEW_FROM_BELOW = (1.0, -1.4, -0.8)  # a little below, where the shot comes from
SHARP_EDGE = 30  # degrees between the triangles at an edge of the chamber that is drawn
ROUND_STEPS = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)  # of colour bars, times powers of ten
LIFT = 0.1  # of discs off the surface, in their radii: the facets of a round edge do not hide them
DISC_SIDES = 24
NO_RENDER = {"render": False, "reset_camera": False}  # until everything is in the plotter


def light(plotter: Any) -> None:
    """Make the background white and put a light beside the camera."""
    plotter.set_background(BACKGROUND)
    plotter.remove_all_lights()
    plotter.add_light(pyvista().Light(light_type="headlight"))


def draw_in_chamber(
    plotter: Any, part: DrawnPart, chamber: Surface, title: str, limits: tuple[float, float]
) -> None:
    """Draw the part inside the glass chamber, over the sonotrode."""
    light(plotter)
    add_part(plotter, part, limits)
    add_chamber(plotter, chamber)
    text = plotter.add_text(escape_dollars(title), position="upper_left", font_size=13, color=DARK)
    text.prop.background_color, text.prop.background_opacity = BACKGROUND, 0.7  # over a tall part
    legend = "orange: sonotrode   grey: not in the target"
    plotter.add_text(legend, position="lower_left", font_size=9, color=DARK)
    plotter.camera_position = [DEFAULT_VIEW, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    plotter.reset_camera()
    plotter.enable_anti_aliasing("ssaa")


def draw_target(plotter: Any, part: DrawnPart, limits: tuple[float, float], bar: bool) -> None:
    """Draw the target from near, with a colour bar if wanted."""
    light(plotter)
    target = add_part(plotter, part, limits)[0]
    if bar:
        steps, number_format = colour_bar_ticks(limits)
        plotter.add_scalar_bar(
            part.quantity.title + "\n", mapper=target.mapper, vertical=True, fmt=number_format,
            n_labels=steps + 1, color=DARK, width=0.06, height=0.55, position_x=0.88,
            position_y=0.2, title_font_size=20, label_font_size=20,
        )  # fmt: skip
    legend = "   ".join(f"{name}: {meaning}" for _, name, meaning in without_colour(part))
    plotter.add_text(legend, position="lower_left", font_size=9, color=DARK)
    plotter.camera_position = [VIEW_FROM_BELOW, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    plotter.reset_camera(bounds=part.whole.bounds)
    plotter.camera.SetWindowCenter(0.14 if bar else 0.0, 0.0)  # makes room for the colour bar
    plotter.enable_anti_aliasing("ssaa")


def without_colour(part: DrawnPart) -> list[tuple[str, str, str]]:
    """(colour, its name, meaning) of what tells no value on the target, where there is any."""
    entries = (
        (not np.all(part.target["resolved"]), FEW_DENTS, "dark grey", "too few dents simulated"),
        (part.unreached.n_cells > 0, UNREACHED, "brown", "out of the reach of the shot"),
    )
    return [(colour, name, meaning) for there, colour, name, meaning in entries if there]


def add_part(
    plotter: Any, part: DrawnPart, limits: tuple[float, float], pale: np.ndarray | None = None
) -> list[Any]:
    """Add the target, coloured by its quantity where that is resolved, and the rest of the part.

    Args:
        pale: triangles of `part.target`, bool, that are drawn pale instead.

    Returns:
        The actors; the mapper of the first has the colours.
    """
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
        (part.rest, GREY),
    ):
        if surface.n_cells:
            style |= {"ambient": 0.75, "diffuse": 0.25} if colour == GREY else {}
            actors.append(plotter.add_mesh(surface, color=colour, **style))
    for actor in actors:
        actor.prop.interpolation = "Phong"  # by the normals of the surface, not of its triangles
    return actors


def add_chamber(plotter: Any, chamber: Surface) -> tuple[dict[int, Any], list[Any]]:
    """Add the sonotrodes, and the walls as glass with their edges; clicks pass through them.

    Returns:
        The actors of the sonotrodes by tag, and those of the walls.
    """
    tags = np.asarray(chamber["tag"])
    style = {"pickable": False, **NO_RENDER}
    faces = {}
    for tag in np.unique(tags[is_sonotrode(tags)]):
        face = chamber.extract_cells(tags == tag).extract_surface(algorithm="dataset_surface")
        faces[int(tag)] = plotter.add_mesh(face, color=SONOTRODE, lighting=False, **style)
    wall = chamber.extract_cells(tags == TAG_WALL).extract_surface(algorithm="dataset_surface")
    edges = wall.extract_feature_edges(SHARP_EDGE, non_manifold_edges=False, manifold_edges=False)
    return faces, [
        plotter.add_mesh(wall, color=GLASS, opacity=0.16, specular=0.3, **style),
        plotter.add_mesh(edges, color=DARK, line_width=2, opacity=0.6, **style),
    ]


class Discs(NamedTuple):
    """Flat discs on a surface, one a row.

    place: centres [mm], shape (k, 3).
    normal: unit vectors away from the surface, shape (k, 3).
    radius: [mm], shape (k,).
    colour: red, green, blue, uint8, shape (k, 3).
    """

    place: np.ndarray
    normal: np.ndarray
    radius: np.ndarray
    colour: np.ndarray

    def only(self, rows: np.ndarray) -> Discs:
        """A copy of some rows."""
        return Discs(*(column[rows] for column in self))


def disc_actor(discs: Discs, ambient: float = 1.0) -> Any:
    """Return an actor that shows discs, later ones over earlier ones.

    ambient: brightness of a disc seen edge on, as a share of one seen face on.
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
    # VTK draws translucent actors after all others and without writing their depth: each disc is
    # hidden by surfaces in front of it, and covers those drawn before it.
    actor.ForceTranslucentOn()
    return actor


def escape_dollars(text: str) -> str:
    """Escape `$`, so that VTK does not typeset a folder's name as a formula."""
    return text.replace("$", r"\$")


def colour_bar_ticks(limits: tuple[float, float]) -> tuple[int, str]:
    """Return into how many round steps a colour bar is divided, and the format of its labels."""
    span = limits[1] - limits[0]
    for steps in (5, 4, 6, 7, 8, 9, 10, 3):
        step = span / steps
        if any(np.isclose(step / 10.0 ** np.floor(np.log10(step)), one) for one in ROUND_STEPS):
            exact = (n for n in range(9) if np.isclose(round(step, n), step, rtol=1e-6))
            return steps, f"%.{next(exact, 9)}f"
    return 5, f"%.{max(0, int(np.ceil(1.0 - np.log10(span)))) if span > 0.0 else 2}f"
