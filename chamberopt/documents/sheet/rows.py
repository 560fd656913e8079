"""Parts of a process sheet that its tables share: rows, and what they are made from."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from chamberopt.common.estimate import NOT_RESOLVED, Estimate
from chamberopt.common.key_words import in_words, unit_of
from chamberopt.design.intensity import WantedIntensity
from chamberopt.design.tolerances import tolerance_box
from chamberopt.documents.wording import plain, value_text

if TYPE_CHECKING:
    from chamberopt.chamber.checks.flat_faces import FlatFace
    from chamberopt.chamber.checks.openings import Mounting, Opening
    from chamberopt.chamber.checks.strips import StripOfTarget
    from chamberopt.chamber.fixture import Plug
    from chamberopt.chamber.part import PartOfFile
    from chamberopt.design.part import Selection
    from chamberopt.design.shot import ShotTable
    from chamberopt.design.sonotrode import VibratingFace
    from chamberopt.peening.held_strip import HeldStrip
    from chamberopt.results.load import Result
    from chamberopt.results.looked_places import LookedPlace

Row = tuple[str, str]  # a name and its value, or "" and a sentence

OF_COMMANDS = r" \((?:[^()]*--[^()]*|no source read|chamberopt [a-z]+|docs/[^()]*)\)"
OF_FRAME = r"(?<=\) mm) in the chamber(?:'s frame)?\b"
MOST_ROWS = 4  # sizes of shot, or further sonotrodes; the report has all of them


class AsBuilt(NamedTuple):
    """What a sheet says of the built chamber that its design does not give in numbers."""

    face_mm: tuple[float, ...]  # of the sonotrode: a diameter, or two sides
    openings: Sequence[Opening] = ()  # through which the part goes out
    mountings: Sequence[Mounting] = ()  # of each of them, if they are known
    strip: StripOfTarget | None = None  # if the target is peened a strip at a time
    plugs: Sequence[Plug] = ()  # of the mask
    usual: WantedIntensity | None = None  # Almen intensity of its metal and thickness
    later: Sequence[Sequence[Opening]] = ()  # openings in each further step
    held: HeldStrip | None = None  # an Almen strip in the place of the part, if it takes a lid
    radii: Sequence[float] = ()  # of the fillets that are the target [m]
    flat: FlatFace | None = None  # the part's largest, by which it is seen how it is turned
    is_ceiling: bool = False  # the part closes the room, which has no other ceiling
    clamp: str = ""  # what clamps the part where it stands out, in words
    screws: str = ""  # holes there that take screws, in words, such as "4 holes of 9 mm"
    push: tuple[float, float, float] | None = None  # mean force of the shot on the part [N]
    volume: float = 0.0  # of the part [m³]
    places: Sequence[LookedPlace] = ()  # of the target to look at, the least covered first
    file: PartOfFile | None = None  # with its pose in the chamber

    def chosen_in_words(self, chosen: Selection) -> str:
        """Return what is chosen of the part in words, with a place in the chamber's frame."""
        place = None
        if self.file is not None and chosen.faces:
            at = 1e-3 * np.array(chosen.faces[0].at_mm)
            place = (1e3 * (self.file.rotation @ at + self.file.shift)).tolist()
        return for_the_shop(chosen.words_at(place))


def for_the_shop(text: str) -> str:
    """Return a text without what is for who designs: commands, options, and sources of rules.

    Its minus signs are as long as a plus. The chamber's frame is left out after places in it, as a
    sheet names it once.
    """
    text = re.sub(OF_FRAME, "", re.sub(OF_COMMANDS, "", text))
    return re.sub(r"(?<!\w)-(?=\d)", "−", text)


def first_rows(rows: Sequence[Row], what: str, most: int = MOST_ROWS) -> Iterator[Row]:
    """Yield at most `most` rows, then a sentence with the number of the rows left out, if any.

    `what` names the rows in the sentence.
    """
    yield from rows[:most]
    if (more := len(rows) - most) > 0:
        yield "", f"{more} more {what if more > 1 else what.removesuffix('s')} in the report."


def with_limits(result: Result, name: str, text: str) -> str:
    """Return the text of a number of the design, with the range that its tolerance allows."""
    ends = tolerance_box(result.design).get(name)
    return text if ends is None else f"{text} ({' to '.join(map(plain, ends))})"


def face_in_words(face_mm: tuple[float, ...]) -> str:
    """Return the size of a sonotrode's face in words: of a disc its diameter alone."""
    return f"{'Ø ' if len(face_mm) == 1 else ''}{' × '.join(map(plain, face_mm))} mm"


def range_text(usual: WantedIntensity) -> str:
    return f"{plain(usual.low)} to {plain(usual.high)} mmA"


def weighed_g(shot: ShotTable) -> float:
    """Return the mass of the simulated balls together [g]. Their number is whole."""
    return 1e3 * shot.ball_mass * shot.count


def peak_to_valley(result: Result) -> float:
    """Return the amplitude of the sonotrode, peak to valley [µm]."""
    return 2.0 * result.design.sonotrode.zero_to_peak_um


def is_unresolved(figure: Estimate) -> bool:
    return figure.in_words == NOT_RESOLVED


def amplitude_text(face: VibratingFace) -> str:
    one = face.zero_to_peak_um
    return f"{plain(one)} µm zero-to-peak = {plain(2.0 * one)} µm peak to valley"


def key_row(key: str, value: Any) -> Row:
    """Return the name and the text of a chamber's value, with the unit in the text.

    In `key`, the unit is the end of the name, e.g. "height_mm".
    """
    parts = value if isinstance(value, list) else [value]
    if any(isinstance(one, list | dict) for one in parts):
        return in_words(key), "see the report"
    return in_words(key), f"{value_text(value)} {unit_of(key)}".rstrip()
