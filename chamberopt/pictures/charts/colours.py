"""Choose the colours of all pictures and of the report: lines, candidates and colour maps."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from matplotlib.colors import Colormap

# The palette of Okabe and Ito, which colour-blind readers can tell apart.
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#9aa3ab"
PURPLE, SKY, YELLOW, BLACK = "#CC79A7", "#56B4E9", "#E69F00", "#000000"
DARK_GREY = "#555555"  # text and reference lines

# Colour maps of the part in viewer and report, and of an objective in a map. Their lightness grows
# in even steps that colour-blind readers see too.
COVERAGE_MAP, COUNT_MAP, WIDTH_MAP = "viridis", "cividis", "magma"
DIFFERENCE_MAP = "PuOr"
# Places of the target with too few simulated dents, out of the balls' reach, and outside the
# chamber. The first is off the scales, which begin dark and end yellow.
FEW_DENTS, UNREACHED, OUTSIDE = "#f7f1e6", "#a9714f", "#7a2a80"
FEW_TO_TELL = "#45464a"  # of a difference, whose scale is pale in its middle

# The part beside its target, the room's walls with their edges, and the sonotrode.
PART_GREY, GLASS, EDGES, SONOTRODE = "#bcc1c6", "#9be0ff", "#6f8796", "#e08a2e"
FIXTURE_COLOURS = {"holder": "#7f7d78", "mask": "#f0d8a0"}


class Kind(NamedTuple):
    """What a legend says of a kind of surface, and its colour."""

    label: str
    colour: str


# Kinds of surfaces of a part in its chamber, by name. Colour-blind readers too can tell any two of
# them apart, which a test checks.
KINDS = {
    "rest": Kind("not in the target", PART_GREY),
    "target": Kind("target", BLUE),
    "few": Kind("target with too few simulated dents", FEW_DENTS),
    "unreached": Kind("target that hardly a ball can touch", UNREACHED),
    "outside": Kind("target outside the chamber", OUTSIDE),
    "zone": Kind("zone", SKY),
    "sonotrode": Kind("sonotrode", SONOTRODE),
    "holder": Kind("holder", FIXTURE_COLOURS["holder"]),
    "mask": Kind("mask", FIXTURE_COLOURS["mask"]),
    "wall": Kind("chamber wall", GLASS),
}

# Colours and line styles of compared results.
_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, BLACK, YELLOW, SKY, GREY)
_DASHES = (6, 1, 1, 1, 1, 1), (8, 2), (2, 1), (4, 1, 1, 1)
_LINES = ("-", "--", "-.", ":", *((0, dashes) for dashes in _DASHES))


def zone_colour(index: int) -> str:
    """Return the colour of the zone with this index. Colours repeat after five zones."""
    return (SKY, PURPLE, GREEN, BLUE, BLACK)[index % 5]  # unlike the sonotrode's colour


def line_style(index: int) -> dict[str, object]:
    """Return the colour and line style of the result with this index in a comparison."""
    return {"color": _COLOURS[index % len(_COLOURS)], "ls": _LINES[index % len(_LINES)]}


def hex_colours(colour_map: Colormap | str, count: int = 10) -> list[str]:
    """Return `count` evenly spaced colours of a matplotlib colour map as texts like #rrggbb."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    drawn = colormaps[colour_map] if isinstance(colour_map, str) else colour_map
    return [to_hex(drawn(i / (count - 1))) for i in range(count)]
