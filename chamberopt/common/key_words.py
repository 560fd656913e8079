"""Words and units for the names of numbers and objectives, in files and among facts.

The end of a name is its unit: "chamber.height_mm" is a "height" in "mm".
"""

from __future__ import annotations

import re

# Units by the ends of names; of a share, per cent.
UNITS = {
    "mm": "mm", "mm2": "mm²", "cm3": "cm³", "um": "µm", "deg": "degrees", "khz": "kHz", "hz": "Hz",
    "mg": "mg", "g": "g", "kg_m3": "kg/m³", "m_s": "m/s", "mm_s": "mm/s", "s": "s", "ms": "ms",
    "HB": "HB", "MPa": "MPa", "GPa": "GPa", "share": "%", "rpm": "rpm",
}  # fmt: skip
# What a study is after, by the name of its objective.
AIMS = {
    "uniform_coverage": "the most even coverage after the treatment time",
    "p05_coverage": "the best coverage of the least covered places",
    "minus_time_to_98_s": "98 % everywhere in the shortest time",
    "minus_treatment_time_s": "the shortest treatment time that meets all limits",
    "intensity_uniformity": "the most even peening strength",
}
# Kinds of holders and masks; "filled" is what a block of a mask becomes.
KINDS = {
    "rod": "rod on a face",
    "collar": "collar round an end or a shaft",
    "plate": "plate on a face or round a root",
    "arbor": "arbor: a shaft through a hole",
    "bore": "the part itself, out through the wall",
    "shell": "shell on the faces",
    "plugs": "plugs that fill holes",
    "block": "block on the faces, up to the wall",
    "filled": "block on the faces, up to the wall",
}
# Words of keys whose names say too little.
KEYS = {
    "holder.at": "faces of the holder",
    "mask.at": "faces of the mask",
    "part.rotate_deg": "pose of the part",
    "effects.part_turn": "turning of the part",
    "optimizer.evaluations": "chambers to simulate",
    "objective_half_width": "half-width of the objective",
    "tensile_MPa": "tensile strength",
    "slope_deg": "slope of the faces",
    "tungsten_carbide": "tungsten carbide",
}
TABLES = (
    "part|chamber|shot|sonotrode|sonotrodes|materials|effects|process|holder|mask|zones|"
    "tolerances|ranges|optimizer"
)
DOTTED = rf"(?:vary\.)?(?:{TABLES})(?:\.\w+)+"
BARE = "|".join(key for key in KEYS if "." not in key)
# A key or a table of a file in a text, in the patterns of the texts that have them.
KEY = rf"\[(?:{TABLES})\]|\[{DOTTED}\]|(?<![\w./])(?:{DOTTED}|(?:{BARE})\b)"
_ITEM = re.compile(r"\.([012])$")
_UNIT = re.compile(rf"(?:_|\.(?=rpm))({'|'.join(sorted(UNITS, key=len, reverse=True))})$")
_ALONG = re.compile(r"(?:deg|mm|axis)\.([012])$")  # along x, y and z


def unit_of(name: str) -> str:
    """Return the unit that a name ends with, or "" if it names none.

    >>> unit_of("part.offset_mm.0")
    'mm'
    """
    found = _UNIT.search(_ITEM.sub("", name))
    return UNITS[found[1]] if found else ""


def in_words(name: str) -> str:
    """Return a name in words without its unit and its place in a list.

    >>> in_words("sonotrode_distance_mm")
    'sonotrode distance'
    """
    text = _UNIT.sub("", _ITEM.sub("", name)).replace("_pv", ", peak to valley")
    return text.replace("_", " ").replace(".", " ")


def title(name: str) -> str:
    """Return a name in words as a title, with its axis where it is of a place or an angle.

    >>> title("part.offset_mm.0")
    'Part offset, x'
    >>> title("effects.part_turn.rpm")
    'Part turn'
    """
    words = in_words(name.removeprefix("effects."))
    words = words[:1].upper() + words[1:] if words[:3].isalpha() else words  # a symbol stays
    along = _ALONG.search(name)
    return f"{words}, {'xyz'[int(along[1])]}" if along else words


def title_with_unit(name: str) -> str:
    """Return a name as a title with its unit.

    >>> title_with_unit("chamber.height_mm")
    'Chamber height [mm]'
    """
    unit = unit_of(name)
    return f"{title(name)} [{unit}]" if unit else title(name)


def inner_first(name: str) -> str:
    """Return a dotted name in words, its innermost step first.

    >>> inner_first("chamber.holes.0.diameter_mm")
    'diameter of the 1 of the holes of the chamber'
    """
    steps = reversed(name.split("."))
    return " of the ".join(str(int(s) + 1) if s.isdecimal() else in_words(s) for s in steps)


def key_in_words(key: str) -> str:
    """Return a key or table as it stands in a text in words.

    >>> key_in_words("[vary.chamber.height_mm]")
    'height of the chamber'
    """
    name = key.strip("[]").removeprefix("vary.")
    effect = name.removeprefix("effects.")
    return KEYS.get(name) or KEYS.get(effect) or inner_first(effect)
