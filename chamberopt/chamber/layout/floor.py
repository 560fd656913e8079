"""Propose the sonotrode of a shop on which a chamber stands, and fit the chamber's floor to it.

The floor of a chamber is the vibrating face. A sonotrode that is larger carries the wall over its
face, with the shop's clearance, which no ball enters; one that is smaller is the floor, and the
walls lean out from its rim, so that the room is as wide as the part needs where the part is.

A round room is as wide as it is high, as far as a sonotrode allows: in a narrow one the walls take
the balls' speed by friction before they are up. In pilots of four hanging parts (a fan blade, an
implant, a connecting rod, a spring) a cylinder on the whole of a disc of 80 mm took 0.3 to 0.6 of
the time of a box that is as long and wide as the part and the usual room beside it.

Notation
    t   how far the walls of the wanted floor must move in to stand on the face [m]
    a   angle by which they lean, tan(a) = t / distance from the sonotrode to the part
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from chamberopt.chamber.layout.end import Strips
from chamberopt.chamber.layout.sizes import Sizes
from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.shop import Shop, Stand
from chamberopt.common.errors import InputError
from chamberopt.design.fixture import slit_in_words
from chamberopt.design.sonotrode import Face
from chamberopt.geometry.heights import lowest_over

TIGHTER = 0.5  # share of the room beside the part that is left, so that the walls stand upright
STEEPEST = 30.0  # degrees: walls that lean more throw the balls up rather than inwards
FARTHER = 1.5  # factor by which the sonotrode's distance may grow, so that walls lean less
WIDEST = 25e-3  # m: how far a leaning wall may move out up to the ceiling
CLEAR = 1e-3  # m: least height of what is outside of the walls over the face
OUTSIDE = f"the part stays {1e3 * CLEAR:g} mm above the rim of the sonotrode outside of the walls"
MOST_RAISED = 1.0  # share of the distance by which it may grow for that
HELD = 1e-9  # m: a floor that must move in by no more lies within a face
SEVERAL = 3  # sonotrodes side by side that a shop would still mount
LEAST_ROOM = 4.0  # ball diameters beside the part that save a sonotrode
# A face up to so much larger than the wanted floor becomes the whole floor: of one sonotrode, and
# of blocks side by side, where an end without a part would only thin out the shot.
WHOLE, WHOLE_OF_BLOCKS = 1.25, 1.1


def of_blocks(ball: float) -> str:
    """Return what is said of a floor of several sonotrodes, for a diameter of the balls [m]."""
    return (
        f"{MatterKind.SEVERAL_SONOTRODES}: a shop with one block peens the target a length at a "
        "time over it (--shop, of a file with pieces = 1). This floor is several side by side, "
        "which must vibrate in phase and alike: settle with their maker how they are driven and "
        "tuned for that; gaps "
        f"between them of {slit_in_words(1e3 * ball)}, half a ball"
    )


class Floor(NamedTuple):
    """The sizes of a chamber on a sonotrode of a shop."""

    sizes: Sizes
    stand: Stand
    reason: str  # for the chamber's size in plan
    lean: float = 0.0  # of the walls [degrees]; infinite if no sonotrode is large enough
    too_large: float = 0.0  # area of a floor for which no sonotrode is large enough [m²]
    offset_mm: tuple[float, float] = (0.0, 0.0)  # of the part, so that its target is on the axis
    is_raised: bool = False  # so that the face stays clear of the part outside of the walls
    is_low: bool = False  # with a ceiling so low that no ball gets above the part
    strips: Strips | None = None  # of the target, if one is peened after the other

    @property
    def is_one_sonotrode(self) -> bool:
        """Whether one sonotrode carries the chamber."""
        return math.isfinite(self.lean) and self.stand.face.count == 1

    @property
    def face(self) -> Face | None:
        """The face as it lies under the chamber; None if none is large enough."""
        return _laid(self.sizes, self.stand.face) if math.isfinite(self.lean) else None

    @property
    def excess(self) -> tuple[float, ...]:
        """How far the floor is from one upright over one sonotrode; less is better."""
        return math.isinf(self.lean), self.stand.face.count, self.lean, self.too_large


def floor_on_sonotrode(
    sizes: Sizes, round_part: float, shop: Shop, may_exceed: bool, ball: float = math.inf
) -> Floor:
    """Return the sizes of a chamber that stands on the most suitable sonotrode of a shop.

    It is the smallest that holds the wanted floor, else the one on which the walls lean least, else
    the fewest blocks side by side that hold it, for which there may be less room beside the part.

    Args:
        sizes: the wanted sizes.
        round_part: radius about the chamber's axis that a conformal chamber needs [m].
        may_exceed: True if a floor larger than all sonotrodes may be proposed.
        ball: diameter of the balls, LEAST_ROOM of which are enough beside the part [m].
    Raises:
        InputError: the shop has no sonotrode for it.
    """
    sizes = _as_wide_as_high(sizes, shop)
    moves = [(_move(sizes, round_part, one.face), one) for one in shop.stands()]
    if held := [one for move, one in moves if move <= HELD]:
        return _over_the_face(sizes, shop, min(held, key=lambda one: one.face.area_mm2))
    move, stand = min(moves, key=lambda one: one[0])
    is_given = sizes.shape == "conformal" or sizes.is_fixed
    tighter = 0.0 if is_given else (1.0 - TIGHTER) * sizes.gap
    if move <= tighter:
        return _over_the_face(_tight(sizes, move, stand.face), shop, stand)
    far = min(
        max(sizes.distance, move / math.tan(math.radians(STEEPEST))), FARTHER * sizes.distance
    )
    far = 1e-3 * math.ceil(1e3 * far - 1e-6)
    angle = math.degrees(math.atan(move / far))
    rise = (sizes.height + far - sizes.distance) * move / far
    if not is_given and angle <= STEEPEST + 0.5 and rise <= WIDEST:
        height = sizes.height + far - sizes.distance
        return _leaning(replace(sizes, distance=far, height=height), move, angle, stand)
    blocks = list(shop.stands_of_blocks())
    floors = [(one.face.area_mm2, _move(sizes, round_part, one.face), one) for one in blocks]
    closer = 0.0 if is_given else sizes.gap - LEAST_ROOM * ball
    if near := [one for one in floors if one[1] <= max(tighter, closer, HELD)]:
        _, out, stand = min(near, key=lambda one: one[0])
        return _over_the_face(_tight(sizes, out, stand.face) if out > HELD else sizes, shop, stand)
    sides = _sides(sizes, round_part)
    wanted = " x ".join(f"{1e3 * one:.4g}" for one in sides)
    ways = (
        "peen it a strip at a time, each in a chamber of its own (cut the part down to it), "
        "set several sonotrodes side by side ([[sonotrodes]] pieces), or take a larger one"
    )
    text = f"the floor of {wanted} mm is larger than the largest face, {stand.face.in_words}"
    if not may_exceed:
        raise InputError(f"--shop: {text}, also with walls that lean by {STEEPEST:g}°: {ways}")
    usual = "usual ones: chamberopt shop --example; give yours by --shop"
    reason = f"{MatterKind.WIDE_FLOOR}, simulated as one face: {ways}; {usual}"
    return Floor(sizes, stand, reason, math.inf, math.prod(sides))


def _as_wide_as_high(sizes: Sizes, shop: Shop) -> Sizes:
    """Return sizes with a round room made as wide as it is high, as far as a face carries it."""
    if sizes.shape != "cylinder":
        return sizes
    wanted = float(sizes.plan["diameter_mm"])
    carried = max(one.face.sides_mm[1] for one in shop.sonotrodes)
    most = min(carried, *(shop.largest_chamber_mm or (carried,))[:2])
    wider = max(wanted, min(math.floor(1e3 * sizes.height), most))
    return replace(sizes, plan={"diameter_mm": wider}, gap=sizes.gap + 5e-4 * (wider - wanted))


def _half(sizes: Sizes) -> tuple[float, float]:
    """Half the length and width [m] of a box's floor."""
    return 5e-4 * float(sizes.plan["length_mm"]), 5e-4 * float(sizes.plan["width_mm"])


def _radius(sizes: Sizes, round_part: float) -> float:
    """Radius of the circle round the floor of a chamber that is no box [m]."""
    if sizes.shape == "conformal":
        return round_part + 1e-3 * float(sizes.plan["gap_mm"])
    if sizes.shape == "prism":
        return 5e-4 * float(sizes.plan["across_mm"]) / math.cos(math.pi / int(sizes.plan["sides"]))
    return 5e-4 * float(sizes.plan["diameter_mm"])


def _sides(sizes: Sizes, round_part: float) -> tuple[float, float]:
    """Length and width [m] of the wanted floor."""
    if sizes.shape == "box":
        x, y = _half(sizes)
        return 2.0 * x, 2.0 * y
    return (2.0 * _radius(sizes, round_part),) * 2


def _move(sizes: Sizes, round_part: float, face: Face) -> float:
    """Return how far the walls of the wanted floor must move in to stand on a face [m].

    It is at most 0 if the floor lies within the face, and infinite if no floor of this form does.
    A box whose walls move in by t has the half diagonal r at x + y - 2 t = sqrt(2 r² - (x - y)²).
    """
    width = 5e-4 * face.sides_mm[1]
    if sizes.shape != "box":
        radius = _radius(sizes, round_part)
        inner = math.cos(math.pi / int(sizes.plan["sides"])) if sizes.shape == "prism" else 1.0
        return inner * (radius - width)
    x, y = _half(sizes)
    if face.size_mm is not None:
        along_x, along_y = (5e-4 * one for one in _laid(sizes, face).sides_mm)
        return max(x - along_x, y - along_y)
    square = 2.0 * width**2 - (x - y) ** 2
    move = 0.5 * (x + y - math.sqrt(square)) if square > 0.0 else math.inf
    return move if move < 0.8 * min(x, y) else math.inf


def _moved(sizes: Sizes, move: float, face: Face) -> dict[str, float | str]:
    """Return the keys of the floor with its walls moved in by some length [m] onto a face."""
    if sizes.shape == "cylinder":
        return {**sizes.plan, "diameter_mm": face.sides_mm[1]}
    plan = {key: one for key, one in sizes.plan.items() if key.endswith("_mm")}
    inside = {key: math.floor(10.0 * float(one) - 2e4 * move) / 10.0 for key, one in plan.items()}
    return {**sizes.plan, **inside}


def _tight(sizes: Sizes, move: float, face: Face) -> Sizes:
    """Return sizes with less room beside the part, so that the floor lies within a face."""
    plan = _moved(sizes, move, face)
    if sizes.shape == "box" and face.size_mm is not None:  # only where it is too wide
        sides = zip(plan, _laid(sizes, face).sides_mm, strict=True)
        plan = {key: min(float(sizes.plan[key]), side) for key, side in sides}
    return replace(sizes, plan=plan, gap=sizes.gap - move)


def _over_the_face(sizes: Sizes, shop: Shop, stand: Stand) -> Floor:
    """Return a floor that is the whole face, if the face is little larger, else a part of it.

    A wall that goes round the face stands beside it by the clearance, which is not simulated.
    """
    clear, face = f"{shop.clearance_mm:g} mm clear", _laid(sizes, stand.face)
    name = _named(face)

    def room(sides: Iterable[float]) -> str:
        """Return in words how wide the room must be where its wall goes round the face."""
        wide = " x ".join(f"{one + 2.0 * shop.clearance_mm:g}" for one in sides)
        are = "is" if face.count == 1 else "and the gaps between the blocks are"
        return (
            f"{MatterKind.BUILD_WIDER} {wide} mm wide, within the limits on the sheet: the slit of "
            f"{shop.clearance_mm:g} mm on each side of {name} {are} not simulated"
        )

    plan = dict(zip(("length_mm", "width_mm"), face.sides_mm, strict=True))
    if sizes.shape == "cylinder":
        plan = {"diameter_mm": face.sides_mm[0]}
    is_disc = face.size_mm is None
    most = WHOLE if face.count == 1 else WHOLE_OF_BLOCKS
    alike = (sizes.shape, is_disc) in (("cylinder", True), ("box", False))
    if (
        alike
        and not sizes.is_fixed
        and all(plan[key] <= most * float(sizes.plan[key]) for key in plan)
    ):
        more = min(plan[key] - float(sizes.plan[key]) for key in plan)
        wider = replace(sizes, plan={**sizes.plan, **plan}, gap=sizes.gap + 5e-4 * more)
        text = f"the face of {name}, the wall round it {clear}; {room(plan.values())}"
        return Floor(wider, stand, text)
    where = f"ends over its face, {clear}"
    if sides := [one for key, one in plan.items() if float(sizes.plan.get(key, 0.0)) >= one]:
        where = (
            f"goes round it on two sides, {clear}, and ends over its face elsewhere; {room(sides)}"
        )
    return Floor(sizes, stand, f"on {name}: the wall {where}")


def _laid(sizes: Sizes, face: Face) -> Face:
    """Return a face as it lies under a floor, the longer sides of both along one axis."""
    plan = sizes.plan
    is_turned = sizes.shape == "box" and float(plan["length_mm"]) < float(plan["width_mm"])
    return face.turned if is_turned else face


def _named(face: Face) -> str:
    """Return the name of a face in a sentence."""
    return f"sonotrode {face.in_words}" if face.count == 1 else face.in_words


def _leaning(sizes: Sizes, move: float, angle: float, stand: Stand) -> Floor:
    """Return a floor that is smaller than the room, with walls that lean out from it."""
    lean = float(math.ceil(angle))
    plan = {**_moved(sizes, move, stand.face), "inclination_deg": lean}
    reason = (
        f"the floor is {_named(stand.face)}; its walls lean out by {lean:g}°, to be wide "
        "enough where the part is"
    )
    return Floor(replace(sizes, plan=plan), stand, reason, lean)


def clear_of_face(
    floor: Floor, posed: np.ndarray, triangles: np.ndarray, middle: np.ndarray, below: float
) -> Floor:
    """Return a floor so far below a part that its face does not hit what is outside of the walls.

    Args:
        posed, triangles: the part in its pose, (n, 3) [m] and (m, 3).
        middle: the middle of the floor in plan, in the pose (2,) [m].
        below: height of the floor in the pose [m].
    """
    face, sizes = floor.face, floor.sizes
    if face is None:
        return floor
    over = lowest_over(posed, triangles, face.outline + middle)
    lacks = 1e-3 * math.ceil(1e3 * (below + CLEAR - over) - 1e-6) if math.isfinite(over) else 0.0
    if not 0.0 < lacks <= MOST_RAISED * sizes.distance:  # what is still hit is refused when built
        return floor
    sizes = replace(sizes, distance=sizes.distance + lacks, height=sizes.height + lacks)
    return floor._replace(sizes=sizes, is_raised=True)


def require_room(sizes: Sizes, shop: Shop) -> Sizes:
    """Return the sizes with a height that the shop has.

    Raises InputError if the shop can build no chamber of these sizes.
    """
    height = round(1e3 * sizes.height, 3)
    if shop.heights_mm:
        higher = [one for one in shop.heights_mm if one >= height]
        if not higher:
            text = f"the chamber would be {height:g} mm high, above all of heights_mm"
            raise InputError(f"--shop: {text}; add a higher lid, or let the part go out through it")
        height = min(higher)
    if shop.largest_chamber_mm is not None:
        lean = 2.0 * height * math.tan(math.radians(float(sizes.plan.get("inclination_deg", 0.0))))
        keys = [key for key in sizes.plan if key.endswith("_mm") and key != "gap_mm"]
        wide = sorted((float(sizes.plan[key]) + lean for key in keys), reverse=True)
        most = np.sort(shop.largest_chamber_mm[:2])[::-1]
        if height > shop.largest_chamber_mm[2] or (np.array(wide) > most[: len(wide)]).any():
            given = " x ".join(f"{one:.4g}" for one in (*wide, height))
            text = f"the chamber would measure {given} mm, more than largest_chamber_mm"
            raise InputError(f"--shop: {text}; peen the part a strip at a time, or in another pose")
    closed = sizes.closed  # a higher lid is no face of the part any more
    if 1e-3 * height > sizes.height + HELD:
        closed = tuple(one for one in closed if one != "z")
    return replace(sizes, height=1e-3 * height, closed=closed)
