"""Tables of a design file for what holds the part in its chamber, and for what masks it."""

import math
from collections.abc import Iterator
from typing import Literal, NamedTuple

from pydantic import Field

from chamberopt.common import toml_fields
from chamberopt.common.number_text import plain
from chamberopt.common.toml_errors import Problem
from chamberopt.common.toml_fields import Direction, Pair, list_field, quantity
from chamberopt.design.part import Selection
from chamberopt.design.table_base import SI, FileTable

# Gaps over the diameter d of the smallest balls up to which the chamber counts as closed there. A
# ball lies on the edges of a gap of width w at asin(w / d) from the gap's middle, and sinks into it
# by (d - sqrt(d² - w²)) / 2. At half a ball these are 30 degrees, where it is thrown out and cannot
# wedge, and 0.067 d. In a tight gap it sinks by SINK of its radius, which reach.py tolerates of an
# overlap. Nobody need work closer than LEAST_GAP_MM.
SINK, LEAST_GAP_MM = 0.01, 0.1
TIGHT_GAP, WIDEST_GAP = math.sqrt(1.0 - (1.0 - SINK) ** 2), 0.5
USUAL_SHELL_MM = 1.0
CUT_MM = 0.1  # width of the tolerance of an opening [mm], which a mill or a wire keeps


def tight_gap_mm(ball_mm: float) -> float:
    """Return the widest gap [mm] of a joint that counts as none for balls of a diameter [mm]."""
    return max(math.floor(100.0 * TIGHT_GAP * ball_mm) / 100.0, LEAST_GAP_MM)


def joint_in_words(ball_mm: float) -> str:
    """Return how wide the gap of a joint may be, also round a shaft in a wall, in words."""
    return f"at most {plain(tight_gap_mm(ball_mm))} mm"


def slit_in_words(ball_mm: float) -> str:
    """Return how wide a gap beside a sonotrode may be, in words."""
    return f"at most {plain(slit_mm(ball_mm))} mm"


def slit_mm(ball_mm: float) -> float:
    """Return the widest gap [mm] beside a sonotrode, which may touch nothing, for such balls."""
    return math.floor(100.0 * WIDEST_GAP * ball_mm + 1e-9) / 100.0


class OpeningCut(NamedTuple):
    """How an opening is cut round a part that goes out through it, all in mm.

    Attributes:
        clearance_mm: all round the part; 0 for an opening that is fitted to it.
        least_mm, most_mm: deviations of its size, by its tolerance.
        corner_mm: largest radius of its inner corners, where the part has sharp ones.
    """

    clearance_mm: float = 0.0
    least_mm: float = 0.0
    most_mm: float = 0.0
    corner_mm: float = 0.0

    @property
    def limits_in_words(self) -> str:
        """The deviations of its size, such as "+0.1/0"; "" for one that is fitted to its part."""
        least = f"−{plain(-self.least_mm)}" if self.least_mm else "0"
        return f"+{plain(self.most_mm)}/{least}" if self.clearance_mm else ""


def opening_cut(clearance_mm: float, ball_mm: float) -> OpeningCut:
    """Return how an opening is cut round a part.

    Its tolerance is CUT_MM wide, and lies above the size as far as no ball wedges, even where all
    the play is on one side. A sharp corner of the part is by the clearance c from both sides of the
    opening, and by r - (r - c) sqrt 2 from an inner corner of radius r. For r = 2 c that is 0.59 c.

    Args:
        clearance_mm: all round the part [mm].
        ball_mm: diameter of the smallest balls [mm].
    """
    if not clearance_mm:
        return OpeningCut()
    room = max(0.0, WIDEST_GAP * ball_mm - 2.0 * clearance_mm)
    most = math.floor(100.0 * min(CUT_MM, room) + 1e-9) / 100.0
    least = min(round(CUT_MM - most, 2), clearance_mm)
    return OpeningCut(clearance_mm, -least if least else 0.0, most, 2.0 * clearance_mm)


# The keys that each kind of holder may have.
HOLDER_KEYS = {
    "rod": ("at", "axis", "diameter_mm"),
    "collar": ("at", "axis", "diameter_mm", "grip_mm"),
    "plate": ("at", "axis", "size_mm", "grip_mm", "thickness_mm", "diameter_mm"),
    "arbor": ("at", "axis", "both_sides", "diameter_mm", "thickness_mm", "grip_mm"),
    "bore": ("clearance_mm",),
}


def _no_condition(at: Selection | None) -> Iterator[Problem]:
    """Yield a problem if faces are asked for without a condition, which would be the whole part."""
    if at is not None and not at.model_fields_set:
        yield Problem(
            "at", "given without a key: this is the whole part; say which faces are meant"
        )


class Holder(FileTable):
    """A body that holds the part and goes out through the chamber's wall, along its axis.

    A rod stands on a face of the part, a collar goes round an end or a shaft, and a plate is a
    block on a face, or round a root. An arbor is a shaft through a hole of the part. In a bore the
    part itself goes out through the wall.
    """

    kind: Literal["rod", "collar", "plate", "arbor", "bore"] = Field(
        description="what holds the part"
    )
    at: Selection | None = Field(
        default=None,
        description="faces that it clamps, by the keys of [part.target]; absent: what reaches "
        "farthest along axis",
    )
    axis: Direction = list_field(
        "three numbers [x, y, z], not all 0", "the way out of the room", (0.0, 0.0, 1.0)
    )
    diameter_mm: float | None = quantity(
        0.1, 2000, "mm", "of a rod, outside of a collar; absent: from the clamped faces", None
    )
    size_mm: Pair | None = list_field(
        "two numbers [long, wide] in mm, above 0",
        "sides of a plate; absent: from the clamped faces",
        None,
    )
    grip_mm: float | None = quantity(
        0.01, 2000, "mm",
        "length of the part that it encloses; absent: a collar encloses its faces, a plate nothing;"
        " of an arbor: how far its flanges reach over the part, as cups", None,
    )  # fmt: skip
    thickness_mm: float | None = quantity(
        0.1, 2000, "mm",
        "of a plate that a rod carries; absent: up to the wall; of an arbor's flanges", None,
    )  # fmt: skip
    both_sides: bool = Field(
        default=False,
        description="an arbor goes out of the room at both ends, not along axis alone",
    )
    clearance_mm: float = quantity(0, 100, "mm", "of a bore, all round the part", 0.0)

    def _problems(self) -> Iterator[Problem]:
        yield from _no_condition(self.at)
        allowed = HOLDER_KEYS[self.kind]
        for name, field in type(self).model_fields.items():
            is_given = getattr(self, name) != field.default
            if is_given and name not in (*allowed, "kind"):
                may = f'of kind "{self.kind}", which may have {" and ".join(allowed)}'
                yield Problem(name, f"not {may}; leave it out")
        if self.size_mm is not None and not all(0.1 <= side <= 2000 for side in self.size_mm):
            text = f"given {list(self.size_mm)}; each side must be from 0.1 to 2000 mm"
            yield Problem("size_mm", text)
        if self.kind == "plate" and self.diameter_mm and self.thickness_mm is None:
            text = "given without thickness_mm: a rod carries only a plate of given thickness"
            yield Problem("diameter_mm", f"{text}; give both or neither")
        if self.kind == "arbor" and (self.diameter_mm is None) != (self.thickness_mm is None):
            lone = "diameter_mm" if self.thickness_mm is None else "thickness_mm"
            yield Problem(lone, "given alone: the flanges of an arbor need both; give both or none")
        if self.kind == "arbor" and self.grip_mm and self.diameter_mm is None:
            yield Problem("grip_mm", "given without flanges, of which it is; give diameter_mm too")
        if self.kind == "arbor" and self.at is None:
            yield Problem("at", "missing: an arbor needs to know its hole; choose the hole's walls")

    @property
    def direction(self) -> tuple[float, float, float]:
        """The way out of the room, a unit vector (3,) in the chamber's frame."""
        return toml_fields.unit_vector(self.axis)

    clearance = SI("clearance_mm", 1e-3, "Clearance of a bore, all round the part [m]")


class Mask(FileTable):
    """What keeps the shot from faces of the part: a shell, plugs, or all up to a wall."""

    at: Selection = Field(description="faces that it covers, by the keys of [part.target]")
    thickness_mm: float | None = quantity(
        0.01, 100, "mm", f"of the shell on these faces; absent: {USUAL_SHELL_MM:g}", None
    )
    axis: Direction | None = list_field(
        "three numbers [x, y, z], not all 0",
        "no shell, but all that is on these faces along this way, up to the wall",
        None,
    )
    margin_mm: float = quantity(
        0, 100, "mm", "from the target, which a shell keeps, so that balls get to its border", 0.0
    )
    plugs: bool = Field(
        default=False,
        description="no shell, but the holes whose walls these faces are are filled to their rims",
    )

    def _problems(self) -> Iterator[Problem]:
        yield from _no_condition(self.at)
        if self.axis is not None and self.thickness_mm is not None:
            text = "given beside axis, along which the mask goes on to the wall; leave one out"
            yield Problem("thickness_mm", text)
        if self.axis is not None and self.margin_mm:
            yield Problem("margin_mm", "given beside axis: only a shell keeps it; leave one out")
        for key in ("axis", "thickness_mm", "margin_mm"):
            if self.plugs and getattr(self, key):
                yield Problem(key, "given beside plugs, which fill their holes; leave one out")

    margin = SI("margin_mm", 1e-3, "Distance from the target that a shell keeps [m]")

    @property
    def thickness(self) -> float:
        """Thickness of the shell [m]."""
        given = self.thickness_mm
        return 1e-3 * (USUAL_SHELL_MM if given is None else given)


def fixture_problems(
    holder: Holder | None, mask: Mask | None, balls_mm: float, turns: bool
) -> Iterator[Problem]:
    """Yield problems of holder and mask with the other tables of a design.

    Args:
        balls_mm: diameter of the smallest balls [mm].
        turns: True if the part turns.
    """
    if mask is not None and turns:
        text = "given for a part that turns, with which it would turn: not supported; leave it out"
        yield Problem("mask", text)
    if holder is None:
        return
    if turns and holder.kind == "plate":
        text = 'given "plate" for a part that turns: only a round holder can turn; give "collar"'
        yield Problem("holder.kind", f'{text}, "rod" or "arbor"')
    # The part may lie against one side of its bore. The whole play is then on the other side.
    most = 0.5 * WIDEST_GAP * balls_mm
    if holder.clearance_mm > most:
        yield Problem(
            "holder.clearance_mm",
            f"given {holder.clearance_mm:g}; allowed: at most {math.floor(1e3 * most) / 1e3:g} for "
            f"balls of {balls_mm:g} mm, as the play on one side is twice that: in a gap above half "
            "a ball they may wedge; close it, or use larger balls",
        )
