"""Draw the chamber to scale with its dimensions: a section through its axis, and a plan."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.checks.openings import find_openings, walls_end_at
from chamberopt.common.number_text import typeset_plain as plain
from chamberopt.design.fixture import OpeningCut
from chamberopt.pictures.drawing.arrangement import (
    ABOVE,
    BELOW,
    BESIDE,
    arrangement,
    ends_of,
    scale_in_words,
)
from chamberopt.pictures.drawing.cuts import section_planes
from chamberopt.pictures.drawing.dimensions import Limits, Point
from chamberopt.pictures.drawing.plan import draw_face, draw_plan
from chamberopt.pictures.drawing.section import draw_section
from chamberopt.pictures.drawing.strip import draw_strip, draw_strip_aside
from chamberopt.pictures.drawing.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from chamberopt.chamber.build import Chamber
    from chamberopt.design.sonotrode import Face
    from chamberopt.peening.held_strip import HeldStrip

RASTER = 200  # dots an inch, for the part in the plan
LEGEND = (
    "Inside dimensions in mm, without a tolerance by ISO 2768-m. Blue: target, in the plan also "
    "where it is hidden. Grey: part. Orange: sonotrode. Black hatching: walls and lid, as thick as "
    "the shop chooses."
)


class Shown(NamedTuple):
    """What a drawing shows beside a chamber.

    Attributes:
        limits: what the keys of [chamber] may be, for dimensions that show one of them.
        face: on which the chamber stands, whose joints the plan shows, and its rim where it is
            larger than the floor and has room beside the plan.
        opening: how the openings round the part are cut.
        held: an Almen strip in the place of the part, which section and plan show dotted.
    """

    limits: Limits = MappingProxyType({})
    face: Face | None = None
    opening: OpeningCut = OpeningCut()
    held: HeldStrip | None = None


NOTHING_BESIDE = Shown()


def draw_chamber(
    axes: Axes,
    chamber: Chamber,
    left: float,
    top: float,
    size: Point,
    shown: Shown = NOTHING_BESIDE,
) -> str:
    """Draw sections and plan of a chamber on a page, and return what they are in sentences.

    Args:
        axes: axes of the whole page, in mm.
        left, top: upper left corner of the drawing.
        size: width and height that it may have.
        shown: what it shows beside the chamber.
    """
    limits, face, opening, held = shown
    (low, high), has_jaws = ends_of(chamber), False
    planes = section_planes(chamber)
    scale, outside, needs, is_below = arrangement(chamber, planes, size)
    deep = scale * (high - low)[1]
    # The middle of the sections is that of their row, and the plan's that of its own.
    of_plan = top - needs[1] + 0.5 * (ABOVE + BELOW + deep) if is_below else top - 0.5 * size[1]
    middle = top - 0.5 * (needs[1] - ABOVE - BELOW - deep if is_below else size[1])
    x = left + 0.5 * (size[0] - needs[0])
    tall, under = scale * (high - low)[2], x + BESIDE
    for number, (plane, more) in enumerate(zip(planes, outside, strict=True)):
        axis = np.array([plane.right, 2])
        corner = np.array([x + BESIDE + more[0], middle - 0.5 * (tall + more[2]) + 1.0])
        view = View(plane.right, scale, corner, low[axis], high[axis], more)
        has_jaws |= draw_section(axes, chamber, view, planes, number, limits, opening)
        if held is not None and held.size is not None:
            draw_strip_aside(axes, view, held)
        x = corner[0] + scale * (high - low)[plane.right] + more[1] + BESIDE
        if plane.right == 0:
            under = corner[0]
    corner = np.array([under if is_below else x + BESIDE, of_plan - 0.5 * deep + 1.0])
    view = View(0, scale, corner, low[:2], high[:2], np.zeros(3))
    draw_plan(axes, chamber, view, planes, limits)
    strip = ""
    if held is not None and held.size is not None:
        draw_strip(axes, view, held)
        piece = "" if held.is_whole else "a piece of "
        strip = (
            f" Dotted: {piece}an Almen strip, {plain(held.level_mm)} mm from the sonotrode, with "
            "its block and screws."
        )
    dashed, beyond = ([], "") if face is None else draw_face(axes, chamber, view, face)
    text = scale_in_words(scale)
    what = "Section A–A" if len(planes) == 1 else "Sections A–A and B–B"
    lies = walls_end_at(find_openings(chamber)) is not None
    kind = "clamps, down on the walls" if lies else "jaws"
    jaws = f" White and crossed: {kind}." if has_jaws else ""
    dashes = f" Dashed: {' and '.join(dashed)}." if dashed else ""
    rim = f" Not drawn: {beyond}." if beyond else ""
    return f"{what} and plan, scale {text}.{dashes}{strip}{rim}{jaws}"


def drawing_height(chamber: Chamber, size: Point) -> float:
    """Return the height [mm] that the drawing of a chamber takes of a width and height."""
    return float(arrangement(chamber, section_planes(chamber), size).needs[1])


def drawing_scale(chamber: Chamber, size: Point) -> float:
    """Return the scale of the drawing of a chamber in a width and height [mm]."""
    return arrangement(chamber, section_planes(chamber), size).scale
