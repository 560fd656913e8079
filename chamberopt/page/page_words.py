"""Words of the page for keys of files, options of the command line and choices.

What the page shows of a message is a list of texts, in which a key or option is a pair: its words,
and what it is in a file or on the command line, which the page shows as a tip.
"""

from __future__ import annotations

import re

from chamberopt.common.key_words import inner_first
from chamberopt.geometry.meshes.formats import SUFFIXES

Words = list[str | tuple[str, str]]

CHOICES = {
    "conformal": "conformal: follows the part",
    "": "none: the part hangs in the air",
    "rod": "rod on a face",
    "collar": "collar round an end or a shaft",
    "plate": "plate on a face or round a root",
    "arbor": "arbor: a shaft through a hole",
    "bore": "the part itself, out through the wall",
    "shell": "shell on the faces",
    "plugs": "plugs that fill holes",
    "block": "block on the faces, up to the wall",
    "random_phase": "random phase",
}
OPTIONS = {
    "target": "what is peened",
    "unit": "the unit of the part",
    "material": "alloy of the part",
    "shot": "balls",
    "shape": "form of the chamber",
    "shop": "what your shop has",
    "intensity": "Almen intensity",
    "coverage": "coverage",
    "ball-mm": "ball diameter in mm",
    "pose": "pose of the part",
    "calibration": "calibration of the machine",
    "no-pilot": "the choice not to simulate",
}
KEYS = {"holder.at": "faces of the holder", "mask.at": "faces of the mask"}
_TABLES = (
    "part|chamber|shot|sonotrode|sonotrodes|materials|effects|process|holder|mask|zones|"
    "tolerances|ranges"
)
_DOTTED = rf"(?:{_TABLES})(?:\.\w+)+"
_GUIDE = r"docs/[\w/]+\.md(?:#[\w-]+)?"
_KEY = re.compile(
    rf"{_GUIDE}|\[(?:{_TABLES})\]|\[{_DOTTED}\]|(?<![\w./]){_DOTTED}|--(?:{'|'.join(OPTIONS)})(?![\w-])"
)
_FILES = (".toml", ".json", ".html", ".pdf", ".png", *SUFFIXES)  # "part.stl" is no key


def on_page(text: str) -> Words:
    """Return a message of the program with its keys and options in the words of the page.

    >>> on_page("raise chamber.height_mm")
    ['raise ', ('height of the chamber', 'chamber.height_mm')]
    """
    made: Words = []
    at = 0
    for match in _KEY.finditer(text):
        found = match[0]
        if found.lower().endswith(_FILES):
            continue
        key = found.strip("[]").removeprefix("effects.")
        words = OPTIONS.get(found[2:]) or KEYS.get(key) or inner_first(key)
        words = "guide" if found.startswith("docs/") else words
        made += [text[at : match.start()]] * (match.start() > at)
        made.append((words, found))
        at = match.end()
    return [*made, *[text[at:]] * (at < len(text))]


# How `new` names balls and an amplitude that would serve (chamber/propose), in mm and µm.
_BALLS = re.compile(r"([\d.]+) mm would serve|--ball-mm ([\d.]+) takes|balls of about ([\d.]+) mm")
_AMPLITUDE = re.compile(r"an amplitude of about ([\d.]+) µm zero-to-peak")


def balls_named(text: str) -> list[float]:
    """Return the diameters [mm] of balls that a matter says would serve.

    >>> balls_named("MANY BALLS, some 7,958 under the whole part: 0.7 mm would serve 80%")
    [0.7]
    """
    return list(dict.fromkeys(float(next(filter(None, one))) for one in _BALLS.findall(text)))


def amplitudes_named(text: str) -> list[float]:
    """Return the amplitudes [µm], zero-to-peak, that a matter says would serve."""
    return list(dict.fromkeys(map(float, _AMPLITUDE.findall(text))))


def choices(allowed: tuple[str, ...] | list[str]) -> list[tuple[str, str]]:
    """Return each allowed text with its words on the page."""
    return [(one, CHOICES.get(one, one)) for one in allowed]
