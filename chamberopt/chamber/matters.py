"""Matters of a design that somebody has to look at: of what kind they are, and how urgent.

A matter is one sentence. The words in capitals that begin it are its kind's. In a design file
(`to_settle`) people may write others, which are of no kind and are settled first.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, StrEnum


class Urgency(IntEnum):
    """Until when a matter is to be looked at, the most urgent first."""

    BEFORE_BUILDING = 0
    SETTING_UP = 1
    ASSUMED = 2

    @property
    def in_words(self) -> str:
        """The heading of a list of such matters."""
        return TITLES[self]


TITLES = (
    "To be settled before it is built",
    "To know while setting up",
    "Assumed, to be confirmed",
)


class MatterKind(StrEnum):
    """What a matter is about: the words that begin its sentence."""

    # The target, and what of the part is beside it.
    BY_SIZE = "TARGET CHOSEN BY SIZE ALONE"
    BY_SHAPE = "TARGET CHOSEN BY SHAPE"
    FILLETS_LEFT = "FILLETS ARE NOT IN THE TARGET"
    FILLETS_NOT_REACHED = "FILLETS ARE LEFT OUT"
    PLACES_LEFT = "PLACES ARE LEFT OUT"
    SHARP_ROOTS = "ROOTS ARE SHARP IN THE FILE"
    END_LEFT = "AN END IS LEFT OUT"
    NOT_MASKED = "NOT MASKED"
    STILL_NOT_MASKED = "STILL NOT MASKED"
    ONE_SIDE = "ONE SIDE OF THIN METAL"
    THIN_PLACES = "THIN PLACES"
    SHARP_EDGES = "SHARP EDGES"
    # How the part stands and is held.
    NOTHING_HOLDS = "NOTHING HOLDS THE PART"
    SHALLOW_GRIP = "SHALLOW GRIP"
    THIN_GRIP = "THIN GRIP"
    NOT_FIXED = "NO HOLE FOR SCREWS"
    POTTED = "NO STRAIGHT END TO CLAMP"
    POSE = "POSE NOT DECIDED"
    SETTINGS = "SETTINGS"
    STRIPS = "A STRIP AT A TIME"
    TURNED = "TURNED BY A DRIVE"
    # The chamber and its sonotrode.
    SEVERAL_SONOTRODES = "LARGER THAN ONE SONOTRODE"
    WIDE_FLOOR = "LARGER THAN USUAL SONOTRODES"
    CUT_ALL_ROUND = "CUT ON SEVERAL SIDES"
    HOLE = "A HOLE THROUGH THE WALL"
    HOLES = "HOLES THROUGH THE WALL"
    OPENINGS_CHANGE = "OPENINGS CHANGE"
    IRON_FROM_WALLS = "IRON FROM THE WALLS"
    CLEAR_OF_MACHINE = "CLEAR OF THE MACHINE"
    BUILD_WIDER = "BUILD IT"
    # The balls, the intensity and the time.
    IRON = "STEEL LEAVES IRON"
    JAM = "BALLS JAM"
    PLAY = "PLAY OF"
    MAY_JAM = "BALLS MAY JAM IN A GAP"
    NO_SIZE = "NO SIZE SUITS ALL"
    LARGER_BALLS = "LARGER BALLS FOR THE INTENSITY"
    FEWER_BALLS = "FEWER BALLS"
    QUICKER_BALLS = "QUICKER BALLS"
    NO_BALLS = "NO BALLS THAT SUIT THE TARGET GIVE"
    NO_USUAL = "NO USUAL INTENSITY"
    UNUSUAL = "OUTSIDE THE USUAL RANGE"
    TWO_INTENSITIES = "TWO INTENSITIES"
    LONG = "LONG"
    MANY_BALLS = "MANY BALLS"
    CHARGE_CUT = "CHARGE IS CUT"
    # What nobody stated or measured.
    UNIT = "UNIT GUESSED"
    ALLOY = "ALLOY NOT KNOWN"
    HARDNESS = "HARDNESS ASSUMED"
    ROUGH_TIME = "TIME KNOWN ROUGHLY"
    TIME_NOT_RESOLVED = "TIME NOT RESOLVED"
    NOT_MEASURED = "TIME NOT MEASURED"
    FEW_DENTS = "TOO FEW DENTS"
    # Of all these.
    WARNED_OF = "THE CHECK WARNS"

    @property
    def urgency(self) -> Urgency:
        """Until when such a matter is to be looked at."""
        return URGENCIES.get(self, Urgency.BEFORE_BUILDING)


# Those that a simulation settles, once it knows the time to 98 %.
OF_TIME = frozenset({MatterKind.ROUGH_TIME, MatterKind.TIME_NOT_RESOLVED, MatterKind.NOT_MEASURED})
URGENCIES = {
    **dict.fromkeys(
        (
            MatterKind.SHARP_EDGES,
            MatterKind.STRIPS,
            MatterKind.TURNED,
            MatterKind.CLEAR_OF_MACHINE,
            MatterKind.BUILD_WIDER,
            MatterKind.MANY_BALLS,
            MatterKind.CHARGE_CUT,
        ),
        Urgency.SETTING_UP,
    ),
    **dict.fromkeys(
        (*OF_TIME, MatterKind.UNIT, MatterKind.ALLOY, MatterKind.HARDNESS, MatterKind.FEW_DENTS),
        Urgency.ASSUMED,
    ),
}


@dataclass(frozen=True)
class Matter:
    """A matter that somebody has to look at.

    Attributes:
        kind: None for one that begins with no kind's words.
        text: the rest of its sentence, from the first character after these words.
    """

    kind: MatterKind | None
    text: str

    @property
    def sentence(self) -> str:
        """All of it, as a design file has it."""
        return f"{self.mark}{self.text}"

    @property
    def mark(self) -> str:
        """The words of its kind, "" if it is of none."""
        return self.kind or ""

    @property
    def urgency(self) -> Urgency:
        """Until when it is to be looked at."""
        return self.kind.urgency if self.kind else Urgency.BEFORE_BUILDING


def matter_of(sentence: str) -> Matter:
    """Return a matter by its sentence, as a design file has it.

    >>> matter_of("LONGER BALLS").kind, matter_of("LONG: few balls get there").kind.name
    (None, 'LONG')
    """
    for kind in MatterKind:
        rest = sentence.removeprefix(kind)
        if rest != sentence and not rest[:1].isalnum():
            return Matter(kind, rest)
    return Matter(None, sentence)
