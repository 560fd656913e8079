"""What is put into a plotter: the part, its chamber as glass, the colour bar."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from chamberopt.design.shapes import TAG_WALL, is_sonotrode
from chamberopt.output.viewer.drawn_part import DrawnPart
from chamberopt.output.vtp_files import Surface, pyvista

GREY, DARK, GLASS, SONOTRODE, BACKGROUND = "#b9bec4", "#2b3440", "#9db7cc", "#e08a2e", "white"
FAULT, PALE = "#d01c1c", "#eceff2"
ROUND = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)  # steps of a colour bar, times a power of ten
LIFT = 0.1  # of discs off the surface, in their radii: the facets of a round edge do not hide them
DISC_SIDES = 24
STILL = {"render": False, "reset_camera": False}  # nothing is seen before all is there


def show(plotter: Any, part: DrawnPart, limits: tuple[float, float], bar: bool) -> None:
    """The target coloured by its quantity, the rest of the part grey, lit from the camera."""
    light(plotter)
    target = target_and_rest(plotter, part, limits)[0]
    if bar:
        steps, written = ticks(limits)
        plotter.add_scalar_bar(
            part.quantity.title + "\n", mapper=target.mapper, vertical=True, fmt=written, n_labels=steps + 1,
            color=DARK, width=0.06, height=0.55, position_x=0.88, position_y=0.2,
            title_font_size=20, label_font_size=20,
        )  # fmt: skip


def light(plotter: Any) -> None:
    """White behind, and a lamp that goes with the camera."""
    plotter.set_background(BACKGROUND)
    plotter.remove_all_lights()
    plotter.add_light(pyvista().Light(light_type="headlight"))


def target_and_rest(
    plotter: Any, part: DrawnPart, limits: tuple[float, float], passed: np.ndarray | None = None
) -> list[Any]:
    """The actors: the target coloured by its quantity, and, if there is more of the part, that in grey.

    passed: triangles of the target, bool, that are pale instead.
    """
    drawn = np.clip(part.target["shown"], *limits)
    if passed is not None:
        drawn[passed] = np.inf
    part.target["drawn"] = drawn
    target = plotter.add_mesh(
        part.target, scalars="drawn", cmap=part.quantity.colours, nan_color=GREY, clim=limits,
        ambient=0.7, diffuse=0.3, show_scalar_bar=False, above_color=None if passed is None else PALE, **STILL,
    )  # fmt: skip
    if not part.rest.n_cells:
        return [target]
    return [target, plotter.add_mesh(part.rest, color=GREY, ambient=0.45, diffuse=0.55, **STILL)]


def in_chamber(
    plotter: Any,
    part: DrawnPart,
    chamber: Surface,
    title: str,
    limits: tuple[float, float],
    bar: bool,
) -> None:
    """The part inside the glass chamber, over the sonotrode."""
    show(plotter, part, limits, bar)
    add_chamber(plotter, chamber)
    plotter.add_text(escape_dollars(title), position="upper_left", font_size=13, color=DARK)
    legend = "orange: sonotrode   grey: not in the target"
    plotter.add_text(legend, position="lower_left", font_size=9, color=DARK)
    plotter.camera_position = [(1.0, -1.6, 0.35), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    plotter.reset_camera()
    plotter.enable_anti_aliasing("ssaa")


def add_chamber(plotter: Any, chamber: Surface) -> tuple[dict[int, Any], list[Any]]:
    """The sonotrodes, and the walls as glass with their edges: the actors of the former by tag, and of the latter. No
    click finds them.
    """
    tags = np.asarray(chamber["tag"])
    faces = {}
    for tag in np.unique(tags[is_sonotrode(tags)]):
        face = chamber.extract_cells(tags == tag).extract_surface(algorithm="dataset_surface")
        faces[int(tag)] = plotter.add_mesh(
            face, color=SONOTRODE, lighting=False, pickable=False, **STILL
        )
    wall = chamber.extract_cells(tags == TAG_WALL).extract_surface(algorithm="dataset_surface")
    rims = wall.extract_feature_edges(30, non_manifold_edges=False, manifold_edges=False)
    return faces, [
        plotter.add_mesh(wall, color=GLASS, opacity=0.16, specular=0.3, pickable=False, **STILL),
        plotter.add_mesh(rims, color=DARK, line_width=2, opacity=0.6, pickable=False, **STILL),
    ]


def near(plotter: Any, part: DrawnPart, limits: tuple[float, float], bar: bool) -> None:
    """The target from near and a little below, where the shot comes from."""
    show(plotter, part, limits, bar)
    if part.reach:
        text = f"averaged over {part.reach:.1f} mm around each triangle: few dents were simulated"
        plotter.add_text(text, position="lower_left", font_size=9, color=DARK)
    plotter.camera_position = [(1.0, -1.4, -0.8), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    plotter.reset_camera(bounds=part.target.bounds)
    plotter.camera.SetWindowCenter(0.14 if bar else 0.0, 0.0)  # makes room for the colour bar
    plotter.enable_anti_aliasing("ssaa")


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
    """Text for VTK, which would set what is between two $ as a formula: a folder's name is none."""
    return text.replace("$", r"\$")


def ticks(limits: tuple[float, float]) -> tuple[int, str]:
    """How many steps a bar is divided into, so that its labels are round, and how they are written."""
    span = limits[1] - limits[0]
    for steps in (5, 4, 6, 7, 8, 9, 10, 3):
        step = span / steps
        if any(np.isclose(step / 10.0 ** np.floor(np.log10(step)), one) for one in ROUND):
            return (
                steps,
                f"%.{next((n for n in range(9) if np.isclose(round(step, n), step, rtol=1e-6)), 9)}f",
            )
    return 5, f"%.{max(0, int(np.ceil(1.0 - np.log10(span)))) if span > 0.0 else 2}f"
